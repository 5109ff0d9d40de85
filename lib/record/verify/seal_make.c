// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The seal of a recording recomputed from its rows, and its statement; see seal_walk.h and incise/seal.h. The file
 * is untrusted.
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
#include "seal_walk.h"

#define BLOCKS_MAX 1000 /* of a stream in a commit */

static int fail_seal_make(struct incise_seal_walk *walk, struct incise_error *err)
{
	return incise_schema_fail(walk->recording->db, walk->recording->path, err);
}

static int open_walk(struct incise_seal_walk *walk, struct incise_recording *recording,
		     bool known, struct incise_error *err)
{
	sqlite3 *db = recording->db;
	int rc;

	*walk = (struct incise_seal_walk){
		.recording = recording, .known = known, .last = -1};
	rc = incise_seal_init(&walk->seal);
	walk->seal.old = recording->old;
	if (rc)
		return incise_error_set(err, -rc, "%s: libcrypto gives no SHA-256",
					recording->path);
	walk->last = incise_schema_ask(db, -1, "SELECT max(number) FROM seal");
	if (sqlite3_prepare_v2(db,
			       "SELECT number, t_ns, head, force, tracker, camera, wall "
			       "FROM seal ORDER BY number",
			       -1, &walk->commits, NULL) != SQLITE_OK ||
	    incise_seal_start(&walk->seal, db) != SQLITE_OK)
		return fail_seal_make(walk, err);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		struct incise_seal_walk_stream *stream = &walk->streams[i];

		rc = incise_ledger_select(db, incise_ledger_forms[i].stream, INT64_MIN,
					  false, &stream->blocks);
		if (rc == SQLITE_OK && recording->old)
			rc = incise_old_rows_open(&stream->rows, recording, i);
		if (rc == SQLITE_OK && recording->old)
			rc = incise_old_rows_next(&stream->rows);
		if (rc != SQLITE_OK)
			return fail_seal_make(walk, err);
	}
	return 0;
}

static void close_walk(struct incise_seal_walk *walk)
{
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		incise_old_rows_close(&walk->streams[i].rows);
		sqlite3_finalize(walk->streams[i].blocks);
	}
	sqlite3_finalize(walk->commits);
	incise_seal_free(&walk->seal);
}

/* A block of today's format: its data have the digest that it names, which a verification has seen. */
static void take_data(struct incise_seal_walk *walk, int i,
		      const struct incise_ledger_block *block)
{
	sqlite3_stmt *stmt = walk->streams[i].blocks;
	const uint8_t *named = incise_ledger_digest(stmt);
	uint8_t digest[INCISE_SEAL_BYTES];
	const void *data;
	size_t size;

	if (walk->known && named) {
		incise_seal_rows_block(&walk->seal, i, block, named);
		walk->seal.n_rows[i] += block->count;
		return;
	}
	walk->good &= incise_ledger_data(stmt, block, &data, &size);
	incise_seal_data(&walk->seal, i, block, data, size, digest);
	walk->good &= named && !memcmp(named, digest, sizeof(digest));
}

/* The next block of a stream, with its rows. */
static int take_block(struct incise_seal_walk *walk, int i, struct incise_error *err)
{
	struct incise_seal_walk_stream *stream = &walk->streams[i];
	struct incise_ledger_block block;
	uint8_t digest[INCISE_SEAL_BYTES];
	int64_t rows = 0;
	int rc = sqlite3_step(stream->blocks);

	stream->ended = rc == SQLITE_DONE;
	if (stream->ended)
		return 0;
	if (rc != SQLITE_ROW)
		return fail_seal_make(walk, err);
	walk->good &= incise_ledger_block_read(&block, stream->blocks);
	if (!walk->recording->old) {
		take_data(walk, i, &block);
		return 0;
	}
	for (rc = SQLITE_OK; rc == SQLITE_OK && stream->rows.has_row &&
			     stream->rows.seq <= block.last_seq;
	     rc = incise_old_rows_next(&stream->rows), rows++) {
		walk->good &= stream->rows.good;
		incise_seal_row(&walk->seal, i, stream->rows.bytes, stream->rows.n);
	}
	walk->good &= rows == block.count;
	incise_seal_block(&walk->seal, i, &block, digest);
	return rc == SQLITE_OK ? 0 : fail_seal_make(walk, err);
}

/* The length of camera.mkv as the ledger has it. */
static int64_t length_of(struct incise_seal_walk *walk)
{
	struct incise_ledger_block block = {0};
	sqlite3_stmt *stmt = NULL;

	if (incise_ledger_select(walk->recording->db, INCISE_LEDGER_FILE, INT64_MIN,
				 false, &stmt) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW)
		incise_ledger_block_read(&block, stmt);
	sqlite3_finalize(stmt);
	return block.last_seq;
}

