// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Table wall of a recording; see incise/wall.h. The file is untrusted.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/wall.h>
#include "../schema.h"
#include "recording.h"
#include "session.h"
#include "source.h"

#define POINTS_MAX 10000000 /* one a second for 115 days */

static void take_recording_wall_text(const union incise_column *column, size_t i,
				     char to[INCISE_LEDGER_TEXT + 1])
{
	memcpy(to, column->s[i], INCISE_LEDGER_TEXT + 1);
	/* A terminal would obey control characters. */
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || (unsigned char)*c >= 0x7f)
			*c = '?';
}

/* Row @i of a batch; columns as in incise_ledger_forms. */
static void take_point(const union incise_column *column, size_t i,
		       struct incise_wall_point *point)
{
	double uncertainty_ns = column[3].r[i];
	int64_t offset_s = column[6].i[i];

	*point = (struct incise_wall_point){
		.t_ns = column[1].i[i],
		.tai_ns = column[2].i[i],
		.uncertainty_ns = isnan(uncertainty_ns) ? INFINITY : uncertainty_ns,
		.rate_ppb = column[4].r[i],
		.rate_uncertainty_ppb = column[5].r[i],
		.utc_offset_s = offset_s > INT32_MAX || offset_s < -INT32_MAX
					? INT32_MAX
					: (int)offset_s,
		.held = (int)column[7].i[i],
	};
	take_recording_wall_text(&column[8], i, point->source);
	take_recording_wall_text(&column[9], i, point->reference);
	take_recording_wall_text(&column[10], i, point->leap);
	take_recording_wall_text(&column[11], i, point->restart);
}

/* *@points is to be freed. Returns 0 or -errno. */
static int read_points(struct incise_recording *rec, struct incise_wall_point **points,
		       size_t *n, struct incise_error *err)
{
	struct incise_source source;
	const struct incise_batch *batch = &source.batch;
	size_t capacity = 0;
	int rc = incise_source_open(&source, rec, INCISE_LEDGER_WALL, err);

	while (!rc && (rc = incise_source_next(&source, err)) > 0) {
		if (*n + batch->n > capacity) {
			struct incise_wall_point *more;

			capacity = 2 * capacity + batch->n;
			more = *n < POINTS_MAX
				       ? realloc(*points, capacity * sizeof(*more))
				       : NULL;
			if (!more) {
				rc = incise_schema_no_memory(rec->path, err);
				break;
			}
			*points = more;
		}
		for (size_t i = 0; i < batch->n; i++)
			take_point(batch->column, i, &(*points)[(*n)++]);
		rc = 0;
	}
	incise_source_close(&source);
	return rc;
}

struct incise_wall *incise_recording_wall(struct incise_recording *rec,
					  struct incise_error *err)
{
	struct incise_wall_point *points = NULL;
	struct incise_wall *wall = NULL;
	/* A session's clock is that of its first member. */
	struct incise_recording *file = rec->streams[INCISE_LEDGER_WALL]->file;
	size_t n = 0;
	int rc = read_points(file, &points, &n, err);

	if (!rc && !n)
		rc = incise_error_set(
			err, ENODATA,
			"%s: has no wall time: its clock was simulated, or it was "
			"recorded without a clock source",
			file->path);
	if (!rc) {
		wall = incise_wall_new(points, n);
		if (!wall)
			rc = incise_error_set(err, errno,
					      errno == EINVAL
						      ? "%s: damaged: table wall: a "
							"value is out of range or order"
						      : "%s: out of memory",
					      file->path);
	}
	if (wall && rec->session) {
		wall = incise_session_extend(rec->session, wall);
		if (!wall)
			rc = incise_error_set(err, errno, "%s: its wall time: %s",
					      file->path, strerror(errno));
	}
	free(points);
	if (rc)
		errno = -rc;
	return wall;
}
