// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of a stream of format 2 to 4 compared with its ledger, both in order and row by row; see old.h.
 *
 *     ledger   ├─ block 0 ─┤├─ block 1 ─┤├─ block 2 ─┤ end
 *     rows     1 2 3 4 5 6  7 8   10 11   12 …              extra
 *                              └ lost
 *
 * If a block does not agree, its rows or its entry are wrong, so the next block may continue from
 * either the recomputed CRC or the one in the entry. That way only the wrong blocks are
 * reported, and not all that follow.
 */
#include <errno.h>
#include "../schema.h"
#include "../verify/verify.h"
#include "old.h"

#define REPORT_ROWS 4096

struct old_verify_walk {
	struct incise_verify_walk *of;
	struct incise_old_rows rows; /* at the next one */
	struct incise_ledger
		chain[2]; /* from the recomputed CRC, from the one in the entry */
	int chains;	  /* 1 while both are the same */
};

/* Read the next row into walk->row. Returns 0; -EIO: SQLite cannot, -ECANCELED. */
static int next_old_verify_row(struct old_verify_walk *walk)
{
	struct incise_verify_walk *w = walk->of;
	struct incise_verification *verify = w->verify;

	if (incise_old_rows_next(&walk->rows) != SQLITE_OK) {
		incise_verify_unreadable(verify, w->form->stream, w->form->table);
		return -EIO;
	}
	return !walk->rows.has_row || ++verify->rows_done % REPORT_ROWS
		       ? 0
		       : incise_verify_progress(verify, false);
}

/* Add the row to the chains, and read the next. Returns as next_row(). */
static int take_old_verify_row(struct old_verify_walk *walk, bool *good)
{
	struct incise_verify_walk *w = walk->of;

	if (w->known && walk->rows.seq > w->last_seq + 1)
		incise_verify_lost(w, w->last_seq + 1, walk->rows.seq - 1,
				   walk->rows.t_ns);
	w->known = true;
	w->last_seq = walk->rows.seq;
	w->last_ns = walk->rows.t_ns;
	w->out->present++;
	*good &= walk->rows.good;
	for (int i = 0; i < walk->chains; i++)
		incise_old_ledger_add(&walk->chain[i], &walk->rows);
	return next_old_verify_row(walk);
}

/*
 * Entries from the next to @block are missing. The rows before @block are treated as one block:
 * if they were one, the chain continues.
 */
static int skip_blocks(struct old_verify_walk *walk,
		       const struct incise_ledger_block *block)
{
	struct incise_verify_walk *w = walk->of;
	struct incise_verify_finding found =
		incise_verify_walk_finding(w, INCISE_VERIFY_LEDGER);
	struct incise_ledger_block ignored;
	uint64_t before = w->out->present;
	bool good = true;
	int rc = 0;

	incise_verify_flush(w);
	while (!rc && walk->rows.has_row && walk->rows.seq < block->first_seq) {
		if (w->out->present == before) {
			found.first_seq = walk->rows.seq;
			found.first_ns = walk->rows.t_ns;
		}
		rc = take_old_verify_row(walk, &good);
		found.last_seq = w->last_seq;
		found.last_ns = w->last_ns;
	}
	if (rc == -ECANCELED)
		return rc;
	/* Without the entries only the recomputed CRC is left. */
	incise_ledger_end(&walk->chain[0], &ignored);
	walk->chain[0].open.block = block->block;
	walk->chains = 1;
	found.first_block = w->next;
	found.last_block = block->block - 1;
	found.count = block->block - w->next;
	w->out->altered += found.count;
	incise_verify_found(
		w->verify, found,
		"%s: the ledger has no entry of block %lld%s%.0lld; %llu rows are in "
		"its place",
		w->form->stream, (long long)found.first_block,
		found.count > 1 ? " to " : "",
		found.count > 1 ? (long long)found.last_block : 0,
		(unsigned long long)(w->out->present - before));
	return rc;
}

