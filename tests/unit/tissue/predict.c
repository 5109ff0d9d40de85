// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The pose predictor: exact on straight lines, better than holding the last pose on a
 * hand's motion, unmoved by nonsense.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <incise/clock.h>
#include "../../../lib/tissue/predict.h"

#define PERIOD_NS (INCISE_NS_PER_S / 120)
#define LATENCY_NS 4200000

static struct incise_predict start(void)
{
	struct incise_tracker_info info = {"test", 120, LATENCY_NS};
	struct incise_predict predict;

	incise_predict_init(&predict, &info);
	return predict;
}

static struct incise_tracker_sample at(int64_t t_ns, double x, double y, double z)
{
	return (struct incise_tracker_sample){
		.t_ns = t_ns + LATENCY_NS, .position_mm = {x, y, z}, .quaternion = {1}};
}

static void test_straight_line(void **state)
{
	struct incise_predict p = start();
	double x[3];

	assert_int_equal(incise_predict_age(&p, 5), INT64_MAX);
	for (int i = 0; i < 240; i++) {
		double t = i / 120.0;
		struct incise_tracker_sample s = at(i * PERIOD_NS, 30 * t, -10 * t, 5);

		incise_predict_add(&p, &s);
	}
	/* The filter has settled: r^240 is nothing; periods are whole ns, 1 in 8e6. */
	incise_predict_at(&p, 240 * PERIOD_NS + 1234567, x);
	assert_true(fabs(x[0] - 30 * (2 + 1234567e-9)) < 1e-4);
	assert_true(fabs(x[1] + 10 * (2 + 1234567e-9)) < 1e-4);
	assert_true(fabs(x[2] - 5) < 1e-9);
	assert_true(fabs(incise_predict_speed(&p) - hypot(30, 10)) < 1e-3);
	assert_int_equal(incise_predict_age(&p, 240 * PERIOD_NS), PERIOD_NS);
}

static double uniform(uint64_t *seed)
{
	*seed = *seed * 6364136223846793005u + 1442695040888963407u;
	return (*seed >> 11) * 0x1p-52 - 1;
}

/*
 * The virtual surgeon's speed swing (25 ± 22 mm/s at 1.6 Hz) with 0.02 mm of noise. Holding
 * the last pose is off by the motion in latency and half a period, 8 ms × 25 mm/s = 0.2 mm;
 * predicting is left with noise and 220 mm/s² × (12.5 ms)²/2 = 0.02 mm: 0.06 mm is thrice that.
 */
static void test_better_than_hold(void **state)
{
	struct incise_predict p = start();
	double predicted = 0, held = 0, last = 0;
	uint64_t seed = 1;
	int next = 0;

	for (int tick = 0; tick < 5000; tick++) {
		int64_t t_ns = tick * 1000000LL;
		double t = tick * 1e-3, x[3];
		double truth = 25 * t - 22 / (2 * M_PI * 1.6) * cos(2 * M_PI * 1.6 * t);

		for (; next * PERIOD_NS + LATENCY_NS <= t_ns; next++) {
			double then = next / 120.0;
			struct incise_tracker_sample s =
				at(next * PERIOD_NS,
				   25 * then -
					   22 / (2 * M_PI * 1.6) *
						   cos(2 * M_PI * 1.6 * then) +
					   0.02 * sqrt(3) * uniform(&seed),
				   0, 0);

			last = s.position_mm[0];
			incise_predict_add(&p, &s);
		}
		if (tick < 500)
			continue;
		incise_predict_at(&p, t_ns, x);
		predicted += pow(x[0] - truth, 2) / 4500;
		held += pow(last - truth, 2) / 4500;
	}
	assert_true(sqrt(predicted) < 0.06);
	assert_true(sqrt(predicted) < sqrt(held) / 3);
}

static void test_nonsense_is_passed_over(void **state)
{
	static const double hostile[] = {NAN, INFINITY, -INFINITY, 1e300, -1e5};
	struct incise_predict p = start(), before;

	for (int i = 0; i < 10; i++) {
		struct incise_tracker_sample s = at(i * PERIOD_NS, i, 0, 0);

		incise_predict_add(&p, &s);
	}
	before = p;
	for (int i = 0; i < 5; i++) {
		struct incise_tracker_sample s = at(11 * PERIOD_NS, 1, 2, 3);

		s.position_mm[i % 3] = hostile[i];
		incise_predict_add(&p, &s);
	}
	/* An older pose than the last, and the same again. */
	incise_predict_add(&p, &(struct incise_tracker_sample){.t_ns = 0});
	incise_predict_add(&p,
			   &(struct incise_tracker_sample){.t_ns = p.t_ns + LATENCY_NS});
	assert_memory_equal(&p, &before, sizeof(p));
}

/* After a gap the hand may be anywhere: no velocity is made up across it. */
static void test_gap_starts_anew(void **state)
{
	struct incise_predict p = start();
	struct incise_tracker_sample s;
	double x[3];

	for (int i = 0; i < 10; i++) {
		s = at(i * PERIOD_NS, 0.5 * i, 0, 0);
		incise_predict_add(&p, &s);
	}
	/* An old pose is not carried on for ever. */
	incise_predict_at(&p, 3600 * INCISE_NS_PER_S, x);
	assert_true(fabs(x[0]) < 10);
	s = at(INCISE_NS_PER_S, 300, 0, 0);
	incise_predict_add(&p, &s);
	assert_true(incise_predict_speed(&p) == 0);
	incise_predict_at(&p, INCISE_NS_PER_S, x);
	assert_true(x[0] == 300);
}

/* Two poses a nanosecond apart ask for an endless speed. */
static void test_speed_is_bounded(void **state)
{
	struct incise_predict p = start();
	struct incise_tracker_sample s = at(0, 0, 0, 0);

	incise_predict_add(&p, &s);
	s = at(1, 9999, 9999, -9999);
	incise_predict_add(&p, &s);
	assert_true(incise_predict_speed(&p) <= 1e4 * sqrt(3) + 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_straight_line),
		cmocka_unit_test(test_better_than_hold),
		cmocka_unit_test(test_nonsense_is_passed_over),
		cmocka_unit_test(test_gap_starts_anew),
		cmocka_unit_test(test_speed_is_bounded),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
