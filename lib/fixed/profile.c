// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Limits, the average and the steps of a motion profile; see lib/fixed/profile.h. The ramp that
 * is averaged is in ramp.c. Lengths are 2^-32 steps. The average is exact: output·N + rest is
 * the sum of the last N positions, and moves by (newest - oldest) each tick, so nothing
 * drifts and the end is the target to the last bit.
 *
 * output is the average rounded down, by less than 1. So its first difference stays within
 * the ramp's largest velocity, which is whole; its second is less than 2 beyond the ramp's
 * acceleration, 1 as both are whole, which init takes off beforehand; its third is less than
 * 4 beyond 2a/N.
 *
 * The largest numbers:
 *   limits to ticks   velocity 200000·2^32 < 2^50, acceleration < 2^64: per_tick()
 *   newest - oldest   N ticks at 400·2^32 each < 2^49
 *   velocity as Q16   (400·2^32 >> 8)·10⁹ < 2^63
 *   step times        tick_ns·way < 2^21·2^41 = 2^62
 */
#include "integers.h"
#include "ramp.h"

/* Without errno.h, which a kernel does not have in this form. */
#define BAD (-EINVAL)
#define OUT_OF_RANGE (-ERANGE)

#define STEP ((int64_t)1 << 32)
#define SECOND_NS 1000000000u

/* x per second as x per tick, rounded down. Any x: x/10⁹ < 2^35, times 2^21. */
static uint64_t per_tick(uint64_t x, uint32_t tick_ns)
{
	uint32_t rest;
	uint64_t seconds = div_u64_rem(x, SECOND_NS, &rest);

	return seconds * tick_ns + div_u64((uint64_t)rest * tick_ns, SECOND_NS);
}

static int64_t hold_profile(int64_t v, int64_t least, int64_t most)
{
	if (v > most)
		return most;
	return v < least ? least : v;
}

/* x/y rounded up; x + y < 2^64. */
static uint64_t rounded_up(uint64_t x, uint32_t y)
{
	return div_u64(x + y - 1, y);
}

static bool position_fits(int32_t position)
{
	return position >= -INCISE_PROFILE_POSITION_MAX &&
	       position <= INCISE_PROFILE_POSITION_MAX;
}

static bool limits_fit(const struct incise_profile_limits *limits)
{
	return limits->tick_ns >= INCISE_PROFILE_TICK_MIN_NS &&
	       limits->tick_ns <= INCISE_PROFILE_TICK_MAX_NS && limits->velocity >= 1 &&
	       limits->velocity <= INCISE_PROFILE_VELOCITY_MAX &&
	       limits->acceleration >= 1 && position_fits(limits->position_min) &&
	       position_fits(limits->position_max) &&
	       limits->position_min <= limits->position_max;
}

/* N = ⌈2a/(jT)⌉, in two steps of rounding up, which is the same and cannot overflow. */
static uint64_t average(const struct incise_profile_limits *limits)
{
	uint64_t n;

	if (!limits->jerk)
		return 1;
	n = rounded_up((uint64_t)limits->acceleration * 2 * SECOND_NS, limits->tick_ns);
	return div64_u64(n - 1, limits->jerk) + 1;
}

static uint64_t velocity_per_tick(const struct incise_profile_limits *limits,
				  uint32_t velocity)
{
	if (velocity > limits->velocity)
		velocity = limits->velocity;
	return per_tick((uint64_t)velocity << 32, limits->tick_ns);
}

static uint64_t acceleration_per_tick(const struct incise_profile_limits *limits)
{
	uint64_t a = per_tick((uint64_t)limits->acceleration << 32, limits->tick_ns);

	a = per_tick(a, limits->tick_ns);
	/* One off for the rounding of the average; the smallest, 10, becomes 9. */
	return average(limits) > 1 ? a - 1 : a;
}

