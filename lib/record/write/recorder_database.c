// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The database of a recording that is written: opening and closing, statements, tables meta and
 * events; see recorder.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>
#include <incise/version.h>
#include "../schema.h"
#include "recorder.h"

#define SETTINGS_MAX 16384
#define CALIBRATION_MAX (1 << 20) /* with the history of years */
/* Longest wait for a reader that blocks the recorder. */
#define BUSY_MS 1000

static const char *const sql[STATEMENTS] = {
	[INSERT_EVENT] = "INSERT INTO events VALUES(?,?,?)",
	[SET_META] = "INSERT OR REPLACE INTO meta VALUES(?,?)",
	[SET_STREAM] = "INSERT OR REPLACE INTO streams "
		       "VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)",
	[DROP_KNOTS] = "DELETE FROM knots WHERE stream = ?",
	[INSERT_KNOT] = "INSERT INTO knots VALUES(?,?,?,?,?,?)",
};

int incise_recorder_fail(struct incise_recorder *rec, struct incise_error *err)
{
	/* SQLite forgets the cause where it fails outside of a statement: "not an error". */
	const int cause = errno, system = sqlite3_system_errno(rec->db);
	const bool forgot = !sqlite3_errcode(rec->db);
	int code = forgot && cause ? cause : incise_schema_errno(rec->db);
	const char *text = forgot	    ? strerror(cause ? cause : EIO)
			   : code == system ? strerror(system)
					    : sqlite3_errmsg(rec->db);
	int rc = incise_recorder_check_files(rec, err);
	char kept[400];

	if (rc)
		return rc;
	if (rec->worthless) {
		snprintf(kept, sizeof(kept), "no data were kept");
	} else {
		snprintf(kept, sizeof(kept),
			 "the committed data are in %.300s: `incise info` reads it",
			 rec->part);
	}
	if (code == ENOSPC)
		return incise_error_set(
			err, code,
			"%.200s: disk full (or a quota or limit on files); free disk "
			"space and record again; %s",
			rec->path, kept);
	return incise_error_set(err, code == EINVAL ? EIO : code,
				"%.200s: cannot be written: %s; %s", rec->path, text,
				kept);
}

int incise_recorder_check(struct incise_recorder *rec, int code, struct incise_error *err)
{
	return code == SQLITE_OK ? 0 : incise_recorder_fail(rec, err);
}

/* --- rows of tables meta and events -------------------------------------------------- */

int incise_recorder_set_text(struct incise_recorder *rec, const char *key,
			     const char *value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_text(stmt, 2, value, -1, SQLITE_TRANSIENT);
	return incise_schema_run(stmt);
}

int incise_recorder_set_integer(struct incise_recorder *rec, const char *key,
				int64_t value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_int64(stmt, 2, value);
	return incise_schema_run(stmt);
}

int incise_recorder_set_bytes(struct incise_recorder *rec, const char *key,
			      const void *bytes, size_t n)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_blob64(stmt, 2, n ? bytes : "", n, SQLITE_TRANSIENT);
	return incise_schema_run(stmt);
}

/* SQLite keeps NaN as NULL: not known. */
int incise_recorder_set_real(struct incise_recorder *rec, const char *key, double value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_double(stmt, 2, value);
	return incise_schema_run(stmt);
}

/* End a truncated text before its last, incomplete character. */
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

static int note_recorder_database(struct incise_recorder *rec, int64_t t_ns,
				  const char *kind, const char *fmt, va_list args)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_EVENT];
	char text[250];

	end_whole(text, sizeof(text), vsnprintf(text, sizeof(text), fmt, args));
	sqlite3_bind_int64(stmt, 1, t_ns);
	sqlite3_bind_text(stmt, 2, kind, -1, SQLITE_TRANSIENT);
	sqlite3_bind_text(stmt, 3, text, -1, SQLITE_TRANSIENT);
	return incise_schema_run(stmt);
}

int incise_recorder_note_at(struct incise_recorder *rec, int64_t t_ns, const char *kind,
			    const char *fmt, ...)
{
	va_list args;
	int rc;

	va_start(args, fmt);
	rc = note_recorder_database(rec, t_ns, kind, fmt, args);
	va_end(args);
	return rc;
}

