// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The motion profile: every promise of lib/fixed/profile.h over motions by chance (see
 * profile_watch.h), arrival and stops against closed forms, the average against adding up.
 */
#include "../unit.h"
#include "profile_watch.h"
#include "../model/paper_model.h"

#define FOREVER 2000000 /* ticks: no motion of these tests takes as many */

/* Evenly distributed in its logarithm, least … most. */
static double any(double least, double most, uint64_t *seed)
{
	double share = (paper_random(seed) + 1) / 2;

	/* The ends themselves in one of ten each. */
	if (share < 0.1)
		return least;
	if (share > 0.9)
		return most;
	return fmin(most, least * pow(most / least, (share - 0.1) / 0.8));
}

static int pick(int n, uint64_t *seed)
{
	return (int)((paper_random(seed) + 1) / 2 * n);
}

static struct incise_profile_limits any_limits(uint64_t *seed)
{
	struct incise_profile_limits l = {
		.tick_ns = (uint32_t)any(INCISE_PROFILE_TICK_MIN_NS,
					 INCISE_PROFILE_TICK_MAX_NS, seed),
		.velocity = (uint32_t)any(1, INCISE_PROFILE_VELOCITY_MAX, seed),
		.acceleration = (uint32_t)any(1, 0x1p31, seed),
	};
	double reach = any(1, INCISE_PROFILE_POSITION_MAX, seed);

	l.position_min = (int32_t)(reach * paper_random(seed));
	l.position_max =
		l.position_min + (int32_t)fmin(reach, INCISE_PROFILE_POSITION_MAX -
							      (double)l.position_min);
	/* Averages of all lengths, and none. */
	if (pick(4, seed)) {
		double n = any(1, INCISE_PROFILE_AVERAGE_MAX, seed);

		l.jerk = (uint64_t)ceil(2.0 * l.acceleration / (n * l.tick_ns * 1e-9));
		if (!l.jerk)
			l.jerk = 1;
	}
	return l;
}

struct motion {
	struct incise_profile profile;
	struct incise_profile_slot slot;
	struct watch watch;
	uint64_t ticks;
};

static void begin(struct motion *m, const struct incise_profile_limits *limits,
		  int32_t position)
{
	assert_int_equal(incise_profile_init(&m->profile, limits, position), 0);
	watch_begin(&m->watch, limits, position);
	m->ticks = 0;
}

static void tick(struct motion *m)
{
	const char *wrong;

	incise_profile_tick(&m->profile, &m->slot);
	m->ticks++;
	wrong = watch_tick(&m->watch, &m->profile, &m->slot);
	if (wrong)
		fail_msg("%s: tick %llu of %u ns, v %u, a %u, j %llu, %d … %d", wrong,
			 (unsigned long long)m->ticks, m->watch.limits.tick_ns,
			 m->watch.limits.velocity, m->watch.limits.acceleration,
			 (unsigned long long)m->watch.limits.jerk,
			 m->watch.limits.position_min, m->watch.limits.position_max);
}

/* Returns the tick that moved last. */
static uint64_t until_rest(struct motion *m)
{
	uint64_t last = m->ticks;

	while (!incise_profile_resting(&m->profile)) {
		tick(m);
		if (m->slot.dir)
			last = m->ticks;
		assert_true(m->ticks < FOREVER);
	}
	return last;
}

static void go(struct motion *m, int64_t target)
{
	incise_profile_target(&m->profile, INCISE_PROFILE_POSITION, target);
}

/* A target that means something at these limits, or any number whatever. */
static int64_t any_target(const struct incise_profile_limits *l, int32_t at,
			  enum incise_profile_mode mode, uint64_t *seed)
{
	switch (pick(8, seed)) {
	case 0:
		return (int64_t)(0x1p63 * paper_random(seed));
	case 1:
		return pick(2, seed) ? INT64_MAX : INT64_MIN;
	case 2: /* a little way: it is retargeted within its braking */
		return mode == INCISE_PROFILE_POSITION ? at + pick(5, seed) - 2
						       : pick(3, seed) - 1;
	}
	if (mode == INCISE_PROFILE_VELOCITY)
		return (int64_t)(1.2 * l->velocity * paper_random(seed));
	return at + (int64_t)(paper_random(seed) *
			      any(1, 200.0 * l->velocity * l->tick_ns * 1e-9 + 10, seed));
}

