// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Lengths in pictures beside the tracker's depth; see incise/recording.h. Both tables are
 * gone through once, side by side:
 *
 *     depth      |     |     |     |      times on the tracker's line
 *     frames        |      |       |      times on the camera's
 *                  ╰ between these two
 */
#include <errno.h>
#include "depth.h"
#include "recording.h"
#include "rows_array.h"

struct deep {
	int64_t t_ns;
	double depth_mm, velocity_mm_s;
};

struct lengths {
	struct incise_rows_array frames; /* a length for each that has one */
	struct incise_rows depth;
	struct deep deep[2]; /* around the picture; n_deep of them so far */
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
		sqlite3_column_double(l->depth.stmt, 2),
		sqlite3_column_double(l->depth.stmt, 3),
	};
	l->n_deep += l->n_deep < 2;
	return 1;
}

static int go_through(struct lengths *l, struct incise_error *err)
{
	struct incise_recording_length *row;
	int rc, more = 1;

	while ((row = incise_rows_array_next(&l->frames, &rc, err))) {
		sqlite3_stmt *stmt = l->frames.rows.stmt;
		const struct deep *deep = l->deep;
		double part;

		*row = (struct incise_recording_length){
			.t_ns = l->frames.rows.t_ns,
			.length_px = sqlite3_column_double(stmt, 2),
			.quality = sqlite3_column_double(stmt, 3),
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
	if (recording->form < 2)
		return incise_error_set(err, EINVAL,
					"%s: is of an older form, which has no pictures",
					recording->path);
	rc = incise_rows_array_open(
		&l.frames, recording, "frames",
		"seq, t_ns, ifnull(length_px, 0.0), ifnull(quality, 0.0)", "iirr",
		sizeof(**lengths), err);
	if (!rc)
		rc = incise_rows_open(&l.depth, recording, "depth",
				      "seq, t_ns, depth_mm, velocity_mm_s", "iirr",
				      recording->depth_rows, err);
	if (!rc)
		rc = go_through(&l, err);
	incise_rows_close(&l.depth);
	rc = incise_rows_array_end(&l.frames, rc);
	*lengths = l.frames.list;
	return rc;
}
