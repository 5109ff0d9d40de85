// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Springs from double, and the bound of their error: no error found is above it, and it
 * is not uselessly far above. The forces are measured against paper 2's formula in long
 * double, which has no formats.
 */
#include "../unit.h"
#include <incise/fixed.h>
#include "../../../lib/base/vector.h"
#include "../../extremes/fixed_spring.h"
#include "../model/paper_model.h"

static void any_direction(double u[3], uint64_t *seed)
{
	/* Long enough to have a direction; corners are the diagonals. */
	do {
		for (int i = 0; i < 3; i++)
			u[i] = paper_random(seed) * (paper_random(seed) > 0.5);
	} while (!v3_unit(u, u, 0.1));
}

/* |F^ - F|, F = -K [(P - P0)·u] u with the x that counts. */
static double force_error(const struct incise_fixed_spring *s, double stiffness,
			  const double p[3], const double anchor[3], const double u[3],
			  bool push_only)
{
	int32_t at[3], force[3] = {0};
	long double x = 0, length = 0, error = 0;

	for (int i = 0; i < 3; i++) {
		at[i] = (int32_t)lrint(p[i] * INCISE_FIXED_ONE);
		length += (long double)u[i] * u[i];
		x += ((long double)p[i] - anchor[i]) * u[i];
	}
	length = sqrtl(length);
	x /= length;
	if (push_only) {
		incise_fixed_spring_push(s, at, force);
		x = fminl(x, 0);
	} else {
		incise_fixed_spring_pull(s, at, force);
	}
	for (int i = 0; i < 3; i++) {
		long double off = force[i] / 0x1p16L + stiffness * x * u[i] / length;

		error += off * off;
	}
	return (double)sqrtl(error);
}

/* Largest error as a share of the bound, over springs of about this stiffness. */
static double worst_share(double stiffness, double reach, int n, uint64_t *seed)
{
	double worst = 0;

	for (int k = 0; k < n; k++) {
		double K = stiffness * (1 + 0.01 * paper_random(seed));
		double u[3], away[3], anchor[3], p[3];
		struct incise_fixed_spring s;
		double length, share;

		any_direction(u, seed);
		/* Far out along u, where all that is relative counts most, or anywhere. */
		if (k % 4)
			v3_copy(away, u);
		else
			any_direction(away, seed);
		length = reach * (k % 3 ? 0.999999 : paper_random(seed)) *
			 (k % 2 ? 1 : -1);
		for (int i = 0; i < 3; i++) {
			anchor[i] = 1000 * paper_random(seed);
			p[i] = anchor[i] + length * away[i];
			/* A direction that is off by as much as may be. */
			u[i] *= 1 + 9e-7 * (k % 5 == 0);
		}
		assert_int_equal(incise_fixed_spring_set(&s, K, anchor, u), 0);
		share = force_error(&s, K, p, anchor, u, k % 7 == 0) /
			incise_fixed_spring_bound(K, reach);
		assert_true(share <= 1);
		worst = fmax(worst, share);
	}
	return worst;
}

TEST(test_never_above_the_bound)
{
	static const struct {
		double stiffness, reach;
	} cases[] = {
		{0, 20},     {1e-4, 20},    {0.1, 20},	{0.1, 1e-4},
		{1, 20},     {10, 20},	    {10, 500},	{100, 20},
		{1000, 1.5}, {32000, 1e-3}, {32000, 1}, {0.5, 16000},
	};
	uint64_t seed = 1;

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		double share =
			worst_share(cases[c].stiffness, cases[c].reach, 100000, &seed);

		/* All roundings at their worst at once are rare: within 3 they do meet. */
		if (cases[c].stiffness > 0 && share < 1.0 / 3)
			fail_msg("%g N/mm, %g mm: at most %g of the bound",
				 cases[c].stiffness, cases[c].reach, share);
	}
}

TEST(test_no_bound_where_it_may_be_held)
{
	static const double cases[][2] = {
		{-1, 1},    {1, -1},	   {NAN, 1},  {1, NAN},	  {32768, 0},
		{1, 16384}, {INFINITY, 0}, {4, 8192}, {32767, 1},
	};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++)
		assert_true(isinf(incise_fixed_spring_bound(cases[c][0], cases[c][1])));
	assert_true(isfinite(incise_fixed_spring_bound(1, 16383)));
	assert_true(isfinite(incise_fixed_spring_bound(32767, 0)));
}

TEST(test_refused)
{
	static const struct {
		int rc;
		double stiffness, anchor[3], direction[3];
	} cases[] = {
		{0, 0, {0, 0, 0}, {0, 0, 1}},
		{0, 32767, {32767, -32767, 0}, {-1, 0, 0}},
		{0, 1, {0, 0, 0}, {0, 0, 1 + 9e-7}},
		{-EINVAL, 1, {0, 0, 0}, {0, 0, 1 + 2e-6}},
		{-EINVAL, 1, {0, 0, 0}, {0, 0, 0}},
		{-EINVAL, 1, {0, 0, 0}, {NAN, 0, 1}},
		{-EINVAL, 1, {0, 0, 0}, {INFINITY, 0, 1}},
		{-EINVAL, 1, {0, NAN, 0}, {0, 0, 1}},
		{-EINVAL, 1, {0, 0, -INFINITY}, {0, 0, 1}},
		{-EINVAL, NAN, {0, 0, 0}, {0, 0, 1}},
		{-EINVAL, INFINITY, {0, 0, 0}, {0, 0, 1}},
		{-EINVAL, -1e-9, {0, 0, 0}, {0, 0, 1}},
		{-ERANGE, 32767.1, {0, 0, 0}, {0, 0, 1}},
		{-ERANGE, 1, {0, 0, -32767.1}, {0, 0, 1}},
	};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct incise_fixed_spring s, before;

		memset(&s, 0x55, sizeof(s));
		before = s;
		assert_int_equal(incise_fixed_spring_set(&s, cases[c].stiffness,
							 cases[c].anchor,
							 cases[c].direction),
				 cases[c].rc);
		assert_true(!cases[c].rc == !!memcmp(&s, &before, sizeof(s)));
	}
}
