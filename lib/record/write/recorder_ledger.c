// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Table ledger of a recording that is written: blocks go with the rows that they count, in
 * one transaction; see recorder.h and ledger.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>
#include "../frames.h"
#include "../ledger.h"
#include "recorder.h"

static int put_block(struct incise_recorder *rec, const char *stream,
		     const struct incise_ledger_block *block)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_LEDGER];
	const int64_t values[] = {block->block,	   block->first_seq, block->last_seq,
				  block->first_ns, block->last_ns,   block->count,
				  block->lost,	   block->crc};

	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_TRANSIENT);
	for (int i = 0; i < 8; i++)
		sqlite3_bind_int64(stmt, 2 + i, values[i]);
	return incise_recorder_run(stmt);
}

int incise_recorder_ledger(struct incise_recorder *rec)
{
	struct incise_ledger_block block;
	int rc = SQLITE_OK;

	for (int i = 0; i < INCISE_LEDGER_STREAMS && rc == SQLITE_OK; i++)
		if (incise_ledger_end(&rec->streams[i].ledger, &block))
			rc = put_block(rec, rec->streams[i].name, &block);
	return rc;
}

int incise_recorder_ledger_close(struct incise_recorder *rec)
{
	int rc = incise_recorder_ledger(rec);

	for (int i = 0; i < INCISE_LEDGER_STREAMS && rc == SQLITE_OK; i++) {
		struct incise_ledger *ledger = &rec->streams[i].ledger;
		struct incise_ledger_block block;
		uint64_t lost = incise_recorder_lost(rec, i);

		if (!rec->streams[i].there)
			continue;
		/* What no gap in the numbers shows. */
		incise_ledger_close(ledger, lost > ledger->lost ? lost - ledger->lost : 0,
				    &block);
		rc = put_block(rec, rec->streams[i].name, &block);
	}
	return rc;
}

/* Of camera.mkv, where there is one. */
static int seal_head(struct incise_recorder *rec)
{
	struct incise_ledger_block block;
	int fd = openat(rec->folder, INCISE_FRAMES_FILE, O_RDONLY | O_CLOEXEC);
	int rc;

	if (fd < 0)
		return errno == ENOENT ? SQLITE_OK : SQLITE_IOERR;
	rc = incise_ledger_seal_head(fd, &block);
	close(fd);
	return rc ? SQLITE_IOERR : put_block(rec, INCISE_LEDGER_HEAD, &block);
}

int incise_recorder_seal(struct incise_recorder *rec)
{
	int rc = seal_head(rec);

	for (int i = 0; incise_ledger_sealed[i] && rc == SQLITE_OK; i++) {
		struct incise_ledger_block block;
		char stream[40];

		snprintf(stream, sizeof(stream), INCISE_LEDGER_TABLE "%s",
			 incise_ledger_sealed[i]);
		rc = incise_ledger_seal(rec->db, incise_ledger_sealed[i], &block);
		if (rc == SQLITE_OK)
			rc = put_block(rec, stream, &block);
	}
	return rc;
}
