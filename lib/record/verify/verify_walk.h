/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A stream while it is compared with its blocks, in order, and what is found of it; see verify.h.
 */
#ifndef INCISE_VERIFY_WALK_H
#define INCISE_VERIFY_WALK_H

#include "verify.h"

struct incise_verify_walk {
	struct incise_verification *verify;
	const struct incise_ledger_form *form;
	int stream;
	struct incise_verify_stream *out;
	sqlite3_stmt *blocks;
	bool known;   /* last_seq and last_ns: of a row, or of the ledger's start */
	bool follows; /* the block before was as it was written */
	int64_t last_seq, last_ns;
	uint64_t counted;		      /* rows, by the ledger */
	int64_t next;			      /* block */
	struct incise_verify_finding altered; /* blocks in a row; first_block -1: none */
	uint64_t altered_rows;		      /* rows that they have */
};

struct incise_verify_finding incise_verify_walk_finding(
	const struct incise_verify_walk *walk, enum incise_verify_kind kind);

/* Go to the next block: 1, 0 at the end, -EIO. */
int incise_verify_step_block(struct incise_verify_walk *walk);

/* Read it. Returns false if it is impossible. */
bool incise_verify_read_block(struct incise_verify_walk *walk,
			      struct incise_ledger_block *block);

void incise_verify_count_block(struct incise_verify_walk *walk,
			       const struct incise_ledger_block *block);

/* Add a block that does not agree, and the rows that it has, to those that flush reports. */
void incise_verify_add_altered(struct incise_verify_walk *walk,
			       const struct incise_ledger_block *block, uint64_t rows);
void incise_verify_flush(struct incise_verify_walk *walk);

/* Report missing samples from @first to @last; the row after them is at @after_ns, or -1. */
void incise_verify_lost(struct incise_verify_walk *walk, int64_t first, int64_t last,
			int64_t after_ns);

void incise_verify_no_end(struct incise_verify_walk *walk);

#endif
