// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Blocks, seals of tables and heads of commits; see block_writer.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "block_writer.h"

int incise_block_writer_start(struct incise_block_writer *writer, sqlite3 *db)
{
	const struct {
		sqlite3_stmt **stmt;
		const char *sql;
	} all[] = {
		{&writer->block, "INSERT INTO blocks VALUES(?,?,?,?,?,?,?,?,?,?,?)"},
		{&writer->entry, "INSERT INTO ledger VALUES(?,?,?,?,?,?,?,?,?)"},
		{&writer->commit, "INSERT INTO seal VALUES(?,?,?,?,?,?,?)"},
	};
	int rc = SQLITE_OK;

	writer->db = db;
	for (size_t i = 0; i < sizeof(all) / sizeof(*all) && rc == SQLITE_OK; i++)
		rc = sqlite3_prepare_v3(db, all[i].sql, -1, SQLITE_PREPARE_PERSISTENT,
					all[i].stmt, NULL);
	return rc == SQLITE_OK ? incise_seal_start(&writer->seal, db) : rc;
}

void incise_block_writer_free(struct incise_block_writer *writer)
{
	sqlite3_finalize(writer->block);
	sqlite3_finalize(writer->entry);
	sqlite3_finalize(writer->commit);
	incise_seal_free(&writer->seal);
	free(writer->data);
	*writer = (struct incise_block_writer){0};
}

static void bind_block(sqlite3_stmt *stmt, const char *stream,
		       const struct incise_ledger_block *block)
{
	const int64_t values[] = {block->block,	   block->first_seq, block->last_seq,
				  block->first_ns, block->last_ns,   block->count,
				  block->lost,	   block->crc};

	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_TRANSIENT);
	for (int i = 0; i < 8; i++)
		sqlite3_bind_int64(stmt, 2 + i, values[i]);
}

int incise_block_writer_put(struct incise_block_writer *writer, int stream,
			    struct incise_batch *batch, struct incise_ledger_block *block)
{
	size_t bound = batch->n ? incise_batch_bound(batch) : 0, size = 0;
	uint8_t digest[INCISE_SEAL_BYTES];

	if (bound > writer->size || !writer->data) {
		uint8_t *more = realloc(writer->data, 2 * bound + 1);

		if (!more)
			return SQLITE_NOMEM;
		writer->data = more;
		writer->size = 2 * bound;
	}
	if (batch->n)
		size = incise_batch_encode(batch, writer->data);
	batch->n = 0;
	incise_ledger_crc(block, writer->data, size);
	incise_seal_data(&writer->seal, stream, block, writer->data, size, digest);
	bind_block(writer->block, incise_ledger_forms[stream].stream, block);
	sqlite3_bind_blob(writer->block, 10, digest, sizeof(digest), SQLITE_TRANSIENT);
	sqlite3_bind_blob64(writer->block, 11, writer->data, size, SQLITE_STATIC);
	return incise_schema_run(writer->block);
}

int incise_block_writer_commit(struct incise_block_writer *writer, int64_t t_ns)
{
	const struct incise_seal *seal = &writer->seal;
	sqlite3_stmt *stmt = writer->commit;

	sqlite3_bind_int64(stmt, 1, seal->next);
	sqlite3_bind_int64(stmt, 2, t_ns);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		sqlite3_bind_int64(stmt, 3 + i, seal->blocks[i]);
	if (!incise_seal_commit(&writer->seal, t_ns))
		return SQLITE_NOMEM;
	sqlite3_bind_blob(stmt, 3 + INCISE_LEDGER_FORMS, seal->head, sizeof(seal->head),
			  SQLITE_TRANSIENT);
	return incise_schema_run(stmt);
}

/* An entry of table ledger: a sealed table, or camera.mkv. */
static int put_entry(struct incise_block_writer *writer, const char *stream,
		     const struct incise_ledger_block *block)
{
	bind_block(writer->entry, stream, block);
	return incise_schema_run(writer->entry);
}

int incise_block_writer_seal(struct incise_block_writer *writer, int folder, bool whole,
			     int64_t t_ns)
{
	struct incise_ledger_block block;
	int64_t length = 0;
	struct stat st;
	int rc = SQLITE_OK, code, fd;

	for (int i = 1; incise_ledger_sealed[i] && rc == SQLITE_OK; i++) {
		char stream[40];

		snprintf(stream, sizeof(stream), INCISE_LEDGER_TABLE "%s",
			 incise_ledger_sealed[i]);
		rc = incise_ledger_seal(writer->db, incise_ledger_sealed[i], &block);
		if (rc == SQLITE_OK)
			rc = put_entry(writer, stream, &block);
	}
	if (rc != SQLITE_OK)
		return rc;
	fd = openat(folder, INCISE_FRAMES_FILE, O_RDONLY | O_CLOEXEC);
	if (fd < 0 && errno != ENOENT)
		return SQLITE_IOERR;
	if (fd >= 0) {
		code = fstat(fd, &st) ? -errno : 0;
		if (whole)
			length = st.st_size;
		if (!code)
			code = incise_ledger_seal_file(fd, length, &block);
		rc = code ? SQLITE_IOERR : put_entry(writer, INCISE_LEDGER_FILE, &block);
	}
	if (rc == SQLITE_OK)
		rc = incise_seal_tables(&writer->seal, writer->db, fd, length);
	if (fd >= 0)
		close(fd);
	return rc == SQLITE_OK ? incise_block_writer_commit(writer, t_ns) : rc;
}
