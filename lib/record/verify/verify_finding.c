// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Findings and progress of a verification, and of a stream in it; see verify.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include "../../base/monotonic.h"
#include "verify.h"

#define REPORT_NS 100000000LL
/* Sums over a damaged ledger stay in range. */
#define COUNT_MAX (1LL << 53)

double incise_verify_s(const struct incise_verification *verify, int64_t t_ns)
{
	return ((double)t_ns - (double)verify->origin_ns) * 1e-9;
}

struct incise_verify_finding incise_verify_finding(enum incise_verify_kind kind)
{
	return (struct incise_verify_finding){
		.kind = kind,
		.stream = "",
		.first_block = -1,
		.last_block = -1,
		.last_seq = -1,
		.first_ns = -1,
		.last_ns = -1,
	};
}

void incise_verify_found(struct incise_verification *verify,
			 struct incise_verify_finding finding, const char *fmt, ...)
{
	char line[400];
	va_list args;

	va_start(args, fmt);
	vsnprintf(line, sizeof(line), fmt, args);
	va_end(args);
	/* Names and values may come from the file: no control characters. */
	for (char *c = line; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	verify->report->findings++;
	verify->report->unverified |= finding.kind == INCISE_VERIFY_UNVERIFIED;
	verify->altered |= finding.kind != INCISE_VERIFY_LOST &&
			   finding.kind != INCISE_VERIFY_INTERRUPTED &&
			   finding.kind != INCISE_VERIFY_ENDED &&
			   finding.kind != INCISE_VERIFY_TIMES;
	finding.text = line;
	if (verify->watch && verify->watch->found)
		verify->watch->found(verify->watch->user, &finding);
}

void incise_verify_unreadable(struct incise_verification *verify, const char *stream,
			      const char *table)
{
	struct incise_verify_finding finding =
		incise_verify_finding(INCISE_VERIFY_DAMAGED);

	finding.stream = stream;
	incise_verify_found(verify, finding, "table %s cannot be read: %s", table,
			    sqlite3_errmsg(verify->recording->db));
}

int incise_verify_progress(struct incise_verification *verify, bool pages)
{
	double share = verify->rows_done < verify->rows
			       ? (double)verify->rows_done / verify->rows
			       : 1;
	int64_t now_ns;

	if (!verify->watch || !verify->watch->progress)
		return 0;
	now_ns = incise_monotonic_ns();
	if (now_ns - verify->reported_ns < REPORT_NS)
		return 0;
	verify->reported_ns = now_ns;
	return verify->watch->progress(verify->watch->user, pages ? -1 : share)
		       ? -ECANCELED
		       : 0;
}

/* --- of a stream ------------------------------------------------------------------------ */

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
