// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of one stream compared with its ledger, both in order and row by row; see verify.h.
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
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../batch.h"
#include "verify.h"

#define REPORT_ROWS 4096
/* Sums over a damaged ledger stay in range. */
#define COUNT_MAX (1LL << 53)

struct walk {
	struct incise_verification *verify;
	const struct incise_ledger_form *form;
	int stream;
	struct incise_verify_stream *out;
	sqlite3_stmt *rows, *blocks;

	struct incise_ledger_row row; /* next, where has_row */
	bool has_row, good_row;
	bool known;   /* last_seq and last_ns: of a row, or of the ledger's start */
	bool follows; /* the block before was as it was written */
	int64_t last_seq, last_ns;

	struct incise_ledger
		chain[2]; /* from the recomputed CRC, from the one in the entry */
	int chains;	  /* 1 while both are the same */
	uint64_t counted; /* rows, by the ledger */
	int64_t next;	  /* block */
	struct incise_verify_finding altered; /* blocks in a row; first_block -1: none */
	uint64_t altered_rows;		      /* rows that they have */
};

static struct incise_verify_finding finding(const struct walk *walk,
					    enum incise_verify_kind kind)
{
	struct incise_verify_finding found = incise_verify_finding(kind);

	found.stream = walk->form->stream;
	return found;
}

/* Report missing samples from @first to @last; the row after them is at @after_ns, or -1. */
static void lost(struct walk *walk, int64_t first, int64_t last, int64_t after_ns)
{
	struct incise_verify_finding found = finding(walk, INCISE_VERIFY_LOST);
	uint64_t count = (uint64_t)last - (uint64_t)first + 1;
	char number[80];

	found.first_seq = first;
	found.last_seq = last;
	found.first_ns = walk->known ? walk->last_ns : -1;
	found.last_ns = after_ns;
	found.count = count;
	if (count == 1)
		snprintf(number, sizeof(number), "number %lld", (long long)first);
	else
		snprintf(number, sizeof(number), "numbers %lld to %lld", (long long)first,
			 (long long)last);
	if (after_ns < 0 && !walk->known)
		incise_verify_found(walk->verify, &found, "%s: %llu missing, %s: all",
				    walk->form->stream, (unsigned long long)count,
				    number);
	else if (after_ns < 0)
		incise_verify_found(walk->verify, &found,
				    "%s: %llu missing at the end, %s, after %.4f s",
				    walk->form->stream, (unsigned long long)count, number,
				    incise_verify_s(walk->verify, walk->last_ns));
	else
		incise_verify_found(walk->verify, &found,
				    "%s: %llu missing, %s, before %.4f s",
				    walk->form->stream, (unsigned long long)count, number,
				    incise_verify_s(walk->verify, after_ns));
}

/* Read the next row into walk->row. Returns 0; -EIO: SQLite cannot, -ECANCELED. */
static int next_row(struct walk *walk)
{
	struct incise_verification *verify = walk->verify;
	int rc = sqlite3_step(walk->rows);

	walk->has_row = rc == SQLITE_ROW;
	if (rc == SQLITE_DONE)
		return 0;
	if (rc != SQLITE_ROW) {
		incise_verify_unreadable(verify, walk->form->stream, walk->form->table);
		return -EIO;
	}
	walk->good_row = incise_ledger_row_read(&walk->row, walk->form, walk->rows);
	return ++verify->rows_done % REPORT_ROWS ? 0
						 : incise_verify_progress(verify, false);
}

/* Add the row to the chains, and read the next. Returns as next_row(). */
static int take_row(struct walk *walk, bool *good)
{
	if (walk->known && walk->row.seq > walk->last_seq + 1)
		lost(walk, walk->last_seq + 1, walk->row.seq - 1, walk->row.t_ns);
	walk->known = true;
	walk->last_seq = walk->row.seq;
	walk->last_ns = walk->row.t_ns;
	walk->out->present++;
	*good &= walk->good_row;
	for (int i = 0; i < walk->chains; i++)
		incise_ledger_add(&walk->chain[i], &walk->row);
	if (walk->verify->hashed)
		incise_seal_row(&walk->verify->rows_seal, walk->stream, &walk->row);
	return next_row(walk);
}

