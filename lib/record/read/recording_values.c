// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Streams of a recording as arrays, with their best times, for what is calibrated from them;
 * see incise/recording.h. Nothing in the file is trusted.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "recording.h"
#include "rows_array.h"

static const struct source {
	const char *name, *table, *columns, *types;
} sources[] = {
	{"force", "force", "seq, t_ns, code", "iii"},
	{"depth", "depth", "seq, t_ns, depth_mm", "iir"},
	{"camera", "frames", "seq, t_ns, depth_mm", "iin"},
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
	struct incise_rows_array array;
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
	rc = incise_rows_array_open(&array, recording, source->table, source->columns,
				    source->types, sizeof(*to), err);
	while (!rc && (to = incise_rows_array_next(&array, &rc, err))) {
		sqlite3_stmt *stmt = array.rows.stmt;

		to->t_ns = array.rows.t_ns;
		to->value = source == sources ? force_of(&recording->meta,
							 sqlite3_column_int64(stmt, 2))
					      : sqlite3_column_double(stmt, 2);
		array.n += sqlite3_column_type(stmt, 2) != SQLITE_NULL;
	}
	rc = incise_rows_array_end(&array, rc);
	*values = array.list;
	return rc;
}

int incise_recording_poses(struct incise_recording *recording,
			   struct incise_tracker_sample **poses, struct incise_error *err)
{
	struct incise_rows_array array;
	struct incise_tracker_sample *to;
	int rc = incise_rows_array_open(
		&array, recording, "tracker",
		"seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status", "iirrrrrrrt",
		sizeof(*to), err);

	while (!rc && (to = incise_rows_array_next(&array, &rc, err))) {
		sqlite3_stmt *stmt = array.rows.stmt;

		*to = (struct incise_tracker_sample){
			.t_ns = array.rows.t_ns,
			.seq = (uint64_t)sqlite3_column_int64(stmt, 0),
			.status = *(const char *)sqlite3_column_text(stmt, 9),
			.station = 1,
		};
		for (int i = 0; i < 3; i++)
			to->position_mm[i] = sqlite3_column_double(stmt, 2 + i);
		for (int i = 0; i < 4; i++)
			to->quaternion[i] = sqlite3_column_double(stmt, 5 + i);
		array.n++;
	}
	rc = incise_rows_array_end(&array, rc);
	*poses = array.list;
	return rc;
}
