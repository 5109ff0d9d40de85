// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The database of a recording that is written: opened, committed, closed; see recorder.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include "recorder.h"
#include "../schema.h"

/* How long a reader may keep the recorder from writing. */
#define BUSY_MS 1000

static const char *const sql[STATEMENTS] = {
	[INSERT_FORCE] = "INSERT INTO force VALUES(?,?,?)",
	[INSERT_TRACKER] = "INSERT INTO tracker VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?)",
	[INSERT_DEPTH] = "INSERT INTO depth VALUES(?,?,?,?)",
	[INSERT_FRAME] = "INSERT INTO frames VALUES(?,?,?,?,?,?,?,?,?,?)",
	[INSERT_EVENT] = "INSERT INTO events VALUES(?,?,?)",
	[INSERT_LEDGER] = "INSERT INTO ledger VALUES(?,?,?,?,?,?,?,?,?)",
	[SET_META] = "INSERT OR REPLACE INTO meta VALUES(?,?)",
	[SET_STREAM] = "INSERT OR REPLACE INTO streams "
		       "VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)",
	[DROP_KNOTS] = "DELETE FROM knots WHERE stream = ?",
	[INSERT_KNOT] = "INSERT INTO knots VALUES(?,?,?,?,?,?)",
};

int incise_recorder_fail(struct incise_recorder *rec, struct incise_error *err)
{
	int code = incise_schema_errno(rec->db);
	const char *text = sqlite3_errmsg(rec->db);

	if (code == ENOSPC)
		return incise_error_set(
			err, code,
			"%s: disk full (or a quota or limit on files); make room "
			"and record again; what was committed is in %s: `incise "
			"info` reads it",
			rec->path, rec->part);
	return incise_error_set(err, code == EINVAL ? EIO : code,
				"%s: cannot be written: %s; what was committed is in %s: "
				"`incise info` reads it",
				rec->path, text, rec->part);
}

/* Counts go with the rows they count, so that an interrupted recording knows its losses. */
static int write_counts(struct incise_recorder *rec)
{
	struct incise_recorder_stats stats;
	bool camera = rec->streams[INCISE_LEDGER_CAMERA].there;
	int bad = SQLITE_OK;

	incise_recorder_stats(rec, &stats);
	const struct {
		const char *key;
		uint64_t value;
	} counts[] = {
		{"force_rows", stats.force},
		{"tracker_rows", stats.tracker},
		{"depth_rows", rec->stats.depth}, /* without those that are to come */
		{"force_lost", stats.force_lost},
		{"tracker_lost", stats.tracker_lost},
		{"force_clipped", stats.force_clipped},
		{"frames_rows", stats.frames},
		{"frames_lost", stats.frames_lost},
		{"frames_unlooked", stats.frames_unlooked},
	};

	for (size_t i = 0; i < sizeof(counts) / sizeof(*counts) - (camera ? 0 : 3); i++)
		bad |= incise_recorder_set_integer(rec, counts[i].key, counts[i].value);
	return bad;
}

/* The knots of a line are many, and move little in a second: not with each commit. */
#define KNOTS_EVERY 10

int incise_recorder_commit(struct incise_recorder *rec, int64_t now_ns, bool last,
			   struct incise_error *err)
{
	bool knots = last || rec->commits++ % KNOTS_EVERY == 0;

	if (write_counts(rec) != SQLITE_OK ||
	    incise_recorder_write_streams(rec, knots) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	if (incise_recorder_ledger(rec) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	if (sqlite3_exec(rec->db, "COMMIT; BEGIN", NULL, NULL, NULL) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	rec->commit_ns = now_ns;
	return 0;
}

int incise_recorder_open_database(struct incise_recorder *rec,
				  const char *calibration_path, struct incise_error *err)
{
	bool real = incise_clock_is_real(incise_rig_clock(rec->rig));
	char *file = NULL;
	int rc;

	if (asprintf(&file, "%s/%s", rec->part, INCISE_SCHEMA_DB) < 0)
		return incise_error_set(err, ENOMEM, "%s: out of memory", rec->path);
	rc = sqlite3_open_v2(
		file, &rec->db,
		SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, NULL);
	free(file);
	/*
	 * Someone may read the recording as it grows, and SQLite keeps the writer out for
	 * a moment: until the file has its log, and when a log is folded in. What comes
	 * meanwhile waits in the sources' rings.
	 */
	if (rc == SQLITE_OK)
		rc = sqlite3_busy_timeout(rec->db, BUSY_MS);
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(
			rec->db,
			real ? "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL"
			     : "PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL",
			NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(rec->db, "BEGIN", NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = incise_schema_create(rec->db);
	for (int i = 0; i < STATEMENTS && rc == SQLITE_OK; i++)
		rc = sqlite3_prepare_v3(rec->db, sql[i], -1, SQLITE_PREPARE_PERSISTENT,
					&rec->stmt[i], NULL);
	if (rc == SQLITE_OK)
		rc = incise_recorder_write_meta(rec, calibration_path);
	if (rc != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	return incise_recorder_commit(rec, incise_clock_now(incise_rig_clock(rec->rig)),
				      false, err);
}

void incise_recorder_close_database(struct incise_recorder *rec)
{
	for (int i = 0; i < STATEMENTS; i++) {
		sqlite3_finalize(rec->stmt[i]);
		rec->stmt[i] = NULL;
	}
	sqlite3_close(rec->db);
	rec->db = NULL;
}
