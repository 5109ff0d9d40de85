// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Streams of a recording as arrays, with their best times, for calibration; see
 * incise/recording.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <incise/depth_pairs.h>
#include "../../base/vector.h"
#include "depth.h"
#include "recording.h"
#include "rows.h"

#define ROWS_MAX 100000000 /* of a stream: an hour at 27 kHz */
/* Least quality and depth of a pair of depths; a blade may be in the air above. */
#define PAIR_QUALITY 0.5
#define PAIR_DEPTH_MM 1.0

/* The rows of a table as an array: an element for each row that counts. */
struct array {
	struct incise_rows rows; /* at the row of the element */
	void *list;		 /* of n elements; free(3) */
	size_t size;		 /* of an element */
	int n, capacity;
};

/* Open a table, as rows.h, for elements of that size. To be ended in any case. */
static int array_open(struct array *array, struct incise_recording *recording,
		      const char *table, const char *columns, size_t size,
		      struct incise_error *err)
{
	*array = (struct array){.size = size};
	return incise_rows_open(&array->rows, recording, table, columns, UINT64_MAX, err);
}

/*
 * Go to the next row. Returns the element behind the last, to be filled; it counts once n is one
 * more. NULL at the end, and with -errno in @rc.
 */
static void *array_next(struct array *array, int *rc, struct incise_error *err)
{
	*rc = incise_rows_next(&array->rows, err);
	if (*rc <= 0)
		return NULL;
	*rc = 0;
	if (array->n == array->capacity) {
		int capacity = array->capacity ? 2 * array->capacity : 4096;
		void *list =
			capacity <= ROWS_MAX
				? realloc(array->list, (size_t)capacity * array->size)
				: NULL;

		if (!list) {
			*rc = incise_error_set(err, ENOMEM,
					       "%s: too long for the "
					       "memory; use a shorter "
					       "recording",
					       array->rows.recording->path);
			return NULL;
		}
		array->list = list;
		array->capacity = capacity;
	}
	return (char *)array->list + (size_t)array->n * array->size;
}

/* Returns n, or @rc if that is below 0. Without an element the list is NULL. */
static int array_end(struct array *array, int rc)
{
	incise_rows_close(&array->rows);
	if (rc >= 0 && array->n)
		return array->n;
	free(array->list);
	array->list = NULL;
	return rc;
}

/* --- values and poses ---------------------------------------------------------------- */

static const struct source {
	const char *name, *table, *columns;
} sources[] = {
	{"force", "force", "seq, t_ns, code"},
	{"depth", "depth", "seq, t_ns, depth_mm"},
	{"camera", "frames", "seq, t_ns, depth_mm"},
};

static double force_of(const struct incise_recording_info *meta, int64_t code)
{
	double zero_mV = isnan(meta->zero_mV) ? 0 : meta->zero_mV;
	int64_t top = (1LL << meta->bits) - 1;

	if (code <= 0 || code >= top)
		return NAN;
	return (meta->full_scale_V * 1e3 * (double)code / (double)(top + 1) +
		meta->offset_V * 1e3 - zero_mV) /
	       meta->force_mV_N;
}

int incise_recording_values(struct incise_recording *recording, const char *name,
			    struct incise_recording_value **values,
			    struct incise_error *err)
{
	const struct source *source = NULL;
	struct incise_recording_value *to;
	struct array array;
	int rc;

	*values = NULL;
	for (int i = 0; i < 3; i++)
		if (!strcmp(sources[i].name, name))
			source = &sources[i];
	if (!source)
		return incise_error_set(err, EINVAL, "no values '%s' in a recording",
					name);
	rc = array_open(&array, recording, source->table, source->columns, sizeof(*to),
			err);
	while (!rc && (to = array_next(&array, &rc, err))) {
		to->t_ns = array.rows.t_ns;
		to->value = source == sources ? force_of(&recording->meta,
							 incise_rows_int(&array.rows, 2))
					      : incise_rows_real(&array.rows, 2);
		array.n += source == sources || !isnan(to->value);
	}
	rc = array_end(&array, rc);
	*values = array.list;
	return rc;
}

int incise_recording_poses(struct incise_recording *recording,
			   struct incise_tracker_sample **poses, struct incise_error *err)
{
	struct array array;
	struct incise_tracker_sample *to;
	int rc = array_open(&array, recording, "tracker",
			    "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status",
			    sizeof(*to), err);

