// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Proof that a recording is complete; see incise/verify.h and verify.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "../old/old.h"
#include "../read/session.h"
#include "seal_walk.h"
#include "verify.h"

/* --- pages, counts and names ---------------------------------------------------------- */

static int report_pages(void *user)
{
	return incise_verify_progress(user, true);
}

/* SQLite's own check of every page. Returns 0 or -ECANCELED. */
static int check_pages(struct incise_verification *verify)
{
	sqlite3 *db = verify->recording->db;
	sqlite3_stmt *stmt = NULL;
	int rc;

	/* in steps of SQLite's machine; some ms */
	sqlite3_progress_handler(db, 100000, report_pages, verify);
	rc = sqlite3_prepare_v2(db, "PRAGMA integrity_check(20)", -1, &stmt, NULL);
	while (rc == SQLITE_OK && (rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		const char *text = (const char *)sqlite3_column_text(stmt, 0);

		if (!text || strcmp(text, "ok"))
			incise_verify_found(verify,
					    incise_verify_finding(INCISE_VERIFY_DAMAGED),
					    "%s is damaged: %s", INCISE_SCHEMA_DB,
					    text ? text : "out of memory");
		rc = SQLITE_OK;
	}
	sqlite3_progress_handler(db, 0, NULL, NULL);
	if (rc != SQLITE_DONE && rc != SQLITE_INTERRUPT)
		incise_verify_found(verify, incise_verify_finding(INCISE_VERIFY_DAMAGED),
				    "%s is damaged: %s", INCISE_SCHEMA_DB,
				    sqlite3_errmsg(db));
	sqlite3_finalize(stmt);
	return rc == SQLITE_INTERRUPT ? -ECANCELED : 0;
}

/* SQLite leaves alone what lies behind the pages that its header counts. */
static void check_length(struct incise_verification *verify)
{
	int64_t bytes = incise_schema_ask(verify->recording->db, 0, "PRAGMA page_size") *
			incise_schema_ask(verify->recording->db, 0, "PRAGMA page_count");
	struct stat st;

	/* With a log, pages may be in it alone; a copy of a locked one has no name. */
	if (verify->report->interrupted ||
	    stat(sqlite3_db_filename(verify->recording->db, "main"), &st))
		return;
	if (st.st_size > bytes)
		incise_verify_found(verify, incise_verify_finding(INCISE_VERIFY_DAMAGED),
				    "%s has %lld bytes of %lld", INCISE_SCHEMA_DB,
				    (long long)st.st_size, (long long)bytes);
}

/* An entry with an unknown name would pass as verified. */
#define RIG_NAMES \
	"SELECT 'force' AS name UNION ALL SELECT 'tracker' UNION ALL SELECT 'camera'"
#define STREAMS "'force', 'tracker', 'camera', 'wall'"
#define SEALS                                                                             \
	", 'table:depth', 'table:events', 'table:knots', 'table:meta', 'table:streams', " \
	"'file:camera.mkv'"
static void check_names(struct incise_verification *verify)
{
	const char *seals = verify->report->interrupted ? "" : SEALS;
	const char *unknown =
		verify->level == INCISE_VERIFY_TABLES
			? "SELECT count(*) FROM ledger WHERE stream NOT IN (''%s)"
			: "SELECT (SELECT count(*) FROM blocks WHERE stream NOT IN "
			  "(" STREAMS ")) + (SELECT count(*) FROM ledger WHERE stream "
			  "NOT IN (''%s))";

	if (incise_schema_ask(verify->recording->db, -1, unknown, seals))
		incise_verify_found(verify, incise_verify_finding(INCISE_VERIFY_LEDGER),
				    "the ledger has entries of unknown streams");
}

/* A field of a stream's first or last entry with rows: entries follow one another, and all would be long to read. */
#define END(field, order)                                                  \
	"(SELECT " field " FROM blocks WHERE stream = name AND count > 0 " \
	"ORDER BY block " order " LIMIT 1)"

/* The number of samples that a dead device would still have sent is not known. */
static void report_ends(struct incise_verification *verify)
{
	struct incise_recording *recording = verify->recording;

	for (int i = 0; i < recording->n_table; i++) {
		const struct incise_stream *stream = &recording->table[i];
		struct incise_verify_finding found =
			incise_verify_finding(INCISE_VERIFY_ENDED);

		if (!*stream->ended)
			continue;
		found.stream = stream->name;
		found.last_ns = incise_schema_ask(
			recording->db, -1,
			"SELECT " END("last_ns", "DESC") " FROM (SELECT %Q AS name)",
			stream->name);
		if (found.last_ns < 0)
			incise_verify_found(verify, found, "%s: gave nothing: %s",
					    stream->name, stream->ended);
		else
			incise_verify_found(
				verify, found,
				"%s: ended at %.4f s, before the recording did: %s",
				stream->name, incise_verify_s(verify, found.last_ns),
				stream->ended);
	}
}

/* A damaged recording that was converted as it was does not become good by that. */
static void report_conversion(struct incise_verification *verify)
{
	sqlite3_stmt *stmt = NULL;

	if (sqlite3_prepare_v2(verify->recording->db,
			       "SELECT substr(value, at + 10) FROM (SELECT value, "
			       "instr(value, 'recorded: ') AS at FROM meta WHERE key = "
			       "'converted_from') WHERE at",
			       -1, &stmt, NULL) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW)
		incise_verify_found(verify, incise_verify_finding(INCISE_VERIFY_ALTERED),
				    "it was converted with a finding: %s",
				    (const char *)sqlite3_column_text(stmt, 0));
	sqlite3_finalize(stmt);
}

static void report_interruption(struct incise_verification *verify)
{
	struct incise_verify_finding found =
		incise_verify_finding(INCISE_VERIFY_INTERRUPTED);

	if (!verify->report->interrupted)
		return;
	found.last_ns = incise_schema_ask(
		verify->recording->db, -1,
		"SELECT max(" END("last_ns", "DESC") ") FROM (" RIG_NAMES ")");
	if (found.last_ns < 0)
		incise_verify_found(verify, found,
				    "interrupted, or being written: no row yet");
	else
		incise_verify_found(
			verify, found,
			"interrupted, or being written: it ends with its last commit, "
			"at %.4f s; tables events, knots, meta and streams have "
			"no seal before the end and are not verified",
			incise_verify_s(verify, found.last_ns));
}

/* --- seals ---------------------------------------------------------------------------- */

/* Number of entries of @stream in the ledger, the first in @entry; -1: it cannot be read. */
static int read_entry(struct incise_verification *verify, const char *stream,
		      struct incise_ledger_block *entry)
{
	sqlite3_stmt *stmt = NULL;
	int n = 0, rc;

	*entry = (struct incise_ledger_block){0};
	if (incise_ledger_select(verify->recording->db, stream, INT64_MIN, false,
				 &stmt) != SQLITE_OK)
		return -1;
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW && n++ == 0)
		if (!incise_ledger_block_read(entry, stmt))
			n = 2; /* as bad as a second one */
	sqlite3_finalize(stmt);
	return rc == SQLITE_ROW || rc == SQLITE_DONE ? n : -1;
}

