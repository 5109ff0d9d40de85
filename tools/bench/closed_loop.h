/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A hand that leans on a plan's tissue, in a closed loop in time: the real plan, fed with poses
 * that are late, on a device in steps of 50 µs. It shares no line with the search for swings that
 * a plan goes through, lib/scene/rest.h, and judges it.
 *
 *   hand leans ─▶ device ─▶ poses, noise, latency ─▶ plan ─▶ late ticks ─┐
 *                   ▲                                                    │
 *                   └──────────────── held for a tick ◀──────────────────┘
 *
 * Guided along z on the plane z = 0, or free in three dimensions on any surface; ticks are of 1 kHz.
 */
#ifndef INCISE_CLOSED_LOOP_H
#define INCISE_CLOSED_LOOP_H

#include <stdbool.h>
#include <incise/plan.h>

/* Way of the device to and fro over the last quarter of a run that counts as a swing. */
#define CLOSED_LOOP_SWING_MM 0.01

/* Along the skin, of a free device: its mass, damping, and the spring to where it began. */
struct closed_loop_hand {
	double mass_kg, damping_N_s_mm, stiffness_N_mm;
};

struct closed_loop {
	double mass_kg, damping_N_s_mm; /* of the device, which has no dry friction */
	double tracker_hz, latency_s;
	double noise_mm; /* sd of a pose's height, for the first 3/8 of a run; then 0 */
	int late_ticks;	 /* of the actuator, 0 … 16 */
	double lean_N, along_mm_s; /* along the skin: of a guided one */
	double run_s;
	/* Free: it leans on a place against the normal there, with this share along the skin. */
	bool free;
	double place_mm[3], normal[3], askew;
	struct closed_loop_hand hand;
};

struct closed_loop_end {
	/* Over the last quarter: the way to and fro, which is 0 for a device that only sinks or
	 * creeps, and the ranges of places and forces. */
	double swing_mm, moved_mm, swing_N;
	double earlier_mm;	      /* the range of places over the second quarter */
	double largest_mm, largest_N; /* of all, to either side */
	double shaken_mm; /* to and fro in the last eighth before the noise ends */
	double depth_mm, force_N; /* at the end */
	bool left; /* of a free device: far from where it leaned, as after sliding off a ball */
};

/* As the plan is to be told of it. */
struct incise_tracker_info closed_loop_tracker(const struct closed_loop *loop);

/*
 * Run it. A plan goes on from run to run: each has a number, its own time and its own place on
 * the skin. @return whether the plan took all poses and ticks
 */
bool closed_loop_run(struct incise_plan *plan, const struct closed_loop *loop, int run,
		     struct closed_loop_end *end);

#endif