static void any_command(struct motion *m, uint64_t *seed)
{
	const struct incise_profile_limits *l = &m->watch.limits;
	enum incise_profile_mode mode =
		pick(3, seed) ? INCISE_PROFILE_POSITION : INCISE_PROFILE_VELOCITY;
	int32_t at = incise_profile_position(&m->profile);

	switch (pick(20, seed)) {
	case 0:
		incise_profile_stop(&m->profile);
		return;
	case 1:
		incise_profile_halt(&m->profile, at);
		assert_true(incise_profile_resting(&m->profile));
		watch_rest(&m->watch, at);
		return;
	}
	incise_profile_target(&m->profile, mode, any_target(l, at, mode, seed));
}

TEST(test_any_motion)
{
	uint64_t seed = 1, averaged = 0, steps = 0, ends = 0;

	for (int n = 0; n < 40000; n++) {
		struct incise_profile_limits l = any_limits(&seed);
		static struct motion m;
		int every = 1 << pick(8, &seed);

		begin(&m, &l, pick(2, &seed) ? l.position_min : l.position_max);
		averaged += m.profile.average > 1;
		for (int k = 0; k < 300; k++) {
			if (!pick(every, &seed))
				any_command(&m, &seed);
			tick(&m);
			ends += m.slot.dir && (m.slot.to == m.profile.min ||
					       m.slot.to == m.profile.max);
			steps += (uint64_t)m.slot.n;
		}
	}
	/* It did meet what it is to be held against. */
	assert_true(averaged > 20000);
	assert_true(steps > 5000000);
	assert_true(ends > 50000);
}

/*
 * Run until rest: a step only comes in a direction that is known to have one ahead, and neither has after
 * the last step of a motion from rest.
 */
static void end_known(struct motion *m, bool from_rest)
{
	bool up = false, down = false;

	while (!incise_profile_resting(&m->profile)) {
		bool any_up = incise_profile_ahead(&m->profile, 1);
		bool any_down = incise_profile_ahead(&m->profile, -1);

		tick(m);
		assert_true(m->ticks < FOREVER);
		if (!m->slot.n)
			continue;
		assert_true(m->slot.dir > 0 ? any_up : any_down);
		up = incise_profile_ahead(&m->profile, 1);
		down = incise_profile_ahead(&m->profile, -1);
	}
	/* From another motion it may be braking, and stop within a step. */
	assert_true(!from_rest || !(up || down));
	assert_false(incise_profile_ahead(&m->profile, 1));
	assert_false(incise_profile_ahead(&m->profile, -1));
}

/* From any motion, the last target is reached to the last bit. */
TEST(test_any_end)
{
	uint64_t seed = 2;

	for (int n = 0; n < 2000; n++) {
		struct incise_profile_limits l = any_limits(&seed);
		static struct motion m;
		int32_t target;

		/* Limits under which it arrives within some thousand ticks. */
		if (l.acceleration * pow(l.tick_ns * 1e-9, 2) < 1e-4 ||
		    l.velocity * l.tick_ns * 1e-9 < 1e-2)
			continue;
		begin(&m, &l, l.position_min);
		for (int k = 0; k < 100; k++) {
			if (!pick(10, &seed))
				any_command(&m, &seed);
			tick(&m);
		}
		target = (int32_t)incise_profile_target(
			&m.profile, INCISE_PROFILE_POSITION,
			any_target(&l, incise_profile_position(&m.profile),
				   INCISE_PROFILE_VELOCITY, &seed) %
					1000 +
				incise_profile_position(&m.profile));
		assert_in_range(target - (int64_t)l.position_min, 0,
				l.position_max - (int64_t)l.position_min);
		end_known(&m, false);
		assert_int_equal(m.profile.output, target * WATCH_STEP);
		assert_int_equal(m.profile.rest, 0);
		assert_int_equal(incise_profile_position(&m.profile), target);
		assert_int_equal(incise_profile_velocity(&m.profile), 0);
		/* And stays. */
		tick(&m);
		assert_int_equal(m.slot.n, 0);
		assert_int_equal(m.slot.dir, 0);
		go(&m, target + pick(2001, &seed) - 1000);
		end_known(&m, true);
	}
}

