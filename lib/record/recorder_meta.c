// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Tables meta and events of a recording that is written: what was known at the start, and
 * what happened; see recorder.h.
 */
#include <stdarg.h>
#include <stdio.h>
#include <sys/utsname.h>
#include <time.h>
#include <incise/version.h>
#include "recorder.h"

/* Run a bound statement. Returns an SQLite code. */
int incise_recorder_run(sqlite3_stmt *stmt)
{
	sqlite3_step(stmt);
	return sqlite3_reset(stmt);
}

int incise_recorder_set_text(struct incise_recorder *rec, const char *key,
			     const char *value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_text(stmt, 2, value, -1, SQLITE_TRANSIENT);
	return incise_recorder_run(stmt);
}

int incise_recorder_set_integer(struct incise_recorder *rec, const char *key,
				int64_t value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_int64(stmt, 2, value);
	return incise_recorder_run(stmt);
}

/* SQLite keeps NaN as NULL: not known. */
int incise_recorder_set_real(struct incise_recorder *rec, const char *key, double value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_double(stmt, 2, value);
	return incise_recorder_run(stmt);
}

/* A line in the table of events. Returns an SQLite code. */
int incise_recorder_note(struct incise_recorder *rec, const char *kind, const char *fmt,
			 ...)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_EVENT];
	char text[200];
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	sqlite3_bind_int64(stmt, 1, incise_clock_now(incise_rig_clock(rec->rig)));
	sqlite3_bind_text(stmt, 2, kind, -1, SQLITE_STATIC);
	sqlite3_bind_text(stmt, 3, text, -1, SQLITE_TRANSIENT);
	return incise_recorder_run(stmt);
}

int incise_recorder_write_meta(struct incise_recorder *rec)
{
	const char *const axes[] = {"x", "y", "z"};
	char started[32];
	struct utsname host;
	struct timespec now;
	struct tm utc;
	int bad = 0;

	clock_gettime(CLOCK_REALTIME, &now);
	strftime(started, sizeof(started), "%Y-%m-%dT%H:%M:%SZ",
		 gmtime_r(&now.tv_sec, &utc));
	uname(&host);
	bad |= incise_recorder_set_integer(rec, "complete", 0);
	bad |= incise_recorder_set_text(rec, "incise", incise_version());
	bad |= incise_recorder_set_text(rec, "host", host.nodename);
	bad |= incise_recorder_set_text(rec, "kernel", host.release);
	bad |= incise_recorder_set_text(rec, "started", started);
	bad |= incise_recorder_set_text(rec, "rig", incise_rig_spec(rec->rig));
	bad |= incise_recorder_set_text(
		rec, "clock",
		incise_clock_is_real(incise_rig_clock(rec->rig)) ? "real" : "simulated");
	bad |= incise_recorder_set_text(rec, "tracker_name", rec->tracker_info.name);
	bad |= incise_recorder_set_real(rec, "tracker_hz", rec->tracker_info.rate_hz);
	bad |= incise_recorder_set_integer(rec, "tracker_latency_ns",
					   rec->tracker_info.latency_ns);
	bad |= incise_recorder_set_text(rec, "force_name", rec->force_info.name);
	bad |= incise_recorder_set_real(rec, "force_hz", rec->force_info.rate_hz);
	bad |= incise_recorder_set_integer(rec, "force_bits", rec->force_info.bits);
	bad |= incise_recorder_set_real(rec, "force_full_scale_V",
					rec->force_info.full_scale_V);
	bad |= incise_recorder_set_real(rec, "force_offset_V", rec->force_info.offset_V);
	bad |= incise_recorder_set_real(rec, "force_mV_N", rec->calibration.force_mV_N);
	bad |= incise_recorder_set_real(rec, "force_zero_mV", rec->stats.zero_mV);
	bad |= incise_recorder_set_real(rec, "depth_mm_px", rec->calibration.depth_mm_px);
	for (int i = 0; i < 3; i++) {
		char key[32];

		snprintf(key, sizeof(key), "surface_point_%s_mm", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->depth.point_mm[i]);
		snprintf(key, sizeof(key), "surface_normal_%s", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->depth.normal[i]);
	}
	return bad | incise_recorder_note(rec, "start", "recording started");
}

int incise_recorder_write_streams(struct incise_recorder *rec)
{
	const struct {
		const char *name, *device;
		bool stamped; /* by the kernel or the converter, at acquisition */
		double rate_hz;
	} streams[] = {
		{"force", rec->force_info.name, true, rec->force_info.rate_hz},
		{"tracker", rec->tracker_info.name, false, rec->tracker_info.rate_hz},
	};
	sqlite3_stmt *stmt;
	int rc = sqlite3_prepare_v2(
		rec->db,
		"INSERT INTO streams(name, device, stamped, nominal_hz, delay_ns, "
		"grain_ns, rows, lost, late) VALUES(?,?,?,?,0,0,0,0,0)",
		-1, &stmt, NULL);

	for (size_t i = 0; i < sizeof(streams) / sizeof(*streams) && rc == SQLITE_OK;
	     i++) {
		sqlite3_bind_text(stmt, 1, streams[i].name, -1, SQLITE_STATIC);
		sqlite3_bind_text(stmt, 2, streams[i].device, -1, SQLITE_STATIC);
		sqlite3_bind_int(stmt, 3, streams[i].stamped);
		sqlite3_bind_double(stmt, 4, streams[i].rate_hz);
		rc = incise_recorder_run(stmt);
	}
	sqlite3_finalize(stmt);
	return rc;
}
