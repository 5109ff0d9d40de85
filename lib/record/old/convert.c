// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A copied recording of format 1 to 4 becomes one of today's format, in its place; see incise/recording.h.
 *
 *     meta, events, streams, knots ──────────────────────────► the same, and how it was converted
 *     a row a sample ──► batches, cut as the old ledger was ──► blocks and commits
 *     seal/ ──────────────────────────────────────────────────► seal-before/: of the old format
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "../verify/verify.h"
#include "../write/block_writer.h"
#include "old.h"

#define ROWS 1000 /* of a block, where there is no ledger */

/* One stream, and where its old ledger is. */
struct stream {
	struct incise_source source;
	struct incise_ledger ledger;
	sqlite3_stmt *entries;
	int64_t taken; /* of them */
	int64_t lost;  /* of its end */
	bool last;     /* no entry is left but the end */
	bool has_end;
	bool done;
};

struct conversion {
	struct incise_recording *old;
	const char *folder;
	struct incise_recovered *made;
	struct incise_block_writer writer;
	struct stream streams[INCISE_LEDGER_FORMS];
	struct incise_frames_reader *frames; /* NULL: rows have a digest, or no file */
	struct incise_camera_frame frame;    /* at hand, where has_frame */
	struct incise_frames_stored stored;
	bool has_frame;
	uint64_t last_frame; /* number of the last row */
	int64_t t_ns;	     /* of the next commit */
	bool wrote;	     /* blocks, for it */
};

static int fail_convert(struct conversion *c, struct incise_error *err)
{
	const int code = incise_schema_errno(c->writer.db);

	/* A file that was just made is not damaged. */
	if (code == EINVAL)
		return incise_schema_fail(c->writer.db, c->old->path, err);
	return incise_error_set(err, code,
				"%s: cannot be written: %s; free disk space, or give a "
				"name elsewhere",
				c->folder,
				c->writer.db ? sqlite3_errmsg(c->writer.db)
					     : strerror(ENOMEM));
}

/* --- rows ------------------------------------------------------------------------------ */

/* The frame at hand, or the next one: of a damaged one the bytes may be whole. */
static bool find_frame(struct conversion *c)
{
	int got;

	if (!c->has_frame) {
		got = incise_frames_next(c->frames, &c->frame, &c->stored, NULL);
		c->has_frame = got == 1 || got == -EBADMSG;
	}
	return c->has_frame;
}

/*
 * Before format 4 rows have no digest of their frame: that of the frame in the file with their CRC. One that is no
 * row's is passed, by its number.
 */
static void add_digests(struct conversion *c, struct incise_batch *batch)
{
	for (size_t k = 0; k < batch->n; k++) {
		const uint64_t seq = batch->column[0].i[k];
		bool is = false;

		while (!is && find_frame(c)) {
			is = c->stored.bytes == batch->column[4].i[k] &&
			     c->stored.crc == batch->column[5].i[k];
			if (!is && c->frame.seq > seq && c->frame.seq <= c->last_frame)
				break;
			c->has_frame = false;
		}
		if (is)
			memcpy(batch->column[10].h[k], c->stored.sha256,
			       INCISE_FRAMES_DIGEST);
	}
}

static int put_block(struct conversion *c, int stream, struct incise_ledger_block *block,
		     struct incise_error *err)
{
	struct stream *s = &c->streams[stream];

	if (incise_block_writer_put(&c->writer, stream, &s->source.batch, block) !=
	    SQLITE_OK)
		return fail_convert(c, err);
	if (c->old->form < 4 && block->last_ns > c->t_ns)
		c->t_ns = block->last_ns;
	c->wrote = true;
	return 1;
}

/* Rows of the stream's next block by the old ledger; 0: none is left but the end; -errno. */
static int64_t next_count(struct conversion *c, struct stream *s,
			  struct incise_error *err)
{
	struct incise_ledger_block block = {0};
	int rc = s->entries ? sqlite3_step(s->entries) : SQLITE_DONE;