	while (!rc && (to = array_next(&array, &rc, err))) {
		const struct incise_rows *rows = &array.rows;

		*to = (struct incise_tracker_sample){
			.t_ns = rows->t_ns,
			.seq = (uint64_t)incise_rows_seq(rows),
			.status = incise_rows_char(rows, 9),
			.station = 1,
		};
		for (int i = 0; i < 3; i++)
			to->position_mm[i] = incise_rows_real(rows, 2 + i);
		for (int i = 0; i < 4; i++)
			to->quaternion[i] = incise_rows_real(rows, 5 + i);
		array.n++;
	}
	rc = array_end(&array, rc);
	*poses = array.list;
	return rc;
}

/*
 * --- lengths in frames, with the tracker's depth ------------------------------------------
 *
 * Both tables are read once, side by side:
 *
 *     depth      |     |     |     |      times on the tracker's line
 *     frames        |      |       |      times on the camera's
 *                  ╰ between these two
 */

struct deep {
	int64_t t_ns;
	double depth_mm, velocity_mm_s;
};

struct lengths {
	struct array frames; /* a length for each that has one */
	struct incise_rows depth;
	struct deep deep[2]; /* around the frame; n_deep of them so far */
	int n_deep;
};

/* 1, 0 at the end, -errno. */
static int next_depth(struct lengths *l, struct incise_error *err)
{
	int rc = incise_rows_next(&l->depth, err);

	if (rc <= 0)
		return rc;
	l->deep[0] = l->deep[1];
	l->deep[1] = (struct deep){
		l->depth.t_ns,
		incise_rows_real(&l->depth, 2),
		incise_rows_real(&l->depth, 3),
	};
	l->n_deep += l->n_deep < 2;
	return 1;
}

static int read_lengths(struct lengths *l, struct incise_error *err)
{
	struct incise_recording_length *row;
	int rc, more = 1;

	while ((row = array_next(&l->frames, &rc, err))) {
		const struct incise_rows *rows = &l->frames.rows;
		const struct deep *deep = l->deep;
		double quality = incise_rows_real(rows, 3), part;

		*row = (struct incise_recording_length){
			.t_ns = rows->t_ns,
			.length_px = incise_rows_real(rows, 2),
			.quality = isnan(quality) ? 0 : quality,
		};
		while (more > 0 && (l->n_deep < 2 || deep[1].t_ns < row->t_ns))
			more = next_depth(l, err);
		if (more < 0)
			return more;
		if (!(row->length_px > 0) || l->n_deep < 2 || deep[0].t_ns > row->t_ns ||
		    deep[1].t_ns < row->t_ns || deep[1].t_ns <= deep[0].t_ns ||
		    deep[1].t_ns - row->t_ns > INCISE_DEPTH_GAP_NS ||
		    row->t_ns - deep[0].t_ns > INCISE_DEPTH_GAP_NS)
			continue;
		part = (double)(row->t_ns - deep[0].t_ns) / (deep[1].t_ns - deep[0].t_ns);
		row->depth_mm =
			deep[0].depth_mm + part * (deep[1].depth_mm - deep[0].depth_mm);
		row->velocity_mm_s =
			deep[0].velocity_mm_s +
			part * (deep[1].velocity_mm_s - deep[0].velocity_mm_s);
		l->frames.n++;
	}
	return rc;
}

int incise_recording_lengths(struct incise_recording *recording,
			     struct incise_recording_length **lengths,
			     struct incise_error *err)
{
	struct lengths l = {0};
	int rc;

	*lengths = NULL;
	rc = array_open(&l.frames, recording, "frames", "seq, t_ns, length_px, quality",
			sizeof(**lengths), err);
	if (!rc)
		rc = incise_rows_open(&l.depth, recording, "depth",
				      "seq, t_ns, depth_mm, velocity_mm_s",
				      recording->meta.depth, err);
	if (!rc)
		rc = read_lengths(&l, err);
	incise_rows_close(&l.depth);
	rc = array_end(&l.frames, rc);
	*lengths = l.frames.list;
	return rc;
}

/* --- pairs of depths by camera and tracker --------------------------------------------- */

struct recording_arrays_place {
	int64_t t_ns; /* -1: none */
	double position_mm[3];
};

struct pairs {
	struct incise_recording *recording;
	struct incise_rows tracker;
	struct array frames; /* a pair for each that is one */
	struct recording_arrays_place before, after;
	struct incise_depth depth;
	double axis[2][3]; /* along the surface */
};

