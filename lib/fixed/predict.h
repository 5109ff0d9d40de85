/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Where the tip is now, in integers: what lib/control/predict.h does in double, see there for the
 * filter, its figure and its source.
 *
 *   poses Q16.16 mm, Q2.30     x Q32 mm     v Q20 mm/s     a Q16 mm/s²     times ns
 */
#ifndef INCISE_FIXED_PREDICT_H
#define INCISE_FIXED_PREDICT_H

#include <incise/export.h>
#include "integers.h"

/* Nothing is believed beyond; no hand is that far. */
#define INCISE_FIXED_FAR_MM 10000

/* Trackers from 20 Hz on: a gap of five periods is 250 ms at most. */
#define INCISE_FIXED_PERIOD_MIN_NS 100000
#define INCISE_FIXED_PERIOD_MAX_NS 50000000
#define INCISE_FIXED_AHEAD_MAX_NS 250000000

/* The filter of one tracker. */
struct incise_fixed_filter {
	int32_t alpha;	    /* Q30 of a miss, to x; 0 … 2^30 */
	int32_t beta;	    /* Q16 1/s, to v; 0 … */
	int32_t gamma;	    /* Q12 1/s², to a; 0 … */
	int32_t period_ns;  /* INCISE_FIXED_PERIOD_MIN_NS … _MAX_NS */
	int32_t latency_ns; /* 0 … 10^9 */
	int32_t gap_ns; /* after a longer one it restarts; 0 … INCISE_FIXED_AHEAD_MAX_NS */
	int32_t ahead_ns; /* it goes no further; 0 … INCISE_FIXED_AHEAD_MAX_NS */
	int32_t reserved;
};

/* Begins with incise_fixed_predict_init(). */
struct incise_fixed_predict {
	int64_t t_ns;		  /* of acquisition of the last pose */
	int64_t arrival_ns;	  /* of it */
	int64_t x[3], v[3], a[3]; /* at t_ns */
	int64_t x_shown[3]; /* when it arrived, less what the filter says then; Q24 mm */
	int64_t v_shown[3]; /* the same; Q20 mm/s */
	int64_t a_shown[3]; /* the same; Q16 mm/s² */
	int32_t q[4], q_shown[4];
	uint32_t discontinuities;
	int32_t started;
};

/* Tell whether a filter's numbers are within their ranges: then nothing overflows. */
bool incise_fixed_filter_good(const struct incise_fixed_filter *filter);

/*
 * Make a pose's quaternion a unit one. Returns false, and leaves @to, where it is more than a tenth
 * longer or shorter than that: devices round their numbers, but not by so much.
 */
bool incise_fixed_attitude(int32_t to[4], const int32_t quaternion[4]) INCISE_REALTIME;

/* Start without a pose. */
void incise_fixed_predict_init(struct incise_fixed_predict *p);

/*
 * Take a pose in, as incise_predict_add(). Any numbers are safe; one of a position beyond
 * INCISE_FIXED_FAR_MM, or not newer than the last, is passed over.
 *
 * Returns whether it was taken.
 */
bool incise_fixed_predict_add(struct incise_fixed_predict *p,
			      const struct incise_fixed_filter *filter,
			      const int32_t position[3], const int32_t quaternion[4],
			      int64_t t_ns) INCISE_REALTIME;

/*
 * Position (Q16.16) and velocity (Q16.16 mm/s) at a time, as incise_predict_at().
 *
 * Velocity is held to ±10^4 mm/s.
 */
void incise_fixed_predict_at(const struct incise_fixed_predict *p,
			     const struct incise_fixed_filter *filter, int64_t t_ns,
			     int32_t position[3], int32_t velocity[3]) INCISE_REALTIME;

/* The acceleration then, as incise_predict_acceleration(): Q16 mm/s², within ±10^5 mm/s². */
void incise_fixed_predict_acceleration(const struct incise_fixed_predict *p,
				       const struct incise_fixed_filter *filter,
				       int64_t t_ns,
				       int64_t acceleration[3]) INCISE_REALTIME;

/* The attitude then, a unit quaternion. Costs a root and four divisions: only when asked. */
void incise_fixed_predict_attitude(const struct incise_fixed_predict *p,
				   const struct incise_fixed_filter *filter, int64_t t_ns,
				   int32_t attitude[4]) INCISE_REALTIME;

/* Age of the last pose, ≥ 0; INT64_MAX before the first. */
int64_t incise_fixed_predict_age(const struct incise_fixed_predict *p,
				 int64_t t_ns) INCISE_REALTIME;

#endif
