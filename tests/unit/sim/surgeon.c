// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/surgeon.c: smooth motion, the protocol kept, every depth met at every speed.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/sim/surgeon.h"

#define TREMOR_MM 0.035 /* a little over the amplitude in y and z */

static void velocity_is_the_derivative(void **state)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;

	incise_sim_config_init(&config);
	config.motion = *(const int *)*state;
	incise_surgeon_init(&surgeon, &config);
	/*
	 * Central difference over ±50 µs: its error is h²/6·jerk ≈ 4e-10·jerk, and at
	 * joints of the path, where acceleration jumps, h/4·jump: at most 600 mm/s² in a
	 * pause, 2·25·2π·1.6·0.9 in a cut and 5.5·(4π)² where pressing begins, so 0.02 mm/s is ample and far below any
	 * wrong term.
	 */
	for (int64_t t = 50000; t < incise_surgeon_duration(&surgeon); t += 1234567) {
		struct incise_blade before, at, after;

		incise_surgeon_blade(&surgeon, t - 50000, &before);
		incise_surgeon_blade(&surgeon, t, &at);
		incise_surgeon_blade(&surgeon, t + 50000, &after);
		for (int i = 0; i < 3; i++) {
			double v = (after.position_mm[i] - before.position_mm[i]) / 1e-4;

			assert_true(fabs(v - at.velocity_mm_s[i]) <
				    0.02 + 1e-3 * fabs(v));
		}
		assert_true(fabs(at.speed_mm_s -
				 sqrt(at.velocity_mm_s[0] * at.velocity_mm_s[0] +
				      at.velocity_mm_s[1] * at.velocity_mm_s[1] +
				      at.velocity_mm_s[2] * at.velocity_mm_s[2])) < 1e-9);
	}
}

static void protocol_is_kept(void **state)
{
	static const double nominal[14] = {5,  5,  5,  10, 10, 10, 10,
					   15, 15, 15, 15, 20, 20, 20};
	struct incise_sim_config config;
	struct incise_surgeon surgeon;
	struct incise_blade blade;

	incise_sim_config_init(&config);
	incise_surgeon_init(&surgeon, &config);
	assert_int_equal(incise_surgeon_duration(&surgeon),
			 (14 * 9 + 1) * INCISE_NS_PER_S);
	for (int cut = 0; cut < 14; cut++) {
		double deepest = 0, ends = 0;

		for (int ms = 0; ms < 9000; ms++) {
			incise_surgeon_blade(&surgeon, (cut * 9000LL + ms) * 1000000,
					     &blade);
			assert_int_equal(blade.cut, ms < 1000 ? -1 : cut);
			if (ms < 1000) {
				assert_true(blade.depth_mm == 0);
				continue;
			}
			deepest = fmax(deepest, blade.depth_mm);
			ends = blade.position_mm[0];
			assert_true(blade.slab >= 0 && blade.slab <= 1);
		}
		/* Held to within 2.5 % of drift, which passes its peak on the way. */
		assert_true(deepest > nominal[cut] * 1.02);
		assert_true(deepest < nominal[cut] * 1.026 + TREMOR_MM);
		/* Along +x, some 25 mm/s for 8 s: less on the steep parts. */
		assert_true(ends > 5 + 25 * 8 * 0.8 && ends < 5 + 25 * 8);
		/* Middle of the pause: 5 mm above the surface. */
		incise_surgeon_blade(&surgeon, (cut * 9000LL + 500) * 1000000, &blade);
		assert_true(fabs(blade.position_mm[2] - 5) < TREMOR_MM);
	}
	/* After the script: at rest in the air, for ever. */
	incise_surgeon_blade(&surgeon, 1000 * INCISE_NS_PER_S, &blade);
	assert_int_equal(blade.cut, -1);
	assert_true(fabs(blade.position_mm[2] - 5) < TREMOR_MM);
	assert_true(blade.velocity_mm_s[0] == 0);
}