/* The digest of a block's rows, for the seal. Without memory it reads the rows again. */
static void keep_digest(struct walk *walk)
{
	struct incise_verification *verify = walk->verify;
	struct incise_seal_digests *kept = &verify->digests[walk->stream];

	if (verify->hashed && kept->n == kept->capacity) {
		size_t capacity = kept->capacity ? 2 * kept->capacity : 1024;
		void *more = reallocarray(kept->digests, capacity, INCISE_SEAL_BYTES);

		verify->hashed = more;
		if (more)
			kept->digests = more;
		if (more)
			kept->capacity = capacity;
	}
	if (verify->hashed)
		incise_seal_rows(&verify->rows_seal, walk->stream,
				 kept->digests[kept->n++]);
}

/* Report the blocks that do not agree, if there are any. */
static void flush_altered(struct walk *walk)
{
	struct incise_verify_finding *found = &walk->altered;
	char blocks[80], what[120];

	if (found->first_block < 0)
		return;
	if (found->first_block == found->last_block)
		snprintf(blocks, sizeof(blocks), "block %lld is",
			 (long long)found->first_block);
	else
		snprintf(blocks, sizeof(blocks), "blocks %lld to %lld are",
			 (long long)found->first_block, (long long)found->last_block);
	if (walk->altered_rows == found->count)
		snprintf(what, sizeof(what), "rows or ledger differ from those written");
	else
		snprintf(what, sizeof(what), "%llu rows, and %llu were written",
			 (unsigned long long)walk->altered_rows,
			 (unsigned long long)found->count);
	incise_verify_found(walk->verify, found,
			    "%s: %s altered, numbers %lld to %lld, %.4f to %.4f s: %s",
			    walk->form->stream, blocks, (long long)found->first_seq,
			    (long long)found->last_seq,
			    incise_verify_s(walk->verify, found->first_ns),
			    incise_verify_s(walk->verify, found->last_ns), what);
	*found = finding(walk, INCISE_VERIFY_ALTERED);
	walk->altered_rows = 0;
}

static void add_altered(struct walk *walk, const struct incise_ledger_block *block,
			uint64_t rows)
{
	struct incise_verify_finding *found = &walk->altered;

	if (found->first_block < 0) {
		found->first_block = block->block;
		found->first_seq = block->first_seq;
		found->first_ns = block->first_ns;
	}
	found->last_block = block->block;
	found->last_seq = block->last_seq;
	found->last_ns = block->last_ns;
	found->count += block->count;
	walk->altered_rows += rows;
	walk->out->altered++;
}

/* Read the next entry. Returns false if it is impossible. */
static bool read_block(struct walk *walk, struct incise_ledger_block *block)
{
	bool good = incise_ledger_block_read(block, walk->blocks);

	if (block->count < 0 || block->count > COUNT_MAX || block->lost < 0 ||
	    block->lost > COUNT_MAX) {
		block->count = block->lost = 0;
		good = false;
	}
	if (block->block < 0 || block->block > COUNT_MAX) {
		block->block = walk->next;
		good = false;
	}
	return good;
}

/*
 * Entries from walk->next to @block are missing. The rows before @block are treated as one block:
 * if they were one, the chain continues.
 */
static int skip_blocks(struct walk *walk, const struct incise_ledger_block *block)
{
	struct incise_verify_finding found = finding(walk, INCISE_VERIFY_LEDGER);
	struct incise_ledger_block ignored;
	uint64_t before = walk->out->present;
	bool good = true;
	int rc = 0;

	flush_altered(walk);
	while (!rc && walk->has_row && walk->row.seq < block->first_seq) {
		if (walk->out->present == before) {
			found.first_seq = walk->row.seq;
			found.first_ns = walk->row.t_ns;
		}
		rc = take_row(walk, &good);
		found.last_seq = walk->last_seq;
		found.last_ns = walk->last_ns;
	}
	if (rc == -ECANCELED)
		return rc;
	/* Without the entries only the recomputed CRC is left. */
	incise_ledger_end(&walk->chain[0], &ignored);
	walk->chain[0].open.block = block->block;
	walk->chains = 1;
	found.first_block = walk->next;
	found.last_block = block->block - 1;
	found.count = block->block - walk->next;
	walk->out->altered += found.count;
	incise_verify_found(
		walk->verify, &found,
		"%s: the ledger has no entry of block %lld%s%.0lld; %llu rows are in "
		"its place",
		walk->form->stream, (long long)found.first_block,
		found.count > 1 ? " to " : "",
		found.count > 1 ? (long long)found.last_block : 0,
		(unsigned long long)(walk->out->present - before));
	return rc;
}

