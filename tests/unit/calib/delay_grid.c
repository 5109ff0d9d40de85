// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/calib/delay_grid.c: two streams on one grid are what they were made of, with
 * derivatives that are known; rows near what is missing are not good.
 */
#include "../unit.h"
#include "../../../lib/calib/delay_grid.h"

#define SPAN_S 12
#define SLOW (SPAN_S * 100)   /* each 10 ms: cubics */
#define QUICK (SPAN_S * 4000) /* each 0.25 ms: means */

static struct incise_delay_point slow[SLOW], quick[QUICK];

/* A parabola, which cubics, lines within a step and a Savitzky-Golay filter know exactly. */
static double value(double t)
{
	return 3 + 2 * t - 0.5 * t * t;
}

static void make_streams(void)
{
	for (int i = 0; i < SLOW; i++)
		slow[i] = (struct incise_delay_point){i * 10000000LL, value(i * 0.01)};
	for (int i = 0; i < QUICK; i++)
		quick[i] = (struct incise_delay_point){i * 250000LL, value(i * 0.00025)};
}

TEST(streams_keep_their_values)
{
	struct delay_grid grid;
	int good = 0;

	make_streams();
	assert_int_equal(delay_grid_make(&grid, slow, SLOW, quick, QUICK, &err), 0);
	for (int i = 0; i < grid.n; i++) {
		double t = i * DELAY_STEP_S;

		if (!grid.good[i])
			continue;
		good++;
		/* doubles of some tens; a mean over 4 ms is off by 0.5 · (4 ms)²/12 */
		assert_true(fabs(grid.motion[i] - value(t)) < 1e-9);
		assert_true(fabs(grid.other[i] - value(t)) < 1e-6);
		/* per second; and per step, which for a parabola is its middle's */
		assert_true(fabs(grid.speed[i] - (2 - t)) < 1e-8);
		assert_true(fabs(grid.target[i] - DELAY_STEP_S * (2 - t)) < 1e-8);
	}
	/* all but the ends, which filters reach over */
	assert_in_range(good, grid.n - 150, grid.n - 2);
	delay_grid_free(&grid);
}

TEST(a_shift_is_a_cubic)
{
	double column[10];

	for (int i = 0; i < 10; i++)
		column[i] = 1 + i - 0.25 * i * i + 0.01 * i * i * i;
	for (double shift = -1.9; shift < 2; shift += 0.3) {
		double x = 4 + shift, y = 1 + x - 0.25 * x * x + 0.01 * x * x * x;

		assert_true(fabs(delay_grid_at(column, 4, shift) - y) < 1e-12);
	}
}

/* A second without values: nothing is made up there, and nothing lost elsewhere. */
TEST(gaps_are_not_good)
{
	const double gap_s[] = {5, 6};
	struct delay_grid grid;
	int n = 0;

	make_streams();
	for (int i = 0; i < SLOW; i++)
		if (i * 0.01 <= gap_s[0] || i * 0.01 >= gap_s[1])
			slow[n++] = slow[i];
	assert_int_equal(delay_grid_make(&grid, slow, n, quick, QUICK, &err), 0);
	for (int i = 0; i < grid.n; i++) {
		double t = i * DELAY_STEP_S;

		if (t > gap_s[0] && t < gap_s[1])
			assert_false(grid.good[i]);
		else if (t > 1 && t < SPAN_S - 1 && (t < 4.5 || t > 6.5))
			assert_true(grid.good[i]);
	}
	delay_grid_free(&grid);

	make_streams();
	quick[QUICK / 2].value = NAN; /* a sample that is clipped */
	assert_int_equal(delay_grid_make(&grid, slow, SLOW, quick, QUICK, &err), 0);
	assert_false(grid.good[grid.n / 2]);
	assert_true(grid.good[grid.n / 4]);
	delay_grid_free(&grid);
}

TEST(what_cannot_be_compared_is_refused)
{
	struct delay_grid grid;

	make_streams();
	assert_int_equal(delay_grid_make(&grid, slow, 9, quick, QUICK, &err), -EDOM);
	assert_int_equal(delay_grid_make(&grid, slow, SLOW / 4, quick, QUICK, &err),
			 -EDOM); /* 3 s in common */
	slow[50].t_ns = slow[49].t_ns;
	assert_int_equal(delay_grid_make(&grid, slow, SLOW, quick, QUICK, &err), -EINVAL);
	make_streams();
	slow[0].t_ns = INT64_MIN;
	assert_int_equal(delay_grid_make(&grid, slow, SLOW, quick, QUICK, &err), -EINVAL);
	for (int i = 0; i < SLOW; i++)
		slow[i].t_ns = i * 200000000LL;
	for (int i = 0; i < QUICK; i++)
		quick[i].t_ns = i * 5000000LL;
	assert_error(delay_grid_make(&grid, slow, SLOW, quick, QUICK, &err), EDOM, &err,
		     "too slow");
}