/* camera.mkv; -1 with errno: there is none, or ENOMEM. */
static int open_seal_make_file(const struct incise_recording *recording)
{
	char *path;
	int fd;

	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, recording->path) < 0)
		return -1;
	fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	free(path);
	return fd;
}

static int next_commit(struct incise_seal_walk *walk, struct incise_error *err)
{
	struct incise_seal *seal = &walk->seal;
	sqlite3_stmt *stmt = walk->commits;
	uint8_t head[INCISE_SEAL_BYTES] = {0};
	int rc = sqlite3_step(stmt);

	if (rc == SQLITE_DONE)
		return 0;
	if (rc != SQLITE_ROW)
		return fail_seal_make(walk, err);
	walk->number = sqlite3_column_int64(stmt, 0);
	walk->t_ns = sqlite3_column_int64(stmt, 1);
	walk->good = walk->number == seal->next;
	seal->next = walk->number;
	for (int i = 0; i < 7; i++)
		walk->good &= sqlite3_column_type(stmt, i) ==
			      (i == 2 ? SQLITE_BLOB : SQLITE_INTEGER);
	if (sqlite3_column_bytes(stmt, 2) == sizeof(head))
		memcpy(head, sqlite3_column_blob(stmt, 2), sizeof(head));
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		int64_t blocks = sqlite3_column_int64(stmt, 3 + i);

		/* Some are of one commit, after a stall, and the end; more of a forged one. */
		walk->good &= (uint64_t)blocks - (uint64_t)seal->blocks[i] <= BLOCKS_MAX;
		for (rc = 0; !rc && seal->blocks[i] < blocks && !walk->streams[i].ended;)
			rc = take_block(walk, i, err);
		if (rc)
			return rc;
		walk->good &= seal->blocks[i] == blocks;
		seal->blocks[i] = blocks;
	}
	if (walk->number == walk->last && walk->recording->meta.complete) {
		int fd = open_seal_make_file(walk->recording);

		rc = incise_seal_tables(seal, walk->recording->db, fd, length_of(walk));
		if (fd >= 0)
			close(fd);
		if (rc != SQLITE_OK)
			return fail_seal_make(walk, err);
	}
	if (!incise_seal_commit(seal, walk->t_ns))
		return incise_schema_no_memory(walk->recording->path, err);
	walk->good &= !memcmp(head, seal->head, sizeof(head));
	/* The next commits go on from what is written: only the wrong ones are reported. */
	if (!walk->good)
		incise_seal_resume(seal, head);
	return 1;
}

uint64_t incise_seal_walk_behind(struct incise_seal_walk *walk, bool *blocks)
{
	uint64_t rows = 0;

	*blocks = false;
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		struct incise_seal_walk_stream *stream = &walk->streams[i];
		struct incise_ledger_block block;

		while (!stream->ended && sqlite3_step(stream->blocks) == SQLITE_ROW) {
			*blocks = true;
			if (!walk->recording->old &&
			    incise_ledger_block_read(&block, stream->blocks))
				rows += block.count;
		}
		while (stream->rows.has_row &&
		       incise_old_rows_next(&stream->rows) == SQLITE_OK)
			rows++;
	}
	return rows;
}

/* --- the statement ---------------------------------------------------------------------- */

/* Head and length of camera.mkv. */
static int make_file_part(struct incise_recording *recording, uint64_t *bytes,
			  uint8_t digest[INCISE_SEAL_BYTES], struct incise_error *err)
{
	const int fd = open_seal_make_file(recording);
	struct stat st = {0};
	int rc;

	*bytes = 0;
	memset(digest, 0, INCISE_SEAL_BYTES);
	if (fd < 0 && errno == ENOMEM)
		return incise_schema_no_memory(recording->path, err);
	if (fd < 0)
		return 0; /* without a camera */
	rc = fstat(fd, &st) ? -errno : 0;
	/* Before the end frames are ahead of their rows. */
	if (recording->meta.complete)
		*bytes = st.st_size;
	if (!rc)
		rc = incise_seal_file(fd, *bytes, digest);
	close(fd);
	return rc ? incise_error_set(err, -rc, "%s/" INCISE_FRAMES_FILE ": %s",
				     recording->path, strerror(-rc))
		  : 0;
}

static int make_parts(struct incise_seal_statement *statement,
		      struct incise_recording *recording, const struct incise_seal *seal,
		      struct incise_error *err)
{
	for (int i = 0; i < INCISE_SEAL_PARTS; i++) {
		struct incise_seal_part *part = &statement->parts[i];
		uint8_t digest[INCISE_SEAL_BYTES];
		int rc = 0;

		snprintf(part->name, sizeof(part->name), "%s", incise_seal_parts[i]);
		if (i >= INCISE_SEAL_STREAM && i < INCISE_SEAL_DEPTH)
			continue;
		if (i == INCISE_SEAL_FILE)
			rc = make_file_part(recording, &part->rows, digest, err);
		else if (incise_seal_table(seal, recording->db, i, &part->rows, digest))
			rc = incise_schema_fail(recording->db, recording->path, err);
		if (rc)
			return rc;
		incise_sha256_hex(digest, part->digest);
	}
	return 0;
}