int incise_profile_init(struct incise_profile *profile,
			const struct incise_profile_limits *limits, int32_t position)
{
	if (!limits_fit(limits))
		return BAD;
	if (position < limits->position_min || position > limits->position_max ||
	    average(limits) > INCISE_PROFILE_AVERAGE_MAX)
		return OUT_OF_RANGE;
	profile->ramp.acceleration = acceleration_per_tick(limits);
	profile->min = limits->position_min * STEP;
	profile->max = limits->position_max * STEP;
	profile->velocity_max = velocity_per_tick(limits, limits->velocity);
	profile->tick_ns = limits->tick_ns;
	profile->velocity = limits->velocity;
	profile->average = (uint32_t)average(limits);
	profile->reserved = 0;
	for (int i = 0; i < INCISE_PROFILE_AVERAGE_MAX; i++)
		profile->history[i] = 0;
	incise_profile_halt(profile, position);
	return 0;
}

static void set_target(struct incise_profile *profile, int64_t target, uint64_t top)
{
	if (target == profile->ramp.target && top == profile->ramp.top)
		return;
	profile->ramp.target = target;
	profile->ramp.top = top;
	profile->still = 0;
}

int64_t incise_profile_target(struct incise_profile *profile,
			      enum incise_profile_mode mode, int64_t target)
{
	uint64_t top;

	if (mode == INCISE_PROFILE_POSITION) {
		target = hold_profile(target, profile->min / STEP, profile->max / STEP);
		set_target(profile, target * STEP, profile->velocity_max);
		return target;
	}
	if (mode != INCISE_PROFILE_VELOCITY)
		target = 0;
	target = hold_profile(target, -(int64_t)profile->velocity, profile->velocity);
	top = (uint64_t)(target < 0 ? -target : target) << 32;
	set_target(profile, target < 0 ? profile->min : profile->max,
		   per_tick(top, profile->tick_ns));
	return target;
}

void incise_profile_stop(struct incise_profile *profile)
{
	incise_profile_target(profile, INCISE_PROFILE_VELOCITY, 0);
}

void incise_profile_halt(struct incise_profile *profile, int32_t position)
{
	int64_t at = hold_profile(position * STEP, profile->min, profile->max);

	incise_ramp_stand(&profile->ramp, at);
	profile->ramp.top = profile->velocity_max;
	for (uint32_t i = 0; i < profile->average; i++)
		profile->history[i] = at;
	profile->at = 0;
	profile->output = at;
	profile->rest = 0;
	profile->moved = 0;
	profile->whole = (int32_t)(at / STEP);
	profile->still = profile->average;
}

/* Take the newest position into the average, and move the output. */
static void take_profile(struct incise_profile *profile)
{
	uint32_t n = profile->average, rest;
	int64_t newest = profile->ramp.position;
	int64_t sum = newest - profile->history[profile->at] + profile->rest;

	profile->history[profile->at] = newest;
	if (++profile->at == n)
		profile->at = 0;
	if (n == 1) {
		profile->moved = sum;
	} else if (sum >= 0) {
		profile->moved = (int64_t)div_u64_rem((uint64_t)sum, n, &rest);
		profile->rest = rest;
	} else {
		/* Rounded down, not towards 0. */
		profile->moved = -(int64_t)div_u64_rem((uint64_t)-sum + n - 1, n, &rest);
		profile->rest = n - 1 - rest;
	}
	profile->output += profile->moved;
}

/* The whole steps that are due on the way to the slot's end. */
static void count_profile(struct incise_profile *profile,
			  struct incise_profile_slot *slot)
{
	int32_t whole = profile->whole;

	slot->dir = slot->to > slot->from ? 1 : slot->to < slot->from ? -1 : 0;
	slot->n = 0;
	slot->first = 0;
	if (slot->dir > 0 && slot->to >= (whole + 1) * STEP) {
		slot->n = (int32_t)(slot->to >> 32) - whole;
		slot->first = (uint64_t)((whole + 1) * STEP - slot->from);
	} else if (slot->dir < 0 && slot->to <= (whole - 1) * STEP) {
		slot->n = whole + (int32_t)(-slot->to >> 32);
		slot->first = (uint64_t)(slot->from - (whole - 1) * STEP);
	}
	profile->whole += slot->dir * slot->n;
}

