// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where the profile is and where the drive stands, each in the other's units; see
 * axis_cycle.h.
 *
 * A part of one noun: tests/unit/can/can_axis.c tests it through its door.
 */
#include <math.h>
#include <string.h>
#include "can_axis_cycle.h"

#define STALE_CYCLES 3	 /* without an answer: no loop is closed over that */
#define ONE 4294967296.0 /* a step, in a profile's units */

int64_t can_axis_steps(const struct can_axis *axis, int32_t counts)
{
	double steps = (counts - axis->zero_counts) / axis->setup.counts_per_step;
	const double most = 2.0 * INCISE_PROFILE_POSITION_MAX;

	/* What a drive says may be anything. */
	return llround(fmax(-most, fmin(most, steps)));
}

/* In the drive's units, whatever its mode asks for. */
static int32_t whole(double value, double most)
{
	value = isnan(value) ? 0 : fmax(-most, fmin(most, value));
	return (int32_t)lrint(value);
}

int32_t can_axis_hold_target(const struct can_axis *axis)
{
	return axis->setup.mode == CIA402_CSP ? axis->position : 0;
}

/* Where the profile is, as the mode says it. */
static int32_t mode_target(const struct can_axis *axis,
			   const struct incise_profile_slot *slot)
{
	const struct can_axis_setup *setup = &axis->setup;
	double to = (double)slot->to / ONE, cycle_s = setup->config.tick_ns * 1e-9;
	double at = (axis->position - axis->zero_counts) / setup->counts_per_step;
	double speed = (double)(slot->to - slot->from) / ONE / cycle_s, most;
	bool stale = axis->missed > STALE_CYCLES;

	switch (setup->mode) {
	case CIA402_CSV:
		most = setup->config.velocity;
		if (!stale)
			speed += setup->gain_1_s * (to - at);
		speed = fmax(-most, fmin(most, speed));
		return whole(speed * setup->units_per_step_s, INT32_MAX);
	case CIA402_CST:
		if (stale)
			return 0;
		speed -= axis->speed / setup->counts_per_step / cycle_s;
		return whole(setup->torque_per_step * (to - at) +
				     setup->torque_s_per_step * speed,
			     setup->torque_most);
	default:
		return whole(axis->zero_counts + to * setup->counts_per_step, INT32_MAX);
	}
}

int32_t can_axis_next_target(struct can_axis *axis)
{
	struct incise_motion *m = &axis->motion;
	struct incise_profile_slot slot;

	incise_profile_tick(&m->profile, &slot);
	incise_motion_ticked(m);
	memmove(&axis->commanded[1], &axis->commanded[0],
		sizeof(axis->commanded) - sizeof(*axis->commanded));
	axis->commanded[0] = incise_profile_position(&m->profile);
	return mode_target(axis, &slot);
}

bool can_axis_within(const struct can_axis *axis)
{
	const struct incise_stepper_config *config = &axis->motion.config;
	int64_t slack = 1 + (int64_t)config->velocity * config->tick_ns / 1000000000;
	int64_t at = axis->motion.status.position;

	return at >= config->position_min - slack && at <= config->position_max + slack;
}
