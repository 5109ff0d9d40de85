/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The real-time loop: runs a plan at the times start + n·period of CLOCK_MONOTONIC.
 *
 * The loop computes each wake-up from the previous one, not from the current time. Rule for
 * overruns: a tick that would start a period late or more is skipped and counted, so that no
 * burst follows a stall. After options->overruns_most of them in a row, without a timely tick
 * in between, the loop removes the force and ends. On a paced clock (incise/clock.h) no tick
 * is skipped; each runs with its own time, even if late.
 */
#ifndef INCISE_LOOP_H
#define INCISE_LOOP_H

#include <signal.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/haptic.h>
#include <incise/loop_control.h>
#include <incise/plan.h>
#include <incise/state.h>

INCISE_BEGIN_DECLS

/**
 * Bins of a histogram of wake-up latencies: bin i counts [i, i+1) µs, the last bin everything
 * above.
 */
#define INCISE_LOOP_BINS 20001

/** Options of a loop. Initialise with {0} and set rate_hz. */
struct incise_loop_options {
	double rate_hz;	     /**< 1 … 20000 */
	int64_t duration_ns; /**< 0: until stopped */
	/** The status file, or NULL. */
	struct incise_state_writer *state;
	/** Buffer for the first log_size ticks, or NULL. */
	struct incise_tick *log;
	size_t log_size;
	/**
	 * A signal handler sets it to end the loop; or NULL. The force ramps to 0 first,
	 * within incise_plan_fade_ns(); these ticks count.
	 */
	const volatile sig_atomic_t *stop;
	/** Number of consecutive overruns that ends the loop; 0: no limit. */
	unsigned int overruns_most;
	/** Carries new plans to the loop and events from it, or NULL. */
	struct incise_loop_control *control;
	/**
	 * Called after each tick, not part of its cost; or NULL. A result other than 0 ends
	 * the loop, and incise_loop_run() returns it. Not for live loops: it delays the next
	 * tick.
	 */
	int (*ticked)(void *context, const struct incise_tick *tick);
	void *context;
};

/** Statistics of a run. */
struct incise_loop_stats {
	uint64_t ticks;	   /**< executed ticks */
	uint64_t skipped;  /**< skipped because they would have been a period late */
	uint64_t overruns; /**< gaps of one or more skipped ticks */
	uint64_t flagged[INCISE_TICK_FLAGS]; /**< ticks with flag 1 << i */
	uint64_t limited; /**< ticks with INCISE_TICK_CLAMPED, _SLEWED or both */
	size_t logged;
	uint64_t lateness_us[INCISE_LOOP_BINS]; /**< wake-up latency */
	int64_t lateness_max_ns;
	int64_t tick_max_ns;		       /**< cost of the plan */
	uint64_t tick_100ns[INCISE_LOOP_BINS]; /**< cost of the plan, bins of 100 ns */
	double force_N;			       /**< commanded force at the last tick */
	double force_max_N;		       /**< largest commanded force */
	/** commanded along each actuator's axis */
	double actuated_N[INCISE_RIG_AXES_MAX];
	/** Σ (rendered - actuated at the previous tick)² of each, N² */
	double rendered_off2;
	/** Σ of the squares of the force that no actuator can render, N² */
	double unfelt2;
	double unfelt_max_N;		 /**< largest of these forces */
	struct incise_pose_counts poses; /**< at the end of the run */
	double texture_felt;		 /**< incise_plan_texture_felt() */
	/**
	 * Smallest height of the tool's end above the surface in ticks with a pose, up to the
	 * first contact, mm; infinite without such a tick
	 */
	double nearest_mm;
	/** ticks in contact that commanded no force, with flag 1 << i; the first: all of them */
	uint64_t forceless[INCISE_TICK_FLAGS];
	enum incise_haptic_off forceless_off; /**< of the device at the last of them */
};

/**
 * Run a plan, and release the actuator at the end in every case. Makes no allocation, and no
 * system call except by the clock and by options->ticked. Meanwhile the thread's timer slack
 * is 1 ns, see PR_SET_TIMERSLACK(2const), and then its earlier value.
 *
 * @param stats caller's memory, some 300 KiB; zeroed here
 * @return 0 at the end of the duration or when stopped; -EINVAL (options), -ETIME (too many
 *         overruns in a row), or the errno of a failed device, including an actuator that
 *         cannot be released; the result of options->ticked, which sets @err itself.
 */
INCISE_API int incise_loop_run(struct incise_plan *plan, struct incise_clock *clock,
			       const struct incise_loop_options *options,
			       struct incise_loop_stats *stats, struct incise_error *err);

/**
 * Quantile of a histogram, in bins: the upper edge of its bin.
 *
 * @param share 0 … 1
 * @return bins; INCISE_LOOP_BINS if it is in the last, open bin; 0 if the histogram is empty.
 */
INCISE_API double incise_loop_quantile(const uint64_t *histogram, double share);

INCISE_END_DECLS
#endif