static void every_depth_at_every_speed(void **state)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;

	incise_sim_config_init(&config);
	for (config.seed = 1; config.seed < 6; config.seed++) {
		long bin[12][10] = {{0}};

		incise_surgeon_init(&surgeon, &config);
		/* Every 1 ms: ten of the samples at 10 kHz. */
		for (int64_t t = 0; t < incise_surgeon_duration(&surgeon); t += 1000000) {
			struct incise_blade blade;
			int i, j;

			incise_surgeon_blade(&surgeon, t, &blade);
			i = (int)(blade.depth_mm / 20 * 12);
			j = (int)(blade.speed_mm_s / 47 * 10);
			if (blade.depth_mm > 0 && i < 12 && j < 10)
				bin[i][j]++;
		}
		/* At least 300 samples a bin, so that a mean is known to 1/17 of its spread. */
		for (int i = 0; i < 12; i++)
			for (int j = 0; j < 10; j++)
				assert_true(bin[i][j] >= 30);
	}
}

static void grip_is_a_rotation(void **state)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;

	incise_sim_config_init(&config);
	incise_surgeon_init(&surgeon, &config);
	for (int64_t t = 0; t < 20 * INCISE_NS_PER_S; t += 10000001) {
		double q[4], norm;

		incise_surgeon_grip(&surgeon, t, q);
		norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
		assert_true(fabs(norm - 1) < 1e-14); /* a few roundings */
		/* The handle (z) within 0.18 rad of upright: lean 0.13, roll 0.03, yaw. */
		assert_true(1 - 2 * (q[1] * q[1] + q[2] * q[2]) > cos(0.18));
	}
}

/* The tip rests while the tool sweeps the cone that was asked for, and no more. */
static void a_turn_is_about_the_tip(void **state)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;
	double farthest = 1;

	incise_sim_config_init(&config);
	config.motion = INCISE_SURGEON_TURNS;
	config.cone_deg = 90;
	incise_surgeon_init(&surgeon, &config);
	for (int64_t t = 0; t < 20 * INCISE_NS_PER_S; t += 10000001) {
		struct incise_blade blade;
		double q[4], norm, up;

		incise_surgeon_blade(&surgeon, t, &blade);
		assert_true(blade.position_mm[0] == 5 && blade.position_mm[1] == 0 &&
			    blade.position_mm[2] == 0 && blade.speed_mm_s == 0);
		incise_surgeon_grip(&surgeon, t, q);
		norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
		assert_true(fabs(norm - 1) < 1e-14);
		up = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
		farthest = fmin(farthest, up);
	}
	/* half the cone; turning about itself on the way takes a little off */
	assert_true(farthest > cos(45 * M_PI / 180) - 1e-9);
	assert_true(farthest < cos(42 * M_PI / 180));
}

static void pressing_goes_into_the_tissue_and_out(void **state)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;
	double low = 0, high = 0;
	int strokes = 0;
	bool inside = false;

	incise_sim_config_init(&config);
	config.motion = INCISE_SURGEON_PRESSES;
	incise_surgeon_init(&surgeon, &config);
	for (int64_t t = 0; t < 11 * INCISE_NS_PER_S; t += 1000001) {
		struct incise_blade blade;

		incise_surgeon_blade(&surgeon, t, &blade);
		assert_int_equal(blade.cut, -1);
		assert_true(t > INCISE_NS_PER_S || blade.position_mm[2] == 3);
		low = fmin(low, blade.position_mm[2]);
		high = fmax(high, blade.position_mm[2]);
		strokes += !inside && blade.depth_mm > 0;
		inside = blade.depth_mm > 0;
	}
	assert_true(fabs(low + 8) < 1e-3 && fabs(high - 3) < 1e-3);
	assert_in_range(strokes, 15, 25); /* about twice a second */
}

int main(void)
{
	static int cuts = INCISE_SURGEON_CUTS, turns = INCISE_SURGEON_TURNS,
		   presses = INCISE_SURGEON_PRESSES;
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_prestate(velocity_is_the_derivative, &cuts),
		cmocka_unit_test_prestate(velocity_is_the_derivative, &turns),
		cmocka_unit_test_prestate(velocity_is_the_derivative, &presses),
		cmocka_unit_test(a_turn_is_about_the_tip),
		cmocka_unit_test(pressing_goes_into_the_tissue_and_out),
		cmocka_unit_test(protocol_is_kept),
		cmocka_unit_test(every_depth_at_every_speed),
		cmocka_unit_test(grip_is_a_rotation),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
