// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/calib/delay_pulse.c: the delay of a stream behind edges is within the interval
 * that is stated; what shows no step, or has times that cannot be, is refused.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <string.h>
#include <incise/calibrate_delay.h>

#define SEEN 850

static struct incise_delay_point seen[SEEN];
static uint64_t seed;

static double uniform(void)
{
	seed = seed * 6364136223846793005u + 1442695040888963407u;
	return ((seed >> 11) + 0.5) * 0x1p-53;
}

static double normal(void)
{
	return sqrt(-2 * log(uniform())) * cos(2 * M_PI * uniform());
}

/* Steps at edges, seen by a camera: means of 20 ms, some of them lost, one misled. */
static void the_interval_holds_the_truth(void **state)
{
	int in = 0;
	double worst = 0;

	for (int run = 1; run <= 200; run++) {
		int64_t edges[60];
		struct incise_delay_fit f;
		struct incise_error err;
		double delay_ms;

		seed = (uint64_t)run;
		delay_ms = 30 * uniform();
		for (int i = 0; i < 60; i++)
			edges[i] = 1000000000LL + i * 263000000LL +
				   (int64_t)(37e6 * uniform());
		for (int i = 0; i < SEEN; i++) {
			int on = 0;

			seen[i].t_ns = 900000000LL + i * 20000000LL;
			for (int e = 0; e < 60; e++)
				on += (double)edges[e] + delay_ms * 1e6 <
				      (double)seen[i].t_ns;
			seen[i].value = 100 * (on % 2) + normal();
		}
		assert_int_equal(
			incise_calibrate_delay_pulse(edges, 60, seen, SEEN, &f, &err), 0);
		in += fabs(f.delay_ms - delay_ms) <= 1.96 * f.sd_ms;
		worst = fmax(worst, fabs(f.delay_ms - delay_ms) / f.sd_ms);
	}
	print_message("pulse: the interval holds %.1f %%, farthest %.1f sd\n", in / 2.0,
		      worst);
	assert_in_range(in, 184, 196);
}

/* Of the stream and of the edges; noise takes a step here and there, by chance. */
static void what_shows_no_step_is_refused(void **state)
{
	struct incise_delay_fit f;
	struct incise_error err;
	int64_t edges[20];

	for (int i = 0; i < 20; i++)
		edges[i] = 1000000000LL + i * 100000000LL;
	for (int i = 0; i < SEEN; i++)
		seen[i] = (struct incise_delay_point){900000000LL + i * 20000000LL, 1};
	assert_int_equal(incise_calibrate_delay_pulse(edges, 20, seen, SEEN, &f, &err),
			 -EDOM);
	assert_non_null(strstr(err.text, "0 of 20 edges"));
}

static void times_ascend(void **state)
{
	int64_t edges[] = {1000000000, 2000000000, 3000000000}, far[] = {INT64_MAX};
	struct incise_delay_point points[] = {{1000000000, 0}, {1500000000, 1}};
	struct incise_delay_fit f;
	struct incise_error err;

	assert_int_equal(incise_calibrate_delay_pulse(edges, 0, points, 2, &f, &err),
			 -EINVAL);
	assert_int_equal(incise_calibrate_delay_pulse(edges, 3, points, 0, &f, &err),
			 -EINVAL);
	assert_int_equal(incise_calibrate_delay_pulse(far, 1, points, 2, &f, &err),
			 -EINVAL);
	edges[1] = edges[0];
	assert_int_equal(incise_calibrate_delay_pulse(edges, 3, points, 2, &f, &err),
			 -EINVAL);
	edges[1] = 2000000000;
	points[1].t_ns = points[0].t_ns;
	assert_int_equal(incise_calibrate_delay_pulse(edges, 3, points, 2, &f, &err),
			 -EINVAL);
	assert_true(isnan(f.delay_ms));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_interval_holds_the_truth),
		cmocka_unit_test(what_shows_no_step_is_refused),
		cmocka_unit_test(times_ascend),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
