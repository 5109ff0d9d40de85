/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Proof that a recording is complete: the ledger is recomputed from the rows, the frames of
 * the camera are compared with their rows, the seals are computed again, and SQLite checks its
 * pages. See table ledger in incise-recording(5). Part of libincise-record.
 */
#ifndef INCISE_VERIFY_H
#define INCISE_VERIFY_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Kinds of findings. */
enum incise_verify_kind {
	INCISE_VERIFY_LOST,    /**< samples are missing between two rows, or at the end */
	INCISE_VERIFY_ALTERED, /**< rows of some blocks or of a sealed table, or the ledger,
					differ from those written */
	INCISE_VERIFY_LEDGER,	   /**< blocks of the ledger are missing or impossible */
	INCISE_VERIFY_EXTRA,	   /**< rows that no block holds */
	INCISE_VERIFY_COUNT,	   /**< the recorder's count differs */
	INCISE_VERIFY_INTERRUPTED, /**< not closed: it ends with its last commit */
	INCISE_VERIFY_FRAMES,	  /**< frames of the camera's file are missing, altered or
					in no row */
	INCISE_VERIFY_UNVERIFIED, /**< not checked, because a module is missing */
	INCISE_VERIFY_DAMAGED,	  /**< SQLite cannot read it, or its pages do not agree */
	INCISE_VERIFY_ENDED,	  /**< a device was gone before the recording ended */
	INCISE_VERIFY_TIMES, /**< rows of the tracker whose t_ns is not to be trusted, by
				  their arrivals; readers time them by these */
};

/** One finding and its place. */
struct incise_verify_finding {
	enum incise_verify_kind kind;
	const char *stream;		 /**< "force", "tracker", "camera"; "": all */
	int64_t first_block, last_block; /**< ALTERED and LEDGER; else -1 */
	int64_t first_seq, last_seq;	 /**< numbers; last < first: not known */
	int64_t first_ns, last_ns; /**< LOST: of the rows around; else of the numbers;
					     CLOCK_MONOTONIC, -1: not known */
	uint64_t count;		   /**< of the samples, rows or blocks */
	const char *text;	   /**< all that as one line; valid during the call */
};

/** Streams that a recording has at most. */
#define INCISE_VERIFY_STREAMS 3

/** One stream. */
struct incise_verify_stream {
	char name[16];
	uint64_t expected; /**< samples from the first to the last one */
	uint64_t present;  /**< rows */
	uint64_t
		lost; /**< expected and not present, whether lost when captured or later */
	uint64_t lost_at_capture; /**< of these, those in the ledger */
	uint64_t blocks;	  /**< of the ledger */
	uint64_t altered; /**< blocks that are missing or do not agree with the rows */
};

/** The camera's file compared with the rows of the camera. All 0 without a camera. */
struct incise_verify_frames {
	bool checked;	  /**< the file was read to its end */
	uint64_t present; /**< as they were written */
	uint64_t missing, altered;
	uint64_t extra; /**< without a row */
	uint64_t ahead; /**< behind the last row of an interrupted recording, or the one
			     during which the camera died: no fault */
};

/** All findings, in sum. */
struct incise_verify_report {
	bool complete;	 /**< closed, nothing lost, nothing altered: no findings */
	bool intact;	 /**< all that was committed is present and unaltered; samples may
			       have been lost before */
	bool unverified; /**< something could not be checked; then it is not intact */
	bool interrupted; /**< not closed, or being written */
	uint64_t findings;
	int n_streams;
	struct incise_verify_stream streams[INCISE_VERIFY_STREAMS];
	struct incise_verify_frames frames;
};

/** Callbacks; any may be NULL. */
struct incise_verify_watch {
	void (*found)(void *user, const struct incise_verify_finding *finding);
	/** Some 10 times a second; @p share from 0 to 1, or -1 while SQLite checks its pages,
	    which reports no share. Another return value than 0 stops it. */
	int (*progress)(void *user, double share);
	void *user;
};

/**
 * Verify a recording, or what is left of an interrupted one, up to its last commit. Its
 * memory grows with the tracker's rows alone, 80 bytes each; a recording that is being written may be
 * verified too.
 *
 * @param path  as of incise_recording_open()
 * @param watch may be NULL
 * @return 0: report->complete has the answer; -ENODATA: a recording of form 1, which has no
 *         ledger; -ECANCELED: stopped by @p watch; of incise_recording_open(), for example
 *         -EINVAL for a file that is too damaged to be opened.
 */
INCISE_API int incise_verify(const char *path, const struct incise_verify_watch *watch,
			     struct incise_verify_report *report,
			     struct incise_error *err);

/**
 * The same for what a program is about to read: the rows, their ledger and the seals of the
 * tables, but neither camera.mkv nor SQLite's own check of every page. report->frames is 0.
 */
INCISE_API int incise_verify_rows(const char *path,
				  const struct incise_verify_watch *watch,
				  struct incise_verify_report *report,
				  struct incise_error *err);

INCISE_END_DECLS
#endif
