// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth by the camera beside depth by the tracker, of a recording; see incise/depth_pairs.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <incise/depth_pairs.h>
#include "../base/vector.h"
#include "depth.h"
#include "recording.h"
#include "rows.h"

#define QUALITY 0.5
#define DEPTH_MM \
	1.0 /* above it, a blade may be in the air, where a camera sees no depth */

struct place {
	int64_t t_ns; /* -1: none */
	double position_mm[3];
};

struct reader {
	struct incise_recording *recording;
	struct incise_rows tracker, frames;
	struct incise_recording_line tracker_line, camera_line;
	struct place before, after;
	struct incise_depth depth;
	double axis[2][3]; /* along the surface */
	struct incise_depth_pair *pairs;
	int n, room;
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
		reader->after.t_ns = incise_recording_time(&reader->tracker_line,
							   sqlite3_column_int64(stmt, 0),
							   reader->tracker.t_ns);
		for (int i = 0; i < 3; i++)
			reader->after.position_mm[i] = sqlite3_column_double(stmt, 2 + i);
		for (int i = 0; i < 4; i++)
			q[i] = sqlite3_column_double(stmt, 5 + i);
		v3_rotate(arm_mm, q, reader->recording->meta.tip_mm);
		v3_add(reader->after.position_mm, reader->after.position_mm, 1, arm_mm);
	}
	return 1;
}

static int add(struct reader *reader, int64_t t_ns, double camera_mm,
	       struct incise_error *err)
{
	const struct place *a = &reader->before, *b = &reader->after;
	struct incise_depth_pair pair = {.t_ns = t_ns, .camera_mm = camera_mm};
	double span = (double)(b->t_ns - a->t_ns), share, position[3];

	if (a->t_ns < 0 || span <= 0 || span > INCISE_DEPTH_GAP_NS)
		return 0;
	share = (double)(t_ns - a->t_ns) / span;
	for (int i = 0; i < 3; i++)
		position[i] = a->position_mm[i] +
			      share * (b->position_mm[i] - a->position_mm[i]);
	pair.tracker_mm = incise_depth_of(&reader->depth, position);
	if (!(pair.tracker_mm >= DEPTH_MM && pair.camera_mm >= DEPTH_MM))
		return 0;
	pair.rate_mm_s = (incise_depth_of(&reader->depth, b->position_mm) -
			  incise_depth_of(&reader->depth, a->position_mm)) /
			 (span * 1e-9);
	for (int k = 0; k < 2; k++)
		pair.place_mm[k] = v3_dot(reader->axis[k], position);
	if (reader->n == reader->room) {
		int room = reader->room ? 2 * reader->room : 1024;
		struct incise_depth_pair *more =
			realloc(reader->pairs, room * sizeof(*more));

		if (!more)
			return incise_error_set(err, ENOMEM, "%s: out of memory",
						reader->recording->path);
		reader->pairs = more;
		reader->room = room;
	}
	reader->pairs[reader->n++] = pair;
	return 0;
}

static int read_pairs(struct reader *reader, struct incise_error *err)
{
	int rc;

	while ((rc = incise_rows_next(&reader->frames, err)) > 0) {
		sqlite3_stmt *stmt = reader->frames.stmt;
		double depth_mm = sqlite3_column_double(stmt, 2);
		int64_t t_ns;

		if (depth_mm < DEPTH_MM || sqlite3_column_double(stmt, 3) < QUALITY)
			continue;
		t_ns = incise_recording_time(&reader->camera_line,
					     sqlite3_column_int64(stmt, 0),
					     reader->frames.t_ns);
		rc = seek(reader, t_ns, err);
		if (rc <= 0)
			return rc;
		rc = add(reader, t_ns, depth_mm, err);
		if (rc)
			return rc;
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
	rc = incise_recording_line(recording, "tracker", &reader.tracker_line, err);
	if (!rc)
		rc = incise_recording_line(recording, "camera", &reader.camera_line, err);
	if (!rc)
		rc = incise_rows_open(&reader.tracker, recording, "tracker",
				      "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz",
				      "iirrrrrrr", info.tracker, err);
	if (!rc)
		rc = incise_rows_open(
			&reader.frames, recording, "frames",
			"seq, t_ns, ifnull(depth_mm, 0.0), ifnull(quality, 0.0)", "iirr",
			UINT64_MAX, err);
	if (!rc)
		rc = read_pairs(&reader, err);
	incise_rows_close(&reader.tracker);
	incise_rows_close(&reader.frames);
	if (rc < 0) {
		free(reader.pairs);
		return rc;
	}
	*pairs = reader.pairs;
	return reader.n;
}
