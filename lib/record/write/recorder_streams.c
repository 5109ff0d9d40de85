// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The streams of a recording that is written: what each device is, what its times are like,
 * and its end; tables streams and knots. See recorder.h and timeline.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "recorder.h"

/* --- beginning ------------------------------------------------------------------------ */

/* A delay of calibration, where there is one, else what the device says of itself. */
static int64_t delay_ns(double calibrated_ms, int64_t device_ns)
{
	return isnan(calibrated_ms) ? device_ns : llround(calibrated_ms * 1e6);
}

static void begin(struct incise_recorder *rec, int i, const char *name,
		  const char *device, double delay_sd_ms,
		  const struct incise_timeline_setup *setup)
{
	struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_timeline_setup with_sd = *setup;

	stream->name = name;
	stream->there = true;
	stream->delay_sd_ms = delay_sd_ms;
	if (!isnan(delay_sd_ms))
		with_sd.delay_sd_ns = llround(delay_sd_ms * 1e6);
	snprintf(stream->device, sizeof(stream->device), "%s", device);
	incise_ledger_init(&stream->ledger);
	incise_timeline_init(&stream->timeline, &with_sd);
}

void incise_recorder_begin_streams(struct incise_recorder *rec)
{
	const struct incise_calibration *calibration = &rec->calibration;

	begin(rec, INCISE_LEDGER_FORCE, "force", rec->force_info.name,
	      calibration->force_delay_sd_ms,
	      &(struct incise_timeline_setup){
		      .timestamped = true,
		      .rate_hz = rec->force_info.rate_hz,
		      .delay_ns = delay_ns(calibration->force_delay_ms, 0),
	      });
	begin(rec, INCISE_LEDGER_TRACKER, "tracker", rec->tracker_info.name,
	      calibration->tracker_delay_sd_ms,
	      &(struct incise_timeline_setup){
		      .rate_hz = rec->tracker_info.rate_hz,
		      .delay_ns = delay_ns(calibration->tracker_delay_ms,
					   rec->tracker_info.latency_ns),
		      .grain_ns = rec->tracker_info.grain_ns,
	      });
	rec->streams[INCISE_LEDGER_FORCE].lost_at_start =
		incise_force_lost(incise_rig_force(rec->rig));
	rec->streams[INCISE_LEDGER_TRACKER].lost_at_start =
		incise_tracker_lost(incise_rig_tracker(rec->rig));
	if (incise_rig_camera(rec->rig))
		begin(rec, INCISE_LEDGER_CAMERA, "camera", rec->camera_info.name,
		      calibration->camera_delay_sd_ms,
		      &(struct incise_timeline_setup){
			      .timestamped = true,
			      .rate_hz = rec->camera_info.rate_hz,
			      .delay_ns = delay_ns(calibration->camera_delay_ms, 0),
		      });
}

/* --- what is known of them ------------------------------------------------------------ */

uint64_t incise_recorder_lost(const struct incise_recorder *rec, int i)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];

	uint64_t since = stream->gaps - stream->gaps_held;

	return stream->gaps_held +
	       (since > stream->device_lost ? since : stream->device_lost);
}

static void tell(const struct incise_recorder *rec, int i, struct incise_stream *out)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_timeline_report report;

	incise_timeline_report(&stream->timeline, &report);
	*out = (struct incise_stream){
		.stamped = stream->timeline.setup.timestamped,
		.nominal_hz = stream->timeline.setup.rate_hz,
		.delay_ms = (double)stream->timeline.setup.delay_ns * 1e-6,
		.delay_sd_ms = stream->delay_sd_ms,
		.rows = stream->rows,
		.lost = incise_recorder_lost(rec, i),
		.late = report.late,
		.rate_hz = report.rate_hz,
		.drift_ppm = report.drift_ppm,
		.drift_sd_ppm = report.drift_sd_ppm,
		.jitter_ms = report.jitter_ns * 1e-6,
		.jitter_max_ms = report.jitter_max_ns * 1e-6,
		.offset_ms = report.offset_ns * 1e-6,
		.offset_sd_ms = report.offset_sd_ns * 1e-6,
	};
	/* Of a stamp nothing is uncertain but its delay, of which nothing is known. */
	if (out->stamped && isnan(out->delay_sd_ms))
		out->offset_sd_ms = NAN;
	snprintf(out->name, sizeof(out->name), "%s", stream->name);
	snprintf(out->device, sizeof(out->device), "%s", stream->device);
	snprintf(out->ended, sizeof(out->ended), "%s", stream->ended);
}

