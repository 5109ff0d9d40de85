// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Table ledger of a recording that is written: blocks go with the rows that they count, in
 * one transaction; see recorder.h and ledger.h.
 */
#include "recorder.h"

static int put_block(struct incise_recorder *rec, const char *stream,
		     const struct incise_ledger_block *block)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_LEDGER];
	const int64_t values[] = {block->block,	   block->first_seq, block->last_seq,
				  block->first_ns, block->last_ns,   block->count,
				  block->lost,	   block->crc};

	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_STATIC);
	for (int i = 0; i < 8; i++)
		sqlite3_bind_int64(stmt, 2 + i, values[i]);
	return incise_recorder_run(stmt);
}

int incise_recorder_ledger(struct incise_recorder *rec)
{
	struct incise_ledger_block block;
	int rc = SQLITE_OK;

	if (incise_ledger_end(&rec->force.ledger, &block))
		rc = put_block(rec, "force", &block);
	if (rc == SQLITE_OK && incise_ledger_end(&rec->tracker.ledger, &block))
		rc = put_block(rec, "tracker", &block);
	return rc;
}

/* @lost: all that this stream has lost. */
static int close_stream(struct incise_recorder *rec, const char *name,
			struct incise_ledger *ledger, uint64_t lost)
{
	struct incise_ledger_block block;

	incise_ledger_close(ledger, lost > ledger->lost ? lost - ledger->lost : 0,
			    &block);
	return put_block(rec, name, &block);
}

int incise_recorder_ledger_close(struct incise_recorder *rec)
{
	int rc = incise_recorder_ledger(rec);

	if (rc == SQLITE_OK)
		rc = close_stream(rec, "force", &rec->force.ledger,
				  rec->stats.force_lost);
	if (rc == SQLITE_OK)
		rc = close_stream(rec, "tracker", &rec->tracker.ledger,
				  rec->stats.tracker_lost);
	return rc;
}