/* The average of the ramp's last N positions, added up. */
TEST(test_average_is_exact)
{
	uint64_t seed = 3;
	int met = 0;

	for (int n = 0; n < 300; n++) {
		struct incise_profile_limits l = any_limits(&seed);
		static int64_t ramp[400];
		static struct motion m;
		int32_t size;

		begin(&m, &l, l.position_min);
		size = (int32_t)m.profile.average;
		for (int k = 0; k < 400; k++) {
			wide sum = 0;

			if (!pick(20, &seed))
				incise_profile_target(&m.profile, pick(2, &seed),
						      any_target(&l, 0, k % 2, &seed));
			tick(&m);
			ramp[k] = m.profile.ramp.position;
			for (int i = 0; i < size; i++)
				sum += k < i ? l.position_min * WATCH_STEP : ramp[k - i];
			if ((wide)m.profile.output * size + m.profile.rest != sum ||
			    m.profile.rest >= m.profile.average)
				fail_msg("N %d, tick %d", size, k);
			met += size > 1 && m.slot.dir;
		}
	}
	assert_true(met > 10000);
}

/*
 * From rest to rest, trapezoid or triangle, in ticks. Braking from V in whole ticks is done
 * up to a tick later than in continuous time, for the first tick of a motion is at a
 * already and so is the last: at most 2 ticks more, and never fewer than it needs but for
 * that same tick.
 */
TEST(test_arrival)
{
	static const struct {
		uint32_t tick_ns, velocity, acceleration;
		uint64_t jerk;
		int32_t way;
	} rows[] = {
		{1000000, 20000, 400000, 0, 50000},
		{1000000, 20000, 400000, 0, 1000}, /* v²/a: the longest triangle */
		{1000000, 20000, 400000, 0, 999},
		{1000000, 20000, 400000, 0, 10},
		{1000000, 20000, 400000, 20000000, 50000},
		{1000000, 20000, 400000, 20000000, -50000},
		{1000000, 20000, 400000, 3200000, 50000}, /* N = 250 */
		{50000, 40000, 1000000, 0, 100000},
		{50000, 40000, 1000000, 400000000, -100000},
		{50000, 200000, 10000000, 2000000000, 200000},
		{2000000, 200000, 10000000, 0, 1000000},
		{2000000, 1000, 100, 0, -2000},
		{137000, 12345, 54321, 98765432, 4321},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct incise_profile_limits l = {
			.tick_ns = rows[i].tick_ns,
			.velocity = rows[i].velocity,
			.acceleration = rows[i].acceleration,
			.jerk = rows[i].jerk,
			.position_min = -2000000,
			.position_max = 2000000,
		};
		double v = l.velocity, a = l.acceleration, d = abs(rows[i].way);
		double seconds = d >= v * v / a ? d / v + v / a : 2 * sqrt(d / a);
		double ticks = seconds / (l.tick_ns * 1e-9);
		static struct motion m;
		double took;

		begin(&m, &l, 7);
		assert_int_equal(
			m.profile.average,
			l.jerk ? ceil(2 * a / (l.jerk * (l.tick_ns * 1e-9)) - 1e-9) : 1);
		go(&m, 7 + rows[i].way);
		took = (double)until_rest(&m) - (m.profile.average - 1);
		if (took < ticks - 1 || took > ticks + 2)
			fail_msg("row %zu: %g ticks, not %g", i, took, ticks);
		assert_int_equal(incise_profile_position(&m.profile), 7 + rows[i].way);
	}
}

