// SPDX-License-Identifier: GPL-2.0-or-later
/* Tests of lib/record/read/depth.c. */
#include "../unit.h"
#include "../../../lib/record/read/depth.h"

#define RECORDS 2000
#define PERIOD_NS 8333333LL /* 120 Hz */

static const double origin[3] = {0, 0, 0}, up[3] = {0, 0, 1};
static struct incise_depth_row rows[RECORDS];

/* Push records from a path through space; collect all rows. */
static int trace(void (*path)(double t_s, double position_mm[3]), int n,
		 const int64_t *times_ns)
{
	struct incise_depth depth;
	int got = 0;

	incise_depth_init(&depth, origin, up);
	for (int i = 0; i < n; i++) {
		int64_t t_ns =
			times_ns ? times_ns[i] : 5000 * 1000000000LL + i * PERIOD_NS;
		double position[3];

		path(t_ns * 1e-9, position);
		if (incise_depth_push(&depth, 100 + i, t_ns, position, &rows[got]))
			got++;
	}
	while (incise_depth_flush(&depth, &rows[got]))
		got++;
	return got;
}

TEST(depth_is_along_the_normal)
{
	static const struct {
		double point[3], normal[3], position[3], depth;
	} cases[] = {
		{{0, 0, 0}, {0, 0, 1}, {3, 4, -5}, 5}, /* below */
		{{0, 0, 0}, {0, 0, 1}, {3, 4, 2}, -2}, /* in the air */
		{{0, 0, 7}, {0, 0, 1}, {0, 0, 7}, 0},  /* on the surface */
		{{1, 2, 3}, {0, 0, -1}, {9, 9, 5}, 2}, /* hung from above */
		{{0, 0, 0}, {0.6, 0, 0.8}, {-5, 1, 0}, 3},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_depth depth;

		incise_depth_init(&depth, cases[i].point, cases[i].normal);
		/* a few roundings of numbers below 10 */
		assert_true(fabs(incise_depth_of(&depth, cases[i].position) -
				 cases[i].depth) < 1e-14);
	}
}

static void straight(double t_s, double p[3])
{
	p[0] = 100 + 30 * (t_s - 5000);
	p[1] = -7 + 40 * (t_s - 5000);
	p[2] = -3;
}

TEST(straight_path_has_its_speed)
{
	int n = trace(straight, 50, NULL);

	assert_int_equal(n, 50); /* the ends too */
	for (int i = 0; i < n; i++) {
		assert_int_equal(rows[i].seq, 100 + i);
		assert_int_equal(rows[i].t_ns, 5000 * 1000000000LL + i * PERIOD_NS);
		assert_true(fabs(rows[i].depth_mm - 3) < 1e-14);
		/* 3-4-5; t_s near 5000 has an ulp of 1e-12 s, times 50 mm/s, over 8 ms */
		assert_true(fabs(rows[i].velocity_mm_s - 50) < 1e-7);
	}
}

TEST(row_comes_after_half_the_window)
{
	struct incise_depth depth;
	struct incise_depth_row row;
	double position[3] = {0};

	incise_depth_init(&depth, origin, up);
	for (int i = 0; i < 30; i++) {
		bool final = incise_depth_push(&depth, i, i * PERIOD_NS, position, &row);

		assert_int_equal(final, i >= INCISE_DEPTH_HALF);
		if (final)
			assert_int_equal(row.seq, i - INCISE_DEPTH_HALF);
	}
}

static double noise(void)
{
	static uint32_t seed = 1;
	double sum = -6;

	for (int i = 0; i < 12; i++) { /* sum of twelve uniforms: sd 1 */
		seed = seed * 1664525 + 1013904223;
		sum += seed / 4294967296.0;
	}
	return sum;
}

static void noisy(double t_s, double p[3])
{
	p[0] = 25 * (t_s - 5000) + 0.02 * noise();
	p[1] = 0.02 * noise();
	p[2] = -5 + 0.02 * noise();
}

TEST(noise_of_the_tracker_gives_a_sane_speed)
{
	double sum = 0, sum2 = 0;
	int n = trace(noisy, RECORDS, NULL), inner = n - 2 * INCISE_DEPTH_HALF;

	for (int i = INCISE_DEPTH_HALF; i < n - INCISE_DEPTH_HALF; i++) {
		sum += rows[i].velocity_mm_s - 25;
		sum2 += pow(rows[i].velocity_mm_s - 25, 2);
	}
	/* 0.31 mm/s by the theory in depth.h; its error here: rows of overlapping windows
	 * count as 2000/9 independent ones, so the sd is known to 1/sqrt(2·222) = 5 %, the
	 * mean to 0.31/sqrt(222) = 0.02: three of each. */
	assert_true(fabs(sqrt(sum2 / inner) / 0.31 - 1) < 0.15);
	assert_true(fabs(sum / inner) < 0.06);
}

static void swing(double t_s, double p[3])
{
	double w = 2 * M_PI;

	p[0] = 25 * (t_s - 5000) + 22 / w * sin(w * (t_s - 5000));
	p[1] = p[2] = 0;
}

TEST(swing_is_flattened_little)
{
	int n = trace(swing, 240, NULL);

	for (int i = INCISE_DEPTH_HALF; i < n - INCISE_DEPTH_HALF; i++) {
		double t = rows[i].t_ns * 1e-9 - 5000;
		double truth = 25 + 22 * cos(2 * M_PI * t);

		/* 22·w²·(3m²+3m-1)/(30·120²)/… = 0.12 mm/s, see depth.h */
		assert_true(fabs(rows[i].velocity_mm_s - truth) < 0.13);
	}
}

TEST(records_across_a_gap_are_not_mixed)
{
	/* Two stretches of 5 at 8 ms, a second apart; the path jumps in between. */
	int64_t times[10];
	int n;

	for (int i = 0; i < 10; i++)
		times[i] = 5000000000000LL + i * 8000000LL + (i >= 5 ? 1000000000LL : 0);
	n = trace(straight, 10, times);
	assert_int_equal(n, 10);
	for (int i = 0; i < 10; i++)
		assert_true(fabs(rows[i].velocity_mm_s - 50) < 1e-7);

	/* A record with no other near has no speed. */
	n = trace(straight, 2, (int64_t[]){5000000000000LL, 5001000000000LL});
	assert_int_equal(n, 2);
	assert_true(rows[0].velocity_mm_s == 0 && rows[1].velocity_mm_s == 0);
}

TEST(nothing_in_nothing_out)
{
	assert_int_equal(trace(straight, 0, NULL), 0);
}
