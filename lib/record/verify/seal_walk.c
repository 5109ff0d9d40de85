// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The seal of a recording recomputed from its rows; see seal_walk.h. The file is untrusted.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "seal_walk.h"

#define BLOCKS_MAX 1000 /* of a stream in a commit */

static int fail(struct incise_seal_walk *walk, struct incise_error *err)
{
	return incise_schema_fail(walk->recording->db, walk->recording->path, err);
}

static int next_row(struct incise_seal_walk *walk, struct incise_seal_walk_stream *stream,
		    struct incise_error *err)
{
	int rc = sqlite3_step(stream->rows);

	stream->has_row = rc == SQLITE_ROW;
	if (stream->has_row)
		stream->good_row =
			incise_ledger_row_read(&stream->row, stream->form, stream->rows);
	return stream->has_row || rc == SQLITE_DONE ? 0 : fail(walk, err);
}

int incise_seal_walk_open(struct incise_seal_walk *walk,
			  struct incise_recording *recording,
			  const struct incise_seal_digests *known,
			  struct incise_error *err)
{
	sqlite3 *db = recording->db;
	int rc;

	*walk = (struct incise_seal_walk){
		.recording = recording, .known = known, .last = -1};
	rc = incise_seal_init(&walk->seal, recording->form);
	if (rc)
		return incise_error_set(err, -rc, "%s: libcrypto gives no SHA-256",
					recording->path);
	/* From the last to know it, then from the first. */
	if (sqlite3_prepare_v2(db, "SELECT max(number) FROM seal", -1, &walk->commits,
			       NULL) != SQLITE_OK)
		return fail(walk, err);
	if (sqlite3_step(walk->commits) == SQLITE_ROW &&
	    sqlite3_column_type(walk->commits, 0) == SQLITE_INTEGER)
		walk->last = sqlite3_column_int64(walk->commits, 0);
	if (sqlite3_finalize(walk->commits) != SQLITE_OK) {
		walk->commits = NULL;
		return fail(walk, err);
	}
	walk->commits = NULL;
	if (sqlite3_prepare_v2(db,
			       "SELECT number, t_ns, head, force, tracker, camera, wall "
			       "FROM seal ORDER BY number",
			       -1, &walk->commits, NULL) != SQLITE_OK ||
	    incise_seal_start(&walk->seal, db) != SQLITE_OK)
		return fail(walk, err);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		struct incise_seal_walk_stream *stream = &walk->streams[i];
		char sql[300];

		stream->form = incise_ledger_form(i, recording->form);
		rc = incise_ledger_select(db, recording->form, stream->form->stream,
					  INT64_MIN, false, &stream->blocks);
		if (rc != SQLITE_OK)
			return fail(walk, err);
		if (recording->form >= 5)
			continue;
		snprintf(sql, sizeof(sql), "SELECT %s FROM %s ORDER BY seq",
			 stream->form->columns, stream->form->table);
		if (sqlite3_prepare_v2(db, sql, -1, &stream->rows, NULL) != SQLITE_OK)
			return fail(walk, err);
		rc = known ? 0 : next_row(walk, stream, err);
		if (rc)
			return rc;
	}
	return 0;
}

void incise_seal_walk_close(struct incise_seal_walk *walk)
{
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		sqlite3_finalize(walk->streams[i].rows);
		sqlite3_finalize(walk->streams[i].blocks);
	}
	sqlite3_finalize(walk->commits);
	incise_seal_free(&walk->seal);
}

/* A block of form 5: its data have the digest that it names, which a verification has seen. */
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
	int64_t rows = 0;
	int rc = sqlite3_step(stream->blocks);

	stream->ended = rc == SQLITE_DONE;
	if (stream->ended)
		return 0;
	if (rc != SQLITE_ROW)
		return fail(walk, err);
	walk->good &= incise_ledger_block_read(&block, stream->blocks);
	if (walk->recording->form >= 5) {
		take_data(walk, i, &block);
		return 0;
	}
	if (walk->known) {
		const struct incise_seal_digests *known = &walk->known[i];
		const uint8_t none[INCISE_SEAL_BYTES] = {0};
		size_t at = walk->seal.blocks[i];

		incise_seal_rows_block(&walk->seal, i, &block,
				       at < known->n ? known->digests[at] : none);
		walk->seal.n_rows[i] += block.count;
		return 0;
	}
	for (rc = 0; !rc && stream->has_row && stream->row.seq <= block.last_seq;
	     rc = next_row(walk, stream, err), rows++) {
		walk->good &= stream->good_row;
		incise_seal_row(&walk->seal, i, &stream->row);
	}
	walk->good &= rows == block.count;
	incise_seal_block(&walk->seal, i, &block);
	return rc;
}

/* The length of camera.mkv as the ledger has it. */
static int64_t length_of(struct incise_seal_walk *walk)
{
	struct incise_ledger_block block = {0};
	sqlite3_stmt *stmt = NULL;

	if (incise_ledger_select(walk->recording->db, walk->recording->form,
				 INCISE_LEDGER_FILE, INT64_MIN, false,
				 &stmt) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW)
		incise_ledger_block_read(&block, stmt);
	sqlite3_finalize(stmt);
	return block.last_seq;
}

static int open_file(struct incise_seal_walk *walk)
{
	char *path;
	int fd;

	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, walk->recording->path) < 0)
		return -1;
	fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	free(path);
	return fd;
}

int incise_seal_walk_next(struct incise_seal_walk *walk, struct incise_error *err)
{
	struct incise_seal *seal = &walk->seal;
	sqlite3_stmt *stmt = walk->commits;
	uint8_t head[INCISE_SEAL_BYTES] = {0};
	int rc = sqlite3_step(stmt);

	if (rc == SQLITE_DONE)
		return 0;
	if (rc != SQLITE_ROW)
		return fail(walk, err);
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
		int fd = open_file(walk);

		rc = incise_seal_tables(seal, walk->recording->db, fd, length_of(walk));
		if (fd >= 0)
			close(fd);
		if (rc != SQLITE_OK)
			return fail(walk, err);
	}
	if (!incise_seal_commit(seal, walk->t_ns))
		return incise_error_set(err, ENOMEM, "%s: out of memory",
					walk->recording->path);
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

		while (sqlite3_step(stream->blocks) == SQLITE_ROW) {
			*blocks = true;
			if ((walk->known || walk->recording->form >= 5) &&
			    incise_ledger_block_read(&block, stream->blocks))
				rows += block.count;
		}
		while (stream->has_row && !next_row(walk, stream, NULL))
			rows++;
	}
	return rows;
}
