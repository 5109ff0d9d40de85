// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/tissue.c: the stated law, a saw-tooth about 1, a boundary of the stated size; the way
 * back out of a cut, and closed motions, which take work.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/sim/world.h"

static const struct incise_blade air = {.cut = 0, .speed_mm_s = 25, .slab = 0.5};
static struct incise_sim_config config;
static struct incise_tissue tissue;
static struct incise_blade blade;

static int begin(void **state)
{
	incise_sim_config_init(&config);
	incise_tissue_init(&tissue, &config);
	blade = air;
	return 0;
}

TEST(mean_force_is_the_law, begin)
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

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		double f = incise_sim_mean_force(&config, row[i].depth_mm,
						 row[i].velocity_mm_s);

		assert_true(fabs(f - row[i].force_N) <= 1e-14 * 4); /* a few roundings */
	}
}

TEST(no_force_and_no_tooth_in_the_air, begin)
{
	for (int i = 0; i < 10000; i++)
		incise_tissue_advance(&tissue, &air, 1e-3);
	assert_true(incise_tissue_force(&tissue, &air, 0) == 0);
	assert_true(tissue.path_mm == 0);
}

TEST(saw_tooth_builds_up_and_drops, begin)
{
	double sum = 0, low = 9, high = 0, previous = 0, mean;
	int drops = 0, n = 400000;

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

TEST(ahead_continues_the_tooth, begin)
{
	struct incise_tissue moved;

	blade.depth_mm = 10;
	moved = tissue;
	incise_tissue_advance(&moved, &blade, 1e-4);
	/* The same path, by the same product: equal to rounding. */
	assert_true(fabs(incise_tissue_force(&tissue, &blade, 1e-4) -
			 incise_tissue_force(&moved, &blade, 0)) < 1e-14);
	assert_true(incise_tissue_force(&tissue, &blade, 1e-4) >
		    incise_tissue_force(&tissue, &blade, 0));
}

TEST(boundary_has_its_size, begin)
{
	double sum = 0, squares = 0, mean;
	const int n = 4000;

	config.tooth = 0;
	blade.depth_mm = 10;
	mean = incise_sim_mean_force(&config, blade.depth_mm, blade.speed_mm_s);
	for (blade.boundary = 0; blade.boundary < n; blade.boundary++) {
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

/* A hand's blade goes straight to a depth in small steps; the force there. */
static double go(double depth_mm)
{
	double from = blade.depth_mm, way = depth_mm - from;

	for (int i = 1; i <= 1000; i++) {
		blade.depth_mm = from + way * i / 1000;
		incise_tissue_advance(&tissue, &blade, 1e-4);
	}
	return incise_tissue_force(&tissue, &blade, 0);
}

static int begin_by_hand(void **state)
{
	incise_sim_config_init(&config);
	config.motion = INCISE_SURGEON_HAND;
	config.boundary = 0;
	incise_tissue_init(&tissue, &config);
	blade = (struct incise_blade){.cut = -1, .slab = 0.5, .side = {0, 1, 0}};
	return 0;
}

/* 1e-9: a thousand roundings of numbers of some mm and N. */
static void near(double is, double should)
{
	if (!(fabs(is - should) < 1e-9))
		fail_msg("%.12g, expected %.12g", is, should);
}

TEST(drawing_back_unloads_and_then_rubs, begin_by_hand)
{
	double c, back_mm;

	c = incise_sim_mean_force(&config, 15, 0);
	back_mm = c / config.unloading_N_mm;
	near(go(15), c);
	near(go(15 - back_mm / 2), c / 2);
	near(go(15 - back_mm), 0);
	near(go(4), -config.friction * incise_sim_mean_force(&config, 4, 0));
	/* Out of the tissue and in again at the same place: the cut is open up to its front. */
	assert_true(go(0) == 0);
	near(go(4), config.friction * incise_sim_mean_force(&config, 4, 0));
	near(go(16), incise_sim_mean_force(&config, 16, 0));
	/* Elsewhere it is new tissue. */
	go(0);
	blade.position_mm[1] = 3;
	near(go(4), incise_sim_mean_force(&config, 4, 0));
}

TEST(each_cut_of_the_script_is_new, begin_by_hand)
{
	config.motion = INCISE_SURGEON_CUTS;
	config.tooth = 0;
	for (blade.cut = 0; blade.cut < 2; blade.cut++) {
		near(go(10), incise_sim_mean_force(&config, 10, 0));
		go(0);
	}
	blade.cut--; /* the blade touched the surface on its way: the same cut */
	near(go(3), config.friction * incise_sim_mean_force(&config, 3, 0));
}

TEST(paper_is_the_law_both_ways)
{
	static const int motions[] = {INCISE_SURGEON_CUTS, INCISE_SURGEON_PRESSES,
				      INCISE_SURGEON_HAND};

	for (size_t i = 0; i < sizeof(motions) / sizeof(*motions); i++) {
		begin_by_hand(NULL);
		config.withdrawal = INCISE_TISSUE_PAPER;
		config.motion = motions[i];
		config.tooth = 0;
		blade.speed_mm_s = 20;
		for (int step = 0; step < 100; step++) {
			blade.velocity_mm_s[2] = step < 50 ? -20 : 20;
			blade.depth_mm = step < 50 ? 0.2 * step : 0.2 * (100 - step);
			incise_tissue_advance(&tissue, &blade, 1e-4);
			assert_true(incise_tissue_force(&tissue, &blade, 0) ==
				    incise_sim_mean_force(&config, blade.depth_mm, 20));
		}
	}
}

TEST(asking_changes_nothing, begin_by_hand)
{
	double force_N;

	go(10);
	blade.depth_mm = 9;
	force_N = incise_tissue_force(&tissue, &blade, 0);
	blade.depth_mm = 12;
	incise_tissue_force(&tissue, &blade, 5e-5);
	blade.depth_mm = 9;
	assert_true(incise_tissue_force(&tissue, &blade, 0) == force_N);
}

/* A law that is steeper than the tissue unloads: the force rises no faster. */
TEST(unloading_limits_the_force, begin_by_hand)
{
	config.unloading_N_mm = 0.02;
	near(go(10), 0.02 * 10);
}

/*
 * Random motions from the air back to it, in depth and along the skin, at any speed, with teeth
 * where the surgeon cuts: more work goes in than comes back, by the trapezium rule, and by hand,
 * where nothing tears, as held forces too.
 */
TEST(closed_motions_take_work)
{
	static const int motions[] = {INCISE_SURGEON_CUTS, INCISE_SURGEON_PRESSES,
				      INCISE_SURGEON_HAND};
	const uint64_t key = incise_random_key(4, 99);
	const int steps = 4000;

	for (uint64_t n = 0; n < 900; n++) {
		double work = 0, held = 0, force = 0, u[6];
		double dt = 1e-3 * (0.1 + incise_random_uniform(key + 1, n));

		begin_by_hand(NULL);
		config.motion = motions[n % 3];
		config.boundary = 0.1;
		for (int k = 0; k < 6; k++)
			u[k] = incise_random_uniform(key, 6 * n + (uint64_t)k);
		for (int i = 1; i <= steps; i++) {
			double t = 2 * M_PI * i / steps, before = blade.depth_mm, d, dx;

			d = (3 + 17 * u[0]) * pow(sin(t / 2), 2) *
			    (1 + 0.5 * u[1] * sin((1 + floor(8 * u[2])) * t));
			dx = config.motion == INCISE_SURGEON_PRESSES
				     ? 0
				     : 0.02 * u[3] *
					       (1 +
						sin((1 + floor(20 * u[4])) * t + u[5]));
			blade.depth_mm = i == steps ? 0 : fmax(d, 0);
			blade.position_mm[0] += dx;
			blade.velocity_mm_s[2] = (before - blade.depth_mm) / dt;
			blade.speed_mm_s = hypot(blade.velocity_mm_s[2], dx / dt);
			held += force * (blade.depth_mm - before);
			work += force / 2 * (blade.depth_mm - before);
			incise_tissue_advance(&tissue, &blade, dt);
			force = incise_tissue_force(&tissue, &blade, 0);
			work += force / 2 * (blade.depth_mm - before);
		}
		if (!(work > 0 && (held > 0 || config.motion != INCISE_SURGEON_HAND)))
			fail_msg("motion %d, number %d: %g and %g N mm", config.motion,
				 (int)n, work, held);
	}
}
