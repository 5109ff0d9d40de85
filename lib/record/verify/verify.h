/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a verification; for lib/record/verify*.c only.
 *
 *     verify.c          the recording as a whole: pages, counts, the report
 *     verify_stream.c   one stream: its rows against its ledger
 *     verify_camera.c   the camera's file against its rows
 *     verify_seal.c     tables and the head of that file against their seals
 *     verify_finding.c  what is wrong, as a line
 */
#ifndef INCISE_VERIFY_PRIVATE_H
#define INCISE_VERIFY_PRIVATE_H

#include <incise/verify.h>
#include "../ledger.h"
#include "../read/recording.h"

/* What a picture takes, in rows: for the share that is done. */
#define INCISE_VERIFY_PICTURE_ROWS 100

struct incise_verification {
	struct incise_recording *recording;
	const struct incise_verify_watch *watch;
	struct incise_verify_report *report;
	int64_t origin_ns; /* times in lines are seconds from here: the first row */
	int64_t told_ns;   /* progress was told */
	uint64_t rows, rows_done; /* to go through; pictures count as some rows each */
	bool camera;
	uint64_t frames; /* rows of table frames */
	bool altered;	 /* found something else than losses and an interruption */
};

/*
 * Walk through a stream; @rows and @lost as the recorder counted them. Fills @out. Returns
 * 0, or -ECANCELED; what SQLite cannot read is a finding.
 */
int incise_verify_stream(struct incise_verification *verify,
			 const struct incise_ledger_form *form, uint64_t rows,
			 uint64_t lost, struct incise_verify_stream *out);

/*
 * Walk through the pictures; fills report->pictures. Returns 0, or -ECANCELED; what cannot
 * be read is a finding.
 */
int incise_verify_camera(struct incise_verification *verify);

/* What a closed recording has sealed, likewise. */
int incise_verify_seals(struct incise_verification *verify);

/* Nothing but its kind. */
struct incise_verify_finding incise_verify_finding(enum incise_verify_kind kind);

/* Tell of a finding, whose text is made of these. */
void incise_verify_found(struct incise_verification *verify,
			 struct incise_verify_finding *finding, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/* That SQLite failed on a table. */
void incise_verify_unreadable(struct incise_verification *verify, const char *stream,
			      const char *table);

/* Some 10 times a second: tell how far it is. Returns 0 or -ECANCELED. */
int incise_verify_progress(struct incise_verification *verify, double share);

/* A time as it stands in lines. */
double incise_verify_s(const struct incise_verification *verify, int64_t t_ns);

#endif
