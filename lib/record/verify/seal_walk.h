/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The seal of a recording recomputed from its rows, commit by commit; or from the digests of its
 * blocks, where another has read all rows. Memory does not grow with the recording, and a commit that does
 * not agree does not affect those after it.
 *
 *     rows of 4 streams ─┐
 *     their ledgers ─────┼─► a commit ─► head, compared with that of table seal
 *     table seal ────────┘
 */
#ifndef INCISE_SEAL_WALK_H
#define INCISE_SEAL_WALK_H

#include <incise/seal.h>
#include "../old/old.h"
#include "../seal_chain.h"
#include "../statement.h"

struct incise_seal_walk_stream {
	sqlite3_stmt *blocks;
	struct incise_old_rows rows; /* of format 4: at the next one */
	bool ended;		     /* no block is left */
};

struct incise_seal_walk {
	struct incise_recording *recording;
	struct incise_seal seal; /* after the commit */
	sqlite3_stmt *commits;
	struct incise_seal_walk_stream streams[INCISE_LEDGER_FORMS];
	bool known;   /* blocks have the digests that they name */
	int64_t last; /* number of the last commit; -1: there is none */
	/* The commit. */
	int64_t number, t_ns;
	bool good; /* it is what its rows give */
};

/* Behind the last commit: the number of rows, and whether the ledger has blocks. */
uint64_t incise_seal_walk_behind(struct incise_seal_walk *walk, bool *blocks);

/*
 * Fill a statement from a recording up to commit @upto, -1: the last one. @known: a verification has seen that
 * blocks have the digests that they name. @step is called after
 * each commit of the whole recording, and may stop it with its result. A recording that ends
 * before @upto has fewer heads: those behind have an empty text.
 */
int incise_statement_make(struct incise_seal_statement *statement,
			  struct incise_recording *recording, bool known, int64_t upto,
			  int (*step)(void *user, struct incise_seal_walk *walk),
			  void *user, struct incise_error *err);

/* A text for one line. */
void incise_seal_line(char *to, size_t size, const char *text);

/* Text of a key of table meta, "" if it has none. Returns 0 or -errno. */
int incise_seal_key(struct incise_recording *recording, const char *key, char *to,
		    size_t size, struct incise_error *err);

int incise_seal_identity(struct incise_recording *recording, char identity[33],
			 struct incise_error *err);

/* Whether a recording can have a seal: 0; -ENOTSUP. */
int incise_seal_possible(const struct incise_recording *recording,
			 struct incise_error *err);

#endif
