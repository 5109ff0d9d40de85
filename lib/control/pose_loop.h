/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Whether the loop of forces and a tracker swings, in three dimensions: device, tracker, predictor (with extrapolation
 * and blending), and any forces that are linear about a state of rest.
 *
 *   device ──pose, P apart──▶ latency ──▶ predict ──each tick T──▶ f = -Kx-Bv ──────┐
 *      ▲                                                                            │
 *      └───────────────────────────── held for T ◀──────────────────────────────────┘
 *
 * This is not the loop with a delay of latency + P and no predictor, nor is that on the
 * safe side. The predictor leads, which helps where the motion is slow, as a hand's is;
 * and it shows faster motion larger than it is, for example a humming wall's. On a device
 * of 50 g and 0.01 N s/mm, with 120 Hz and 4.2 ms, the loop holds a wall of 0.40 N/mm where
 * the delay would hold 0.94. With a twentieth of the damping the loop holds three times more
 * than the delay. Damping by the predictor's velocity makes it less, not more.
 *
 * About a state of rest all of it is linear, and periodic when P is a whole number of ticks. The map
 * of the state over one P is therefore a matrix, and the loop is stable when that has no
 * eigenvalue of modulus above 1. The matrix is not derived but measured: the columns are
 * what device (incise/plant.h) and predictor (predict.h) make of each unit state in one P.
 * So it follows the real predictor, also after changes of that.
 *
 *   state, of each axis: device x v | predictor x v a, shown x v (and a, with A) | poses on their way | forces on
 *   theirs
 *
 * Times that are no multiples of each other are made so by a longer tick, or by a slower tracker if the tracker is
 * faster than the loop. Beyond 64 ticks in a P, or 16 P in a tick or 32 in the latency, tick or P are made longer
 * too.
 *
 * In the loop of a host (incise/host.h) a period is its step: a pose, the ticks since the last
 * one with poses between, and the last force, held for the step. Its states are the last pose,
 * and its velocity, in place of those on their way.
 *
 * N, mm, s.
 */
#ifndef INCISE_POSE_LOOP_H
#define INCISE_POSE_LOOP_H

#include "host_path.h"
#include "plant.h"
#include "predict.h"

#define INCISE_POSE_LOOP_LATE_MAX 16 /* ticks */

/* A hand that holds the device: passive, added to its mass and damping, and tied to a place. */
struct incise_hand_impedance {
	double mass_kg, damping_N_s_mm, stiffness_N_mm;
};

/* Coulomb friction, encoder and noise are left out. */
struct incise_pose_loop {
	double period_s; /* of a tick */
	/* As initialised for the tracker: its gains, period and latency count. */
	const struct incise_predict *predict;
	int late_ticks; /* until a force acts, 0 … INCISE_POSE_LOOP_LATE_MAX … */
	double early_s; /* … less this part of the last of them */
	/* With more ticks than one there is a host in place of the tracker, whose period is a tick. */
	struct incise_host_hold hold;
};

/* A mass in a hand, or free (NULL). */
struct incise_plant incise_pose_loop_plant(double mass_kg, double damping_N_s_mm,
					   const struct incise_hand_impedance *hand);

/*
 * Forces in three dimensions about a state of rest: linear, but each with all axes. For a wall all are multiples of
 * the unit matrix.
 *
 *   f = - now x - mean (mean of the last x) - damping v - mass a
 */
struct incise_force_map {
	double now[3][3], mean[3][3]; /* N/mm */
	double damping[3][3];	      /* N s/mm */
	double mass[3][3];	      /* N s²/mm */
	int mean_ticks;		      /* 1: no mean */
};

/* The fastest of the loop's swings. */
struct incise_swing {
	double hz;
	double along[3]; /* unit, in the axes of the map */
};

/*
 * Growth of that swing, 1/s; 0: no swing grows. A motion that grows by e before it turns by a radian is no swing: it
 * goes away, as a tool does that stands on a ball. The states are the loop's above for each axis, and the places of
 * the mean: exact up to 32 ticks, within some hundredths up to 64.
 *
 * @param share  of all forces of the map
 * @param axis   of the device, from where it is at rest
 * @param swing  or NULL
 * @return INFINITY: no memory. Some 0.5 ms; 5 ms with a mean of 32 ticks.
 */
double incise_pose_loop_swing(const struct incise_pose_loop *of,
			      const struct incise_plant axis[3],
			      const struct incise_force_map *map, double share,
			      struct incise_swing *swing);

/* The share up to which no swing grows, at most @most; then @swing stays as it is. */
double incise_pose_loop_margin(const struct incise_pose_loop *of,
			       const struct incise_plant axis[3],
			       const struct incise_force_map *map, double most,
			       struct incise_swing *swing);

#endif
