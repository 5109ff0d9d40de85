// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth by the camera beside depth by the tracker, of a recording; see incise/depth_pairs.h.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <incise/depth_pairs.h>
#include "../../base/vector.h"
#include "depth.h"
#include "recording.h"
#include "rows_array.h"

#define QUALITY 0.5
#define DEPTH_MM \
	1.0 /* above it, a blade may be in the air, where a camera sees no depth */

struct place {
	int64_t t_ns; /* -1: none */
	double position_mm[3];
};

struct reader {
	struct incise_recording *recording;
	struct incise_rows tracker;
	struct incise_rows_array frames; /* a pair for each that is one */
	struct place before, after;
	struct incise_depth depth;
	double axis[2][3]; /* along the surface */
};

/* Two unit vectors along the surface. */
static void find_axes(struct reader *reader)
{
	const double *n = reader->depth.normal;
	double helper[3] = {0, 0, 0}, length;

	/* the axis that is least along the normal */
	helper[fabs(n[0]) < fabs(n[1]) ? (fabs(n[0]) < fabs(n[2]) ? 0 : 2)
				       : (fabs(n[1]) < fabs(n[2]) ? 1 : 2)] = 1;
	for (int i = 0; i < 3; i++)
		reader->axis[0][i] = n[(i + 1) % 3] * helper[(i + 2) % 3] -
				     n[(i + 2) % 3] * helper[(i + 1) % 3];
	length = sqrt(v3_dot(reader->axis[0], reader->axis[0]));
	for (int i = 0; i < 3; i++)
		reader->axis[0][i] /= length;
	for (int i = 0; i < 3; i++)
		reader->axis[1][i] = n[(i + 1) % 3] * reader->axis[0][(i + 2) % 3] -
				     n[(i + 2) % 3] * reader->axis[0][(i + 1) % 3];
}

/* Go on until the tracker's records lie around a time; 1, 0 (none left), or of rows. */
static int seek(struct reader *reader, int64_t t_ns, struct incise_error *err)
{
	while (reader->after.t_ns < t_ns) {
		sqlite3_stmt *stmt = reader->tracker.stmt;
		double q[4], arm_mm[3];
		int rc = incise_rows_next(&reader->tracker, err);

		if (rc <= 0)
			return rc;
		reader->before = reader->after;
		reader->after.t_ns = reader->tracker.t_ns;
		for (int i = 0; i < 3; i++)
			reader->after.position_mm[i] = sqlite3_column_double(stmt, 2 + i);
		for (int i = 0; i < 4; i++)
			q[i] = sqlite3_column_double(stmt, 5 + i);
		v3_rotate(arm_mm, q, reader->recording->meta.tip_mm);
		v3_add(reader->after.position_mm, reader->after.position_mm, 1, arm_mm);
	}
	return 1;
}

/* Fill the tracker's side of a pair; false: it has no record close by, or too little depth. */
static bool pair_up(const struct reader *reader, struct incise_depth_pair *pair)
{
	const struct place *a = &reader->before, *b = &reader->after;
	double span = (double)(b->t_ns - a->t_ns), share, position[3];

	if (a->t_ns < 0 || span <= 0 || span > INCISE_DEPTH_GAP_NS)
		return false;
	share = (double)(pair->t_ns - a->t_ns) / span;
	for (int i = 0; i < 3; i++)
		position[i] = a->position_mm[i] +
			      share * (b->position_mm[i] - a->position_mm[i]);
	pair->tracker_mm = incise_depth_of(&reader->depth, position);
	if (!(pair->tracker_mm >= DEPTH_MM))
		return false;
	pair->rate_mm_s = (incise_depth_of(&reader->depth, b->position_mm) -
			   incise_depth_of(&reader->depth, a->position_mm)) /
			  (span * 1e-9);
	for (int k = 0; k < 2; k++)
		pair->place_mm[k] = v3_dot(reader->axis[k], position);
	return true;
}

static int read_pairs(struct reader *reader, struct incise_error *err)
{
	struct incise_depth_pair *pair;
	int rc;

	while ((pair = incise_rows_array_next(&reader->frames, &rc, err))) {
		sqlite3_stmt *stmt = reader->frames.rows.stmt;

		*pair = (struct incise_depth_pair){
			.t_ns = reader->frames.rows.t_ns,
			.camera_mm = sqlite3_column_double(stmt, 2),
		};
		if (pair->camera_mm < DEPTH_MM ||
		    sqlite3_column_double(stmt, 3) < QUALITY)
			continue;
		rc = seek(reader, pair->t_ns, err);
		if (rc <= 0)
			break;
		reader->frames.n += pair_up(reader, pair);
	}
	return rc;
}

int incise_depth_pairs(struct incise_recording *recording,
		       struct incise_depth_pair **pairs, struct incise_error *err)
{
	struct reader reader = {
		.recording = recording, .before.t_ns = -1, .after.t_ns = -1};
	struct incise_recording_info info;
	int rc = incise_recording_info(recording, &info, err);

	*pairs = NULL;
	if (rc || recording->form < 2)
		return rc;
	incise_depth_init(&reader.depth, info.surface_point_mm, info.surface_normal);
	find_axes(&reader);
	rc = incise_rows_open(&reader.tracker, recording, "tracker",
			      "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz", "iirrrrrrr",
			      info.tracker, err);
	if (!rc)
		rc = incise_rows_array_open(
			&reader.frames, recording, "frames",
			"seq, t_ns, ifnull(depth_mm, 0.0), ifnull(quality, 0.0)", "iirr",
			sizeof(**pairs), err);
	if (!rc)
		rc = read_pairs(&reader, err);
	incise_rows_close(&reader.tracker);
	rc = incise_rows_array_end(&reader.frames, rc);
	*pairs = reader.frames.list;
	return rc;
}
