// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Streams of a recording as arrays, with their best times, for what is calibrated from them;
 * see incise/recording.h. Nothing in the file is trusted.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "recording.h"
#include "rows.h"

#define ROWS_MAX 100000000 /* of a stream: an hour at 27 kHz */
#define NOT_SEEN (-1e300)

/* What a table holds, and on whose line its times are. */
static const struct source {
	const char *name, *table, *line, *columns, *types;
} sources[] = {
	{"force", "force", "force", "seq, t_ns, code", "iii"},
	{"depth", "depth", "tracker", "seq, t_ns, depth_mm", "iir"},
	{"camera", "frames", "camera", "seq, t_ns, ifnull(depth_mm, -1e300)", "iir"},
	{"poses", "tracker", "tracker",
	 "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status", "iirrrrrrrt"},
};

struct walk {
	struct incise_rows rows;
	struct incise_recording_line *line;
	void *list;
	size_t size; /* of an element */
	int n, room;
};

static int walk_open(struct walk *walk, struct incise_recording *recording,
		     const struct source *source, size_t size, struct incise_error *err)
{
	int rc;

	*walk = (struct walk){.size = size};
	walk->line = calloc(1, sizeof(*walk->line));
	if (!walk->line)
		return incise_error_set(err, ENOMEM, "out of memory");
	rc = incise_recording_line(recording, source->line, walk->line, err);
	return rc ? rc
		  : incise_rows_open(&walk->rows, recording, source->table,
				     source->columns, source->types, UINT64_MAX, err);
}

/* Room for the next row: 1, 0 at the end, -errno. */
static int walk_next(struct walk *walk, int64_t *t_ns, struct incise_error *err)
{
	int rc = incise_rows_next(&walk->rows, err);
	void *list;

	if (rc <= 0)
		return rc;
	*t_ns = incise_recording_time(walk->line,
				      (uint64_t)sqlite3_column_int64(walk->rows.stmt, 0),
				      walk->rows.t_ns);
	if (walk->n < walk->room)
		return 1;
	walk->room = walk->room ? 2 * walk->room : 4096;
	list = walk->room <= ROWS_MAX
		       ? realloc(walk->list, (size_t)walk->room * walk->size)
		       : NULL;
	if (!list)
		return incise_error_set(err, ENOMEM, "%s: too long for the memory",
					walk->rows.recording->path);
	walk->list = list;
	return 1;
}

static void walk_close(struct walk *walk)
{
	incise_rows_close(&walk->rows);
	free(walk->line);
}

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
	struct walk walk;
	int rc;

	*values = NULL;
	for (int i = 0; i < 3; i++)
		if (!strcmp(sources[i].name, name))
			source = &sources[i];
	if (!source)
		return incise_error_set(err, EINVAL, "a recording has no values '%s'",
					name);
	if (source == &sources[2] && recording->form < 2)
		return 0;
	rc = walk_open(&walk, recording, source, sizeof(**values), err);
	while (!rc) {
		struct incise_recording_value *to;
		int64_t t_ns;

		rc = walk_next(&walk, &t_ns, err);
		if (rc <= 0)
			break;
		rc = 0;
		to = (struct incise_recording_value *)walk.list + walk.n;
		to->t_ns = t_ns;
		to->value = source == sources
				    ? force_of(&recording->meta,
					       sqlite3_column_int64(walk.rows.stmt, 2))
				    : sqlite3_column_double(walk.rows.stmt, 2);
		walk.n += to->value > NOT_SEEN / 2 || isnan(to->value);
	}
	walk_close(&walk);
	if (rc < 0) {
		free(walk.list);
		return rc;
	}
	*values = walk.list;
	return walk.n;
}

int incise_recording_poses(struct incise_recording *recording,
			   struct incise_tracker_sample **poses, struct incise_error *err)
{
	struct walk walk;
	int rc = walk_open(&walk, recording, &sources[3], sizeof(**poses), err);

	*poses = NULL;
	while (!rc) {
		struct incise_tracker_sample *to;
		int64_t t_ns;

		rc = walk_next(&walk, &t_ns, err);
		if (rc <= 0)
			break;
		rc = 0;
		to = (struct incise_tracker_sample *)walk.list + walk.n;
		*to = (struct incise_tracker_sample){
			.t_ns = t_ns,
			.seq = (uint64_t)sqlite3_column_int64(walk.rows.stmt, 0),
			.status = *(const char *)sqlite3_column_text(walk.rows.stmt, 9),
			.station = 1,
		};
		for (int i = 0; i < 3; i++)
			to->position_mm[i] = sqlite3_column_double(walk.rows.stmt, 2 + i);
		for (int i = 0; i < 4; i++)
			to->quaternion[i] = sqlite3_column_double(walk.rows.stmt, 5 + i);
		walk.n++;
	}
	walk_close(&walk);
	if (rc < 0) {
		free(walk.list);
		return rc;
	}
	*poses = walk.list;
	return walk.n;
}
