// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The averaged normal: against the sum made again each tick, opposed normals, nonsense.
 */
#include "../unit.h"
#include <float.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/base/random.h"
#include "../../../lib/surface/average.h"

static void unit_at_random(uint64_t n, double normal[3])
{
	double v[3];

	for (int c = 0; c < 3; c++)
		v[c] = incise_random_normal(1, 3 * n + c);
	v[2] += 1;
	assert_true(v3_unit(normal, v, 0));
}

TEST(test_against_the_sum)
{
	static const int ns[] = {1, 2, 3, 10, 63, 64};

	for (int k = 0; k < 6; k++) {
		int n = ns[k], ticks = n == 10 ? 100000 : 1000;
		struct incise_average a;

		incise_average_init(&a, n);
		assert_int_equal(a.n, n);
		for (int i = 0; i < ticks; i++) {
			double normal[3], averaged[3], sum[3] = {0}, wanted[3];

			for (int j = i < n ? 0 : i - n + 1; j <= i; j++) {
				unit_at_random(j, normal);
				v3_add(sum, sum, 1, normal);
			}
			incise_average_add(&a, normal, averaged);
			v3_unit(wanted, sum, 0);
			/*
			 * No sum is above 64: each of the 3 · 64 additions since the last
			 * turn rounds by 7e-15 at most, which a short sum makes much of.
			 */
			for (int c = 0; c < 3; c++)
				assert_true(fabs(averaged[c] - wanted[c]) *
						    v3_length(sum) <
					    2e-12);
			/* A root, a square, a quotient: an ulp or two. */
			assert_true(fabs(v3_length(averaged) - 1) < 4 * DBL_EPSILON);
		}
	}
}

/* Rounding does not pile up: after a turn of equal normals nothing old is left. */
TEST(test_rounding_is_forgotten)
{
	static const double up[3] = {0, 0, 1};
	struct incise_average a;
	double averaged[3];

	incise_average_init(&a, 7);
	for (int i = 0; i < 1000003; i++) {
		double normal[3] = {sin(i), cos(i), 0};

		incise_average_add(&a, normal, averaged);
	}
	/* Two turns: one may have begun before. */
	for (int i = 0; i < 14; i++)
		incise_average_add(&a, up, averaged);
	assert_memory_equal(averaged, up, sizeof(up));
	assert_memory_equal(a.sum, ((double[3]){0, 0, 7}), sizeof(a.sum));
}

TEST(test_one_is_the_normal_itself)
{
	struct incise_average a;

	incise_average_init(&a, 1);
	for (int i = 0; i < 1000; i++) {
		double normal[3], averaged[3];

		unit_at_random(i, normal);
		incise_average_add(&a, normal, averaged);
		assert_memory_equal(averaged, normal, sizeof(normal));
	}
}

TEST(test_opposed_normals)
{
	struct incise_average a;
	double averaged[3], first[3], back[3];

	/* Of two that cancel none is left: the last average stays, tick after tick. */
	incise_average_init(&a, 2);
	unit_at_random(5, first);
	for (int c = 0; c < 3; c++)
		back[c] = -first[c];
	for (int i = 0; i < 100; i++) {
		incise_average_add(&a, i % 2 ? back : first, averaged);
		for (int c = 0; c < 3; c++)
			assert_true(fabs(averaged[c] - first[c]) < 4 * DBL_EPSILON);
	}
	/* Three at 120° cancel but for rounding, which is no direction. */
	incise_average_init(&a, 3);
	for (int i = 0; i < 100; i++) {
		double angle = 2 * M_PI * i / 3;
		double normal[3] = {0, sin(angle), cos(angle)};

		incise_average_add(&a, normal, averaged);
		/* The sum of the first two points between them, at 60°; then it stays. */
		if (i > 0) {
			assert_true(fabs(averaged[1] - sin(M_PI / 3)) < 1e-12);
			assert_true(fabs(averaged[2] - cos(M_PI / 3)) < 1e-12);
		}
	}
}

TEST(test_what_is_no_normal)
{
	static const double none[][3] = {
		{0, 0, 0},	  {NAN, 0, 1},		{INFINITY, 0, 0},
		{1e-300, 0, 0},	  {1e308, 1e308, 0},	{-INFINITY, INFINITY, NAN},
		{0.1, 0.2, -0.3}, {DBL_MAX, 0, 5e-324}, {3, 0, 0},
	};
	static const double up[3] = {0, 0, 1}, across[3] = {1, 0, 0};
	struct incise_average a;
	double averaged[3];

	incise_average_init(&a, 3);
	for (int i = 0; i < 9; i++) {
		incise_average_add(&a, none[i], averaged);
		assert_true(v3_length(averaged) == 0);
	}
	incise_average_add(&a, up, averaged);
	incise_average_add(&a, across, averaged);
	for (int i = 0; i < 9; i++) {
		incise_average_add(&a, none[i], averaged);
		/* Half way between the two; it does not count how often. */
		assert_true(fabs(averaged[0] - M_SQRT1_2) < 4 * DBL_EPSILON);
		assert_true(fabs(averaged[2] - M_SQRT1_2) < 4 * DBL_EPSILON);
	}
	incise_average_add(&a, across, averaged);
	assert_true(fabs(averaged[0] - 2 / sqrt(5)) < 4 * DBL_EPSILON);
}

TEST(test_reset_forgets)
{
	static const struct {
		int asked, n;
	} sizes[] = {{-5, 1},  {0, 1},	 {1, 1},	 {20, 20},
		     {64, 64}, {65, 64}, {INT32_MAX, 64}};

	for (int i = 0; i < 7; i++) {
		static const double zero[3];
		struct incise_average a;
		double normal[3], averaged[3];

		incise_average_init(&a, sizes[i].asked);
		assert_int_equal(a.n, sizes[i].n);
		for (int k = 0; k < 100; k++) {
			unit_at_random(k, normal);
			incise_average_add(&a, normal, averaged);
		}
		incise_average_reset(&a);
		assert_int_equal(a.n, sizes[i].n);
		incise_average_add(&a, zero, averaged);
		assert_true(v3_length(averaged) == 0);
		incise_average_add(&a, normal, averaged);
		for (int c = 0; c < 3; c++)
			assert_true(fabs(averaged[c] - normal[c]) < 4 * DBL_EPSILON);
	}
}