/* Two unit vectors along the surface. */
static void find_axes(struct pairs *p)
{
	const double *n = p->depth.normal;
	double helper[3] = {0, 0, 0}, length;

	/* the axis that is least along the normal */
	helper[fabs(n[0]) < fabs(n[1]) ? (fabs(n[0]) < fabs(n[2]) ? 0 : 2)
				       : (fabs(n[1]) < fabs(n[2]) ? 1 : 2)] = 1;
	v3_cross(p->axis[0], n, helper);
	length = sqrt(v3_dot(p->axis[0], p->axis[0]));
	for (int i = 0; i < 3; i++)
		p->axis[0][i] /= length;
	v3_cross(p->axis[1], n, p->axis[0]);
}

/* Read until the tracker's records lie around a time; 1, 0 (none left), or -errno. */
static int seek(struct pairs *p, int64_t t_ns, struct incise_error *err)
{
	while (p->after.t_ns < t_ns) {
		double q[4], arm_mm[3];
		int rc = incise_rows_next(&p->tracker, err);

		if (rc <= 0)
			return rc;
		p->before = p->after;
		p->after.t_ns = p->tracker.t_ns;
		for (int i = 0; i < 3; i++)
			p->after.position_mm[i] = incise_rows_real(&p->tracker, 2 + i);
		for (int i = 0; i < 4; i++)
			q[i] = incise_rows_real(&p->tracker, 5 + i);
		v3_rotate(arm_mm, q, p->recording->meta.tip_mm);
		v3_add(p->after.position_mm, p->after.position_mm, 1, arm_mm);
	}
	return 1;
}

/* Fill the tracker's side of a pair; false: no record is near, or the depth is too small. */
static bool pair_up(const struct pairs *p, struct incise_depth_pair *pair)
{
	const struct recording_arrays_place *a = &p->before, *b = &p->after;
	double span = (double)(b->t_ns - a->t_ns), share, position[3];

	if (a->t_ns < 0 || span <= 0 || span > INCISE_DEPTH_GAP_NS)
		return false;
	share = (double)(pair->t_ns - a->t_ns) / span;
	for (int i = 0; i < 3; i++)
		position[i] = a->position_mm[i] +
			      share * (b->position_mm[i] - a->position_mm[i]);
	pair->tracker_mm = incise_depth_of(&p->depth, position);
	if (!(pair->tracker_mm >= PAIR_DEPTH_MM))
		return false;
	pair->rate_mm_s = (incise_depth_of(&p->depth, b->position_mm) -
			   incise_depth_of(&p->depth, a->position_mm)) /
			  (span * 1e-9);
	for (int k = 0; k < 2; k++)
		pair->place_mm[k] = v3_dot(p->axis[k], position);
	return true;
}

static int read_pairs(struct pairs *p, struct incise_error *err)
{
	struct incise_depth_pair *pair;
	int rc;

	while ((pair = array_next(&p->frames, &rc, err))) {
		const struct incise_rows *rows = &p->frames.rows;

		*pair = (struct incise_depth_pair){
			.t_ns = rows->t_ns,
			.camera_mm = incise_rows_real(rows, 2),
		};
		if (!(pair->camera_mm >= PAIR_DEPTH_MM) ||
		    !(incise_rows_real(rows, 3) >= PAIR_QUALITY))
			continue;
		rc = seek(p, pair->t_ns, err);
		if (rc <= 0)
			break;
		p->frames.n += pair_up(p, pair);
	}
	return rc;
}

int incise_depth_pairs(struct incise_recording *recording,
		       struct incise_depth_pair **pairs, struct incise_error *err)
{
	struct pairs p = {.recording = recording, .before.t_ns = -1, .after.t_ns = -1};
	struct incise_recording_info info;
	int rc = incise_recording_measure(recording, &info, err);

	*pairs = NULL;
	if (rc)
		return rc;
	incise_depth_init(&p.depth, info.surface_point_mm, info.surface_normal);
	find_axes(&p);
	rc = incise_rows_open(&p.tracker, recording, "tracker",
			      "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz", info.tracker,
			      err);
	if (!rc)
		rc = array_open(&p.frames, recording, "frames",
				"seq, t_ns, depth_mm, quality", sizeof(**pairs), err);
	if (!rc)
		rc = read_pairs(&p, err);
	incise_rows_close(&p.tracker);
	rc = array_end(&p.frames, rc);
	*pairs = p.frames.list;
	return rc;
}
