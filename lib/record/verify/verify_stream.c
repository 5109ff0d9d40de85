// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * One stream compared with its blocks: their data, their fields, and that each follows the one before; see
 * verify.h.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "../batch.h"
#include "../old/old.h"
#include "verify.h"

#define REPORT_ROWS 4096

/* Blocks from walk->next to @block are missing, and their rows with them. */
static void report_missing(struct incise_verify_walk *walk,
			   const struct incise_ledger_block *block)
{
	struct incise_verify_finding found =
		incise_verify_walk_finding(walk, INCISE_VERIFY_LEDGER);

	incise_verify_flush(walk);
	found.first_block = walk->next;
	found.last_block = block->block - 1;
	found.count = block->block - walk->next;
	walk->out->altered += found.count;
	if (found.count == 1)
		incise_verify_found(walk->verify, found, "%s: block %lld is missing",
				    walk->form->stream, (long long)found.first_block);
	else
		incise_verify_found(walk->verify, found,
				    "%s: blocks %lld to %lld are missing",
				    walk->form->stream, (long long)found.first_block,
				    (long long)found.last_block);
}

/* The rows of a block, whose numbers and times go on, and the samples missing before and within. */
static uint64_t take_numbers(struct incise_verify_walk *walk,
			     const struct incise_batch *batch, bool *good)
{
	uint64_t missing = 0;

	for (size_t k = 0; k < batch->n; k++) {
		const int64_t seq = batch->column[0].i[k], t_ns = batch->column[1].i[k];

		*good &= !walk->known || (seq > walk->last_seq && t_ns >= walk->last_ns);
		if (walk->known && seq > walk->last_seq && seq - walk->last_seq > 1) {
			missing += (uint64_t)(seq - walk->last_seq - 1);
			incise_verify_lost(walk, walk->last_seq + 1, seq - 1, t_ns);
		}
		walk->known = true;
		walk->last_seq = seq;
		walk->last_ns = t_ns;
	}
	walk->out->present += batch->n;
	return missing;
}

/* The data of a block are those of its CRC, and of its digest, which the seal takes as it is. */
static bool has_data(struct incise_verify_walk *walk,
		     const struct incise_ledger_block *block, const void **data,
		     size_t *size)
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
static int take_data(struct incise_verify_walk *walk, struct incise_batch *batch,
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
		incise_verify_flush(walk);
	else
		incise_verify_add_altered(walk, block, batch->n);
	verify->rows_done += batch->n;
	return verify->rows_done / REPORT_ROWS == rows
		       ? 0
		       : incise_verify_progress(verify, false);
}

static int walk_through_blocks(struct incise_verify_walk *walk)
{
	struct incise_batch batch = {.form = walk->form};
	struct incise_ledger_block block;
	int64_t end_seq = INT64_MIN;
	bool ended = false;
	int rc = 0, step = 0;

	walk->follows = true;

	while (!rc && (step = incise_verify_step_block(walk)) > 0) {
		bool good = incise_verify_read_block(walk, &block);

		if (block.block > walk->next)
			report_missing(walk, &block);
		rc = take_data(walk, &batch, &block, good);
		incise_verify_count_block(walk, &block);
		ended = !block.count;
		end_seq = good ? block.last_seq : end_seq;
	}
	incise_batch_free(&batch);
	incise_verify_flush(walk);
	rc = rc ? rc : step;
	if (!rc && end_seq > walk->last_seq)
		incise_verify_lost(walk, walk->last_seq + 1, end_seq, -1);
	if (!rc && !ended)
		incise_verify_no_end(walk);
	return rc;
}

/* Compare the recorder's counts in table meta with the blocks. */
static void check_counts(struct incise_verify_walk *walk, uint64_t rows,
			 uint64_t lost_rows)
{
	const struct incise_verify_stream *out = walk->out;
	struct incise_verify_finding found =
		incise_verify_walk_finding(walk, INCISE_VERIFY_COUNT);

	if (rows != walk->counted) {
		found.count = rows;
		incise_verify_found(walk->verify, found,
				    "%s: %llu rows were written, and the ledger has %llu",
				    walk->form->stream, (unsigned long long)rows,
				    (unsigned long long)walk->counted);
	}
	/* Before the end a device may count losses that no gap shows yet. */
	if (!walk->verify->report->interrupted && lost_rows != out->lost_at_capture) {
		found.count = lost_rows;
		incise_verify_found(
			walk->verify, found,
			"%s: %llu were lost during the capture, and the ledger has %llu",
			walk->form->stream, (unsigned long long)lost_rows,
			(unsigned long long)out->lost_at_capture);
	}
}

int incise_verify_stream(struct incise_verification *verify, int stream, uint64_t rows,
			 uint64_t lost_rows, struct incise_verify_stream *out)
{
	const struct incise_ledger_form *form = &incise_ledger_forms[stream];
	struct incise_verify_walk walk = {.verify = verify,
					  .form = form,
					  .stream = stream,
					  .out = out,
					  .last_seq = -1};
	int rc = 0;

	snprintf(out->name, sizeof(out->name), "%s", form->stream);
	walk.altered = incise_verify_walk_finding(&walk, INCISE_VERIFY_ALTERED);
	if (incise_ledger_select(verify->recording->db, form->stream, INT64_MIN, false,
				 &walk.blocks) != SQLITE_OK) {
		incise_verify_unreadable(verify, form->stream, form->table);
		rc = -EIO;
	}
	if (!rc)
		rc = verify->recording->old ? incise_old_verify_stream(&walk)
					    : walk_through_blocks(&walk);
	if (!rc)
		check_counts(&walk, rows, lost_rows);
	sqlite3_finalize(walk.blocks);
	out->expected = walk.counted + out->lost_at_capture;
	if (out->expected < rows + lost_rows)
		out->expected = rows + lost_rows;
	out->lost = out->expected > out->present ? out->expected - out->present : 0;
	return rc == -ECANCELED ? rc : 0;
}
