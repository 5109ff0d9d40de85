/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a verification; for lib/record only. Each file calls only those below it.
 *
 *     verify.c          the recording as a whole: seals, pages, counts, the report
 *     verify_stream.c   one stream: its data compared with its blocks
 *     verify_camera.c   the camera's file compared with its rows
 *     verify_seal.c     the chain of its commits, and a statement
 *     verify_times.c    the tracker's times compared with its arrivals
 *     verify_finding.c  findings and progress
 */
#ifndef INCISE_VERIFY_PRIVATE_H
#define INCISE_VERIFY_PRIVATE_H

#include <incise/seal.h>
#include <incise/verify.h>
#include "../ledger.h"
#include "../read/recording.h"
#include "../seal_chain.h"

/* Work for a frame, in rows: for the share that is done. */
#define INCISE_VERIFY_FRAME_ROWS 100

enum incise_verify_level {
	INCISE_VERIFY_ALL,
	INCISE_VERIFY_ROWS,   /* not camera.mkv, nor all pages */
	INCISE_VERIFY_TABLES, /* nor samples */
};

struct incise_verification {
	struct incise_recording *recording;
	const struct incise_verify_watch *watch;
	struct incise_verify_report *report;
	int64_t origin_ns;	  /* time 0 of the texts: the first row */
	int64_t reported_ns;	  /* last report of progress */
	uint64_t rows, rows_done; /* a frame counts as some rows */
	enum incise_verify_level level;
	bool camera;
	uint64_t frames; /* rows of table frames */
	bool altered;	 /* a finding other than losses and an interruption */
	bool rows_altered, tables_altered;	       /* by the ledger */
	const struct incise_seal_statement *statement; /* to compare with; NULL: none */
	/* The digests that blocks name are those of their data, which the seal takes then. */
	bool hashed;
	struct incise_seal rows_seal;
};

/* As incise_verify(), without what a level leaves out. */
int incise_verify_level(const char *path, enum incise_verify_level level,
			const struct incise_verify_watch *watch,
			struct incise_verify_report *report, struct incise_error *err);

/*
 * Verify a stream, INCISE_LEDGER_*; @rows and @lost are the recorder's counts. Fills @out. Returns 0 or
 * -ECANCELED; a read error of SQLite is a finding.
 */
int incise_verify_stream(struct incise_verification *verify, int stream, uint64_t rows,
			 uint64_t lost, struct incise_verify_stream *out);

/*
 * Verify a recording that was opened as it was recorded, but for a joined one; @statement: to compare with, or NULL. As
 * incise_verify().
 */
int incise_verify_recording(struct incise_recording *recording,
			    const struct incise_verify_watch *watch,
			    enum incise_verify_level level,
			    const struct incise_seal_statement *statement,
			    struct incise_verify_report *report,
			    struct incise_error *err);

/* Verify the frames; fills report->frames. Returns as incise_verify_stream(). */
int incise_verify_camera(struct incise_verification *verify);

/*
 * Recompute the seal, and compare it with the statement. Returns 0 or -ECANCELED; a read error is
 * a finding. What the ledger has reported is not repeated.
 */
int incise_verify_seal(struct incise_verification *verify);

/* Report rows of the tracker whose times are not to be trusted. */
void incise_verify_times(struct incise_verification *verify);

/* An empty finding of a kind. */
struct incise_verify_finding incise_verify_finding(enum incise_verify_kind kind);

/* Report a finding with this text. */
void incise_verify_found(struct incise_verification *verify,
			 struct incise_verify_finding finding, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/* Report that SQLite failed on a table. */
void incise_verify_unreadable(struct incise_verification *verify, const char *stream,
			      const char *table);

/*
 * Report progress, some 10 times a second, as the share of rows_done, or as -1 with @pages.
 * Returns 0 or -ECANCELED.
 */
int incise_verify_progress(struct incise_verification *verify, bool pages);

/* A time as in the texts. */
double incise_verify_s(const struct incise_verification *verify, int64_t t_ns);

/* --- a stream, while it is compared with its blocks, in order ----------------------------- */

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
