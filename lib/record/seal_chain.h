/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The seal of a recording: a chain of SHA-256 over its commits, while it is written or
 * recomputed. It shows that nothing was changed since somebody signed a head of it.
 *
 *     meta of the start ─► genesis ─► head 0 ─► head 1 ─► … ─► last head
 *                                       ▲         ▲               ▲
 *     rows of a commit ─► digest ─┬─► its blocks, number, time    depth, events, knots, meta,
 *                                 └─► chain of each stream        streams, camera.mkv
 *
 * All integers are 64 bits, little-endian. Described for users in incise-recording(5), which
 * tests/attack/forgeries.py implements a second time. Part of libincise-record, on libcrypto.
 */
#ifndef INCISE_SEAL_CHAIN_H
#define INCISE_SEAL_CHAIN_H

#include <stdbool.h>
#include <stdint.h>
#include <sqlite3.h>
#include "../base/crypto/sha256.h"
#include "ledger.h"

#define INCISE_SEAL_BYTES INCISE_SHA256_BYTES

/* Parts with a digest in a statement, in its order; the streams are those of the ledger. */
enum incise_seal_number {
	INCISE_SEAL_START,
	INCISE_SEAL_CONFIGURATION,
	INCISE_SEAL_CALIBRATION,
	INCISE_SEAL_STREAM,
	INCISE_SEAL_DEPTH = INCISE_SEAL_STREAM + INCISE_LEDGER_FORMS,
	INCISE_SEAL_EVENTS,
	INCISE_SEAL_KNOTS,
	INCISE_SEAL_STREAMS,
	INCISE_SEAL_META,
	INCISE_SEAL_FILE,
	INCISE_SEAL_PARTS
};

struct incise_seal {
	bool old; /* of format 4: over rows, and table depth; after the init */
	struct incise_sha256 rows[INCISE_LEDGER_FORMS]; /* of the open blocks */
	struct incise_sha256 commit;			/* of the open commit */
	int64_t next;					/* number of the open commit */
	int64_t blocks[INCISE_LEDGER_FORMS];		/* so far */
	uint64_t n_rows[INCISE_LEDGER_FORMS];		/* so far */
	uint8_t chain[INCISE_LEDGER_FORMS][INCISE_SEAL_BYTES];
	uint8_t head[INCISE_SEAL_BYTES];
};

/* Returns 0, or -ENOMEM: libcrypto gives no SHA-256. Free it in any case. */
int incise_seal_init(struct incise_seal *seal);
void incise_seal_free(struct incise_seal *seal);

/* The genesis: start the chain over the parts of table meta that are never rewritten. */
int incise_seal_start(struct incise_seal *seal, sqlite3 *db);

/* Go on from another head than the last: that of the table, where it is not the recomputed one. */
void incise_seal_resume(struct incise_seal *seal, const uint8_t head[INCISE_SEAL_BYTES]);

/* A row of a stream's open block, then the block, with their digest. Within a commit: streams in their order. */
void incise_seal_row(struct incise_seal *seal, int stream, const void *bytes, size_t n);
void incise_seal_block(struct incise_seal *seal, int stream,
		       const struct incise_ledger_block *block,
		       uint8_t digest[INCISE_SEAL_BYTES]);

/* A block whose rows have this digest. */
void incise_seal_rows_block(struct incise_seal *seal, int stream,
			    const struct incise_ledger_block *block,
			    const uint8_t digest[INCISE_SEAL_BYTES]);

/* A block of today's format, whose digest is that of its data. */
void incise_seal_data(struct incise_seal *seal, int stream,
		      const struct incise_ledger_block *block, const void *data,
		      size_t size, uint8_t digest[INCISE_SEAL_BYTES]);

/* The tables without blocks and camera.mkv (-1: none), before the last commit. SQLite's code. */
int incise_seal_tables(struct incise_seal *seal, sqlite3 *db, int fd, int64_t length);

/* End the commit: its head is in seal->head. False: libcrypto has failed. */
bool incise_seal_commit(struct incise_seal *seal, int64_t t_ns);

/*
 * The digest of a part of meta or of a table, and the number of its rows. Returns an SQLite code;
 * SQLITE_NOMEM where libcrypto failed.
 */
int incise_seal_table(const struct incise_seal *seal, sqlite3 *db,
		      enum incise_seal_number part, uint64_t *rows,
		      uint8_t digest[INCISE_SEAL_BYTES]);

/* Compute the digest of camera.mkv: its head, and its length, 0 where it is not known. Returns 0 or -errno. */
int incise_seal_file(int fd, int64_t length, uint8_t digest[INCISE_SEAL_BYTES]);

#endif