int incise_recorder_streams(const struct incise_recorder *rec,
			    struct incise_stream streams[INCISE_STREAMS_MAX])
{
	int n = 0;

	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		if (rec->streams[i].there)
			tell(rec, i, &streams[n++]);
	return n;
}

/* --- end ------------------------------------------------------------------------------ */

int incise_recorder_end_stream(struct incise_recorder *rec, int i, const char *why,
			       struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[i];

	snprintf(stream->ended, sizeof(stream->ended), "%s", why);
	return incise_recorder_note(rec, "failed", "%s: %s", stream->name, why) ==
			       SQLITE_OK
		       ? 0
		       : incise_recorder_fail(rec, err);
}

/* --- tables --------------------------------------------------------------------------- */

static int write_stream(struct incise_recorder *rec, int i)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	sqlite3_stmt *stmt = rec->stmt[SET_STREAM];
	struct incise_stream now;

	tell(rec, i, &now);
	sqlite3_bind_text(stmt, 1, now.name, -1, SQLITE_TRANSIENT);
	sqlite3_bind_text(stmt, 2, now.device, -1, SQLITE_TRANSIENT);
	sqlite3_bind_int(stmt, 3, now.stamped);
	sqlite3_bind_double(stmt, 4, now.nominal_hz);
	sqlite3_bind_int64(stmt, 5, stream->timeline.setup.delay_ns);
	if (isnan(now.delay_sd_ms))
		sqlite3_bind_null(stmt, 6);
	else
		sqlite3_bind_int64(stmt, 6, stream->timeline.setup.delay_sd_ns);
	sqlite3_bind_int64(stmt, 7, stream->timeline.setup.grain_ns);
	sqlite3_bind_int64(stmt, 8, now.rows);
	sqlite3_bind_int64(stmt, 9, now.lost);
	sqlite3_bind_int64(stmt, 10, now.late);
	sqlite3_bind_double(stmt, 11, now.rate_hz);
	sqlite3_bind_double(stmt, 12, now.drift_ppm);
	sqlite3_bind_double(stmt, 13, now.drift_sd_ppm);
	sqlite3_bind_double(stmt, 14, now.jitter_ms * 1e6);
	sqlite3_bind_double(stmt, 15, now.jitter_max_ms * 1e6);
	sqlite3_bind_double(stmt, 16, now.offset_ms * 1e6);
	sqlite3_bind_double(stmt, 17, now.offset_sd_ms * 1e6);
	if (*now.ended)
		sqlite3_bind_text(stmt, 18, now.ended, -1, SQLITE_TRANSIENT);
	else
		sqlite3_bind_null(stmt, 18);
	return incise_recorder_run(stmt);
}

static int write_knots(struct incise_recorder *rec, int i)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
	sqlite3_stmt *stmt = rec->stmt[DROP_KNOTS];
	int n = incise_timeline_knots(&stream->timeline, knots), rc;

	sqlite3_bind_text(stmt, 1, stream->name, -1, SQLITE_STATIC);
	rc = incise_recorder_run(stmt);
	stmt = rec->stmt[INSERT_KNOT];
	for (int k = 0; k < n && rc == SQLITE_OK; k++) {
		sqlite3_bind_text(stmt, 1, stream->name, -1, SQLITE_STATIC);
		sqlite3_bind_int(stmt, 2, k);
		sqlite3_bind_int64(stmt, 3, knots[k].seq);
		sqlite3_bind_int64(stmt, 4, knots[k].t_ns);
		sqlite3_bind_double(stmt, 5, knots[k].sd_ns);
		sqlite3_bind_int(stmt, 6, knots[k].starts);
		rc = incise_recorder_run(stmt);
	}
	return rc;
}

int incise_recorder_write_streams(struct incise_recorder *rec, bool knots)
{
	int rc = SQLITE_OK;

	for (int i = 0; i < INCISE_LEDGER_STREAMS && rc == SQLITE_OK; i++) {
		if (!rec->streams[i].there)
			continue;
		rc = write_stream(rec, i);
		/* What is stamped carries its time itself. */
		if (rc == SQLITE_OK && knots &&
		    !rec->streams[i].timeline.setup.timestamped)
			rc = write_knots(rec, i);
	}
	return rc;
}