/* @stream is the name in the ledger, @what that in the finding. */
static void compare_verify(struct incise_verification *verify, const char *stream,
			   const char *what, const char *units,
			   const struct incise_ledger_block *made)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_ALTERED);
	struct incise_ledger_block entry;
	int n = read_entry(verify, stream, &entry);

	if (n < 0) {
		incise_verify_unreadable(verify, "", "ledger");
		return;
	}
	if (!n) {
		found.kind = INCISE_VERIFY_LEDGER;
		incise_verify_found(verify, found, "%s has no seal in the ledger", what);
		return;
	}
	found.count = entry.count;
	if (n == 1 && incise_ledger_same(made, &entry))
		return;
	if (n == 1 && made->count != entry.count)
		incise_verify_found(verify, found, "%s has %lld %s of %lld", what,
				    (long long)made->count, units,
				    (long long)entry.count);
	else
		incise_verify_found(verify, found,
				    "%s is altered: its %s or its seal differ from "
				    "those written",
				    what, units);
}

static void check_file(struct incise_verification *verify)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_DAMAGED);
	struct incise_ledger_block made, entry;
	struct stat st;
	char *path;
	int fd, rc, n;

	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, verify->recording->path) < 0)
		return;
	fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	free(path);
	if (fd < 0) {
		/* With frames, verify_camera.c reports that it is missing. */
		if (read_entry(verify, INCISE_LEDGER_FILE, &entry) && !verify->frames)
			incise_verify_found(verify, found,
					    "camera: " INCISE_FRAMES_FILE " is missing");
		return;
	}
	n = read_entry(verify, INCISE_LEDGER_FILE, &entry);
	rc = fstat(fd, &st) ? -errno : 0;
	if (!rc)
		rc = incise_ledger_seal_file(fd, n == 1 ? entry.last_seq : 0, &made);
	close(fd);
	if (rc) {
		incise_verify_found(verify, found,
				    INCISE_FRAMES_FILE " cannot be read: %s",
				    strerror(-rc));
		return;
	}
	compare_verify(verify, INCISE_LEDGER_FILE, "the head of " INCISE_FRAMES_FILE,
		       "bytes", &made);
	/* 0: made before the length was noted, or on a disk that hung. */
	if (n == 1 && entry.last_seq && entry.last_seq != st.st_size)
		incise_verify_found(verify, found,
				    INCISE_FRAMES_FILE " has %lld bytes of %lld",
				    (long long)st.st_size, (long long)entry.last_seq);
}

