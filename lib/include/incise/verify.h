/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Proof that a recording is complete. It recomputes ledger and seal from the rows, compares the
 * frames of the camera with their rows, recomputes the seals, and lets SQLite check its pages.
 * See table ledger in incise-recording(5). Part of libincise-record.
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
	INCISE_VERIFY_LOST, /**< samples are missing between two rows, or at the end */
	/** Rows of blocks or of a sealed table, or the ledger, differ from those written. */
	INCISE_VERIFY_ALTERED,
	INCISE_VERIFY_LEDGER,	   /**< blocks of the ledger are missing or invalid */
	INCISE_VERIFY_EXTRA,	   /**< rows without a block */
	INCISE_VERIFY_COUNT,	   /**< the recorder's count differs */
	INCISE_VERIFY_INTERRUPTED, /**< not closed: ends with its last commit */
	INCISE_VERIFY_FRAMES,	   /**< frames are missing, altered or without a row */
	INCISE_VERIFY_UNVERIFIED,  /**< not checked, because a module is missing */
	/** SQLite cannot read it, or its pages are inconsistent */
	INCISE_VERIFY_DAMAGED,
	INCISE_VERIFY_ENDED, /**< a device failed before the recording ended */
	INCISE_VERIFY_TIMES, /**< t_ns of tracker rows is wrong; arrivals are used */
	/** rows, though their ledger agrees, or a statement differ from the seal; see incise/seal.h */
	INCISE_VERIFY_SEAL,
};

/** One finding and its place. */
struct incise_verify_finding {
	enum incise_verify_kind kind;
	/** "force", "tracker", "camera"; "": all; of SEAL: the part, see incise_seal_part */
	const char *stream;
	int64_t first_block, last_block; /**< ALTERED, LEDGER; SEAL: commits; else -1 */
	int64_t first_seq, last_seq;	 /**< numbers; last < first: unknown */
	/** CLOCK_MONOTONIC; LOST: of the rows around; else of the numbers; -1: unknown. */
	int64_t first_ns, last_ns;
	uint64_t count;	  /**< number of samples, rows or blocks */
	const char *text; /**< one line; valid during the call */
};

/** Largest number of streams of a recording. */
#define INCISE_VERIFY_STREAMS 3

/** Findings of a stream. */
struct incise_verify_stream {
	char name[16];
	uint64_t expected;	  /**< samples from the first to the last */
	uint64_t present;	  /**< rows */
	uint64_t lost;		  /**< expected and not present */
	uint64_t lost_at_capture; /**< lost ones in the ledger */
	uint64_t blocks;	  /**< blocks of the ledger */
	uint64_t altered;	  /**< blocks that are missing or differ from the rows */
};

/** The camera's file compared with the rows of the camera. All 0 without a camera. */
struct incise_verify_frames {
	bool checked;	  /**< the file was read to its end */
	uint64_t present; /**< frames as they were written */
	uint64_t missing, altered;
	uint64_t extra; /**< frames without a row */
	/** After the last row of an interrupted recording or a failed camera: not an error. */
	uint64_t ahead;
};

/** Summary of all findings. */
struct incise_verify_report {
	bool complete; /**< closed, nothing lost, nothing altered */
	/** All committed data are present and unaltered; samples may have been lost before. */
	bool intact;
	bool unverified;  /**< a part could not be checked; then intact is false */
	bool interrupted; /**< not closed, or being written */
	uint64_t findings;
	int n_streams;
	struct incise_verify_stream streams[INCISE_VERIFY_STREAMS];
	struct incise_verify_frames frames;
	/** Its seal agrees, and the statement that it was compared with; false without a seal. */
	bool sealed;
	uint64_t commits; /**< in the seal; 0: it has none */
};

/** Callbacks; any may be NULL. */
struct incise_verify_watch {
	void (*found)(void *user, const struct incise_verify_finding *finding);
	/**
	 * Called about 10 times a second with the completed share, 0 to 1, or -1 while SQLite
	 * checks its pages. A value other than 0 stops the check.
	 */
	int (*progress)(void *user, double share);
	void *user;
};

/**
 * Verify a recording; an interrupted or running one up to its last commit. Memory grows only
 * with the tracker's rows, 80 bytes each.
 *
 * @param path  as for incise_recording_open()
 * @param watch may be NULL
 * @return 0: report->complete has the result; -ECANCELED: stopped by @p watch; negative errno of incise_recording_open(),
 *         for example -EINVAL for a file that is too damaged to open.
 */
INCISE_API int incise_verify(const char *path, const struct incise_verify_watch *watch,
			     struct incise_verify_report *report,
			     struct incise_error *err);

INCISE_END_DECLS
#endif