/* Recompute a block from its rows. Returns as next_row(). */
static int take_block(struct old_verify_walk *walk,
		      const struct incise_ledger_block *block, bool good)
{
	struct incise_verify_walk *w = walk->of;
	uint64_t before = w->out->present;
	int match = -1, rc = 0;

	while (!rc && walk->rows.has_row && walk->rows.seq <= block->last_seq)
		rc = take_old_verify_row(walk, &good);
	if (rc == -ECANCELED)
		return rc;
	for (int i = 0; i < walk->chains; i++) {
		struct incise_ledger_block computed;
		bool is = true;

		if (!block->count && w->out->present == before)
			incise_ledger_close(&walk->chain[i], block->lost, &computed);
		else
			is = incise_ledger_end(&walk->chain[i], &computed);
		if (match < 0 && good && is && incise_ledger_same(&computed, block))
			match = i;
	}
	w->next = block->block + 1;
	if (match >= 0) {
		incise_verify_flush(w);
		walk->chain[0] = walk->chain[match];
		walk->chains = 1;
	} else {
		incise_verify_add_altered(w, block, w->out->present - before);
		walk->chains = 2;
		walk->chain[1] = walk->chain[0];
		walk->chain[1].open.crc = block->crc;
		if (block->count) {
			walk->chain[1].started = true;
			walk->chain[1].last_seq = block->last_seq;
			walk->chain[1].last_ns = block->last_ns;
		}
	}
	for (int i = 0; i < walk->chains; i++) {
		walk->chain[i].open.block = w->next;
		walk->chain[i].open.count = 0;
	}
	return rc;
}

/* Rows behind the last block. */
static int take_extra(struct old_verify_walk *walk)
{
	struct incise_verify_walk *w = walk->of;
	struct incise_verify_finding found =
		incise_verify_walk_finding(w, INCISE_VERIFY_EXTRA);
	bool good = true;
	int rc = 0;

	if (!walk->rows.has_row)
		return 0;
	found.first_seq = walk->rows.seq;
	found.first_ns = walk->rows.t_ns;
	while (!rc && walk->rows.has_row) {
		rc = take_old_verify_row(walk, &good);
		found.count++;
	}
	if (rc == -ECANCELED)
		return rc;
	found.last_seq = w->last_seq;
	found.last_ns = w->last_ns;
	incise_verify_found(
		w->verify, found,
		"%s: %llu row%s after the end of the ledger, numbers %lld to %lld",
		w->form->stream, (unsigned long long)found.count,
		found.count == 1 ? "" : "s", (long long)found.first_seq,
		(long long)found.last_seq);
	return rc;
}

static int walk_through(struct old_verify_walk *walk)
{
	struct incise_verify_walk *w = walk->of;
	struct incise_ledger_block block;
	int64_t end_seq = INT64_MIN;
	bool ended = false;
	int rc = next_old_verify_row(walk), step;

	while (!rc && (rc = step = incise_verify_step_block(w)) > 0) {
		bool good = incise_verify_read_block(w, &block);

		rc = 0;
		if (good && !w->known && block.count && block.first_seq >= 0) {
			w->known = true;
			w->last_seq = block.first_seq - 1;
			w->last_ns = block.first_ns;
		}
		if (block.block > w->next)
			rc = skip_blocks(walk, &block);
		if (!rc)
			rc = take_block(walk, &block, good);
		incise_verify_count_block(w, &block);
		ended = !block.count;
		end_seq = good ? block.last_seq : end_seq;
	}
	incise_verify_flush(w);
	if (!rc && end_seq > w->last_seq &&
	    !(walk->rows.has_row && walk->rows.seq <= end_seq))
		incise_verify_lost(w, w->last_seq + 1, end_seq, -1);
	if (!rc)
		rc = take_extra(walk);
	if (!rc && !ended)
		incise_verify_no_end(w);
	return rc;
}

int incise_old_verify_stream(struct incise_verify_walk *of)
{
	struct old_verify_walk walk = {.of = of, .chains = 1};
	int rc;

	incise_ledger_init(&walk.chain[0]);
	if (incise_old_rows_open(&walk.rows, of->verify->recording, of->stream) ==
	    SQLITE_OK) {
		rc = walk_through(&walk);
	} else {
		incise_verify_unreadable(of->verify, of->form->stream, of->form->table);
		rc = -EIO;
	}
	incise_old_rows_close(&walk.rows);
	return rc;
}

void incise_old_verify_depth(struct incise_verification *verify)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_COUNT);
	int64_t rows = incise_schema_ask(verify->recording->db, -1,
					 "SELECT count(*) FROM depth");

	found.count = verify->recording->meta.depth;
	if (rows < 0 || (uint64_t)rows != found.count)
		incise_verify_found(verify, found, "table depth has %lld rows of %llu",
				    (long long)rows, (unsigned long long)found.count);
}
