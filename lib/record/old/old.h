/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Recordings of an older incise, of formats 1 to 4: a row a sample. No other folder knows how they are kept.
 *
 *     1   force, tracker (without station and button), depth, events, meta     ╮
 *     2   and frames (without a digest), streams, knots, ledger                ├ only to be converted
 *     3   and wall                                                             ╯
 *     4   and seal, over rows; a digest of each frame                            read by all
 *
 * Temporary tables and views give those of format 1 to 3 what format 4 has, and make table blocks, without data, of
 * the ledger's entries of streams.
 *
 *     old_format.c    tables, views, batches of rows
 *     old_ledger.c    rows as the ledger and the seal have them
 *     old_verify.c    a stream compared with its ledger, row by row
 *     convert.c       one of today's format
 */
#ifndef INCISE_OLD_H
#define INCISE_OLD_H

#include "../read/source.h"

struct incise_verification;
struct incise_verify_walk;

/* The part of an opened recording that is of an old format. */
struct incise_old {
	/* As in source.h: open a stream, its last rows first or from a number on; an SQLite code. */
	int (*open)(struct incise_source *source, int64_t from_seq, bool from_end);
	int (*next)(struct incise_source *source, struct incise_error *err);
	/* The number of the first row from a time on; INT64_MIN: there is none. */
	int64_t (*seek)(struct incise_recording *recording, int stream, int64_t t_ns);
	/* As incise_session_identity(). */
	char *(*identity)(struct incise_recording *recording);
};

/*
 * Check the tables of a recording that has an older format, and set recording->old. Returns 0; -ENOTSUP: of format 1
 * to 3, unless @any; -EINVAL, -EIO.
 */
int incise_old_adopt(struct incise_recording *recording, bool any,
		     struct incise_error *err);

/* Whether it has a seal. */
bool incise_old_is_sealed(const struct incise_recording *recording);

/* --- rows as the ledger has them -------------------------------------------------------- */

/*
 * A row, encoded: integers and reals (IEEE 754) as 8 bytes, little-endian, a character as
 * one, a text with zeros up to 24 bytes, a digest as its 32. Minus zero is zero, since SQLite keeps no minus zero;
 * NULL is the NaN 0x7ff8000000000000, since it keeps no NaN.
 */
struct incise_old_rows {
	sqlite3_stmt *stmt;
	const struct incise_ledger_form *form;
	bool has_row, good; /* good: its columns have the right types */
	int64_t seq, t_ns;
	size_t n;
	uint8_t bytes[20 * 8];
};

/* Open the rows of a stream, in order. Returns an SQLite code; close them in any case. */
int incise_old_rows_open(struct incise_old_rows *rows, struct incise_recording *recording,
			 int stream);

/* Go to the next. Returns SQLITE_OK, also at the end, or another code. */
int incise_old_rows_next(struct incise_old_rows *rows);

void incise_old_rows_close(struct incise_old_rows *rows);

/* Add the row to a ledger. */
void incise_old_ledger_add(struct incise_ledger *ledger,
			   const struct incise_old_rows *rows);

/* --- verification ------------------------------------------------------------------------ */

/* Compare a stream with its ledger. Returns 0, -EIO, -ECANCELED. */
int incise_old_verify_stream(struct incise_verify_walk *walk);

/* Compare table depth of an interrupted recording with its count; a closed one has a seal of it. */
void incise_old_verify_depth(struct incise_verification *verify);

#endif