/* The streams until here, and the head. */
static void take_commit(struct incise_seal_statement *statement,
			const struct incise_seal_walk *walk)
{
	const struct incise_seal *seal = &walk->seal;

	statement->last.commit = walk->number;
	statement->last.t_ns = walk->t_ns;
	incise_sha256_hex(seal->head, statement->last.head);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		statement->parts[INCISE_SEAL_STREAM + i].rows = seal->n_rows[i];
		incise_sha256_hex(seal->chain[i],
				  statement->parts[INCISE_SEAL_STREAM + i].digest);
	}
}

int incise_statement_make(struct incise_seal_statement *statement,
			  struct incise_recording *recording, bool known, int64_t upto,
			  int (*step)(void *user, struct incise_seal_walk *walk),
			  void *user, struct incise_error *err)
{
	struct incise_seal_walk walk;
	int rc, at = 0;

	*statement = (struct incise_seal_statement){.complete = recording->meta.complete,
						    .last = {.commit = -1}};
	rc = open_walk(&walk, recording, known, err);
	if (upto < 0)
		upto = walk.last;
	if (!rc && upto < 0)
		rc = incise_error_set(err, ENODATA, "%s: its seal has no commit",
				      recording->path);
	if (!rc)
		rc = incise_seal_identity(recording, statement->identity, err);
	if (!rc)
		rc = incise_seal_key(recording, "incise", statement->software,
				     sizeof(statement->software), err);
	if (!rc)
		rc = incise_seal_key(recording, "host", statement->host,
				     sizeof(statement->host), err);
	if (!rc)
		rc = incise_seal_key(recording, "started", statement->started,
				     sizeof(statement->started), err);
	incise_seal_line(statement->name, sizeof(statement->name), recording->name);
	statement->n_earlier =
		upto < INCISE_STATEMENT_EARLIER ? upto : INCISE_STATEMENT_EARLIER;
	for (int i = 0; i < statement->n_earlier; i++)
		statement->earlier[i].commit =
			incise_statement_earlier(i, statement->n_earlier, upto);
	while (!rc && (rc = next_commit(&walk, err)) > 0) {
		struct incise_seal_head *earlier = &statement->earlier[at];

		if (walk.number <= upto)
			take_commit(statement, &walk);
		if (at < statement->n_earlier && earlier->commit == walk.number) {
			earlier->t_ns = walk.t_ns;
			memcpy(earlier->head, statement->last.head,
			       sizeof(earlier->head));
		}
		/* A table that was forged may leave out numbers. */
		while (at < statement->n_earlier &&
		       statement->earlier[at].commit <= walk.number)
			at++;
		rc = step ? step(user, &walk) : 0;
	}
	if (!rc)
		rc = make_parts(statement, recording, &walk.seal, err);
	close_walk(&walk);
	return rc;
}

/* --- interface ------------------------------------------------------------------------ */

static int check_step(void *user, struct incise_seal_walk *walk)
{
	bool *good = user;

	*good &= walk->good;
	return 0;
}

static size_t make_text(struct incise_recording *recording,
			char text[INCISE_STATEMENT_MAX], struct incise_error *err)
{
	struct incise_seal_statement statement;
	bool good = true;
	int rc = incise_seal_possible(recording, err);
	size_t n = 0;

	if (!rc)
		rc = incise_statement_make(&statement, recording, false, -1, check_step,
					   &good, err);
	if (!rc && !good)
		rc = incise_error_set(err, EBADMSG,
				      "%s: differs from its own seal; `incise verify` "
				      "lists where",
				      recording->path);
	if (!rc) {
		n = incise_statement_write(&statement, text);
		if (!n)
			rc = incise_error_set(err, EINVAL, "%s: damaged: table meta",
					      recording->path);
	}
	errno = -rc;
	return n;
}

char *incise_seal_statement(const char *path, struct incise_error *err)
{
	struct incise_recording *recording =
		incise_recording_open_as(path, INCISE_RECORDING_ORIGINAL, err);
	char text[INCISE_STATEMENT_MAX], *copy;
	size_t n;
	int code;

	if (!recording)
		return NULL;
	n = make_text(recording, text, err);
	code = errno;
	incise_recording_close(recording);
	errno = code;
	copy = n ? strndup(text, n) : NULL;
	if (n && !copy)
		incise_schema_no_memory(path, err);
	return copy;
}
