/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Seals of what has no blocks in the ledger: tables that are written over and over while a
 * recording goes on, and the head of camera.mkv. Made once, when all is written, in the
 * transaction that says that it is complete; made again to verify. Described for users in
 * incise-recording(5).
 */
#ifndef INCISE_LEDGER_SEAL_H
#define INCISE_LEDGER_SEAL_H

#include <sqlite3.h>
#include "ledger.h"

#define INCISE_LEDGER_TABLE "table:" /* and the name, as stream */
#define INCISE_LEDGER_HEAD "file:camera.mkv"

/* NULL behind the last. */
extern const char *const incise_ledger_sealed[];

/*
 * What the ledger says of one of these tables: its rows are count, and crc is over all of
 * them in a fixed order, then over the fields of the entry. Of each value a letter and then
 *
 *     i  8 bytes     r  8 bytes     t, b  8 bytes of length, the bytes     n  nothing
 *
 * little-endian; t is UTF-8. Returns an SQLite code; SQLITE_ERROR for another table.
 */
int incise_ledger_seal(sqlite3 *db, const char *table, struct incise_ledger_block *block);

/*
 * Of an open camera.mkv what is before its first picture, which says how to decode them:
 * count is bytes. The file's offset is not used. Returns 0 or a negative errno.
 */
int incise_ledger_seal_head(int fd, struct incise_ledger_block *block);

#endif