/* Compare all seals of a closed recording. Returns 0 or -ECANCELED. */
static int check_seals(struct incise_verification *verify)
{
	int rc = 0;

	/* Today's format has no table depth, the first of them. */
	for (int i = !verify->recording->old; incise_ledger_sealed[i] && !rc; i++) {
		const char *table = incise_ledger_sealed[i];
		struct incise_ledger_block made;
		char stream[40], what[40];

		snprintf(stream, sizeof(stream), INCISE_LEDGER_TABLE "%s", table);
		snprintf(what, sizeof(what), "table %s", table);
		if (incise_ledger_seal(verify->recording->db, table, &made) != SQLITE_OK)
			incise_verify_unreadable(verify, "", table);
		else
			compare_verify(verify, stream, what, "rows", &made);
		rc = incise_verify_progress(verify, false);
	}
	if (!rc && verify->camera && verify->level == INCISE_VERIFY_ALL)
		check_file(verify);
	return rc;
}

/* --- the recording ---------------------------------------------------------------------- */

/* Whether there is any trace of a stream, which may have no row: others may have been removed. */
static bool recorded(struct incise_verification *verify, int stream, const char *key)
{
	const struct incise_ledger_form *form = &incise_ledger_forms[stream];

	return incise_schema_ask(
		       verify->recording->db, 1,
		       "SELECT EXISTS(SELECT 1 FROM blocks WHERE stream = '%s') OR "
		       "EXISTS(SELECT 1 FROM streams WHERE name = '%s') OR EXISTS(SELECT 1 "
		       "FROM meta WHERE key = '%s' AND value > 0)",
		       form->stream, form->stream, key) ||
	       (verify->recording->old &&
		incise_schema_ask(verify->recording->db, 1,
				  "SELECT EXISTS(SELECT 1 FROM %s)", form->table));
}

/* A number of table meta. */
static int64_t count_of(struct incise_verification *verify, const char *key)
{
	return incise_schema_ask(verify->recording->db, 0,
				 "SELECT value FROM meta WHERE key = '%s'", key);
}

/* Wall time is no stream of the report: its findings are all there is to tell. */
static int check_wall(struct incise_verification *verify)
{
	struct incise_verify_stream rows = {0};

	if (!recorded(verify, INCISE_LEDGER_WALL, "wall_rows"))
		return 0;
	return incise_verify_stream(verify, INCISE_LEDGER_WALL,
				    count_of(verify, "wall_rows"), 0, &rows);
}