/* Steps and ns that a stop took, from now on. */
static void stop(struct motion *m, uint64_t *steps, uint64_t *ns)
{
	uint64_t begin_tick = m->ticks, last = m->ticks;

	*steps = 0;
	incise_profile_stop(&m->profile);
	while (!incise_profile_resting(&m->profile)) {
		tick(m);
		*steps += (uint64_t)m->slot.n;
		if (m->slot.dir)
			last = m->ticks;
		assert_true(m->ticks < FOREVER);
	}
	*ns = (last - begin_tick) * m->watch.limits.tick_ns;
}

/* Any motion whatever stops within what is stated for the fastest. */
TEST(test_stops_as_stated)
{
	uint64_t seed = 4, met = 0;

	for (int n = 0; n < 3000; n++) {
		struct incise_profile_limits l = any_limits(&seed);
		static struct motion m;
		uint64_t steps, ns, most_steps, most_ns;

		most_steps = incise_profile_stopping_steps(&l, l.velocity);
		most_ns = incise_profile_stopping_ns(&l, l.velocity);
		if (most_ns / l.tick_ns > 3000)
			continue;
		met++;
		begin(&m, &l, l.position_min + (l.position_max - l.position_min) / 2);
		for (int k = 0; k < 300; k++) {
			if (!pick(50, &seed))
				any_command(&m, &seed);
			tick(&m);
		}
		stop(&m, &steps, &ns);
		if (steps > most_steps || ns > most_ns)
			fail_msg("%llu steps in %llu ns, stated are %llu in %llu",
				 (unsigned long long)steps, (unsigned long long)ns,
				 (unsigned long long)most_steps,
				 (unsigned long long)most_ns);
	}
	assert_true(met > 1000);
}

/* The stated stopping time is a stop's from full speed to the tick, the stated way to one step. */
TEST(test_stops_no_earlier)
{
	static const struct incise_profile_limits rows[] = {
		{1000000, 20000, 400000, -2000000, 2000000, 0},
		{1000000, 20000, 400000, -2000000, 2000000, 20000000},
		{50000, 40000, 1000000, -2000000, 2000000, 400000000},
		{2000000, 200000, 3000000, -2000000, 2000000, 20000000},
		{1000000, 20000, 0xffffffff, -2000000, 2000000, 0},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++)
		for (uint32_t v = rows[i].velocity; v > 100; v /= 3) {
			static struct motion m;
			uint64_t steps, ns,
				most = incise_profile_stopping_steps(rows + i, v);

			begin(&m, rows + i, -1900000);
			incise_profile_target(&m.profile, INCISE_PROFILE_VELOCITY, v);
			for (int k = 0; k < 4000; k++)
				tick(&m);
			stop(&m, &steps, &ns);
			assert_in_range(steps, most ? most - 1 : 0, most);
			assert_int_equal(ns, incise_profile_stopping_ns(rows + i, v));
		}
}

TEST(test_stopping_extremes)
{
	struct incise_profile_limits l = {50000, 200000, 1, -1000000000, 1000000000, 0};

	/* v²/2a would be 2·10^10 steps. */
	assert_int_equal(incise_profile_stopping_steps(&l, 0xffffffff), 2000000000);
	/* v/a = 200000 s, and more by what rounding took off a: 10 of 10.7 are left. */
	assert_in_range(incise_profile_stopping_ns(&l, 0xffffffff),
			200000 * 1000000000ull, 215000 * 1000000000ull);
	assert_int_equal(incise_profile_stopping_steps(&l, 0), 0);
	assert_int_equal(incise_profile_stopping_ns(&l, 0), 0);
	l.position_min = l.position_max = 5;
	assert_int_equal(incise_profile_stopping_steps(&l, 200000), 0);
	l.tick_ns = 0;
	assert_true(incise_profile_stopping_steps(&l, 1) == UINT64_MAX);
	assert_true(incise_profile_stopping_ns(&l, 1) == UINT64_MAX);
	l.tick_ns = 50000;
	l.acceleration = 1000000;
	l.jerk = 1;
	assert_true(incise_profile_stopping_steps(&l, 1) == UINT64_MAX);
	assert_true(incise_profile_stopping_ns(&l, 1) == UINT64_MAX);
}

