/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Blocks, seals of tables and heads of commits, as the recorder writes them and as an older recording is
 * converted to them:
 *
 *     batch ──► put ──► commit ──► … ──► seal ──► the last commit
 *
 * All functions but free() return an SQLite code, SQLITE_NOMEM also where libcrypto failed.
 */
#ifndef INCISE_BLOCK_WRITER_H
#define INCISE_BLOCK_WRITER_H

#include <sqlite3.h>
#include "../batch.h"
#include "../seal_chain.h"

struct incise_block_writer {
	sqlite3 *db;
	struct incise_seal seal; /* incise_seal_init() is before start() */
	sqlite3_stmt *block, *entry, *commit;
	uint8_t *data; /* of a block that is written */
	size_t size;
};

/* Behind the rows of table meta that are never rewritten: the genesis is of them. */
int incise_block_writer_start(struct incise_block_writer *writer, sqlite3 *db);

/* Before its database is closed; again does nothing. */
void incise_block_writer_free(struct incise_block_writer *writer);

/* A stream's block with the rows of a batch, which is empty then; of the end there are none. */
int incise_block_writer_put(struct incise_block_writer *writer, int stream,
			    struct incise_batch *batch,
			    struct incise_ledger_block *block);

/* The head of a commit. */
int incise_block_writer_commit(struct incise_block_writer *writer, int64_t t_ns);

/*
 * Seal the tables without blocks, and camera.mkv, if it is in @folder; then the last commit.
 * @whole: the file grows no more.
 */
int incise_block_writer_seal(struct incise_block_writer *writer, int folder, bool whole,
			     int64_t t_ns);

#endif