/* Recompute a block from its rows. Returns as next_row(). */
static int take_block(struct walk *walk, const struct incise_ledger_block *block,
		      bool good)
{
	uint64_t before = walk->out->present;
	int match = -1, rc = 0;

	while (!rc && walk->has_row && walk->row.seq <= block->last_seq)
		rc = take_row(walk, &good);
	if (rc == -ECANCELED)
		return rc;
	keep_digest(walk);
	for (int i = 0; i < walk->chains; i++) {
		struct incise_ledger_block computed;
		bool is = true;

		if (!block->count && walk->out->present == before)
			incise_ledger_close(&walk->chain[i], block->lost, &computed);
		else
			is = incise_ledger_end(&walk->chain[i], &computed);
		if (match < 0 && good && is && incise_ledger_same(&computed, block))
			match = i;
	}
	walk->next = block->block + 1;
	if (match >= 0) {
		flush_altered(walk);
		walk->chain[0] = walk->chain[match];
		walk->chains = 1;
	} else {
		add_altered(walk, block, walk->out->present - before);
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
		walk->chain[i].open.block = walk->next;
		walk->chain[i].open.count = 0;
	}
	return rc;
}

/* Rows behind the last block. */
static int take_extra(struct walk *walk)
{
	struct incise_verify_finding found = finding(walk, INCISE_VERIFY_EXTRA);
	bool good = true;
	int rc = 0;

	if (!walk->has_row)
		return 0;
	found.first_seq = walk->row.seq;
	found.first_ns = walk->row.t_ns;
	while (!rc && walk->has_row) {
		rc = take_row(walk, &good);
		found.count++;
	}
	if (rc == -ECANCELED)
		return rc;
	found.last_seq = walk->last_seq;
	found.last_ns = walk->last_ns;
	incise_verify_found(
		walk->verify, &found,
		"%s: %llu row%s after the end of the ledger, numbers %lld to %lld",
		walk->form->stream, (unsigned long long)found.count,
		found.count == 1 ? "" : "s", (long long)found.first_seq,
		(long long)found.last_seq);
	return rc;
}

static int step_block(struct walk *walk)
{
	int rc = sqlite3_step(walk->blocks);

	if (rc == SQLITE_ROW || rc == SQLITE_DONE)
		return rc == SQLITE_ROW;
	incise_verify_unreadable(walk->verify, walk->form->stream, "ledger");
	return -EIO;
}

/* Compare the recorder's counts in table meta with the ledger. */
static void check_counts(struct walk *walk, uint64_t rows, uint64_t lost_rows)
{
	const struct incise_verify_stream *out = walk->out;
	struct incise_verify_finding found = finding(walk, INCISE_VERIFY_COUNT);

	if (rows != walk->counted) {
		found.count = rows;
		incise_verify_found(walk->verify, &found,
				    "%s: %llu rows were written, and the ledger has %llu",
				    walk->form->stream, (unsigned long long)rows,
				    (unsigned long long)walk->counted);
	}
	/* Before the end a device may count losses that no gap shows yet. */
	if (!walk->verify->report->interrupted && lost_rows != out->lost_at_capture) {
		found.count = lost_rows;
		incise_verify_found(
			walk->verify, &found,
			"%s: %llu were lost during the capture, and the ledger has %llu",
			walk->form->stream, (unsigned long long)lost_rows,
			(unsigned long long)out->lost_at_capture);
	}
}

