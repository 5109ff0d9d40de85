/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a verification; for lib/record only. Each file calls only those below it.
 *
 *     verify.c          the recording as a whole: seals, pages, counts, the report
 *     verify_stream.c   one stream: its rows compared with its ledger
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
#include "seal_walk.h"

/* Work for a frame, in rows: for the share that is done. */
#define INCISE_VERIFY_FRAME_ROWS 100

struct incise_verification {
	struct incise_recording *recording;
	const struct incise_verify_watch *watch;
	struct incise_verify_report *report;
	int64_t origin_ns;	  /* time 0 of the texts: the first row */
	int64_t reported_ns;	  /* last report of progress */
	uint64_t rows, rows_done; /* a frame counts as some rows */
	enum incise_verify_level {
		INCISE_VERIFY_ALL,
		INCISE_VERIFY_ROWS,   /* not camera.mkv, nor all pages */
		INCISE_VERIFY_TABLES, /* nor samples */
	} level;
	bool camera;
	uint64_t frames; /* rows of table frames */
	bool altered;	 /* a finding other than losses and an interruption */
	bool rows_altered, tables_altered;	       /* by the ledger */
	const struct incise_seal_statement *statement; /* to compare with; NULL: none */
	/* Digests of the blocks, which the streams give to the seal: rows are read once. */
	bool hashed;
	struct incise_seal rows_seal;
	struct incise_seal_digests digests[INCISE_LEDGER_FORMS];
};

/* As incise_verify(), without what INCISE_VERIFY_ROWS and INCISE_VERIFY_TABLES leave out. */
int incise_verify_rows(const char *path, const struct incise_verify_watch *watch,
		       struct incise_verify_report *report, struct incise_error *err);
int incise_verify_tables(const char *path, const struct incise_verify_watch *watch,
			 struct incise_verify_report *report, struct incise_error *err);

/*
 * Verify a stream, INCISE_LEDGER_*; @rows and @lost are the recorder's counts. Fills @out. Returns 0 or
 * -ECANCELED; a read error of SQLite is a finding.
 */
int incise_verify_stream(struct incise_verification *verify, int stream, uint64_t rows,
			 uint64_t lost, struct incise_verify_stream *out);

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
			 struct incise_verify_finding *finding, const char *fmt, ...)
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

#endif