	if (!s->entries)
		return ROWS;
	if (rc != SQLITE_ROW && rc != SQLITE_DONE)
		return incise_schema_fail(c->old->db, c->old->path, err);
	if (rc == SQLITE_ROW)
		incise_ledger_block_read(&block, s->entries);
	s->taken += rc == SQLITE_ROW;
	s->has_end |= rc == SQLITE_ROW && block.count <= 0;
	s->lost = block.lost;
	return block.count < 0			     ? 0
	       : block.count > INCISE_BATCH_ROWS_MAX ? INCISE_BATCH_ROWS_MAX
						     : block.count;
}

/* Without a ledger, what the recorder counted, and no gap in the numbers shows. */
static void find_end(struct conversion *c, int stream)
{
	const struct incise_recording_info *meta = &c->old->meta;
	struct stream *s = &c->streams[stream];
	const uint64_t lost =
		stream == INCISE_LEDGER_FORCE ? meta->force_lost : meta->tracker_lost;

	s->has_end = meta->complete && (s->ledger.started || lost);
	s->lost = lost > s->ledger.lost ? (int64_t)(lost - s->ledger.lost) : 0;
}

/* Write the stream's next block. 1; 0: nothing is left; -errno. */
static int advance_convert(struct conversion *c, int stream, struct incise_error *err)
{
	struct stream *s = &c->streams[stream];
	struct incise_batch *batch = &s->source.batch;
	struct incise_ledger_block block;
	int64_t count = 0;
	int rc;

	if (s->done)
		return 0;
	if (!s->last)
		count = next_count(c, s, err);
	if (count < 0)
		return (int)count;
	s->last = !count;
	s->source.rows_max = count ? (size_t)count : ROWS;
	rc = incise_source_next(&s->source, err);
	if (rc < 0)
		return rc;
	if (rc) {
		if (batch->column[0].i[0] < 0)
			return incise_error_set(err, EINVAL,
						"%s: damaged: table %s has a row with a "
						"negative number",
						c->old->path, batch->form->table);
		if (c->frames && stream == INCISE_LEDGER_CAMERA)
			add_digests(c, batch);
		for (size_t k = 0; k < batch->n; k++)
			incise_ledger_count(&s->ledger, batch->column[0].i[k],
					    batch->column[1].i[k]);
		incise_ledger_end(&s->ledger, &block);
		return put_block(c, stream, &block, err);
	}
	if (!s->last && s->entries)
		return 1; /* its rows are not there */
	s->done = true;
	if (!s->entries && stream <= INCISE_LEDGER_TRACKER)
		find_end(c, stream);
	if (!s->has_end)
		return 0;
	incise_ledger_close(&s->ledger, (uint64_t)s->lost, &block);
	return put_block(c, stream, &block, err);
}

static int open_stream(struct conversion *c, int stream, struct incise_error *err)
{
	struct stream *s = &c->streams[stream];
	int rc = incise_source_open(&s->source, c->old, stream, err);

	incise_ledger_init(&s->ledger);
	if (rc || c->old->form < 2)
		return rc;
	if (incise_ledger_select(c->old->db, s->source.batch.form->stream, INT64_MIN,
				 false, &s->entries) != SQLITE_OK)
		rc = incise_schema_fail(c->old->db, c->old->path, err);
	return rc;
}

/* --- commits --------------------------------------------------------------------------- */

static int end_commit(struct conversion *c, struct incise_error *err)
{
	c->wrote = false;
	return incise_block_writer_commit(&c->writer, c->t_ns) == SQLITE_OK
		       ? 0
		       : fail_convert(c, err);
}