/* Streams one after the other. Returns 0 or -ECANCELED. */
static int check_streams(struct incise_verification *verify)
{
	const struct incise_recording_info *meta = &verify->recording->meta;
	struct incise_verify_report *report = verify->report;
	const struct {
		uint64_t rows, lost;
	} counted[INCISE_LEDGER_STREAMS] = {
		[INCISE_LEDGER_FORCE] = {meta->force, meta->force_lost},
		[INCISE_LEDGER_TRACKER] = {meta->tracker, meta->tracker_lost},
		[INCISE_LEDGER_CAMERA] = {count_of(verify, "frames_rows"),
					  count_of(verify, "frames_lost")}};
	int rc = 0;

	verify->camera = recorded(verify, INCISE_LEDGER_CAMERA, "frames_rows");
	verify->rows = meta->force + meta->tracker;
	if (verify->camera) {
		verify->frames =
			incise_schema_ask(verify->recording->db, 0,
					  "SELECT sum(count) FROM blocks WHERE stream = "
					  "'camera'");
		verify->rows += verify->frames * INCISE_VERIFY_FRAME_ROWS;
	}
	for (int i = 0; i < INCISE_LEDGER_STREAMS && !rc; i++) {
		if (i == INCISE_LEDGER_CAMERA
			    ? !verify->camera
			    : !counted[i].rows && !recorded(verify, i, ""))
			continue;
		rc = incise_verify_stream(verify, i, counted[i].rows, counted[i].lost,
					  &report->streams[report->n_streams++]);
	}
	if (!rc)
		rc = check_wall(verify);
	verify->rows_altered = verify->altered;
	if (!rc && verify->camera && verify->level == INCISE_VERIFY_ALL)
		rc = incise_verify_camera(verify);
	return rc;
}

int incise_verify_recording(struct incise_recording *recording,
			    const struct incise_verify_watch *watch,
			    enum incise_verify_level level,
			    const struct incise_seal_statement *statement,
			    struct incise_verify_report *report, struct incise_error *err)
{
	struct incise_verification verify = {.recording = recording,
					     .watch = watch,
					     .report = report,
					     .level = level,
					     .statement = statement};
	const bool old = recording->old, sealed = !old || incise_old_is_sealed(recording);
	bool altered;
	int rc = 0;

	*report = (struct incise_verify_report){.interrupted = !recording->meta.complete};
	verify.hashed = !old && !incise_seal_init(&verify.rows_seal);
	/* Where no sample is read the recorder's summary has to be enough. */
	if ((old || report->interrupted) && level == INCISE_VERIFY_TABLES)
		level = verify.level = INCISE_VERIFY_ROWS;
	if (level != INCISE_VERIFY_TABLES) {
		verify.origin_ns = incise_schema_ask(
			recording->db, 0,
			"SELECT min(" END("first_ns", "ASC") ") FROM "
							     "(" RIG_NAMES ")");
		rc = check_streams(&verify);
	}
	if (!rc) {
		if (old && report->interrupted)
			incise_old_verify_depth(&verify);
		check_names(&verify);
		altered = verify.altered;
		verify.altered = false;
		if (!report->interrupted)
			rc = check_seals(&verify);
		verify.tables_altered = verify.altered;
		verify.altered |= altered;
	}
	if (!rc && sealed && level != INCISE_VERIFY_TABLES)
		rc = incise_verify_seal(&verify);
	if (!rc && level == INCISE_VERIFY_ALL) {
		rc = check_pages(&verify);
		check_length(&verify);
	}
	incise_seal_free(&verify.rows_seal);
	if (rc)
		return incise_error_set(err, ECANCELED, "%s: stopped; not verified",
					recording->path);
	/* Nothing follows from altered rows. */
	if (!verify.altered && level != INCISE_VERIFY_TABLES)
		incise_verify_times(&verify);
	report_ends(&verify);
	report_conversion(&verify);
	report_interruption(&verify);
	report->complete = !report->findings;
	report->intact = !verify.altered;
	return 0;
}

/* --- joined recordings --------------------------------------------------------------- */

/* A member of a session under verification; findings get its name. */
struct member_watch {
	const struct incise_verify_watch *watch;
	const char *name;
	int at, n;
};

static void member_found(void *user, const struct incise_verify_finding *finding)
{
	const struct member_watch *member = user;
	struct incise_verify_finding named = *finding;
	char text[480];

	if (!member->watch || !member->watch->found)
		return;
	snprintf(text, sizeof(text), "%s: %s", member->name, finding->text);
	named.text = text;
	member->watch->found(member->watch->user, &named);
}

