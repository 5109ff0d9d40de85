// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The pose predictor in double and in integers: no jump whatever comes when, nothing but numbers, and
 * both the same. Its gains are in ../control/predict.c, how far it is off is in
 * ../control/reference_path.c.
 */
#include "../unit.h"
#include <incise/clock.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/control/predict.h"
#include "stage_kinds.h"

#define PERIOD_NS (INCISE_NS_PER_S / 120)
#define LATENCY_NS 4200000
#define MS_NS 1000000
#define S 1e-9
#define CASES(array) (sizeof(array) / sizeof(*(array)))

/*
 * In integers positions are rounded to 2^-16 mm when they are shown. Gains are rounded: 2^-17 1/s of a
 * miss of at most 20 mm, over 1/4 s, and 2^-13 1/s² over (1/4 s)²/2; each miss passes that on, and the
 * filter forgets it within some poses.
 */
#define INTEGERS_MM 2e-3
#define INTEGERS_MM_S 2e-2
#define INTEGERS_MM_S2 0.2

static double length4(const double q[4])
{
	return sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

static struct incise_double_filter filter_of(double rate_hz, int64_t latency_ns,
					     double noise_mm)
{
	struct incise_tracker_info info = {
		.name = "test", .rate_hz = rate_hz, .latency_ns = latency_ns};
	struct incise_double_filter filter;
	struct incise_predict p;

	incise_predict_init(&p, &info, noise_mm);
	incise_predict_filter(&p, &filter);
	return filter;
}

static void start(void)
{
	struct incise_double_filter filter = filter_of(120, LATENCY_NS, 0);

	assert_true(kind->set_filter(&filter));
}

/* A pose acquired at @t_ns. */
static struct incise_tracker_sample at(int64_t t_ns, double x, double y, double z)
{
	return (struct incise_tracker_sample){
		.t_ns = t_ns + LATENCY_NS, .position_mm = {x, y, z}, .quaternion = {1}};
}

static bool add(int64_t t_ns, double x, double y, double z)
{
	struct incise_tracker_sample s = at(t_ns, x, y, z);

	return kind->add_pose(&s);
}

/* So many poses of a hand at rest. */
static void rest(int poses)
{
	for (int i = 0; i < poses; i++)
		add(i * PERIOD_NS, 0, 0, 0);
}

/* A hand that accelerates evenly is where the filter says; it has no lag. */
TEST_KINDS(test_even_acceleration_is_exact)
{
	/* The slowest of the filter's roots is 0.66: 0.66^240 is nothing. */
	double mm = kind->is_double ? 1e-9 : INTEGERS_MM;
	double mm_s = kind->is_double ? 1e-7 : INTEGERS_MM_S;
	int64_t now = 240 * PERIOD_NS + 1234567;
	double t = now * S;
	struct shown got;

	start();
	assert_int_equal(kind->show(5).age_ns, INT64_MAX);
	assert_true(kind->show(5).q[0] == 1);
	for (int i = 0; i <= 239; i++) {
		double then = i * PERIOD_NS * S;

		add(i * PERIOD_NS, 30 * then - 40 * then * then, -10 * then, 5);
	}
	got = kind->show(now);
	assert_true(fabs(got.x[0] - (30 * t - 40 * t * t)) < mm);
	assert_true(fabs(got.x[1] + 10 * t) < mm);
	assert_true(fabs(got.x[2] - 5) < mm);
	assert_true(fabs(got.v[0] - (30 - 80 * t)) < mm_s);
	assert_true(fabs(got.v[1] + 10) < mm_s);
	assert_true(fabs(got.v[2]) < mm_s);
	assert_int_equal(kind->show(240 * PERIOD_NS).age_ns, PERIOD_NS);
	assert_int_equal(kind->show(5).age_ns, 0);
}

/* The filter without the blend. */
static double bare(int64_t t_ns)
{
	struct filtered now = kind->filtered();
	double dt = (double)(t_ns - now.t_ns) * S;

	return now.x[0] + now.v[0] * dt + now.a[0] * dt * dt / 2;
}

static double uniform(uint64_t *seed)
{
	incise_random_step(seed);
	return (double)(*seed >> 11) * 0x1p-52 - 1;
}

/*
 * Poses at any time, in bursts and with pauses: at the time when one arrives all that is
 * shown is the same before and after it is taken in.
 */
TEST_KINDS(test_arrival_moves_nothing)
{
	int64_t t_ns = 0;
	uint64_t seed = 1;

	start();
	for (int n = 0; n < 5000; n++) {
		struct incise_tracker_sample s;
		struct shown before, after;

		/* 0 … 2 periods, seldom 8 of them: beyond a gap. */
		t_ns += 1 +
			(int64_t)((1 + uniform(&seed)) * PERIOD_NS * (n % 50 ? 1 : 8));
		s = at(t_ns, uniform(&seed), uniform(&seed), 30 + uniform(&seed));
		for (int i = 0; i < 4; i++)
			s.quaternion[i] = uniform(&seed);
		for (double l = length4(s.quaternion), i = 0; i < 4; i++)
			s.quaternion[(int)i] /= l;
		before = kind->show(s.t_ns);
		assert_true(kind->add_pose(&s));
		after = kind->show(s.t_ns);
		/*
		 * Rounding of some numbers below 100 mm, 1e4 mm/s and 1e5 mm/s²; of Q16,
		 * and of a root of Q30.
		 */
		for (int i = 0; n && i < 3; i++) {
			assert_true(fabs(after.x[i] - before.x[i]) <= 1e-12 + kind->bit);
			assert_true(fabs(after.v[i] - before.v[i]) <= 1e-9 + kind->bit);
			assert_true(fabs(after.a[i] - before.a[i]) <= 1e-9 + kind->bit);
		}
		for (int i = 0; n && i < 4; i++)
			assert_true(fabs(after.q[i] - before.q[i]) <=
				    1e-12 + kind->bit * 0x1p-12);
	}
}

/* A hand at rest, then a pose elsewhere: the way there takes one period, evenly. */
TEST_KINDS(test_blend_takes_one_period)
{
	int64_t arrival = 20 * PERIOD_NS + LATENCY_NS;
	double half = sqrt(0.5);
	struct incise_tracker_sample s = at(20 * PERIOD_NS, 1, 0, 0);
	struct shown shown;

	/* A quarter turn about x, as the other of its two quaternions. */
	s.quaternion[0] = -half;
	s.quaternion[1] = -half;
	start();
	rest(20);
	kind->add_pose(&s);
	for (int i = 0; i <= 10; i++) {
		double share = i / 10.0;
		int64_t t_ns = arrival + i * PERIOD_NS / 10;

		shown = kind->show(t_ns);
		/* The filter's answer at arrival, less what it moved on since. */
		assert_true(fabs(shown.x[0] - bare(t_ns) + (1 - share) * bare(arrival)) <
			    1e-6 + kind->bit);
		assert_true(fabs(length4(shown.q) - 1) < 1e-15 * 4 + kind->bit * 0x1p-12);
		assert_true(fabs(shown.q[1] / shown.q[0] -
				 share * half / (1 - share + share * half)) < 1e-6);
	}
	/* Done, and it stays so; periods are whole ns, 1 in 8e6. */
	assert_true(fabs(shown.x[0] - bare(arrival + PERIOD_NS)) < 1e-6 + kind->bit);
	assert_true(fabs(shown.q[0] - half) < 1e-6 && fabs(shown.q[1] - half) < 1e-6);
}

/* Three poses in one tick, after a stall of the wire: no more of a step than of one. */
TEST_KINDS(test_many_poses_in_one_tick)
{
	int64_t t_ns = 20 * PERIOD_NS;
	double before, after;

	start();
	rest(20);
	before = kind->show(t_ns + LATENCY_NS).x[0];
	for (int i = 1; i <= 3; i++)
		add(t_ns + i * 300000, 0.1 * i, 0, 0);
	after = kind->show(t_ns + LATENCY_NS + 1000000).x[0];
	/*
	 * Each correction is at most 0.3 mm and what velocity makes of it in the
	 * latency, β / T × 4.2 ms + γ / T² × (4.2 ms)²/2 < 0.4 of it; three of
	 * these, over 0.7, 0.4 and 0.1 ms of the 8.3.
	 */
	assert_true(fabs(after - before) < 3 * 0.42 * 0.7 / 8.3);
	assert_true(after > 0);
}

TEST_KINDS(test_attitude_that_is_none)
{
	static const double hostile[][4] = {
		{NAN, 0, 0, 0},
		{1, INFINITY, 0, 0},
		{0, 0, 0, 0},
		{1e300, 1, 0, 0},
		{0.5, 0.5, 0.5, 0},
		{1.2, 0, 0, 0},
		{-INFINITY, INFINITY, NAN, 1e-300},
	};
	double bit = kind->bit * 0x1p-12;
	struct incise_tracker_sample s = at(0, 0, 0, 0);
	struct shown shown;

	start();
	s.quaternion[0] = 0.6;
	s.quaternion[2] = -0.8;
	kind->add_pose(&s);
	for (int i = 0; i < (int)CASES(hostile); i++) {
		s = at((i + 1) * PERIOD_NS, 0.1 * i, 0, 0);
		memcpy(s.quaternion, hostile[i], sizeof(s.quaternion));
		/* The position is taken all the same. */
		assert_true(kind->add_pose(&s));
		assert_int_equal(kind->filtered().t_ns, (i + 1) * PERIOD_NS);
		shown = kind->show(s.t_ns + PERIOD_NS / 3);
		assert_true(fabs(shown.q[0] - 0.6) < 1e-12 + bit);
		assert_true(fabs(shown.q[2] + 0.8) < 1e-12 + bit);
	}
	/* Rounding by the device is no reason. */
	s = at(8 * PERIOD_NS, 0, 0, 0);
	s.quaternion[0] = 1.001;
	kind->add_pose(&s);
	shown = kind->show(s.t_ns + PERIOD_NS + 100);
	assert_true(fabs(shown.q[0] - 1) < 1e-12 + bit);
}

TEST_KINDS(test_nonsense_is_passed_over)
{
	static const double hostile[] = {NAN, INFINITY, -INFINITY, 1e300, -1e5, 10000};
	static const int64_t old_ns[] = {0, INT64_MIN, -1, 9 * PERIOD_NS + LATENCY_NS};
	void *before = malloc(kind->size);

	start();
	for (int i = 0; i < 10; i++)
		assert_true(add(i * PERIOD_NS, i, 0, 0));
	memcpy(before, kind->tried, kind->size);
	for (size_t i = 0; i < CASES(hostile); i++) {
		struct incise_tracker_sample s = at(11 * PERIOD_NS, 1, 2, 3);

		s.position_mm[i % 3] = hostile[i];
		assert_false(kind->add_pose(&s));
	}
	/* An older pose than the last, and the same again. */
	for (size_t i = 0; i < CASES(old_ns); i++)
		assert_false(kind->add_pose(&(struct incise_tracker_sample){
			.t_ns = old_ns[i], .quaternion = {1}}));
	assert_memory_equal(kind->tried, before, kind->size);
	free(before);
}

/* After a gap the hand may be anywhere: no velocity is made up across it. */
TEST_KINDS(test_gap_starts_anew)
{
	static const struct {
		int periods;
		double off_mm; /* from what is shown when the pose arrives */
		bool anew, blend;
	} cases[] = {
		{1, 0.5, false, true},	 {5, 3, false, true},	  {6, 3, true, true},
		{6, 19, true, true},	 {6, 21, true, false},	  {1, 21, true, false},
		{1, -5000, true, false}, {5000, -19, true, true},
	};

	for (size_t i = 0; i < CASES(cases); i++) {
		int64_t then = (9 + cases[i].periods) * PERIOD_NS;
		struct filtered now;
		struct shown pose;
		double shown;

		start();
		for (int k = 0; k < 10; k++)
			add(k * PERIOD_NS, 0, 0.2 * k, 0);
		shown = kind->show(then + LATENCY_NS).x[1];
		add(then, 0, shown + cases[i].off_mm, 0);
		now = kind->filtered();
		if (cases[i].anew)
			assert_true(v3_length(now.v) == 0 && v3_length(now.a) == 0);
		else
			assert_true(v3_length(now.v) > 0);
		/* A change that is not blended is one; the first pose of all is none. */
		assert_int_equal(now.discontinuities, !cases[i].blend);
		pose = kind->show(then + LATENCY_NS);
		if (cases[i].blend) {
			assert_true(fabs(pose.x[1] - shown) <= 1e-12 + kind->bit);
		} else {
			assert_true(pose.x[1] == kind->number(shown + cases[i].off_mm));
			assert_true(v3_length(pose.v) == 0);
		}
	}
}

/* An old pose is not carried on for ever. */
TEST_KINDS(test_never_further_ahead_than_a_gap)
{
	struct shown end, later;

	start();
	for (int i = 0; i < 50; i++)
		add(i * PERIOD_NS, 0.5 * i, 0, 0);
	end = kind->show((49 + 5) * PERIOD_NS);
	later = kind->show(INT64_MAX);
	/* 5 periods are 41 666 666 ns, 5 times a period 41 666 665; at 60 mm/s. */
	assert_true(fabs(end.x[0] - later.x[0]) < 1e-6 + kind->bit);
	assert_true(fabs(end.x[0] - 27) < (kind->is_double ? 1e-3 : INTEGERS_MM));
	assert_int_equal(later.age_ns, INT64_MAX - 49 * PERIOD_NS);
	later = kind->show(INT64_MIN);
	assert_true(v3_finite(later.x));
	assert_int_equal(later.age_ns, 0);
}

/* 12 ms are more than five periods of 1000 Hz, and are made up for all the same. */
TEST_KINDS(test_latency_of_many_periods)
{
	struct incise_double_filter filter = filter_of(1000, 12000000, 0);
	struct incise_tracker_sample s = {.quaternion = {1}};

	assert_true(kind->set_filter(&filter));
	for (int i = 0; i < 500; i++) {
		s.t_ns = i * MS_NS + 12000000;
		s.position_mm[0] = 0.06 * i;
		kind->add_pose(&s);
	}
	/* An even motion is exact once the start has died away, by 1e-15 and more. */
	assert_true(fabs(kind->show(s.t_ns + MS_NS).x[0] - 0.06 * (499 + 13)) <
		    (kind->is_double ? 1e-6 : INTEGERS_MM));
}

/* Poses a nanosecond apart, each 9 mm on: 9 000 km/s. */
TEST_KINDS(test_speed_is_bounded)
{
	double fastest = 0;
	int64_t t_ns;

	start();
	for (int i = 0; i < 1000; i++) {
		struct shown shown;

		add(i, i * 9.0, -i * 9.0, 0);
		shown = kind->show(i + LATENCY_NS + PERIOD_NS);
		fastest = fmax(fastest, v3_length(shown.v));
		assert_true(v3_finite(shown.x));
	}
	assert_true(fastest > 1e3 && fastest <= 1e4 * sqrt(3));
	/* Turned about: the old speed is still blended out when the new one is gone. */
	kind->turn_about(-1e4, 1e5, 2e4);
	t_ns = kind->filtered().t_ns + PERIOD_NS;
	assert_true(kind->show(t_ns).v[0] > 9e3 && kind->show(t_ns).v[0] <= 1e4);
}

/* Poses of a hand, of leaps and of any bits, at any time. */
static struct incise_tracker_sample any_sample(uint64_t *seed, int i, int64_t t_ns)
{
	struct incise_tracker_sample s = {.t_ns = t_ns, .quaternion = {1}};
	double spread = i % 3 ? 9 : 9999;

	for (int k = 0; k < 3; k++) {
		s.position_mm[k] = spread * uniform(seed);
		/* What a tracker of integers may say. */
		if (i % 4 == 1)
			s.position_mm[k] = ldexp(
				(double)((int32_t)(*seed >> 32) >> *seed % 16), -16);
	}
	for (int k = 0; k < 4 && i % 5 < 2; k++) {
		s.quaternion[k] = 2 * uniform(seed);
		if (i % 5 == 0)
			memcpy(&s.quaternion[k], seed, sizeof(*seed));
	}
	if (i % 11 == 0)
		memcpy(&s.position_mm[i % 3], seed, sizeof(*seed));
	return s;
}

/* Any bits as poses and times: numbers only, within their ranges, and unit quaternions. */
static void try_any(uint64_t *seed, int poses, bool any_time)
{
	int64_t t_ns = 0;

	for (int i = 0; i < poses; i++) {
		struct incise_tracker_sample s;
		struct shown shown;

		t_ns += (int64_t)((1 + uniform(seed)) * (i % 7 ? 1e6 : 1e8));
		s = any_sample(seed, i, t_ns);
		if (any_time && i > poses / 2)
			s.t_ns = (int64_t)(*seed ^ *seed << 32);
		kind->add_pose(&s);
		shown = kind->show(i % 13 ? s.t_ns + (int64_t)(*seed >> 40)
					  : (int64_t)*seed);
		assert_true(v3_length(shown.x) < 1e6);
		assert_true(fabs(length4(shown.q) - 1) < 1e-14 + kind->bit * 0x1p-10);
		assert_true(shown.age_ns >= 0);
		for (int k = 0; k < 3; k++)
			assert_true(fabs(shown.v[k]) <= 1e4 && fabs(shown.a[k]) <= 1e5);
	}
}

/* In integers nothing overflows, under UBSan. */
TEST_KINDS(test_only_numbers)
{
	static const double hz[] = {120, 60, 1000, 0, NAN, INFINITY, -5, 1e-300, 1e300};
	static const int64_t latency[] = {LATENCY_NS, 0, INT64_MAX, INT64_MIN, -1};
	uint64_t seed = 7;
	int taken = 0;

	for (int run = 0; run < 45; run++) {
		struct incise_double_filter filter =
			filter_of(hz[run % 9], latency[run % 5], 0);

		/* Integers have no tracker of 1 Hz. */
		if (!kind->set_filter(&filter))
			continue;
		taken++;
		try_any(&seed, 2000, run < 20);
	}
	assert_int_equal(taken, kind->is_double ? 45 : 25);
	/* Filters at the ends of what integers hold. */
	for (int k = 0; k < 400; k++) {
		struct incise_double_filter filter = {
			.alpha = 1,
			.beta = INT32_MAX * 0x1p-16,
			.gamma = INT32_MAX * 0x1p-12,
			.period_ns = k & 1 ? INCISE_FIXED_PERIOD_MIN_NS
					   : INCISE_FIXED_PERIOD_MAX_NS,
			.latency_ns = k & 2 ? 1000000000 : 0,
			.gap_ns = INCISE_FIXED_AHEAD_MAX_NS,
			.ahead_ns = INCISE_FIXED_AHEAD_MAX_NS,
		};

		assert_true(kind->set_filter(&filter));
		try_any(&seed, 100, k & 4);
	}
}

/* Both kinds at one time. */
static void compare(int64_t t_ns)
{
	struct shown want = kinds[0].show(t_ns), got = kinds[1].show(t_ns);

	for (int i = 0; i < 3; i++) {
		if (!(fabs(got.x[i] - want.x[i]) <= INTEGERS_MM))
			fail_msg("position is %g mm off", got.x[i] - want.x[i]);
		if (!(fabs(got.v[i] - want.v[i]) <= INTEGERS_MM_S))
			fail_msg("velocity is %g mm/s off", got.v[i] - want.v[i]);
		if (!(fabs(got.a[i] - want.a[i]) <= INTEGERS_MM_S2))
			fail_msg("acceleration is %g mm/s² off", got.a[i] - want.a[i]);
	}
	for (int i = 0; i < 4; i++)
		/* The blend's share has 26 bits. */
		assert_true(fabs(got.q[i] - want.q[i]) <= 1e-7);
	assert_int_equal(got.age_ns, want.age_ns);
}

/* A hand with noise, gaps, leaps and late poses: integers are as double. */
TEST(test_kinds_agree)
{
	static const double rates[] = {30, 60, 120, 240};
	uint64_t seed = 1;

	for (size_t k = 0; k < CASES(rates); k++) {
		struct incise_double_filter filter =
			filter_of(rates[k], LATENCY_NS, 0.05);
		int64_t t_ns = 1000000000;

		EACH_KIND
		assert_true(kind->set_filter(&filter));
		for (int n = 0; n < 5000; n++) {
			double s = (double)t_ns * 1e-9;
			struct incise_tracker_sample sample = {.t_ns = t_ns};
			double turn = sin(s),
			       step = (1 + 0.5 * uniform(&seed)) / rates[k];

			sample.quaternion[0] = cos(turn);
			sample.quaternion[1] = sin(turn);
			for (int i = 0; i < 3; i++)
				sample.position_mm[i] =
					40 * sin((3 + i) * s) + 0.05 * uniform(&seed);
			if (n % 500 == 250)
				sample.position_mm[1] += 100;
			EACH_KIND
			kind->add_pose(&sample);
			if (n % 300 == 100)
				step *= 20;
			for (int64_t end_ns = t_ns + (int64_t)(step * 1e9); t_ns < end_ns;
			     t_ns += 1000000)
				compare(t_ns);
		}
		assert_int_equal(kinds[1].filtered().discontinuities,
				 kinds[0].filtered().discontinuities);
		assert_true(kinds[0].filtered().discontinuities > 0);
	}
}
