/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Holds each tick of a motion profile against every inequality that lib/fixed/profile.h
 * promises, in integers of 128 bits where it can. For the unit tests and the fuzzer.
 *
 * It knows limits, slots and step times only, and nothing of how they are made.
 */
#ifndef PROFILE_WATCH_H
#define PROFILE_WATCH_H

#include <stdlib.h>
#include <string.h>
#include "../../../lib/fixed/profile.h"

#define WATCH_STEP ((int64_t)1 << 32)
#define WATCH_BACK 32 /* steps that are remembered */

typedef __int128 wide;

struct watch {
	struct incise_profile_limits limits;
	int64_t moved_max, second_max; /* of P, 2^-32 steps */
	double third_max;
	int64_t steps_max; /* in a tick */
	int64_t to, moved, second, sum;
	int64_t now; /* ns */
	int64_t time[WATCH_BACK];
	int dir[WATCH_BACK];
	uint64_t n; /* steps so far */
};

/* At rest at a position, all history forgotten. */
static inline void watch_rest(struct watch *w, int32_t position)
{
	w->sum = position;
	w->to = position * WATCH_STEP;
	w->moved = w->second = 0;
	w->n = 0;
}

static inline void watch_begin(struct watch *w,
			       const struct incise_profile_limits *limits,
			       int32_t position)
{
	const wide s = 1000000000;
	wide velocity = (wide)limits->velocity * limits->tick_ns * WATCH_STEP;
	wide acceleration = (wide)limits->acceleration * limits->tick_ns *
			    limits->tick_ns * WATCH_STEP;
	double tick = limits->tick_ns * 1e-9;

	memset(w, 0, sizeof(*w));
	w->limits = *limits;
	w->moved_max = (int64_t)(velocity / s);
	w->second_max = acceleration / s / s > INT64_MAX
				? INT64_MAX
				: (int64_t)(acceleration / s / s);
	/* Of double's five roundings, 1e-15 together. */
	w->third_max = limits->jerk
			       ? limits->jerk * tick * tick * tick * 0x1p32 * (1 + 1e-15)
			       : 1e300;
	w->steps_max = (int64_t)limits->velocity * limits->tick_ns / 1000000000 + 1;
	watch_rest(w, position);
}

/* Step i, counted back from the newest. */
static inline int watch_place(const struct watch *w, uint64_t back)
{
	return (int)((w->n - 1 - back) % WATCH_BACK);
}

/* t(i) - t(i-n), or -1 where there are not that many. */
static inline int64_t watch_gap(const struct watch *w, uint64_t to, uint64_t from)
{
	if (from >= w->n || from >= WATCH_BACK)
		return -1;
	return w->time[watch_place(w, to)] - w->time[watch_place(w, from)];
}

static inline const char *watch_step(struct watch *w,
				     const struct incise_profile_slot *slot, int k)
{
	static const unsigned int backs[] = {1, 2, 3, 7, 15, 31};
	uint32_t ns = incise_profile_step_ns(slot, k);
	int64_t way = slot->dir * (slot->to - slot->from), g, h;
	double e = 1e-9, bound, old, new;
	wide crossing;

	w->sum += slot->dir;
	if (w->sum < w->limits.position_min || w->sum > w->limits.position_max)
		return "a step beyond the position limits";
	if (ns < 1 || ns > slot->tick_ns)
		return "a step outside of its tick";
	/* It is there at ns, and was not 1 ns before. */
	crossing = (wide)slot->dir * (w->sum * WATCH_STEP - slot->from) * slot->tick_ns;
	if ((wide)way * ns < crossing || (wide)way * (ns - 1) >= crossing)
		return "a step before or after the position is there";

	w->n++;
	w->time[watch_place(w, 0)] = w->now + ns;
	w->dir[watch_place(w, 0)] = slot->dir;
	for (size_t i = 0; i < sizeof(backs) / sizeof(*backs); i++) {
		int64_t gap = watch_gap(w, 0, backs[i]);

		if (gap >= 0 && gap < (int64_t)backs[i] * 1000000000 / w->limits.velocity)
			return "steps nearer than velocity allows";
	}
	if (w->n < 3 || w->dir[watch_place(w, 0)] != w->dir[watch_place(w, 1)] ||
	    w->dir[watch_place(w, 1)] != w->dir[watch_place(w, 2)])
		return NULL;
	g = watch_gap(w, 1, 2);
	h = watch_gap(w, 0, 1);
	old = g * e;
	new = h *e;
	bound = w->limits.acceleration * ((old + new) / 2 + w->limits.tick_ns * e + e);
	/* The last factor is of double's roundings, the last term of those of 1/g and 1/h. */
	bound = bound * (1 + 1e-12) + 1e-9;
	if (g > 1 && h > 1 &&
	    (1 / (new + e) - 1 / (old - e) > bound ||
	     1 / (old + e) - 1 / (new - e) > bound))
		return "gaps of steps change faster than acceleration allows";
	return NULL;
}

/*
 * Take the slot of the tick that the profile just did.
 *
 * Returns NULL, or what is wrong.
 */
static inline const char *watch_tick(struct watch *w,
				     const struct incise_profile *profile,
				     const struct incise_profile_slot *slot)
{
	int64_t moved = slot->to - slot->from, second = moved - w->moved;
	int64_t third = second - w->second, away;
	const char *wrong;

	if (slot->from != w->to)
		return "a slot does not begin where the last ended";
	if (slot->to < w->limits.position_min * WATCH_STEP ||
	    slot->to > w->limits.position_max * WATCH_STEP)
		return "beyond the position limits";
	if (llabs(moved) > w->moved_max)
		return "faster than velocity";
	if (llabs(second) > w->second_max)
		return "more than acceleration";
	/* Strictly below 4·2^-32 steps more, for the rounding of P. */
	if ((double)llabs(third) - 4 >= w->third_max)
		return "more than jerk";
	if (slot->dir != (moved > 0) - (moved < 0))
		return "dir is not that of the motion";
	if (slot->n < 0 || slot->n > w->steps_max)
		return "more steps in a tick than velocity allows";
	for (int k = 0; k < slot->n; k++) {
		wrong = watch_step(w, slot, k);
		if (wrong)
			return wrong;
	}
	away = slot->to - w->sum * WATCH_STEP;
	if (llabs(away) >= WATCH_STEP)
		return "a step was left out";
	if (incise_profile_position(profile) != w->sum)
		return "the position is not the sum of steps";
	if (incise_profile_resting(profile) && moved)
		return "moves while it rests";
	w->to = slot->to;
	w->moved = moved;
	w->second = second;
	w->now += slot->tick_ns;
	return NULL;
}

#endif
