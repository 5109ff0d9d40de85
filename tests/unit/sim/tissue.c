// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/tissue.c: the stated law, a saw-tooth about 1, a boundary of the stated size.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/sim/world.h"

static const struct incise_blade air = {.cut = 0, .speed_mm_s = 25, .slab = 0.5};

static void mean_force_is_the_law(void **state)
{
	static const struct {
		double depth_mm, velocity_mm_s, force_N;
	} row[] = {
		{0, 25, 0},
		{-1, 25, 0},
		{NAN, 25, 0},
		{10, 0, 0.73},		  /* 0.45 + 0.28 */
		{10, 15, 0.73 * 1.175},	  /* half of c at v0 */
		{10, -15, 0.73 * 1.175},  /* a speed */
		{20, 45, 2.02 * 1.2625},  /* 0.9 + 1.12; 45/60 of c */
		{20, 1e300, 2.02 * 1.35}, /* all of c */
	};
	struct incise_sim_config config;

	incise_sim_config_init(&config);
	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		double f = incise_sim_mean_force(&config, row[i].depth_mm,
						 row[i].velocity_mm_s);

		assert_true(fabs(f - row[i].force_N) <= 1e-14 * 4); /* a few roundings */
	}
}

static void no_force_and_no_tooth_in_the_air(void **state)
{
	struct incise_sim_config config;
	struct incise_tissue tissue;

	incise_sim_config_init(&config);
	incise_tissue_init(&tissue, &config);
	for (int i = 0; i < 10000; i++)
		incise_tissue_advance(&tissue, &air, 1e-3);
	assert_true(incise_tissue_force(&tissue, &air, 0) == 0);
	assert_true(tissue.path_mm == 0);
}

static void saw_tooth_builds_up_and_drops(void **state)
{
	struct incise_sim_config config;
	struct incise_tissue tissue;
	struct incise_blade blade = air;
	double sum = 0, low = 9, high = 0, previous = 0, mean;
	int drops = 0, n = 400000;

	incise_sim_config_init(&config);
	config.boundary = 0;
	incise_tissue_init(&tissue, &config);
	blade.depth_mm = 10;
	mean = incise_sim_mean_force(&config, blade.depth_mm, blade.speed_mm_s);
	for (int i = 0; i < n; i++) {
		double factor = incise_tissue_force(&tissue, &blade, 0) / mean;

		sum += factor / n;
		low = fmin(low, factor);
		high = fmax(high, factor);
		/* Either a linear rise, at most 2a / half a mean tooth per mm, or a fracture. */
		if (factor < previous)
			drops++;
		else if (i)
			assert_true(factor - previous <= 0.4 / 0.75 * 25e-4 * 1.0001);
		previous = factor;
		incise_tissue_advance(&tissue, &blade, 1e-4);
	}
	/*
	 * 1000 mm: 667 teeth of 1.5 mm, each with an sd of 0.29 of that, so the count's sd
	 * is √667 · 0.29 = 7.5; 5 of them. Each whole tooth has mean 1; what is left is part
	 * of a tooth in 667 and the sampling of its ends, 0.2/600 per tooth.
	 */
	assert_true(drops > 667 - 38 && drops < 667 + 38);
	assert_true(fabs(sum - 1) < 0.2 / 667 + 0.2 / 600 + 1e-4);
	/* The whole amplitude shows, to within one sample of 2.5 µm in 0.75 mm. */
	assert_true(low >= 0.8 - 1e-12 && low < 0.8 + 0.4 * 0.0025 / 0.75);
	assert_true(high <= 1.2 + 1e-12 && high > 1.2 - 0.4 * 0.0025 / 0.75);
}

static void ahead_continues_the_tooth(void **state)
{
	struct incise_sim_config config;
	struct incise_tissue tissue, moved;
	struct incise_blade blade = air;

	incise_sim_config_init(&config);
	incise_tissue_init(&tissue, &config);
	blade.depth_mm = 10;
	moved = tissue;
	incise_tissue_advance(&moved, &blade, 1e-4);
	/* The same path, by the same product: equal to rounding. */
	assert_true(fabs(incise_tissue_force(&tissue, &blade, 1e-4) -
			 incise_tissue_force(&moved, &blade, 0)) < 1e-14);
	assert_true(incise_tissue_force(&tissue, &blade, 1e-4) >
		    incise_tissue_force(&tissue, &blade, 0));
}

static void boundary_has_its_size(void **state)
{
	struct incise_sim_config config;
	struct incise_blade blade = air;
	double sum = 0, squares = 0, mean;
	const int n = 4000;

	incise_sim_config_init(&config);
	config.tooth = 0;
	blade.depth_mm = 10;
	mean = incise_sim_mean_force(&config, blade.depth_mm, blade.speed_mm_s);
	for (blade.boundary = 0; blade.boundary < n; blade.boundary++) {
		struct incise_tissue tissue;
		double at, fixed, loose;

		incise_tissue_init(&tissue, &config);
		blade.slab = 0.5;
		at = incise_tissue_force(&tissue, &blade, 0) / mean;
		blade.slab = 0;
		fixed = incise_tissue_force(&tissue, &blade, 0) / mean;
		blade.slab = 1;
		loose = incise_tissue_force(&tissue, &blade, 0) / mean;
		/* From the fixed to the free end the drift is `boundary` in all. */
		assert_true(fabs((fixed - loose) / at - 0.1) < 1e-12);
		assert_true(at >= 0.75 - 1e-12 && at <= 1.25 + 1e-12);
		sum += at / n;
		squares += (at - 1) * (at - 1) / n;
	}
	/* Mean: sd 0.1/√n. Spread: sd of a standard deviation 0.1/√(2n); 2.5 sd of clipping
	   take 1.2 % from it (∫ of the normal density). Bounds are 5 sd. */
	assert_true(fabs(sum - 1) < 5 * 0.1 / sqrt(n));
	assert_true(fabs(sqrt(squares) - 0.0988) < 5 * 0.1 / sqrt(2 * n));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(mean_force_is_the_law),
		cmocka_unit_test(no_force_and_no_tooth_in_the_air),
		cmocka_unit_test(saw_tooth_builds_up_and_drops),
		cmocka_unit_test(ahead_continues_the_tooth),
		cmocka_unit_test(boundary_has_its_size),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