#define GOOD .tick_ns = 50000, .velocity = 1, .acceleration = 1

TEST(test_init)
{
	static const struct {
		struct incise_profile_limits limits;
		int32_t position;
		int result;
	} rows[] = {
		{{GOOD}, 0, 0},
		{{2000000, 200000, 0xffffffff, -1000000000, 1000000000, UINT64_MAX},
		 5,
		 0},
		{{49999, 1, 1, 0, 0, 0}, 0, -22},
		{{2000001, 1, 1, 0, 0, 0}, 0, -22},
		{{50000, 0, 1, 0, 0, 0}, 0, -22},
		{{50000, 200001, 1, 0, 0, 0}, 0, -22},
		{{50000, 1, 0, 0, 0, 0}, 0, -22},
		{{50000, 1, 1, 1, 0, 0}, 0, -22},
		{{50000, 1, 1, -1000000001, 0, 0}, 0, -22},
		{{50000, 1, 1, 0, 1000000001, 0}, 0, -22},
		{{50000, 1, 1, INT32_MIN, INT32_MAX, 0}, 0, -22},
		{{GOOD}, 1, -34},
		{{GOOD}, -1, -34},
		{{GOOD, .position_min = -1000000000}, INT32_MIN, -34},
		/* 2a/(jT) = 256, and just more. */
		{{1000000, 1, 128000, 0, 0, 1000000}, 0, 0},
		{{1000000, 1, 128000, 0, 0, 999999}, 0, -34},
		{{1000000, 1, 0xffffffff, 0, 0, 1}, 0, -34},
	};

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		struct incise_profile p, before;

		memset(&p, 0x5a, sizeof(p));
		before = p;
		if (incise_profile_init(&p, &rows[i].limits, rows[i].position) !=
		    rows[i].result)
			fail_msg("row %zu", i);
		if (rows[i].result)
			assert_memory_equal(&p, &before, sizeof(p));
		else
			assert_true(incise_profile_resting(&p) &&
				    incise_profile_position(&p) == rows[i].position &&
				    incise_profile_velocity(&p) == 0);
	}
}

TEST(test_targets_are_clamped)
{
	static const struct {
		int mode;
		int64_t target, in_force;
	} rows[] = {
		{INCISE_PROFILE_POSITION, 99, 99},
		{INCISE_PROFILE_POSITION, 101, 100},
		{INCISE_PROFILE_POSITION, INT64_MAX, 100},
		{INCISE_PROFILE_POSITION, INT64_MIN, -50},
		{INCISE_PROFILE_VELOCITY, 999, 999},
		{INCISE_PROFILE_VELOCITY, 1001, 1000},
		{INCISE_PROFILE_VELOCITY, INT64_MAX, 1000},
		{INCISE_PROFILE_VELOCITY, INT64_MIN, -1000},
		{2, 5, 0},
		{-1, INT64_MIN, 0},
	};
	struct incise_profile_limits l = {1000000, 1000, 100000, -50, 100, 0};
	static struct motion m;

	for (size_t i = 0; i < sizeof(rows) / sizeof(*rows); i++) {
		begin(&m, &l, 0);
		assert_int_equal(incise_profile_target(&m.profile, rows[i].mode,
						       rows[i].target),
				 rows[i].in_force);
		until_rest(&m);
		if (rows[i].mode == INCISE_PROFILE_POSITION)
			assert_int_equal(incise_profile_position(&m.profile),
					 rows[i].in_force);
		else
			assert_int_equal(incise_profile_position(&m.profile),
					 rows[i].in_force > 0	? 100
					 : rows[i].in_force < 0 ? -50
								: 0);
	}
}