/* Commits as table seal has them, but for the one that seals the tables. */
static int write_sealed(struct conversion *c, struct incise_error *err)
{
	const bool complete = c->old->meta.complete;
	sqlite3_stmt *stmt = NULL;
	int rc = 0, step = SQLITE_DONE;

	if (sqlite3_prepare_v2(c->old->db,
			       "SELECT t_ns, number = max(number) OVER (), force, "
			       "tracker, camera, wall FROM seal ORDER BY number",
			       -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(c->old->db, c->old->path, err);
	while (rc >= 0 && (step = sqlite3_step(stmt)) == SQLITE_ROW) {
		c->t_ns = sqlite3_column_int64(stmt, 0);
		if (complete && sqlite3_column_int(stmt, 1))
			continue;
		/* Rows and the end are two at most. */
		for (int i = 0; i < INCISE_LEDGER_FORMS && rc >= 0; i++)
			for (int k = 0;
			     k < 2 && rc >= 0 &&
			     c->streams[i].taken < sqlite3_column_int64(stmt, 2 + i);
			     k++)
				rc = advance_convert(c, i, err);
		if (rc >= 0)
			rc = end_commit(c, err);
	}
	if (rc >= 0 && step != SQLITE_DONE)
		rc = incise_schema_fail(c->old->db, c->old->path, err);
	sqlite3_finalize(stmt);
	return rc < 0 ? rc : 0;
}

/* And what is left: of formats without a seal block k of each stream in commit k. */
static int write_rest(struct conversion *c, struct incise_error *err)
{
	bool more = true;
	int rc = 0;

	while (more && rc >= 0) {
		more = false;
		for (int i = 0; i < INCISE_LEDGER_FORMS && rc >= 0; i++) {
			rc = advance_convert(c, i, err);
			more |= rc > 0;
		}
		if (rc >= 0 && (c->wrote || (!more && !c->writer.seal.next)))
			rc = end_commit(c, err);
	}
	return rc < 0 ? rc : 0;
}

/* --- tables ---------------------------------------------------------------------------- */

static int run_bound(struct conversion *c, const char *sql, const char *text)
{
	sqlite3_stmt *stmt = NULL;
	int rc = sqlite3_prepare_v2(c->writer.db, sql, -1, &stmt, NULL);

	if (rc == SQLITE_OK && text)
		rc = sqlite3_bind_text(stmt, 1, text, -1, SQLITE_STATIC);
	if (rc == SQLITE_OK)
		rc = incise_schema_run(stmt);
	sqlite3_finalize(stmt);
	return rc;
}

/* The key converted_from: the identity of the old recording. */
static int write_origin(struct conversion *c)
{
	const int form = c->old->form;
	char text[sizeof(c->made->altered) + 40] = "", sql[600];

	if (*c->made->altered)
		snprintf(text, sizeof(text), "; not as it was recorded: %s",
			 c->made->altered);
	snprintf(
		sql, sizeof(sql),
		"INSERT OR REPLACE INTO meta VALUES('converted_from', 'format %d' || "
		"coalesce(%s, '') || ?)",
		form,
		form < 2 ? "''"
		: incise_old_is_sealed(c->old)
			? "(SELECT ', head ' || lower(hex(head)) FROM old.seal ORDER BY "
			  "number DESC LIMIT 1)"
			: "(SELECT ', ledger ' || group_concat(stream || ' ' || "
			  "printf('%08x', crc), ', ') FROM (SELECT stream, crc, "
			  "max(block) FROM old.ledger GROUP BY stream ORDER BY stream))");
	return run_bound(c, sql, text);
}

/* The recorder's summary, of the samples. */
static int write_summary(struct conversion *c, struct incise_error *err)
{
	struct incise_recording_info info;
	int rc = c->old->meta.complete ? incise_recording_measure(c->old, &info, err) : 0;
	char sql[300];

	if (!c->old->meta.complete || (rc && *c->made->altered))
		return 0; /* readers find it, or why they cannot */
	if (rc)
		return rc;
	snprintf(sql, sizeof(sql),
		 "INSERT OR REPLACE INTO meta VALUES('cuts', %d), ('depth_max_mm', "
		 "%.17e), ('force_max_N', %.17e)",
		 info.cuts, info.depth_max_mm, info.force_max_N);
	return run_bound(c, sql, NULL) == SQLITE_OK ? 0 : fail_convert(c, err);
}

/* Before format 4 a recording has no identity, which a seal needs. */
static int copy_tables(struct conversion *c)
{
	int rc = incise_schema_create(c->writer.db);

	if (rc == SQLITE_OK)
		rc = sqlite3_exec(c->writer.db,
				  "INSERT INTO meta SELECT * FROM old.meta ORDER BY "
				  "rowid; INSERT INTO events SELECT t_ns, kind, text "
				  "FROM old.events ORDER BY rowid; INSERT OR IGNORE "
				  "INTO meta VALUES('identity', "
				  "lower(hex(randomblob(16))))",
				  NULL, NULL, NULL);
	if (rc == SQLITE_OK && c->old->form >= 2)
		rc = sqlite3_exec(c->writer.db,
				  "INSERT INTO streams SELECT * FROM old.streams ORDER "
				  "BY rowid; INSERT INTO knots SELECT * FROM old.knots",
				  NULL, NULL, NULL);
	return rc == SQLITE_OK ? write_origin(c) : rc;
}

/* --- files ----------------------------------------------------------------------------- */

static int open_frames(struct conversion *c, struct incise_error *err)
{
	struct incise_error found = {0};
	int64_t last = 0, t_ns;
	char *path;

	if (c->old->form < 2 || c->old->form > 3)
		return 0;
	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, c->folder) < 0)
		return incise_schema_no_memory(c->folder, err);
	if (!access(path, F_OK)) {
		c->frames = incise_frames_reader_new(path, &found);
		if (c->frames)
			c->frames->digests = c->frames->undecoded = true;
		incise_source_end(c->old, "frames", true, &last, &t_ns, NULL, NULL);
		c->last_frame = (uint64_t)last;
	}
	free(path);
	/* A file that is none has no frames, as incise verify says. */
	return !found.code || found.code == EINVAL
		       ? 0
		       : incise_error_set(err, found.code, "%s", found.text);
}

