// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/calib/stepper_lines.c: lines of one slope are found beside outliers, behind the
 * turns, and not where there are too few points. Whole actuators are in stepper.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include "../../../lib/calib/stepper_work.h"
#include "../../../lib/base/random.h"

#define POINTS 101 /* of a stroke */
#define RANGE_MM 2.0
#define SLOPE 2.0
#define SKIP_MM 0.2

static struct incise_calibrate_stepper_point points[2 * POINTS];
static enum incise_calibrate_stepper_state states[2 * POINTS];
static struct stroke strokes[2];
static struct incise_calibrate_stepper_setup setup;

/* Up on one line and down on another, 0.2 N apart; behind the turns anything. */
static struct stepper_work make(double noise_N)
{
	const uint64_t key = incise_random_key(3, INCISE_RANDOM_FORCE);

	for (int i = 0; i < 2 * POINTS; i++) {
		double gone_mm = (i % POINTS) * RANGE_MM / (POINTS - 1);
		double x = i < POINTS ? gone_mm : RANGE_MM - gone_mm;

		points[i].position_mm = x;
		points[i].force_N = (i < POINTS ? 0.1 : 0.3) + SLOPE * x +
				    noise_N * incise_random_normal(key, i);
		if (gone_mm <= SKIP_MM)
			points[i].force_N += 1;
		states[i] = INCISE_CALIBRATE_STEPPER_USED;
	}
	strokes[0] = (struct stroke){.first = 0, .last = POINTS - 1, .way = 1};
	strokes[1] = (struct stroke){
		.first = POINTS, .last = 2 * POINTS - 1, .way = -1, .from_mm = RANGE_MM};
	incise_calibrate_stepper_init(&setup);
	return (struct stepper_work){
		.points = points,
		.setup = &setup,
		.n = 2 * POINTS,
		.n_strokes = 2,
		.strokes = strokes,
		.states = states,
		.range_mm = RANGE_MM,
	};
}

static void exact_lines_are_found(void **state)
{
	struct stepper_work w = make(0);

	assert_int_equal(incise_stepper_lines(&w, SKIP_MM), 0);
	/* sums of some hundred doubles of size 1 */
	assert_true(fabs(w.slope - SLOPE) < 1e-12);
	assert_true(fabs(strokes[0].zero_N - 0.1) < 1e-12);
	assert_true(fabs(strokes[1].zero_N - 0.3) < 1e-12);
	assert_true(w.sd < 1e-12);
	assert_int_equal(strokes[0].used, 90);
	for (int i = 0; i < POINTS; i++) {
		assert_int_equal(states[i], i <= 10 ? INCISE_CALIBRATE_STEPPER_TURN
						    : INCISE_CALIBRATE_STEPPER_USED);
		assert_true(i <= 10 ||
			    fabs(incise_stepper_off(&w, &strokes[0], i)) < 1e-12);
	}
}

/* A fifth of the points far off, all to one side; what is saturated is not even looked at. */
static void outliers_do_not_bend_them(void **state)
{
	struct stepper_work w = make(1e-3);

	for (int i = 15; i < 2 * POINTS; i += 5)
		points[i].force_N += 0.5;
	for (int i = 2; i < 2 * POINTS; i += 20) {
		points[i].force_N = 100;
		states[i] = INCISE_CALIBRATE_STEPPER_SATURATED;
	}
	assert_int_equal(incise_stepper_lines(&w, SKIP_MM), 0);
	for (int i = 15; i < POINTS; i += 5)
		if (i % 20 != 2)
			assert_int_equal(states[i], INCISE_CALIBRATE_STEPPER_OUTLIER);
	for (int i = 2; i < 2 * POINTS; i += 20)
		assert_int_equal(states[i], INCISE_CALIBRATE_STEPPER_SATURATED);
	/* five standard uncertainties: noise over the root of Σ (x - mean)² */
	assert_true(fabs(w.slope - SLOPE) < 5 * 1e-3 / sqrt(w.sxx));
	/* of 140 points the sd is known to 6 %; three times that */
	assert_true(fabs(w.sd - 1e-3) < 0.18e-3);
}

static void too_few_are_no_line(void **state)
{
	struct stepper_work w = make(0);

	/* all of it is behind the turn */
	assert_int_equal(incise_stepper_lines(&w, RANGE_MM), -EDOM);
	w = make(0);
	for (int i = POINTS; i < 2 * POINTS; i++)
		states[i] = INCISE_CALIBRATE_STEPPER_SATURATED;
	assert_int_equal(incise_stepper_lines(&w, SKIP_MM), -EDOM);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(exact_lines_are_found),
		cmocka_unit_test(outliers_do_not_bend_them),
		cmocka_unit_test(too_few_are_no_line),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