/* A set-point takes effect in the tick behind it, at the limits. */
TEST(test_next_tick)
{
	struct incise_profile_limits l = {1000000, 20000, 2000000, -100000, 100000, 0};
	static struct motion m;

	begin(&m, &l, 0);
	go(&m, 50000);
	tick(&m);
	/* 2 steps/tick², rounded down. */
	assert_in_range(m.slot.to, 2 * WATCH_STEP - 2, 2 * WATCH_STEP);
	for (int k = 0; k < 100; k++)
		tick(&m);
	go(&m, -50000);
	tick(&m);
	assert_in_range(m.slot.to - m.slot.from, 18 * WATCH_STEP - 2,
			18 * WATCH_STEP + 2);
}

/* Nearer than it can stop: past it, no farther than it must, and back. */
TEST(test_comes_back)
{
	struct incise_profile_limits l = {1000000, 20000,  400000,
					  -100000, 100000, 20000000};
	static struct motion m;
	int32_t at, most;

	begin(&m, &l, 0);
	incise_profile_target(&m.profile, INCISE_PROFILE_VELOCITY, 20000);
	for (int k = 0; k < 1000; k++)
		tick(&m);
	at = most = incise_profile_position(&m.profile);
	go(&m, at + 100);
	while (!incise_profile_resting(&m.profile)) {
		tick(&m);
		if (incise_profile_position(&m.profile) > most)
			most = incise_profile_position(&m.profile);
	}
	assert_int_equal(incise_profile_position(&m.profile), at + 100);
	/* The average turns back before the ramp is at its end: not the whole way of a stop. */
	assert_in_range(most - at, 400, incise_profile_stopping_steps(&l, 20000));
}

TEST(test_halt)
{
	struct incise_profile_limits l = {1000000, 20000, 400000, -1000, 1000, 20000000};
	static struct motion m;

	begin(&m, &l, 0);
	go(&m, 1000);
	for (int k = 0; k < 60; k++)
		tick(&m);
	assert_true(m.slot.n > 1);
	incise_profile_halt(&m.profile, 321);
	watch_rest(&m.watch, 321);
	assert_true(incise_profile_resting(&m.profile));
	assert_int_equal(incise_profile_velocity(&m.profile), 0);
	for (int k = 0; k < 100; k++) {
		tick(&m);
		assert_int_equal(m.slot.dir, 0);
	}
	/* It forgot where it wanted to go, and knows the old target as a new one. */
	go(&m, 1000);
	assert_false(incise_profile_resting(&m.profile));
	until_rest(&m);
	assert_int_equal(incise_profile_position(&m.profile), 1000);
	incise_profile_halt(&m.profile, INT32_MIN);
	assert_int_equal(incise_profile_position(&m.profile), -1000);
	incise_profile_halt(&m.profile, INT32_MAX);
	assert_int_equal(incise_profile_position(&m.profile), 1000);
}

/* The same target again and again, as a page gives it each tick, lets it rest. */
TEST(test_target_again)
{
	struct incise_profile_limits l = {1000000, 20000, 400000, -1000, 1000, 20000000};
	static struct motion m;

	begin(&m, &l, 0);
	for (int k = 0; k < 1000; k++) {
		go(&m, 100);
		tick(&m);
	}
	assert_true(incise_profile_resting(&m.profile));
	/* A velocity into the limit at which it stands does not wake it for good. */
	go(&m, 1000);
	until_rest(&m);
	incise_profile_target(&m.profile, INCISE_PROFILE_VELOCITY, 5);
	assert_false(incise_profile_resting(&m.profile));
	until_rest(&m);
	assert_int_equal(m.slot.dir, 0);
}

