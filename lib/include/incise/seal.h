/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The seal of a recording: a chain of SHA-256 over its commits, and the statement, a small text
 * that says all of it in digests. A person who signs or time-stamps the statement vouches for the
 * recording as it was then; see incise-recording(5). Part of libincise-record.
 */
#ifndef INCISE_SEAL_H
#define INCISE_SEAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/verify.h>

INCISE_BEGIN_DECLS

struct incise_recording;

/** Largest length of the text of a statement, bytes, with a NUL behind it. */
#define INCISE_STATEMENT_MAX 16384
/** Largest number of heads before the last one. */
#define INCISE_STATEMENT_EARLIER 100
/** Number of parts. */
#define INCISE_STATEMENT_PARTS 13

/** A head of the chain: all until this commit follows from it. */
struct incise_seal_head {
	int64_t commit; /**< number, from 0 */
	int64_t t_ns;	/**< CLOCK_MONOTONIC of the recording machine */
	char head[65];	/**< SHA-256, 64 lower-case hexadecimal digits */
};

/** A part of a recording. */
struct incise_seal_part {
	/**
	 * start, configuration, calibration, force, tracker, camera, wall, depth, events, knots,
	 * streams, meta, camera.mkv, in this order
	 */
	char name[16];
	uint64_t
		rows; /**< rows or keys; camera.mkv: its length in bytes, 0 before the end */
	char digest[65]; /**< SHA-256, 64 lower-case hexadecimal digits */
};

/**
 * A statement. Its text has a line for each field, in this order, and ends with a line "end":
 *
 *     incise statement 1
 *     identity 0123456789abcdef0123456789abcdef
 *     name liver
 *     software 3.1.0
 *     host rig2
 *     started 2026-11-27T09:00:00Z
 *     complete yes
 *     commit 97 1234567890 0123…             number, t_ns, head
 *     part start 6 0123…                     name, rows, digest; 13 of them
 *     earlier 0 1200000000 0123…             at most 100, evenly spread
 *     end
 */
struct incise_seal_statement {
	char identity[33]; /**< 16 random bytes of the recording, in hexadecimal */
	char name[256];	   /**< of its folder, without .rec: only to be read by people */
	char software[64]; /**< version of incise that recorded it */
	char host[128];
	char started[32]; /**< wall clock, ISO 8601 UTC */
	bool complete;	  /**< closed by its recorder */
	struct incise_seal_head last;
	struct incise_seal_part parts[INCISE_STATEMENT_PARTS];
	int n_earlier; /**< the smaller of last.commit and 100 */
	/** of commits i · last.commit / n_earlier */
	struct incise_seal_head earlier[INCISE_STATEMENT_EARLIER];
};

/**
 * Make the statement of a recording, also of one that was interrupted, from its rows. Memory does
 * not grow with the recording. camera.mkv is not read: its rows have the digest of each frame;
 * incise_verify() compares them. The same recording gives the same text.
 *
 * @param path as for incise_recording_open()
 * @return text, to be freed with free(3); NULL with errno ENODATA (it has no sealed
 *         commit), ENOTSUP (a joined recording: each of its members has its own statement),
 *         EBADMSG (its rows differ from its seal), or as of incise_recording_open(). Thread-safe.
 */
INCISE_API char *incise_seal_statement(const char *path, struct incise_error *err);

/**
 * Read a statement. Accepts exactly the form that incise_seal_statement() writes.
 *
 * @param text need not end with a NUL
 * @return 0; -EINVAL, and @p err has the line. Thread-safe.
 */
INCISE_API int incise_seal_read(struct incise_seal_statement *statement, const char *text,
				size_t length, struct incise_error *err);

/**
 * Verify a recording, as incise_verify() does, and compare it with a statement. Each difference
 * is a finding of kind INCISE_VERIFY_SEAL that names the part and from where on: another
 * recording's statement, a part that differs, a recording that ends with an older commit, or has
 * commits after the last one in the statement.
 *
 * @param watch may be NULL
 * @return 0: report->sealed: whether it agrees with the statement; -EINVAL: not a statement;
 *         otherwise as incise_verify(); -ENODATA, -ENOTSUP as errno of incise_seal_statement()
 */
INCISE_API int incise_seal_compare(const char *path, const char *text, size_t length,
				   const struct incise_verify_watch *watch,
				   struct incise_verify_report *report,
				   struct incise_error *err);

/**
 * Get identity and last head of an opened recording as they are in its tables, without
 * recomputing them: to write them into files that are made of it.
 *
 * @param identity 32 hexadecimal digits and a NUL
 * @return 0; -ENODATA (no commit), -ENOTSUP (joined), -EINVAL, -EIO.
 */
INCISE_API int incise_seal_head(struct incise_recording *recording, char identity[33],
				struct incise_seal_head *head, struct incise_error *err);

/**
 * Whether an opened recording was converted from one of an older format with this last head, 64
 * hexadecimal digits: files made of that, and its signatures, cover the same samples.
 */
INCISE_API bool incise_seal_before(struct incise_recording *recording, const char *head);

INCISE_END_DECLS
#endif
