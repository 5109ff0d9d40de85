/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The motion profile in integers: from targets to steps, within limits of velocity,
 * acceleration, jerk and position. The kernel module's hard timer, the thread over GPIO and
 * the CAN backend run this same code.
 *
 *   target ─▶ ramp ─▶ average of N ticks ─▶ P(k) ─▶ steps
 *             v, a    jerk                   │
 *                                            └▶ set-points of a bus
 *
 *   P ┤            ╭───────  target       Time goes in ticks of T = tick_ns. A tick gives
 *     │          ╱                        the position at its end; within a tick position
 *     │        ╱                          is linear in time. A step is due when the
 *     │     ╱                             position is a whole step away from the sum of
 *     │──╯                                all steps before it, up or down.
 *     ┼──┬──┬──┬──┬──┬──┬▶ t
 *      k=1  2  3  4  5  6
 *
 * The ramp keeps velocity and acceleration and can always stop within the position limits.
 * Its jumps of acceleration, 2a at most, the average spreads over N = ⌈2a/(jT)⌉ ticks, so
 * that jerk is at most 2a/(NT) ≤ j; and as an average of positions is never beyond all of
 * them, the other limits and the end hold as they were (L. Biagiotti, C. Melchiorri, 'FIR
 * filters for online trajectory planning with time- and frequency-domain specifications',
 * Control Engineering Practice 20, 2012; there the filter for jerk takes a/j, for motions in
 * which +a does not turn to -a at once, as it may here). It costs (N-1)/2 ticks of delay.
 *
 * For any targets at any time, these inequalities hold, with v, a, j, T of the limits
 * in steps and seconds, P(k) = incise_profile_slot.to of tick k and t(i) the time of the
 * i-th step in ns (ticks k·tick_ns + incise_profile_step_ns()); halt and init restart:
 *
 *   |P(k) - P(k-1)|                            ≤ v T
 *   |P(k) - 2 P(k-1) + P(k-2)|                 ≤ a T²
 *   |P(k) - 3 P(k-1) + 3 P(k-2) - P(k-3)|      ≤ j T³ + 2^-30    where j > 0
 *   position_min ≤ P(k) ≤ position_max, and so is the sum of steps after each step
 *   |P(k) - sum of steps| < 1, and 0 at rest on a target
 *   t(i+n) - t(i)                              ≥ ⌊n·10⁹/v⌋ ns    in any directions
 *   steps in a tick                            ≤ ⌊v T⌋ + 1
 *   for gaps g, h (s) between three steps of one direction, ε = 10⁻⁹ s:
 *   1/(h+ε) - 1/(g-ε), 1/(g+ε) - 1/(h-ε)       ≤ a ((g+h)/2 + T + ε)
 *
 * Arithmetic is of 64-bit integers in units of 2^-32 steps. Limits are rounded down: an
 * acceleration by less than 0.2 steps/s² at 50 µs and 0.0002 at 2 ms, a velocity by less than
 * 10⁻⁵ steps/s. No float, no allocation: builds in a kernel, for 32 bits too. All functions are
 * real-time safe. A profile belongs to one motor, and one thread at a time uses it.
 */
#ifndef INCISE_PROFILE_H
#define INCISE_PROFILE_H

#ifndef __KERNEL__
#include <stdbool.h>
#endif
#include "integers.h"

/* Shortest tick. */
#define INCISE_PROFILE_TICK_MIN_NS 50000
/* Longest tick. */
#define INCISE_PROFILE_TICK_MAX_NS 2000000
#define INCISE_PROFILE_VELOCITY_MAX 200000     /* steps/s */
#define INCISE_PROFILE_POSITION_MAX 1000000000 /* steps, to either side */
#define INCISE_PROFILE_AVERAGE_MAX 256	       /* ticks */

/* The limits of a motion. */
struct incise_profile_limits {
	uint32_t tick_ns;      /* INCISE_PROFILE_TICK_MIN_NS … _MAX_NS */
	uint32_t velocity;     /* steps/s, 1 … INCISE_PROFILE_VELOCITY_MAX */
	uint32_t acceleration; /* steps/s², 1 … */
	int32_t position_min;  /* steps, within ±INCISE_PROFILE_POSITION_MAX */
	int32_t position_max;  /* steps, from position_min on */
	uint64_t jerk;	       /* steps/s³; 0: not limited */
};

/* The kind of a target. */
enum incise_profile_mode {
	INCISE_PROFILE_POSITION, /* target in steps */
	INCISE_PROFILE_VELOCITY, /* target in steps/s */
};

/* Private: the ramp, in units of 2^-32 steps and ticks. */
struct incise_ramp {
	int64_t position, velocity;
	int64_t target;	       /* position */
	uint64_t top;	       /* velocity on the way there */
	uint64_t acceleration; /* per tick */
	uint64_t brake;	       /* full ticks of it in velocity */
};