static void count_block(struct walk *walk, const struct incise_ledger_block *block)
{
	walk->out->blocks++;
	if (walk->counted < COUNT_MAX && walk->out->lost_at_capture < COUNT_MAX) {
		walk->counted += block->count;
		walk->out->lost_at_capture += block->lost;
	}
}

static void report_no_end(struct walk *walk)
{
	struct incise_verify_finding found = finding(walk, INCISE_VERIFY_LEDGER);

	if (walk->verify->report->interrupted)
		return;
	found.first_block = found.last_block = walk->next;
	incise_verify_found(walk->verify, &found,
			    "%s: the ledger has no end: its last blocks were removed",
			    walk->form->stream);
}

static int walk_through(struct walk *walk)
{
	struct incise_ledger_block block;
	int64_t end_seq = INT64_MIN;
	bool ended = false;
	int rc = next_row(walk), step;

	while (!rc && (rc = step = step_block(walk)) > 0) {
		bool good = read_block(walk, &block);

		rc = 0;
		if (good && !walk->known && block.count && block.first_seq >= 0) {
			walk->known = true;
			walk->last_seq = block.first_seq - 1;
			walk->last_ns = block.first_ns;
		}
		if (block.block > walk->next)
			rc = skip_blocks(walk, &block);
		if (!rc)
			rc = take_block(walk, &block, good);
		count_block(walk, &block);
		ended = !block.count;
		end_seq = good ? block.last_seq : end_seq;
	}
	flush_altered(walk);
	if (!rc && end_seq > walk->last_seq &&
	    !(walk->has_row && walk->row.seq <= end_seq))
		lost(walk, walk->last_seq + 1, end_seq, -1);
	if (!rc)
		rc = take_extra(walk);
	if (!rc && !ended)
		report_no_end(walk);
	return rc;
}

/* Blocks from walk->next to @block are missing, and their rows with them. */
static void report_missing(struct walk *walk, const struct incise_ledger_block *block)
{
	struct incise_verify_finding found = finding(walk, INCISE_VERIFY_LEDGER);

	flush_altered(walk);
	found.first_block = walk->next;
	found.last_block = block->block - 1;
	found.count = block->block - walk->next;
	walk->out->altered += found.count;
	if (found.count == 1)
		incise_verify_found(walk->verify, &found, "%s: block %lld is missing",
				    walk->form->stream, (long long)found.first_block);
	else
		incise_verify_found(walk->verify, &found,
				    "%s: blocks %lld to %lld are missing",
				    walk->form->stream, (long long)found.first_block,
				    (long long)found.last_block);
}

/* The rows of a block of form 5, whose numbers and times go on, and the samples missing before and within. */
static uint64_t take_numbers(struct walk *walk, const struct incise_batch *batch,
			     bool *good)
{
	uint64_t missing = 0;

	for (size_t k = 0; k < batch->n; k++) {
		const int64_t seq = batch->column[0].i[k], t_ns = batch->column[1].i[k];

		*good &= !walk->known || (seq > walk->last_seq && t_ns >= walk->last_ns);
		if (walk->known && seq > walk->last_seq && seq - walk->last_seq > 1) {
			missing += (uint64_t)(seq - walk->last_seq - 1);
			lost(walk, walk->last_seq + 1, seq - 1, t_ns);
		}
		walk->known = true;
		walk->last_seq = seq;
		walk->last_ns = t_ns;
	}
	walk->out->present += batch->n;
	return missing;
}

/* The data of a block are those of its CRC, and of its digest, which the seal takes as it is. */
static bool has_data(struct walk *walk, const struct incise_ledger_block *block,
		     const void **data, size_t *size)
{
	struct incise_verification *verify = walk->verify;
	const uint8_t *named = incise_ledger_digest(walk->blocks);
	uint8_t digest[INCISE_SEAL_BYTES];

	if (!incise_ledger_data(walk->blocks, block, data, size) || !named)
		return false;
	if (!verify->hashed)
		return true;
	incise_seal_data(&verify->rows_seal, walk->stream, block, *data, *size, digest);
	return !memcmp(named, digest, sizeof(digest));
}

