// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Findings of a stream that is compared with its blocks; see verify_walk.h.
 */
#include <errno.h>
#include <stdio.h>
#include "verify_walk.h"

/* Sums over a damaged ledger stay in range. */
#define COUNT_MAX (1LL << 53)

struct incise_verify_finding incise_verify_walk_finding(
	const struct incise_verify_walk *walk, enum incise_verify_kind kind)
{
	struct incise_verify_finding found = incise_verify_finding(kind);

	found.stream = walk->form->stream;
	return found;
}

void incise_verify_lost(struct incise_verify_walk *walk, int64_t first, int64_t last,
			int64_t after_ns)
{
	struct incise_verify_finding found =
		incise_verify_walk_finding(walk, INCISE_VERIFY_LOST);
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
		incise_verify_found(walk->verify, found, "%s: %llu missing, %s: all",
				    walk->form->stream, (unsigned long long)count,
				    number);
	else if (after_ns < 0)
		incise_verify_found(walk->verify, found,
				    "%s: %llu missing at the end, %s, after %.4f s",
				    walk->form->stream, (unsigned long long)count, number,
				    incise_verify_s(walk->verify, walk->last_ns));
	else
		incise_verify_found(walk->verify, found,
				    "%s: %llu missing, %s, before %.4f s",
				    walk->form->stream, (unsigned long long)count, number,
				    incise_verify_s(walk->verify, after_ns));
}

void incise_verify_flush(struct incise_verify_walk *walk)
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
	incise_verify_found(walk->verify, *found,
			    "%s: %s altered, numbers %lld to %lld, %.4f to %.4f s: %s",
			    walk->form->stream, blocks, (long long)found->first_seq,
			    (long long)found->last_seq,
			    incise_verify_s(walk->verify, found->first_ns),
			    incise_verify_s(walk->verify, found->last_ns), what);
	*found = incise_verify_walk_finding(walk, INCISE_VERIFY_ALTERED);
	walk->altered_rows = 0;
}

void incise_verify_add_altered(struct incise_verify_walk *walk,
			       const struct incise_ledger_block *block, uint64_t rows)
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

bool incise_verify_read_block(struct incise_verify_walk *walk,
			      struct incise_ledger_block *block)
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

int incise_verify_step_block(struct incise_verify_walk *walk)
{
	int rc = sqlite3_step(walk->blocks);

	if (rc == SQLITE_ROW || rc == SQLITE_DONE)
		return rc == SQLITE_ROW;
	incise_verify_unreadable(walk->verify, walk->form->stream, "ledger");
	return -EIO;
}

void incise_verify_count_block(struct incise_verify_walk *walk,
			       const struct incise_ledger_block *block)
{
	walk->out->blocks++;
	if (walk->counted < COUNT_MAX && walk->out->lost_at_capture < COUNT_MAX) {
		walk->counted += block->count;
		walk->out->lost_at_capture += block->lost;
	}
}

void incise_verify_no_end(struct incise_verify_walk *walk)
{
	struct incise_verify_finding found =
		incise_verify_walk_finding(walk, INCISE_VERIFY_LEDGER);

	if (walk->verify->report->interrupted)
		return;
	found.first_block = found.last_block = walk->next;
	incise_verify_found(walk->verify, found,
			    "%s: the ledger has no end: its last blocks were removed",
			    walk->form->stream);
}
