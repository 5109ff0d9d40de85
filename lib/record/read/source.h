/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A stream of one recording as batches, in order: the only place that knows how its file keeps it.
 *
 *     table blocks ─► decode ───────────────┐
 *     format 4     ─► ../old/old.h ─────────┼─► batch ─► rows.h, Arrow
 *     depth        ─► tracker ─► tip, speed ┘
 *
 * The file is untrusted: what is impossible in a batch is an error that names where; reading may go on
 * behind it.
 */
#ifndef INCISE_SOURCE_H
#define INCISE_SOURCE_H

#include <sqlite3.h>
#include <incise/error.h>
#include "../batch.h"
#include "depth.h"
#include "recording.h"

/* Behind the streams of the ledger: the tip below the surface, with its pose. */
#define INCISE_SOURCE_DEPTH INCISE_LEDGER_FORMS

/* INCISE_LEDGER_* or INCISE_SOURCE_DEPTH by the name of its table; -1: none. */
int incise_source_find(const char *table);

/* The columns of a stream's batches. */
const struct incise_ledger_form *incise_source_form(int stream);

/* The stream of a recording that has the rows; depth has the tracker's. */
struct incise_stream_source *incise_source_stream(
	const struct incise_recording *recording, int stream);

struct incise_source_depth;

struct incise_source {
	struct incise_recording *recording; /* a member of a session */
	int stream;
	sqlite3_stmt *stmt;
	struct incise_batch batch;
	size_t rows_max; /* of a batch, where the file has no blocks */
	bool ended;	 /* another step would begin anew */
	bool held; /* the statement is at a row that did not fit, or a block that did not follow */
	/* The number of the next block, -1: not known; and the last number and time of the block before. */
	int64_t next, last_seq, last_ns;
	struct incise_source_depth *depth; /* what it is made of */
	double scale; /* of depths by vision, of another calibration */
};

/* Returns 0 or -errno. Close it in any case. */
int incise_source_open(struct incise_source *source, struct incise_recording *recording,
		       int stream, struct incise_error *err);

/* The same, from the batch on that has this number or a later one; of depth that of the tracker's. */
int incise_source_open_at(struct incise_source *source,
			  struct incise_recording *recording, int stream,
			  int64_t from_seq, struct incise_error *err);

/*
 * The next batch, of at least one row: 1, 0 at the end, -EINVAL, -EIO, -ENOMEM. Behind an impossible
 * block or row, -EINVAL, the next call goes on.
 */
int incise_source_next(struct incise_source *source, struct incise_error *err);

/*
 * Pass the blocks that end before a time, behind the batch: the next one is the first that does not. Depths begin
 * there anew. Returns 0 or -errno.
 */
int incise_source_pass(struct incise_source *source, int64_t t_ns,
		       struct incise_error *err);

/* Step the statement, once to its end. Returns an SQLite code. */
int incise_source_step(struct incise_source *source);

void incise_source_close(struct incise_source *source);

/*
 * The number of a row of a table that is not behind the first one at this time, and near it; INT64_MIN: from the
 * first on.
 */
int64_t incise_source_seek(struct incise_recording *recording, const char *table,
			   int64_t t_ns);

/*
 * The first or the last sample of a table, as it was recorded: 1, 0: there is none, or as next(). Of
 * depth those of the tracker. @arrival_ns is 0 where there is none, and may be NULL.
 */
int incise_source_end(struct incise_recording *recording, const char *table, bool last,
		      int64_t *seq, int64_t *t_ns, int64_t *arrival_ns,
		      struct incise_error *err);

/* First and last t_ns of a table, on its own clock. Returns whether it has rows. */
bool incise_source_span(struct incise_recording *recording, const char *table,
			int64_t *first_ns, int64_t *last_ns);

#endif