/* Compare a block with its fields, and with the one before. Returns 0 or -ECANCELED. */
static int take_data(struct walk *walk, struct incise_batch *batch,
		     const struct incise_ledger_block *block, bool good)
{
	struct incise_verification *verify = walk->verify;
	const uint64_t rows = verify->rows_done / REPORT_ROWS;
	/* Behind one that is missing or altered the number before is not known. */
	const bool follows = block->block == walk->next && walk->follows;
	const void *data;
	size_t size;

	batch->n = 0;
	good &= has_data(walk, block, &data, &size);
	if (block->count) {
		good &= !incise_batch_decode(batch, block, data, size);
		good &= take_numbers(walk, batch, &good) == (uint64_t)block->lost ||
			!follows;
	} else {
		good &= !size && block->first_ns == block->last_ns &&
			(!follows ||
			 (block->first_seq == walk->last_seq + 1 &&
			  block->last_seq == walk->last_seq + block->lost &&
			  block->last_ns == (walk->known ? walk->last_ns : 0)));
	}
	/* Rows that cannot be read are altered, not lost. */
	if (block->count && !batch->n) {
		walk->known = false;
		walk->last_seq = block->last_seq;
	}
	walk->next = block->block + 1;
	walk->follows = good;
	if (good)
		flush_altered(walk);
	else
		add_altered(walk, block, batch->n);
	verify->rows_done += batch->n;
	return verify->rows_done / REPORT_ROWS == rows
		       ? 0
		       : incise_verify_progress(verify, false);
}

static int walk_through_blocks(struct walk *walk)
{
	struct incise_batch batch = {.form = walk->form};
	struct incise_ledger_block block;
	int64_t end_seq = INT64_MIN;
	bool ended = false;
	int rc = 0, step = 0;

	walk->follows = true;

	while (!rc && (step = step_block(walk)) > 0) {
		bool good = read_block(walk, &block);

		if (block.block > walk->next)
			report_missing(walk, &block);
		rc = take_data(walk, &batch, &block, good);
		count_block(walk, &block);
		ended = !block.count;
		end_seq = good ? block.last_seq : end_seq;
	}
	incise_batch_free(&batch);
	flush_altered(walk);
	rc = rc ? rc : step;
	if (!rc && end_seq > walk->last_seq)
		lost(walk, walk->last_seq + 1, end_seq, -1);
	if (!rc && !ended)
		report_no_end(walk);
	return rc;
}

int incise_verify_stream(struct incise_verification *verify, int stream, uint64_t rows,
			 uint64_t lost_rows, struct incise_verify_stream *out)
{
	const struct incise_ledger_form *form =
		incise_ledger_form(stream, verify->recording->form);
	sqlite3 *db = verify->recording->db;
	struct walk walk = {.verify = verify,
			    .form = form,
			    .stream = stream,
			    .out = out,
			    .last_seq = -1};
	const bool blocks = verify->recording->form >= 5;
	char sql[300];
	int rc = 0;

	snprintf(out->name, sizeof(out->name), "%s", form->stream);
	walk.chains = 1;
	incise_ledger_init(&walk.chain[0]);
	walk.altered = finding(&walk, INCISE_VERIFY_ALTERED);
	snprintf(sql, sizeof(sql), "SELECT %s FROM %s ORDER BY seq", form->columns,
		 form->table);
	if ((!blocks && sqlite3_prepare_v2(db, sql, -1, &walk.rows, NULL) != SQLITE_OK) ||
	    incise_ledger_select(db, verify->recording->form, form->stream, INT64_MIN,
				 false, &walk.blocks) != SQLITE_OK) {
		incise_verify_unreadable(verify, form->stream, form->table);
		rc = -EIO;
	}
	if (!rc)
		rc = blocks ? walk_through_blocks(&walk) : walk_through(&walk);
	if (!rc)
		check_counts(&walk, rows, lost_rows);
	sqlite3_finalize(walk.rows);
	sqlite3_finalize(walk.blocks);
	out->expected = walk.counted + out->lost_at_capture;
	if (out->expected < rows + lost_rows)
		out->expected = rows + lost_rows;
	out->lost = out->expected > out->present ? out->expected - out->present : 0;
	return rc == -ECANCELED ? rc : 0;
}