/* Signatures and time-stamps are of the old format. */
static int keep_seal(struct conversion *c, struct incise_error *err)
{
	char *from = NULL, *to = NULL;
	struct dirent *entry;
	DIR *folder;
	int rc = 0;

	if (asprintf(&from, "%s/seal", c->folder) < 0)
		from = NULL;
	if (from && asprintf(&to, "%s-before", from) < 0)
		to = NULL;
	if (!to)
		rc = incise_schema_no_memory(c->folder, err);
	else if (rename(from, to) && errno != ENOENT)
		rc = incise_error_set(err, errno,
				      "%s: its folder seal cannot become "
				      "seal-before: %s; remove what is there",
				      c->old->path, strerror(errno));
	folder = rc ? NULL : opendir(to);
	while (folder && (entry = readdir(folder))) {
		const char *end = strrchr(entry->d_name, '.');

		c->made->signatures += end && !strcmp(end, ".sig");
		c->made->timestamps += end && !strcmp(end, ".tsr");
	}
	if (folder)
		closedir(folder);
	free(from);
	free(to);
	return rc;
}

/* Beside the old database, to which nothing is written. */
static int open_database(struct conversion *c, const char *file, const char *old,
			 struct incise_error *err)
{
	sqlite3 *db;
	int rc = sqlite3_open_v2(
		file, &db,
		SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, NULL);

