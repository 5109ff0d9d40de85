/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The ledger of a recording: the rows that each stream was written with, in blocks of one
 * commit each. It shows later which rows are missing or altered.
 *
 *     rows    ├─ block 0 ─┤├─ block 1 ─┤├─ … ─┤ end
 *     CRC32C  0 ─────────► c0 ────────► c1 … ► cn          each goes on from the one before
 *
 * A block's CRC is that of its rows and then of its own fields (all of them but the name of
 * the stream and the CRC), each integer 64 bits, little-endian. The end is a block without
 * rows: its count is 0, and its lost are the samples that the device lost and that no gap
 * in the numbers shows. Tables without blocks are sealed. Described for users in
 * incise-recording(5).
 */
#ifndef INCISE_LEDGER_H
#define INCISE_LEDGER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sqlite3.h>
#include "frames.h"

/* A stream, its table, and the encoding of its columns. */
struct incise_ledger_form {
	const char *stream, *table;
	const char *columns; /* seq and t_ns are first */
	/*
	 * Of each column: i integer, r real, n real or NULL, c one character, s a text of at most
	 * INCISE_LEDGER_TEXT bytes, h a digest; see below.
	 */
	const char *types;
};

enum {
	INCISE_LEDGER_FORCE,
	INCISE_LEDGER_TRACKER,
	INCISE_LEDGER_CAMERA,
	INCISE_LEDGER_STREAMS,
	/* Not of a device: readings of the computer's clocks. */
	INCISE_LEDGER_WALL = INCISE_LEDGER_STREAMS,
	INCISE_LEDGER_FORMS
};

extern const struct incise_ledger_form incise_ledger_forms[INCISE_LEDGER_FORMS];

#define INCISE_LEDGER_TEXT 23
#define INCISE_LEDGER_DIGEST 32 /* bytes of SHA-256 */

/* As in table ledger. */
struct incise_ledger_block {
	int64_t block;
	int64_t first_seq, last_seq;
	int64_t first_ns, last_ns;
	int64_t count; /* rows */
	int64_t lost;  /* gaps in their numbers, before the first and within */
	uint32_t crc;
};

/* One stream's, while it is written or recomputed. */
struct incise_ledger {
	bool started;		   /* there were rows */
	int64_t last_seq, last_ns; /* of the row before; -1 and 0 before the first */
	uint64_t lost;		   /* of all blocks so far */
	struct incise_ledger_block open; /* crc: of its rows so far */
};

void incise_ledger_init(struct incise_ledger *ledger);

/* Add the next row; numbers increase. */
void incise_ledger_count(struct incise_ledger *ledger, int64_t seq, int64_t t_ns);

/* End the block. Returns false, and does nothing, when it has no rows. */
bool incise_ledger_end(struct incise_ledger *ledger, struct incise_ledger_block *block);

/* The CRC of a block: that of its data, and then of its fields. */
void incise_ledger_crc(struct incise_ledger_block *block, const void *data, size_t size);

/* End the ledger after the last block; @lost: losses that no gap shows. */
void incise_ledger_close(struct incise_ledger *ledger, uint64_t lost,
			 struct incise_ledger_block *block);

/*
 * Select the blocks of a stream, or the seals of a name, from a block on, INT64_MIN: all, in order, or the last one
 * first. Returns an SQLite code.
 */
int incise_ledger_select(sqlite3 *db, const char *stream, int64_t from_block,
			 bool from_end, sqlite3_stmt **stmt);

/* The first block that ends with this number, or @by_time at this time, or later; by bisection. */
int64_t incise_ledger_find(sqlite3 *db, const char *stream, bool by_time, int64_t value);

/* Read the entry of a row of that. False: a value is impossible in any entry. */
bool incise_ledger_block_read(struct incise_ledger_block *block, sqlite3_stmt *stmt);

/* The data of that block, until the next step. False: they do not agree with its CRC. */
bool incise_ledger_data(sqlite3_stmt *stmt, const struct incise_ledger_block *block,
			const void **data, size_t *size);

/* And the digest of its data that was written, or NULL. */
const uint8_t *incise_ledger_digest(sqlite3_stmt *stmt);

bool incise_ledger_same(const struct incise_ledger_block *a,
			const struct incise_ledger_block *b);

/* --- seals ------------------------------------------------------------------------- */

/*
 * Tables without blocks (they are rewritten while a recording goes on) and the head and length
 * of camera.mkv are sealed once, in the transaction that marks the recording complete, and sealed
 * again to verify it.
 */
#define INCISE_LEDGER_TABLE "table:" /* and the name, as stream */
#define INCISE_LEDGER_FILE "file:camera.mkv"

/* Names of the sealed tables; ends with NULL. */
extern const char *const incise_ledger_sealed[];

/*
 * The ledger's entry of one of these tables: count is the number of its rows, crc is over all
 * of them in a fixed order, then over the fields of the entry. Of each value a letter and then
 *
 *     i  8 bytes     r  8 bytes     t, b  8 bytes of length, the bytes     n  nothing
 *
 * little-endian; t is UTF-8. Returns an SQLite code; SQLITE_ERROR for another table.
 */
int incise_ledger_seal(sqlite3 *db, const char *table, struct incise_ledger_block *block);

/* Pass the values that a SELECT returns to a sink, encoded so. NULL is an error of SQLite. */
typedef void (*incise_ledger_sink)(void *user, const void *bytes, size_t n);
int incise_ledger_values(sqlite3 *db, const char *sql, incise_ledger_sink sink,
			 void *user, uint64_t *rows);

/* The SELECT of such a table; NULL for another. */
const char *incise_ledger_sql(const char *table);

/*
 * The entry of camera.mkv: count is the bytes of its head, those before the first frame, which
 * a decoder needs; last_seq is the length of the file, which is @length, 0 where it is not known.
 * The offset of @fd is not used. Returns 0 or a negative errno.
 */
int incise_ledger_seal_file(int fd, int64_t length, struct incise_ledger_block *block);

/* Read these bytes, to be freed. Returns 0 or a negative errno. */
int incise_ledger_file_head(int fd, uint8_t **bytes, size_t *size);

#endif
