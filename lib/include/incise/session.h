/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sessions: recordings of several machines on one timeline, the CLOCK_MONOTONIC of the first
 * one. A session is a folder with the recordings as they were; incise_recording_open() opens it
 * like a recording. Part of libincise-record.
 *
 *     a  force    ├────────────────────────┤
 *     b  tracker       ├──────────────────────┤      offset and rate of b's clock: by wall time
 *     b                     │tap                     (incise/wall.h), by a signal that both
 *     a                     │tap                     recorded, or by both, which must agree
 */
#ifndef INCISE_SESSION_H
#define INCISE_SESSION_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

INCISE_BEGIN_DECLS

/** Largest number of members. */
#define INCISE_SESSION_MEMBERS_MAX 32

/** Signals that align clocks. */
enum incise_session_align {
	INCISE_ALIGN_CLOCKS, /**< no signal: wall time alone */
	INCISE_ALIGN_TAP,    /**< knocks that force or tracker of each member show */
	/** events of the kind "sync", of a common line, or steps that it makes in the force */
	INCISE_ALIGN_EVENTS,
};

/** A member, and its clock. Times are ns of the session's clock. */
struct incise_session_info {
	char name[64];	  /**< of its folder in the session, unique */
	char host[64];	  /**< name of the machine */
	char method[16];  /**< "first", "same" (clock), "clocks", "tap", "sync" */
	char streams[64]; /**< that it has: "force, tracker, camera" */
	bool complete;	  /**< closed by its recorder */
	int64_t first_ns, last_ns; /**< first and last row; -1: no row */
	int64_t offset_ns; /**< session's clock less the member's, at its first row */
	double rate_ppm; /**< how much faster the session's clock runs, over the recording */
	double uncertainty_ns; /**< largest bound of the error of its times */
	int64_t overlap_ns; /**< common time with the members before it; below 0: a gap */
	/** Signals that both recorded; 0: not aligned. */
	int matches;
	/** Time by the signal less time by the clocks, and its bound; NAN: not both known. */
	double agreement_ns, agreement_bound_ns;
};

/** Options of a join. */
struct incise_session_options {
	double within_s; /**< largest bound of the error that is accepted; 0: any */
	enum incise_session_align align;
	/** Called with texts for people, for example of a recording that was interrupted; or NULL. */
	void (*note)(void *context, const char *text);
	void *context;
};

/**
 * Join recordings into a session. Their files are cloned, linked or copied; not a bit changes.
 *
 * @param paths  n recordings, 2 to INCISE_SESSION_MEMBERS_MAX, the first one's clock is the
 *               session's
 * @param output a new folder; while it is written, it is output.part
 * @return 0; -EINVAL (a session, the same recording twice), -ENODATA (no
 *         wall time, or an unknown uncertainty, and no signal that aligns), -EDOM (a signal that
 *         matches at several offsets, or may match by chance), -ERANGE (an uncertainty
 *         above within_s, clocks and signal that disagree, a clock that went back), -EEXIST, -EBUSY (it is being
 *         recorded), -EIO,
 *         -ENOSPC, -ENOMEM, errno of incise_recording_open().
 */
INCISE_API int incise_session_join(const char *const *paths, int n,
				   const struct incise_session_options *options,
				   const char *output, struct incise_error *err);

/**
 * Get the members of a session.
 *
 * @param members belongs to the recording
 * @return the number of members; 0: it is no session
 */
INCISE_API int incise_session_members(const struct incise_recording *recording,
				      const struct incise_session_info **members);

/**
 * State a join: its members by identity and head, in their order, their hosts, how the clocks were
 * aligned, and the maps of the clocks with their bounds. With the members' own statements
 * (incise/seal.h) it says all that is read of the recording. Its text is
 *
 *     incise statement 1 of a join
 *     member a                              for each member
 *     identity 0123456789abcdef0123456789abcdef
 *     commit 97 1234567890 0123…            number, t_ns, head
 *     host rig2
 *     method clocks
 *     signals 0 nan nan                     number, agreement and its bound, ns
 *     map 12 0123…                          knots, SHA-256 of a line "t_ns session_ns bound_ns" of each
 *     end
 *
 * with numbers as "%.17g" writes them.
 *
 * @return text, to be freed with free(3); the same recording gives the same. NULL with errno EINVAL
 *         (not joined), ENODATA (a member without a sealed commit), EIO, ENOMEM.
 */
INCISE_API char *incise_session_statement(const struct incise_recording *recording,
					  struct incise_error *err);

INCISE_END_DECLS
#endif
