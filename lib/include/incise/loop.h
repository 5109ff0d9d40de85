/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The real-time loop: runs a plan at the times start + n·period of CLOCK_MONOTONIC.
 *
 * The next wake-up follows from the previous one, never from now. The rule for overruns: a
 * tick that would start a period late or more is skipped and counted, so that a stall is not
 * followed by a burst; after options->overruns_most of them in a row, with no tick in time in
 * between, the loop takes the force away and ends. On a paced clock (incise/clock.h) every
 * tick has its own time, however late it runs, so that none is skipped.
 */
#ifndef INCISE_LOOP_H
#define INCISE_LOOP_H

#include <signal.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/loop_control.h>
#include <incise/plan.h>
#include <incise/state.h>

INCISE_BEGIN_DECLS

/** Histogram of latenesses: bin i counts [i, i+1) µs, the last one everything above. */
#define INCISE_LOOP_BINS 20001

/** Options of a loop. Start from {0} and set rate_hz. */
struct incise_loop_options {
	double rate_hz;	     /**< 1 … 20000 */
	int64_t duration_ns; /**< 0: until stopped */
	/** The page for readers, or NULL. */
	struct incise_state_writer *state;
	/** Buffer for the first log_size ticks, or NULL. */
	struct incise_tick *log;
	size_t log_size;
	/**
	 * Set by a signal handler to end the loop, or NULL. The force fades out first, within
	 * incise_plan_fade_ns(); these ticks count.
	 */
	const volatile sig_atomic_t *stop;
	/** Consecutive overruns that end the loop; 0: any number is allowed. */
	unsigned int overruns_most;
	/** Carries new plans to the loop and events from it, or NULL. */
	struct incise_loop_control *control;
	/**
	 * Called after each tick, outside of its cost, or NULL. A result other than 0 ends the
	 * loop, and incise_loop_run() returns it. Not for live loops: it delays the next tick.
	 */
	int (*ticked)(void *context, const struct incise_tick *tick);
	void *context;
};

/** Statistics of a run. */
struct incise_loop_stats {
	uint64_t ticks;	   /**< run */
	uint64_t skipped;  /**< not run because they would have been a period late */
	uint64_t overruns; /**< gaps of one or more skipped ticks */
	uint64_t flagged[INCISE_TICK_FLAGS]; /**< ticks with flag 1 << i */
	uint64_t limited; /**< ticks with INCISE_TICK_CLAMPED, _SLEWED or both */
	size_t logged;
	uint64_t lateness_us[INCISE_LOOP_BINS]; /**< of the wake-up */
	int64_t lateness_max_ns;
	int64_t tick_max_ns;			/**< cost of the plan */
	uint64_t tick_100ns[INCISE_LOOP_BINS];	/**< cost of the plan, bins of 100 ns */
	double force_N;				/**< commanded at the last tick */
	double force_max_N;			/**< largest commanded */
	double actuated_N[INCISE_RIG_AXES_MAX]; /**< of that along each actuator's axis */
	double rendered_off2; /**< Σ (rendered - actuated a tick before)² of each, N² */
	double unfelt2;	      /**< Σ of the squares of what no actuator can push, N² */
	double unfelt_max_N;  /**< largest of that */
	struct incise_pose_counts poses; /**< at the end of the run */
};

/**
 * Run a plan, and release the actuator at the end in every case. Makes no allocation and no
 * system call other than the clock's and those of options->ticked.
 *
 * @param stats caller's memory, some 300 KiB; zeroed here
 * @return 0 at the end of the time or when stopped; -EINVAL (options), -ETIME (too many
 *         overruns in a row), or the errno of the device that failed, also of an actuator
 *         that cannot be released any more; the result of options->ticked, which sets @err
 *         itself.
 */
INCISE_API int incise_loop_run(struct incise_plan *plan, struct incise_clock *clock,
			       const struct incise_loop_options *options,
			       struct incise_loop_stats *stats, struct incise_error *err);

/**
 * The value below which a share of a histogram lies, in bins (its upper edge).
 *
 * @param share 0 … 1
 * @return bins; INCISE_LOOP_BINS when it lies in the last, open one; 0 when empty.
 */
INCISE_API double incise_loop_quantile(const uint64_t *histogram, double share);

INCISE_END_DECLS
#endif