/* In a motion of constant velocity all gaps are 1/v to the ns, at every tick. */
TEST(test_step_rates)
{
	static const uint32_t ticks_ns[] = {50000, 100000, 333333, 1000000, 2000000};
	static const uint32_t rates[] = {1, 1000, 40000, 123457, 200000};

	for (size_t t = 0; t < sizeof(ticks_ns) / sizeof(*ticks_ns); t++)
		for (size_t r = 0; r < sizeof(rates) / sizeof(*rates); r++) {
			struct incise_profile_limits l = {
				ticks_ns[t], rates[r], 0x80000000, -1000000, 1000000, 0};
			static struct motion m;
			double gap = 1e9 / rates[r];
			uint64_t n, first;

			begin(&m, &l, 0);
			incise_profile_target(&m.profile, INCISE_PROFILE_VELOCITY,
					      rates[r]);
			/* Full speed takes at most 2 ticks. */
			while (m.ticks < 3 || m.watch.n < 2)
				tick(&m);
			n = m.watch.n;
			first = (uint64_t)m.watch.time[watch_place(&m.watch, 0)];
			while (m.watch.n < n + (rates[r] == 1 ? 2 : 1000)) {
				uint64_t from = m.watch.n;

				tick(&m);
				/* 1 ns of rounding, 10⁻⁵ steps/s of the limit's. */
				for (uint64_t b = 0; b < m.watch.n - from && b < 8; b++)
					assert_true(fabs(watch_gap(&m.watch, b, b + 1) -
							 gap) <= 1 + gap * 1e-5);
			}
			first = (uint64_t)m.watch.time[watch_place(&m.watch, 0)] - first;
			assert_true(fabs(first / gap - (m.watch.n - n)) <
				    1e-5 * (m.watch.n - n) + 1 / gap);
			assert_true(llabs(incise_profile_velocity(&m.profile) -
					  (int64_t)rates[r] * 65536) <=
				    /* 10⁻⁵ and 2^-24 steps per tick of 50 µs */
				    0.0015 * 65536);
		}
}

/* Under 1 step/s² the largest way: there in the closed form's time. */
TEST(test_slowest)
{
	struct incise_profile_limits l = {2000000, 1, 1, 0, 100, 1};
	static struct motion m;
	double seconds = 100.0 + 1;

	/* 2a/(jT) = 1000 ticks. */
	assert_int_equal(incise_profile_init(&m.profile, &l, 0), -34);
	l.jerk = 4; /* 250 ticks */
	begin(&m, &l, 100);
	go(&m, 0);
	/* Rounding of a and v together takes less than 0.1 %. */
	assert_true(fabs((double)until_rest(&m) - 249 - seconds / 2e-3) <
		    2 + seconds / 2e-3 * 1e-3);
}

TEST(test_step_of_no_slot)
{
	struct incise_profile_slot none = {.tick_ns = 50000},
				   slot = {.to = 2 * WATCH_STEP,
					   .first = (uint64_t)WATCH_STEP,
					   .tick_ns = 50000,
					   .n = 2,
					   .dir = 1};

	assert_int_equal(incise_profile_step_ns(&none, 0), 50000);
	assert_int_equal(incise_profile_step_ns(&slot, -1), 25000);
	assert_int_equal(incise_profile_step_ns(&slot, 0), 25000);
	assert_int_equal(incise_profile_step_ns(&slot, 1), 50000);
	assert_int_equal(incise_profile_step_ns(&slot, INT32_MAX), 50000);
}

TEST(test_size)
{
	/* Eight motors within five pages of a kernel's memory. */
	assert_true(8 * sizeof(struct incise_profile) <= 5 * 4096);
	/* A copy goes on as the first does. */
	struct incise_profile_limits l = {1000000, 20000, 400000, -1000, 1000, 20000000};
	struct incise_profile a, b;

	incise_profile_init(&a, &l, 0);
	incise_profile_target(&a, INCISE_PROFILE_POSITION, 500);
	b = a;
	for (int k = 0; k < 200; k++) {
		struct incise_profile_slot of_a, of_b;

		incise_profile_tick(&a, &of_a);
		incise_profile_tick(&b, &of_b);
		assert_memory_equal(&of_a, &of_b, sizeof(of_a));
	}
}
