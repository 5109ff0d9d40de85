/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Wall time of a recording: a mapping from CLOCK_MONOTONIC, in which all its times are, to TAI,
 * with a bound of its error. Part of libincise-record.
 *
 *     TAI                                  ╱ ─ restart: the mapping starts again
 *      │                 ╱ · · · · · · · ·│    after a step or a suspend
 *      │          ╱ point                 │
 *      │   ╱ point ± uncertainty
 *      └────────────────────────────────────────── CLOCK_MONOTONIC
 *
 * Uncertainties are bounds of the error, as the sources state them (a maximum, not a standard
 * deviation). They are relative to the reference that a point names: "TAI" itself, or the clock of
 * a PTP grandmaster that is not traceable to TAI. Times with the same reference can be compared;
 * others cannot.
 */
#ifndef INCISE_WALL_H
#define INCISE_WALL_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

INCISE_BEGIN_DECLS

/** An uncertainty that is not known: the clock was not synchronised. */
#define INCISE_WALL_UNKNOWN INT64_MAX

/** A clock reading that the recorder kept. Texts have at most 23 bytes. */
struct incise_wall_point {
	int64_t t_ns;	       /**< CLOCK_MONOTONIC */
	int64_t tai_ns;	       /**< ns since 1970-01-01 00:00:00 TAI, as CLOCK_TAI */
	double uncertainty_ns; /**< bound of the error; INFINITY: unknown */
	/** From here on TAI advances by 1 + rate_ppb / 1e9 ns per ns of CLOCK_MONOTONIC. */
	double rate_ppb;
	double rate_uncertainty_ppb; /**< bound, until the next point */
	int utc_offset_s;	     /**< TAI less UTC */
	/** The clock has lost its source: continued from earlier points, with a growing bound. */
	bool held;
	/**
	 * "ptp", "ptp-master" (this computer is the grandmaster), "chrony", "kernel" (synchronised
	 * by a program), "plain" (not synchronised), "simulated"
	 */
	char source[24];
	/** "TAI", or "ptp:" and the identity of a grandmaster that is not traceable */
	char reference[24];
	/** Source of utc_offset_s: "ptp", "kernel", "list", "expired list", "assumed" */
	char leap[24];
	/** Empty, or why the mapping starts again here: "step", "suspend", "source" */
	char restart[24];
};

/** A mapping; its functions are thread-safe, and not for real-time threads. */
struct incise_wall;

/**
 * Make a mapping of points.
 *
 * @param points n of them, in the order of t_ns, which increases; they are copied
 * @return mapping, to be freed with incise_wall_free(); NULL with errno ENODATA (n is 0), EINVAL
 *         (a value is out of range or order), ENOMEM.
 */
INCISE_API struct incise_wall *incise_wall_new(const struct incise_wall_point *points,
					       size_t n);

/**
 * Read the wall time of a recording.
 *
 * @return mapping, to be freed with incise_wall_free(); it does not use the recording any more.
 *         NULL with errno ENODATA (without wall time: formats 1 and 2, a simulated clock), EINVAL
 *         (damaged), EIO, ENOMEM.
 */
INCISE_API struct incise_wall *incise_recording_wall(struct incise_recording *recording,
						     struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_wall_free(struct incise_wall *wall);

/** Get the points. @return the number of points, which belong to the mapping. */
INCISE_API size_t incise_wall_points(const struct incise_wall *wall,
				     const struct incise_wall_point **points);

/**
 * Convert a time to TAI. Between two points the time is interpolated, and the bound grows with the
 * distance from them. Between a point and a restart, the interval of the result contains what
 * either part gives. Where a restart contradicts the bounds before it, as after a step of a clock
 * that was said to be synchronised, all bounds are widened by its size.
 *
 * @param t_ns           CLOCK_MONOTONIC, at most 60 s before the first or after the last point
 * @param tai_ns         ns since 1970-01-01 00:00:00 TAI
 * @param uncertainty_ns bound of the error, or INCISE_WALL_UNKNOWN; may be NULL
 * @return 0; -ENODATA: further from the points.
 */
INCISE_API int incise_wall_tai(const struct incise_wall *wall, int64_t t_ns,
			       int64_t *tai_ns, int64_t *uncertainty_ns);

/**
 * Convert TAI to CLOCK_MONOTONIC, the inverse of incise_wall_tai(). After a step backwards two
 * times have the same TAI: the interval of the result contains both.
 *
 * @return as incise_wall_tai()
 */
INCISE_API int incise_wall_monotonic(const struct incise_wall *wall, int64_t tai_ns,
				     int64_t *t_ns, int64_t *uncertainty_ns);

/** Room for incise_wall_utc_text(). */
#define INCISE_WALL_TEXT 40

/** Write a time as "2026-11-27T08:00:00.123456789Z". @param utc_offset_s TAI less UTC */
INCISE_API void incise_wall_utc_text(int64_t tai_ns, int utc_offset_s,
				     char text[INCISE_WALL_TEXT]);

/** Get TAI less UTC at a time of CLOCK_MONOTONIC, s, by the last point before it. */
INCISE_API int incise_wall_utc_offset_s(const struct incise_wall *wall, int64_t t_ns);

INCISE_END_DECLS
#endif