/*
 * A profile; the caller's memory, 2.2 kB. All fields are private. It has no pointers: a
 * copy is a profile of its own.
 */
struct incise_profile {
	struct incise_ramp ramp;
	int64_t min, max;      /* 2^-32 steps */
	uint64_t velocity_max; /* 2^-32 steps per tick */
	int64_t output;	       /* average, 2^-32 steps, rounded down */
	int64_t moved;	       /* by it in the last tick */
	int32_t whole;	       /* sum of steps */
	uint32_t tick_ns;
	uint32_t velocity; /* steps/s */
	uint32_t average;  /* N */
	uint32_t rest;	   /* rounding rest of output, 1/N */
	uint32_t at;	   /* place of the oldest position */
	uint32_t still;	   /* ticks at rest */
	uint32_t reserved;
	int64_t history[INCISE_PROFILE_AVERAGE_MAX];
};

/* The motion within one tick. */
struct incise_profile_slot {
	int64_t from, to; /* position at begin and end, 2^-32 steps */
	uint64_t first;	  /* private: way to the first step, 2^-32 steps */
	uint32_t tick_ns;
	int32_t n;   /* steps, 0 … */
	int32_t dir; /* of all of them, and of the motion: +1, -1; 0: at rest */
	int32_t reserved;
};

/*
 * Make a profile that rests at a position.
 *
 * @return 0; -22 (EINVAL: a limit is out of its range), -34 (ERANGE: @position is not within
 *         the limits, or jerk is so low that the average would take more than
 *         INCISE_PROFILE_AVERAGE_MAX ticks). @profile is left as it was then.
 */
int incise_profile_init(struct incise_profile *profile,
			const struct incise_profile_limits *limits, int32_t position);

/*
 * Set where to go, or how fast; at any time, in flight too. The next tick already goes
 * there. If a position lies nearer than the way to a stop, it brakes, stops beyond, and
 * comes back. A velocity goes on to the position limit and rests there.
 *
 * @param mode   another value counts as velocity 0
 * @param target any number; clamped to the limits
 * @return target in force, after clamping
 */
int64_t incise_profile_target(struct incise_profile *profile,
			      enum incise_profile_mode mode, int64_t target);

/* Brake to rest at the limits, wherever that is: velocity 0. */
void incise_profile_stop(struct incise_profile *profile);

/*
 * Rest at a position at once, against all limits, with nothing left to do: a limit switch,
 * an emergency stop, or a new name for where it stands.
 *
 * @param position steps; clamped to the limits
 */
void incise_profile_halt(struct incise_profile *profile, int32_t position);

/* Go on by one tick. */
void incise_profile_tick(struct incise_profile *profile,
			 struct incise_profile_slot *slot);

/*
 * The time at which a step of a slot is due: ns from the start of its tick, 1 … tick_ns,
 * rounded up.
 * Ascending with @k, and equal only where steps are less than 1 ns apart, which no limits do.
 *
 * @param k 0 … slot->n - 1; beyond: clamped; tick_ns where the slot has no steps
 */
uint32_t incise_profile_step_ns(const struct incise_profile_slot *slot, int32_t k);

/*
 * True while it rests, and will until there is a new target: N ticks after the last motion of
 * the ramp at the earliest; incise_profile_tick() is cheap from then on.
 */
bool incise_profile_resting(const struct incise_profile *profile);

/*
 * The direction of the way that is left after the last tick's slot: 1, -1; 0 where the steps that
 * were given out end it. A motion that brakes, or has passed its target, goes on as it went.
 */
int incise_profile_ahead(const struct incise_profile *profile);

/* The sum of all steps of the ticks so far, from the position that init or halt gave. */
int32_t incise_profile_position(const struct incise_profile *profile);

/* Velocity in the last tick, 2^-16 steps/s, rounded towards 0. */
int64_t incise_profile_velocity(const struct incise_profile *profile);

/*
 * The most steps that come in the ticks after incise_profile_stop() until it rests. Where
 * it is called within a tick, the rest of that tick's steps comes on top.
 *
 * @param velocity no target, and no ramp, was faster before, steps/s; the limit's and more:
 *                 in any case
 * @return steps; at most position_max - position_min; 2^64 - 1 for limits that
 *         incise_profile_init() refuses
 */
uint64_t incise_profile_stopping_steps(const struct incise_profile_limits *limits,
				       uint32_t velocity);

/* The same as time until the end of the last tick that moves, ns. */
uint64_t incise_profile_stopping_ns(const struct incise_profile_limits *limits,
				    uint32_t velocity);

#endif