int incise_recorder_note(struct incise_recorder *rec, const char *kind, const char *fmt,
			 ...)
{
	va_list args;
	int rc;

	va_start(args, fmt);
	rc = note_recorder_database(rec, incise_clock_now(incise_rig_clock(rec->rig)),
				    kind, fmt, args);
	va_end(args);
	return rc;
}

/* --- what is known at the start ------------------------------------------------------ */

/* Set a value to the text of a file, up to @max bytes; skip a file that cannot be read. */
static int set_file(struct incise_recorder *rec, const char *key, const char *path,
		    size_t max)
{
	FILE *file = fopen(path, "re");
	char *text = file ? malloc(max + 1) : NULL;
	int rc = SQLITE_OK;

	if (text) {
		text[fread(text, 1, max, file)] = 0;
		rc = incise_recorder_set_text(rec, key, text);
	}
	free(text);
	if (file)
		fclose(file);
	return rc;
}

/* Keep the texts of rig.conf and calibration.conf. */
static int set_settings(struct incise_recorder *rec, const char *calibration_path)
{
	const char *spec = incise_rig_spec(rec->rig);
	int bad = SQLITE_OK;

	if (strncmp(spec, "sim:", 4))
		bad |= set_file(rec, "rig_conf", spec, SETTINGS_MAX);
	if (calibration_path)
		bad |= set_file(rec, "calibration_conf", calibration_path,
				CALIBRATION_MAX);
	return bad;
}

/* Equal in recordings of one CLOCK_MONOTONIC: the kernel's boot, and the time namespace in it. */
static int set_boot(struct incise_recorder *rec)
{
	char boot[40] = "", space[32] = "", text[80];
	FILE *file = fopen("/proc/sys/kernel/random/boot_id", "re");
	ssize_t n = readlink("/proc/self/ns/time", space, sizeof(space) - 1);

	if (file) {
		boot[fread(boot, 1, 36, file)] = '\0';
		fclose(file);
	}
	if (!boot[0] || n <= 0 || !incise_clock_is_real(incise_rig_clock(rec->rig)))
		return SQLITE_OK;
	snprintf(text, sizeof(text), "%s %s", boot, space);
	return incise_recorder_set_text(rec, "boot", text);
}

/* No two recordings have the same one. */
static int set_identity(struct incise_recorder *rec)
{
	uint8_t bytes[16];
	char text[2 * sizeof(bytes) + 1];

	if (getrandom(bytes, sizeof(bytes), 0) != sizeof(bytes))
		return SQLITE_IOERR;
	for (size_t i = 0; i < sizeof(bytes); i++)
		snprintf(text + 2 * i, 3, "%02x", bytes[i]);
	return incise_recorder_set_text(rec, "identity", text);
}

