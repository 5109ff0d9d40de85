// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The best time of each row; see row_times.h. Nothing in the file is trusted.
 */
#include <math.h>
#include <string.h>
#include "row_times.h"
#include "../schema.h"

#define TIME_MAX (INT64_MAX / 4) /* 73 years; sums and differences do not overflow */
#define DELAY_MAX_NS 1e12	 /* a quarter of an hour; shifts stay far from overflow */

static const struct {
	const char *table, *stream;
} streams[] = {
	{"force", "force"},
	{"tracker", "tracker"},
	{"depth", "tracker"}, /* rows have the number of the tracker's record */
	{"frames", "camera"},
};

/* The delay in recordings from before there was a table of streams. */
static int old_latency(struct incise_recording *recording, double *delay_ns,
		       struct incise_error *err)
{
	sqlite3_stmt *stmt;

	if (sqlite3_prepare_v2(recording->db,
			       "SELECT value FROM meta WHERE key = 'tracker_latency_ns'",
			       -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	if (sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_INTEGER)
		*delay_ns = sqlite3_column_double(stmt, 0);
	sqlite3_finalize(stmt);
	return 0;
}

int incise_row_times_open(struct incise_row_times *times,
			  struct incise_recording *recording, const char *table,
			  struct incise_error *err)
{
	struct incise_stream known[INCISE_STREAMS_MAX];
	int rc = 0, n;

	*times = (struct incise_row_times){
		.still = true,
		.delay_ns = NAN,
		.own_ns = -1,
		.last_ns = INCISE_TIME_NONE,
	};
	for (size_t i = 0; i < sizeof(streams) / sizeof(*streams); i++)
		if (!strcmp(streams[i].table, table))
			times->stream = streams[i].stream;
	if (!times->stream)
		return 0; /* events */
	times->still = false;
	if (!strcmp(times->stream, "tracker"))
		rc = old_latency(recording, &times->delay_ns, err);
	if (rc)
		return rc;
	n = incise_recording_streams(recording, known, err);
	for (int i = 0; i < n; i++)
		if (!strcmp(known[i].name, times->stream)) {
			times->delay_ns = known[i].delay_ms * 1e6;
			times->delay_sd_ns = known[i].delay_sd_ms * 1e6;
			times->offset_sd_ns = known[i].offset_sd_ms * 1e6;
		}
	return n < 0 ? n
		     : incise_recording_line(recording, times->stream, &times->line, err);
}

static double known(double value, double otherwise)
{
	return isnan(value) ? otherwise : value;
}

void incise_row_times_calibrate(struct incise_row_times *times,
				const struct incise_calibration *calibration)
{
	double ms = NAN, sd_ms = NAN, old_ns = known(times->delay_ns, 0);
	double old_sd_ns = known(times->delay_sd_ns, 0);

	if (!times->stream)
		return;
	if (!strcmp(times->stream, "force")) {
		ms = calibration->force_delay_ms;
		sd_ms = calibration->force_delay_sd_ms;
	} else if (!strcmp(times->stream, "tracker")) {
		ms = calibration->tracker_delay_ms;
		sd_ms = calibration->tracker_delay_sd_ms;
	} else {
		ms = calibration->camera_delay_ms;
		sd_ms = calibration->camera_delay_sd_ms;
	}
	if (isnan(ms))
		return;
	times->shift_ns =
		(int64_t)fmax(fmin(old_ns - ms * 1e6, DELAY_MAX_NS), -DELAY_MAX_NS);
	if (!isnan(sd_ms))
		times->variance_ns2 = sd_ms * 1e6 * sd_ms * 1e6 - old_sd_ns * old_sd_ns;
}

bool incise_row_times_next(struct incise_row_times *times, int64_t seq, int64_t t_ns,
			   int64_t *best_ns)
{
	int64_t best;

	if (t_ns < 0 || t_ns > TIME_MAX || t_ns < times->own_ns ||
	    (t_ns == times->own_ns && !times->still))
		return false;
	times->own_ns = t_ns;
	best = incise_recording_time(&times->line, seq, t_ns) + times->shift_ns;
	best = best > TIME_MAX ? TIME_MAX : best < -TIME_MAX ? -TIME_MAX : best;
	if (times->last_ns != INCISE_TIME_NONE && best < times->last_ns + !times->still)
		best = times->last_ns + !times->still;
	times->last_ns = *best_ns = best;
	return true;
}

double incise_row_times_sd(const struct incise_row_times *times, int64_t seq)
{
	double sd_ns = times->line.n ? incise_recording_time_sd(&times->line, seq)
				     : known(times->offset_sd_ns, 0);
	double variance = sd_ns * sd_ns + times->variance_ns2;

	return variance > 0 ? sqrt(variance) * 1e-9 : 0;
}
