// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/calib/robust_line.c: nearly half of the points may be anywhere; without outliers it is
 * the line of least squares.
 */
#include "../unit.h"
#include "../../../lib/calib/robust_line.h"
#include "../../../lib/base/random.h"

#define MAX 400

struct points {
	double x[MAX], y[MAX];
	int n;
};

static void make(struct points *p, int n, uint64_t seed, double noise)
{
	uint64_t key = incise_random_key(seed, 3);

	p->n = n;
	for (int i = 0; i < n; i++) {
		p->x[i] = 10.0 * i / n;
		p->y[i] = 5 - 3 * p->x[i] + noise * incise_random_normal(key, i);
	}
}

TEST(clean_points_give_least_squares)
{
	struct robust_line line;
	struct points p;
	bool outlier[MAX];

	for (int n = 3; n <= 350; n += 27) {
		double mx = 0, my = 0, xx = 0, xy = 0;

		make(&p, n, n, 0.1);
		assert_int_equal(incise_robust_line(p.x, p.y, n, 0.1, &line, outlier), 0);
		for (int i = 0; i < n; i++) {
			assert_false(outlier[i]);
			mx += p.x[i] / n;
			my += p.y[i] / n;
		}
		for (int i = 0; i < n; i++) {
			xx += (p.x[i] - mx) * (p.x[i] - mx);
			xy += (p.x[i] - mx) * (p.y[i] - my);
		}
		/* rounding of sums of 350 */
		assert_float_equal(line.slope, xy / xx, 1e-10);
		assert_float_equal(line.zero, my - xy / xx * mx, 1e-9);
	}
}

TEST(wild_points_do_not_bend_it)
{
	for (int n = 20; n <= 380; n += 60) {
		struct robust_line line;
		struct points p;
		bool outlier[MAX];
		int wild = 2 * n / 5;

		make(&p, n, n, 0.1);
		/* two in five, all on another line, at one end */
		for (int i = 0; i < wild; i++)
			p.y[i] = 30 + p.x[i];
		assert_int_equal(incise_robust_line(p.x, p.y, n, 0, &line, outlier), 0);
		for (int i = 0; i < n; i++)
			assert_int_equal(outlier[i], i < wild);
		/* 0.1 over the 12 points and 6 of x that are left at least: sd 0.016 */
		assert_float_equal(line.slope, -3, 0.07);
	}
}

TEST(small_outliers_are_borne)
{
	struct robust_line line;
	struct points p;
	bool outlier[MAX];

	make(&p, 24, 1, 1e-6);
	p.y[7] += 0.3;
	assert_int_equal(incise_robust_line(p.x, p.y, p.n, 0, &line, outlier), 0);
	assert_true(outlier[7]);
	assert_int_equal(incise_robust_line(p.x, p.y, p.n, 0.1, &line, outlier), 0);
	assert_false(outlier[7]);
}

TEST(no_line_is_told)
{
	struct robust_line line;
	double x[4] = {1, 1, 1, 1}, y[4] = {1, 2, 3, 4};
	bool outlier[4];

	assert_int_equal(incise_robust_line(x, y, 4, 0, &line, outlier), -EDOM);
	x[0] = 2;
	assert_int_equal(incise_robust_line(x, y, 2, 0, &line, outlier), -EDOM);
}
