// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The motion profile under libFuzzer: bytes become limits, then commands and ticks; every
 * tick is held against what lib/fixed/profile.h promises, and at the end so is a stop.
 *
 *   limits  tick 4 · velocity 4 · acceleration 4 · jerk 8 · min 4 · max 4 · begin 4 · how 1
 *   then, until the bytes end, one command: what 1 · target 8, little-endian
 *
 *   how & 1   taken as they are; else brought into range, so that most inputs move
 *   what & 7  0 halt, 1 stop, 2 velocity, 3 any mode whatever, 4 … 7 position;
 *   what >> 3 that many ticks follow, squared
 */
#include <stdio.h>
#include "../unit/fixed/profile_watch.h"

/* Of one input, so that it is fast; the stop comes on top. */
#define TICKS_MAX 1000
#define STEPS_MAX 4000

struct bytes {
	const uint8_t *data;
	size_t n;
};

/* Zeros behind the end. */
static uint64_t take(struct bytes *bytes, int n)
{
	uint64_t v = 0;

	for (int i = 0; i < n && bytes->n; i++, bytes->data++, bytes->n--)
		v |= (uint64_t)*bytes->data << 8 * i;
	return v;
}

static uint32_t within(uint64_t v, uint32_t least, uint32_t most)
{
	return least + (uint32_t)(v % ((uint64_t)most - least + 1));
}

static struct incise_profile_limits take_limits(struct bytes *bytes, int32_t *position)
{
	struct incise_profile_limits l = {
		.tick_ns = (uint32_t)take(bytes, 4),
		.velocity = (uint32_t)take(bytes, 4),
		.acceleration = (uint32_t)take(bytes, 4),
		.jerk = take(bytes, 8),
		.position_min = (int32_t)take(bytes, 4),
		.position_max = (int32_t)take(bytes, 4),
	};
	uint64_t least;

	*position = (int32_t)take(bytes, 4);
	if (take(bytes, 1) & 1)
		return l;
	l.tick_ns =
		within(l.tick_ns, INCISE_PROFILE_TICK_MIN_NS, INCISE_PROFILE_TICK_MAX_NS);
	l.velocity = within(l.velocity, 1, INCISE_PROFILE_VELOCITY_MAX);
	l.acceleration = within(l.acceleration, 1, UINT32_MAX);
	/* The least that an average can do, and a little on top. */
	least = (uint64_t)(2e9 * l.acceleration / l.tick_ns /
			   INCISE_PROFILE_AVERAGE_MAX) +
		1;
	if (l.jerk)
		l.jerk = least + (l.jerk & 1 ? l.jerk >> (l.jerk & 63) : 0);
	l.position_min %= INCISE_PROFILE_POSITION_MAX;
	l.position_max = (int32_t)within((uint32_t)l.position_max, 0,
					 (uint32_t)(INCISE_PROFILE_POSITION_MAX -
						    l.position_min)) +
			 l.position_min;
	*position = l.position_min +
		    (int32_t)((uint32_t)*position %
			      ((uint32_t)(l.position_max - l.position_min) + 1));
	return l;
}

static void wrong(const char *what)
{
	fprintf(stderr, "profile: %s\n", what);
	abort();
}

struct run {
	struct incise_profile profile;
	struct incise_profile_slot slot;
	struct watch watch;
	int ticks;
	int64_t steps;
};

static void tick(struct run *run)
{
	const char *what;

	incise_profile_tick(&run->profile, &run->slot);
	run->ticks++;
	run->steps += run->slot.n;
	what = watch_tick(&run->watch, &run->profile, &run->slot);
	if (what)
		wrong(what);
}

static void command(struct run *run, unsigned int what, int64_t target)
{
	enum incise_profile_mode mode = INCISE_PROFILE_POSITION;

	switch (what) {
	case 0:
		incise_profile_halt(&run->profile, (int32_t)target);
		watch_rest(&run->watch, incise_profile_position(&run->profile));
		return;
	case 1:
		incise_profile_stop(&run->profile);
		return;
	case 2:
		mode = INCISE_PROFILE_VELOCITY;
		break;
	case 3:
		mode = (enum incise_profile_mode)(target & 0xff);
		break;
	}
	incise_profile_target(&run->profile, mode, target);
}

/* Stopped within what is stated, where that is not too long to try. */
static void check_stop(struct run *run, const struct incise_profile_limits *l)
{
	uint64_t most_steps = incise_profile_stopping_steps(l, l->velocity), steps = 0;
	uint64_t most_ticks = incise_profile_stopping_ns(l, l->velocity) / l->tick_ns;

	if (most_ticks > TICKS_MAX || most_steps > STEPS_MAX)
		return;
	incise_profile_stop(&run->profile);
	for (uint64_t k = 0; k < most_ticks; k++) {
		tick(run);
		steps += (uint64_t)run->slot.n;
	}
	if (steps > most_steps)
		wrong("a longer way to a stop than stated");
	tick(run);
	if (run->slot.dir)
		wrong("a longer time to a stop than stated");
	for (uint32_t k = 0; k <= run->profile.average; k++)
		tick(run);
	if (!incise_profile_resting(&run->profile))
		wrong("does not rest after a stop");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct bytes bytes = {data, size};
	struct incise_profile_limits l;
	static struct run run;
	int32_t position;

	l = take_limits(&bytes, &position);
	if (incise_profile_init(&run.profile, &l, position)) {
		/* Refused limits are as harmless here. */
		incise_profile_stopping_steps(&l, (uint32_t)take(&bytes, 4));
		incise_profile_stopping_ns(&l, (uint32_t)take(&bytes, 4));
		return 0;
	}
	watch_begin(&run.watch, &l, position);
	run.ticks = 0;
	run.steps = 0;
	while (bytes.n && run.ticks < TICKS_MAX && run.steps < STEPS_MAX) {
		unsigned int what = (unsigned int)take(&bytes, 1);

		command(&run, what & 7, (int64_t)take(&bytes, 8));
		for (unsigned int k = (what >> 3) * (what >> 3);
		     k && run.steps < STEPS_MAX; k--)
			tick(&run);
	}
	check_stop(&run, &l);
	return 0;
}
