/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From readings of clocks and of their sources to points of wall time; see incise/wall.h. No
 * input and output, so that simulated clocks test it.
 *
 *     reading     ●     ●     ●  lost        ●  again
 *     points      ●─────●─────●┄┄┄┄┄┄○┄┄┄┄┄┄●       held: on CLOCK_MONOTONIC_RAW, which no
 *     bound       │     │     │    ╱     ╲   │       program slews
 *
 * A step of CLOCK_REALTIME does not move CLOCK_MONOTONIC: points are held until the source has
 * measured again. A suspend stops CLOCK_MONOTONIC: the mapping restarts.
 */
#ifndef INCISE_WALL_FOLLOW_H
#define INCISE_WALL_FOLLOW_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/wall.h>

/* Clocks read together, all at mono_ns ± half_ns. */
struct incise_wall_clocks {
	int64_t mono_ns, raw_ns, boot_ns, real_ns;
	int64_t half_ns;
	int utc_offset_s; /* TAI less UTC */
	char leap[24];	  /* its source, as of incise_wall_point */
};

/* A source's statement of the time; in a list, the best source is first. */
struct incise_wall_reading {
	bool good; /* there is a reading, with a bound */
	char source[24], reference[24];
	int64_t tai_ns; /* at mono_ns of the clocks */
	double bound_ns; /* INFINITY: unknown, for source "plain" only, which is the last */
	double rate_uncertainty_ppb;
	int utc_offset_s;
	char leap[24];
	int64_t updated; /* changes when the source has measured again */
};

#define INCISE_WALL_SOURCES 4
#define INCISE_WALL_EVENTS 4

struct incise_wall_follow {
	bool started;
	struct incise_wall_point last;
	struct incise_wall_clocks clocks; /* of the last point */
	/* TAI per CLOCK_MONOTONIC_RAW, less 1, by the points since the anchor. */
	double tai_per_raw;
	bool anchored;
	int64_t anchor_raw_ns, anchor_tai_ns, next_raw_ns, next_tai_ns;
	/* After a step or a suspend, until the source has measured again. */
	struct {
		bool waits;
		int64_t updated;
	} distrust[INCISE_WALL_SOURCES];
};

struct incise_wall_result {
	struct incise_wall_point point;
	int n_events;
	char events[INCISE_WALL_EVENTS][160];
};

/* Start with zeros. The clocks increase from call to call; one call for each point. */
void incise_wall_follow(struct incise_wall_follow *follow,
			const struct incise_wall_clocks *clocks,
			const struct incise_wall_reading *readings, int n,
			struct incise_wall_result *result);

#endif