	c->writer.db = db;
	if (rc == SQLITE_OK) {
		/* No code of the old file's schema is run. */
		sqlite3_db_config(db, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
		sqlite3_db_config(db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
		rc = run_bound(c, "ATTACH ? AS old", old);
	}
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(db, "BEGIN", NULL, NULL, NULL);
	return rc == SQLITE_OK ? 0 : fail_convert(c, err);
}

static int write_all(struct conversion *c, struct incise_error *err)
{
	sqlite3 *db = c->writer.db;
	int rc = copy_tables(c) == SQLITE_OK ? 0 : fail_convert(c, err), folder;

	if (!rc)
		rc = write_summary(c, err);
	if (!rc && incise_seal_init(&c->writer.seal))
		rc = incise_error_set(err, ENOMEM,
				      "%s: libcrypto gives no SHA-256; check its "
				      "openssl.cnf",
				      c->folder);
	if (!rc && incise_block_writer_start(&c->writer, db) != SQLITE_OK)
		rc = fail_convert(c, err);
	if (!rc)
		rc = open_frames(c, err);
	for (int i = 0; i < INCISE_LEDGER_FORMS && !rc; i++)
		rc = open_stream(c, i, err);
	if (!rc && incise_old_is_sealed(c->old))
		rc = write_sealed(c, err);
	if (!rc)
		rc = write_rest(c, err);
	if (!rc && c->old->meta.complete) {
		folder = open(c->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
		if (folder < 0 || incise_block_writer_seal(&c->writer, folder, true,
							   c->t_ns) != SQLITE_OK)
			rc = fail_convert(c, err);
		if (folder >= 0)
			close(folder);
	}
	if (!rc && sqlite3_exec(db, "COMMIT", NULL, NULL, NULL) != SQLITE_OK)
		rc = fail_convert(c, err);
	return rc;
}

static int write_database(struct conversion *c, struct incise_error *err)
{
	char *old = NULL, *new = NULL;
	sqlite3 *db;
	int rc;

	if (asprintf(&old, "%s/" INCISE_SCHEMA_DB, c->folder) < 0)
		old = NULL;
	if (old && asprintf(&new, "%s.new", old) < 0)
		new = NULL;
	rc = new ? open_database(c, new, old, err)
		 : incise_schema_no_memory(c->folder, err);
	if (!rc)
		rc = write_all(c, err);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		sqlite3_finalize(c->streams[i].entries);
		incise_source_close(&c->streams[i].source);
	}
	incise_frames_reader_close(c->frames);
	db = c->writer.db;
	incise_block_writer_free(&c->writer);
	sqlite3_close(db);
	if (!rc && rename(new, old))
		rc = incise_error_set(err, errno, "%s: %s", old, strerror(errno));
	free(old);
	free(new);
	return rc;
}

/* --- checks ---------------------------------------------------------------------------- */

/* Keep the first finding of what is not as it was recorded. */
static void keep_first(void *user, const struct incise_verify_finding *finding)
{
	struct incise_recovered *made = user;

	if (finding->kind != INCISE_VERIFY_LOST &&
	    finding->kind != INCISE_VERIFY_INTERRUPTED &&
	    finding->kind != INCISE_VERIFY_ENDED &&
	    finding->kind != INCISE_VERIFY_TIMES && !*made->altered)
		snprintf(made->altered, sizeof(made->altered), "%s", finding->text);
}

/* By its ledger, and its seal. Of format 1 there is none. */
static int check_convert(struct incise_recording *recording,
			 struct incise_recovered *made, struct incise_error *err)
{
	const struct incise_verify_watch watch = {.found = keep_first, .user = made};
	struct incise_verify_report report;

	return recording->form < 2
		       ? 0
		       : incise_verify_recording(recording, &watch, INCISE_VERIFY_ROWS,
						 NULL, &report, err);
}

static int check_new(const char *folder, struct incise_recovered *made,
		     struct incise_error *err)
{
	struct incise_recording *recording =
		incise_recording_open_as(folder, INCISE_RECORDING_ORIGINAL, err);
	int rc = recording ? check_convert(recording, made, err) : -errno;

	incise_recording_close(recording);
	return rc;
}

int incise_recording_convert(const char *folder, const char *path, bool damaged,
			     struct incise_recovered *made, struct incise_error *err)
{
	struct conversion c = {.folder = folder, .made = made};
	struct incise_recovered now = {0};
	int rc;

	c.old = incise_recording_open_as(folder, INCISE_RECORDING_OLDER, err);
	if (!c.old)
		return -errno;
	made->converted = c.old->old;
	made->form = made->converted ? c.old->form : INCISE_SCHEMA_VERSION;
	if (!made->converted) {
		incise_recording_close(c.old);
		return 0;
	}
	rc = check_convert(c.old, made, err);
	/* Messages name the recording that was given. */
	free(c.old->path);
	c.old->path = strdup(path);
	if (!c.old->path)
		rc = incise_schema_no_memory(path, err);
	if (!rc && *made->altered && !damaged)
		rc = incise_error_set(err, EBADMSG, "%s: not as it was recorded: %s",
				      path, made->altered);
	if (!rc)
		rc = write_database(&c, err);
	if (!rc)
		rc = keep_seal(&c, err);
	incise_recording_close(c.old);
	/* A good recording stays good: nothing else gets the final name. */
	if (!rc)
		rc = check_new(folder, &now, err);
	if (!rc && *now.altered && !damaged)
		rc = incise_error_set(err, EIO,
				      "%s: its counts do not agree with its rows: %s; "
				      "--damaged converts it as it is",
				      path, now.altered);
	else if (!*made->altered)
		memcpy(made->altered, now.altered, sizeof(now.altered));
	return rc;
}