static int member_progress(void *user, double share)
{
	const struct member_watch *member = user;

	if (!member->watch || !member->watch->progress)
		return 0;
	return member->watch->progress(member->watch->user,
				       share < 0 ? share
						 : (member->at + share) / member->n);
}

/* Add the report of a member to that of all. */
static void add_report(struct incise_verify_report *to,
		       const struct incise_verify_report *member)
{
	to->interrupted |= member->interrupted;
	to->unverified |= member->unverified;
	to->findings += member->findings;
	to->sealed &= member->sealed;
	to->commits += member->commits;
	to->complete &= member->complete;
	to->intact &= member->intact;
	to->frames.checked |= member->frames.checked;
	to->frames.present += member->frames.present;
	to->frames.missing += member->frames.missing;
	to->frames.altered += member->frames.altered;
	to->frames.extra += member->frames.extra;
	to->frames.ahead += member->frames.ahead;
	for (int i = 0; i < member->n_streams; i++) {
		const struct incise_verify_stream *from = &member->streams[i];
		int k = 0;

		while (k < to->n_streams && strcmp(to->streams[k].name, from->name))
			k++;
		if (k == to->n_streams) {
			to->streams[to->n_streams++] = *from;
			continue;
		}
		to->streams[k].expected += from->expected;
		to->streams[k].present += from->present;
		to->streams[k].lost += from->lost;
		to->streams[k].lost_at_capture += from->lost_at_capture;
		to->streams[k].blocks += from->blocks;
		to->streams[k].altered += from->altered;
	}
}

/* Each member by itself; the session's own tables were checked when it was opened. */
static int verify_members(const struct incise_session *session,
			  const struct incise_verify_watch *watch,
			  enum incise_verify_level level,
			  struct incise_verify_report *report, struct incise_error *err)
{
	int rc = 0;

	*report = (struct incise_verify_report){
		.complete = true, .intact = true, .sealed = true};
	for (int i = 0; i < session->n && !rc; i++) {
		struct member_watch member = {watch, session->info[i].name, i,
					      session->n};
		const struct incise_verify_watch named = {member_found, member_progress,
							  &member};
		struct incise_recording *recording;
		struct incise_verify_report found;

		recording = incise_recording_open_as(session->members[i]->path,
						     INCISE_RECORDING_ORIGINAL, err);
		rc = recording ? incise_verify_recording(recording, &named, level, NULL,
							 &found, err)
			       : -errno;
		incise_recording_close(recording);
		if (!rc)
			add_report(report, &found);
	}
	return rc;
}

int incise_verify_level(const char *path, enum incise_verify_level level,
			const struct incise_verify_watch *watch,
			struct incise_verify_report *report, struct incise_error *err)
{
	struct incise_recording *recording =
		incise_recording_open_as(path, INCISE_RECORDING_ORIGINAL, err);
	int rc;

	*report = (struct incise_verify_report){0};
	if (!recording)
		return -errno;
	rc = recording->session
		     ? verify_members(recording->session, watch, level, report, err)
		     : incise_verify_recording(recording, watch, level, NULL, report,
					       err);
	incise_recording_close(recording);
	return rc;
}

int incise_verify(const char *path, const struct incise_verify_watch *watch,
		  struct incise_verify_report *report, struct incise_error *err)
{
	return incise_verify_level(path, INCISE_VERIFY_ALL, watch, report, err);
}

int incise_seal_compare(const char *path, const char *text, size_t length,
			const struct incise_verify_watch *watch,
			struct incise_verify_report *report, struct incise_error *err)
{
	struct incise_recording *recording =
		incise_recording_open_as(path, INCISE_RECORDING_ORIGINAL, err);
	struct incise_seal_statement statement;
	int rc;

	*report = (struct incise_verify_report){0};
	if (!recording)
		return -errno;
	rc = incise_seal_possible(recording, err);
	if (!rc)
		rc = incise_seal_read(&statement, text, length, err);
	if (!rc)
		rc = incise_verify_recording(recording, watch, INCISE_VERIFY_ALL,
					     &statement, report, err);
	incise_recording_close(recording);
	return rc;
}