void incise_profile_tick(struct incise_profile *profile, struct incise_profile_slot *slot)
{
	bool stood = !profile->ramp.velocity;

	slot->from = profile->output;
	slot->tick_ns = profile->tick_ns;
	slot->reserved = 0;
	if (incise_profile_resting(profile)) {
		profile->moved = 0;
	} else {
		incise_ramp_tick(&profile->ramp);
		take_profile(profile);
		/* A ramp that stood and stands does so until there is a new target. */
		profile->still =
			stood && !profile->ramp.velocity ? profile->still + 1 : 0;
	}
	slot->to = profile->output;
	count_profile(profile, slot);
}

uint32_t incise_profile_step_ns(const struct incise_profile_slot *slot, int32_t k)
{
	uint64_t way =
		(uint64_t)(slot->dir < 0 ? slot->from - slot->to : slot->to - slot->from);
	uint64_t there;

	if (slot->n <= 0 || !way)
		return slot->tick_ns;
	k = (int32_t)hold_profile(k, 0, slot->n - 1);
	there = slot->first + (uint64_t)k * STEP;
	return (uint32_t)div64_u64(there * slot->tick_ns + way - 1, way);
}

bool incise_profile_resting(const struct incise_profile *profile)
{
	return profile->still >= profile->average;
}

bool incise_profile_ahead(const struct incise_profile *profile, int32_t direction)
{
	int64_t next = (profile->whole + (int64_t)direction) * STEP;
	int64_t far = profile->ramp.top ? profile->ramp.target : profile->ramp.position;

	/* It goes on until it has braked, beyond its target if need be. It arrives with a velocity. */
	if (profile->ramp.velocity * direction > 0 &&
	    profile->ramp.position != profile->ramp.target)
		return true;
	/* Positions that the average has not reached. */
	for (uint32_t i = 0; i < profile->average; i++)
		if (direction > 0 ? profile->history[i] > far : profile->history[i] < far)
			far = profile->history[i];
	return direction > 0 ? far >= next : far <= next;
}

int32_t incise_profile_position(const struct incise_profile *profile)
{
	return profile->whole;
}

int64_t incise_profile_velocity(const struct incise_profile *profile)
{
	uint64_t moved =
		(uint64_t)(profile->moved < 0 ? -profile->moved : profile->moved);
	uint64_t q16 = div_u64((moved >> 8) * SECOND_NS, profile->tick_ns) >> 8;

	return profile->moved < 0 ? -(int64_t)q16 : (int64_t)q16;
}

uint64_t incise_profile_stopping_steps(const struct incise_profile_limits *limits,
				       uint32_t velocity)
{
	uint64_t v, way, travel, n;

	if (!limits_fit(limits) || average(limits) > INCISE_PROFILE_AVERAGE_MAX)
		return INCISE_RAMP_UNBOUNDED;
	n = average(limits);
	v = velocity_per_tick(limits, velocity);
	travel = (uint64_t)((int64_t)limits->position_max - limits->position_min);
	way = incise_ramp_way(v, acceleration_per_tick(limits));
	if (way >= travel * STEP)
		return travel;
	/* The average trails by the mean of 0 … n-1 ticks, and is rounded down. */
	if (v && n > 1)
		way += (v * (n - 1) + 1) / 2 + 1;
	/* A step is due when the position gets there: rounded up to the whole. */
	way = (way + STEP - 1) >> 32;
	return way < travel ? way : travel;
}

uint64_t incise_profile_stopping_ns(const struct incise_profile_limits *limits,
				    uint32_t velocity)
{
	uint64_t v, a, ticks;

	if (!limits_fit(limits) || average(limits) > INCISE_PROFILE_AVERAGE_MAX)
		return INCISE_RAMP_UNBOUNDED;
	v = velocity_per_tick(limits, velocity);
	if (!v)
		return 0;
	a = acceleration_per_tick(limits);
	/* The ramp moves in ⌈v/a⌉ - 1 ticks, and each is in the average for N. */
	ticks = div64_u64(v - 1, a) + 1 + average(limits) - 2;
	return ticks * limits->tick_ns;
}
