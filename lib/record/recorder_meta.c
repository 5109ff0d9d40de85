// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Tables meta and events of a recording that is written: what was known at the start, and
 * what happened; see recorder.h.
 */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>
#include <time.h>
#include <incise/version.h>
#include "recorder.h"

#define SETTINGS_MAX 16384

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

/* A text that was cut short ends before the character that has no room. */
static void end_whole(char *text, size_t size, int length)
{
	size_t n = size - 1;

	if (length < (int)size)
		return;
	while (n && ((unsigned char)text[n - 1] & 0xc0) == 0x80)
		n--;
	if (n && (unsigned char)text[n - 1] >= 0xc0)
		n--;
	text[n] = 0;
}

static int note(struct incise_recorder *rec, int64_t t_ns, const char *kind,
		const char *fmt, va_list args)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_EVENT];
	char text[250];

	end_whole(text, sizeof(text), vsnprintf(text, sizeof(text), fmt, args));
	sqlite3_bind_int64(stmt, 1, t_ns);
	sqlite3_bind_text(stmt, 2, kind, -1, SQLITE_TRANSIENT);
	sqlite3_bind_text(stmt, 3, text, -1, SQLITE_TRANSIENT);
	return incise_recorder_run(stmt);
}

int incise_recorder_note_at(struct incise_recorder *rec, int64_t t_ns, const char *kind,
			    const char *fmt, ...)
{
	va_list args;
	int rc;

	va_start(args, fmt);
	rc = note(rec, t_ns, kind, fmt, args);
	va_end(args);
	return rc;
}

int incise_recorder_note(struct incise_recorder *rec, const char *kind, const char *fmt,
			 ...)
{
	va_list args;
	int rc;

	va_start(args, fmt);
	rc = note(rec, incise_clock_now(incise_rig_clock(rec->rig)), kind, fmt, args);
	va_end(args);
	return rc;
}

/* The text of rig.conf as it is now, so that it is known what each device was set to. */
static int set_settings(struct incise_recorder *rec)
{
	const char *spec = incise_rig_spec(rec->rig);
	char text[SETTINGS_MAX + 1];
	FILE *file = strncmp(spec, "sim:", 4) ? fopen(spec, "re") : NULL;
	size_t n;

	if (!file)
		return SQLITE_OK;
	n = fread(text, 1, SETTINGS_MAX, file);
	fclose(file);
	text[n] = 0;
	return incise_recorder_set_text(rec, "rig_conf", text);
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
	bad |= set_settings(rec);
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
	if (rec->streams[INCISE_LEDGER_CAMERA].there) {
		bad |= incise_recorder_set_text(rec, "camera_name",
						rec->camera_info.name);
		bad |= incise_recorder_set_real(rec, "camera_hz",
						rec->camera_info.rate_hz);
		bad |= incise_recorder_set_integer(rec, "camera_width",
						   rec->camera_info.width);
		bad |= incise_recorder_set_integer(rec, "camera_height",
						   rec->camera_info.height);
		bad |= incise_recorder_set_integer(rec, "camera_exposure_ns",
						   rec->camera_info.exposure_ns);
	}
	for (int i = 0; i < 3; i++) {
		char key[32];

		snprintf(key, sizeof(key), "surface_point_%s_mm", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->depth.point_mm[i]);
		snprintf(key, sizeof(key), "surface_normal_%s", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->depth.normal[i]);
	}
	return bad | incise_recorder_note(rec, "start", "recording started");
}