static int write_meta(struct incise_recorder *rec, const char *calibration_path)
{
	const struct incise_tracker_info *tracker = &rec->tracker_info;
	const struct incise_force_info *force = &rec->force_info;
	const struct incise_camera_info *camera = &rec->camera_info;
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
	bad |= set_identity(rec);
	bad |= incise_recorder_set_text(rec, "incise", incise_version());
	bad |= incise_recorder_set_text(rec, "host", host.nodename);
	bad |= incise_recorder_set_text(rec, "kernel", host.release);
	bad |= set_boot(rec);
	bad |= incise_recorder_set_text(rec, "started", started);
	bad |= incise_recorder_set_text(rec, "rig", incise_rig_spec(rec->rig));
	bad |= set_settings(rec, calibration_path);
	bad |= incise_recorder_set_text(
		rec, "clock",
		incise_clock_is_real(incise_rig_clock(rec->rig)) ? "real" : "simulated");
	bad |= incise_recorder_set_text(rec, "tracker_name", tracker->name);
	bad |= incise_recorder_set_real(rec, "tracker_hz", tracker->rate_hz);
	bad |= incise_recorder_set_integer(rec, "tracker_latency_ns",
					   tracker->latency_ns);
	/* The notes of these do not change. */
	if (*tracker->note)
		bad |= incise_recorder_set_text(rec, "tracker_note", tracker->note);
	if (*force->note)
		bad |= incise_recorder_set_text(rec, "force_note", force->note);
	bad |= incise_recorder_set_text(rec, "force_name", force->name);
	bad |= incise_recorder_set_real(rec, "force_hz", force->rate_hz);
	bad |= incise_recorder_set_integer(rec, "force_bits", force->bits);
	bad |= incise_recorder_set_real(rec, "force_full_scale_V", force->full_scale_V);
	bad |= incise_recorder_set_real(rec, "force_offset_V", force->offset_V);
	bad |= incise_recorder_set_integer(rec, "force_newtons", force->newtons);
	bad |= incise_recorder_set_real(rec, "force_mV_N", rec->calibration.force_mV_N);
	bad |= incise_recorder_set_real(rec, "force_zero_mV", rec->stats.zero_mV);
	bad |= incise_recorder_set_real(rec, "depth_mm_px", rec->calibration.depth_mm_px);
	if (rec->streams[INCISE_LEDGER_CAMERA].exists) {
		bad |= incise_recorder_set_text(rec, "camera_name", camera->name);
		bad |= incise_recorder_set_real(rec, "camera_hz", camera->rate_hz);
		bad |= incise_recorder_set_integer(rec, "camera_width", camera->width);
		bad |= incise_recorder_set_integer(rec, "camera_height", camera->height);
		bad |= incise_recorder_set_integer(rec, "camera_exposure_ns",
						   camera->exposure_ns);
	}
	for (int i = 0; i < 3; i++) {
		char key[32];

		snprintf(key, sizeof(key), "tip_%s_mm", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->calibration.tip_mm[i]);
		snprintf(key, sizeof(key), "surface_point_%s_mm", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->depth.point_mm[i]);
		snprintf(key, sizeof(key), "surface_normal_%s", axes[i]);
		bad |= incise_recorder_set_real(rec, key, rec->depth.normal[i]);
	}
	return bad | incise_recorder_note(rec, "start", "recording started");
}

/* --- opening and closing ------------------------------------------------------------- */

int incise_recorder_open_database(struct incise_recorder *rec,
				  const char *calibration_path, struct incise_error *err)
{
	bool real = incise_clock_is_real(incise_rig_clock(rec->rig));
	char *file = NULL;
	int rc;

	if (asprintf(&file, "%s/%s", rec->part, INCISE_SCHEMA_DB) < 0)
		return incise_schema_no_memory(rec->path, err);
	rc = sqlite3_open_v2(
		file, &rec->db,
		SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, NULL);
	free(file);
	/* A reader can hold up the writer until it has locked the file. */
	if (rc == SQLITE_OK)
		rc = sqlite3_busy_timeout(rec->db, BUSY_MS);
	/*
	 * The lock is held to the end, so that the index of the log is in memory of its own: as
	 * a mapped file, others could end this program by cutting it off. Readers take copies.
	 * The log is written by commits only, which check the files.
	 */
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(
			rec->db,
			"PRAGMA locking_mode=EXCLUSIVE; PRAGMA journal_mode=WAL; "
			"PRAGMA cache_spill=OFF",
			NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(rec->db,
				  real ? "PRAGMA synchronous=FULL"
				       : "PRAGMA synchronous=NORMAL",
				  NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(rec->db, "BEGIN", NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = incise_schema_create(rec->db);
	for (int i = 0; i < STATEMENTS && rc == SQLITE_OK; i++)
		rc = sqlite3_prepare_v3(rec->db, sql[i], -1, SQLITE_PREPARE_PERSISTENT,
					&rec->stmt[i], NULL);
	if (rc == SQLITE_OK)
		rc = write_meta(rec, calibration_path);
	if (rc == SQLITE_OK)
		rc = incise_block_writer_start(&rec->blocks, rec->db);
	return incise_recorder_check(rec, rc, err);
}

void incise_recorder_close_database(struct incise_recorder *rec)
{
	incise_block_writer_free(&rec->blocks);
	for (int i = 0; i < STATEMENTS; i++) {
		sqlite3_finalize(rec->stmt[i]);
		rec->stmt[i] = NULL;
	}
	sqlite3_close(rec->db);
	rec->db = NULL;
}
