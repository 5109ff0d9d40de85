/* SPDX-License-Identifier: GPL-2.0-or-later */
/* The stiffness up to which a flat wall rests in the loop with a tracker, by bisection; N/mm. */
#ifndef INCISE_TEST_WALL_LIMIT_H
#define INCISE_TEST_WALL_LIMIT_H

#include <incise/stability.h>
#include "../lib/control/pose_loop.h"

#define WALL_LIMIT_SOFTEST_N_mm 1e-5
#define WALL_LIMIT_FACTOR 1.1
#define WALL_LIMIT_STIFFEST_N_mm 1e5
#define WALL_LIMIT_HALVINGS 24

static inline bool wall_rests(const struct incise_haptic_device *device,
			      const struct incise_predict *predict, double stiffness_N_mm,
			      double damping_N_s_mm, int late_ticks)
{
	const struct incise_pose_loop loop = {.period_s = device->period_s,
					      .predict = predict,
					      .late_ticks = late_ticks};
	const struct incise_plant plant =
		incise_pose_loop_plant(device->mass_kg, device->damping_N_s_mm, NULL);
	const struct incise_force_map wall = {.now = {{stiffness_N_mm}},
					      .damping = {{damping_N_s_mm}},
					      .mean_ticks = 1};

	return !(incise_pose_loop_swing(
			 &loop, (const struct incise_plant[]){plant, plant, plant}, &wall,
			 1, NULL) > 0);
}

/* 0: not even the softest rests. Coulomb friction, encoder and delay_ticks of the device are left out. */
static inline double wall_limit(const struct incise_haptic_device *device,
				const struct incise_predict *predict,
				double damping_N_s_mm, int late_ticks)
{
	double low = 0, high = WALL_LIMIT_SOFTEST_N_mm;

	/* Upwards, for a wall may rest again beyond one that does not. */
	while (high < WALL_LIMIT_STIFFEST_N_mm &&
	       wall_rests(device, predict, high, damping_N_s_mm, late_ticks)) {
		low = high;
		high *= WALL_LIMIT_FACTOR;
	}
	for (int i = 0; i < WALL_LIMIT_HALVINGS && low > 0; i++) {
		double middle = (low + high) / 2;

		*(wall_rests(device, predict, middle, damping_N_s_mm, late_ticks)
			  ? &low
			  : &high) = middle;
	}
	return low;
}

#endif
