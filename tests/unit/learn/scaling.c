// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Units for learning: there and back, whatever the size of the data.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <float.h>
#include <math.h>
#include "../../../lib/learn/scaling.h"
#include "../model/paper_model.h"

/* Outputs of any size come out with mean 0 and variance 1. */
static void test_output(void **state)
{
	static const double sizes[] = {1e-300, 1e-9, 1, 1e9, 1e300};
	static const struct incise_variable in[] = {{"x", 2, 6}};

	for (int s = 0; s < 5; s++) {
		double rows[20], row[2], mean = 0, square = 0;
		struct incise_pairs pairs = {rows, 10, 1};
		struct incise_scaling scaling;

		for (int i = 0; i < 10; i++) {
			rows[2 * i] = 2 + i * 4.0 / 9;
			rows[2 * i + 1] = sizes[s] * (1 + i % 4);
		}
		incise_scaling_find(&scaling, in, &pairs);
		for (int i = 0; i < 10; i++) {
			incise_scaling_row(&scaling, rows + 2 * i, row);
			assert_true(fabs(row[0] - i / 9.0) < 1e-15);
			mean += row[1] / 10;
			square += row[1] * row[1] / 10;
		}
		assert_true(fabs(mean) < 1e-14 && fabs(square - 1) < 1e-14);
	}
}

/* A constant has no spread, whatever rounding makes of its mean. */
static void test_constant_output(void **state)
{
	static const struct incise_variable in[] = {{"x", 0, 1}};
	double rows[] = {0, 0.7, 0.3, 0.7, 1, 0.7}, row[2];
	struct incise_pairs pairs = {rows, 3, 1};
	struct incise_scaling scaling;

	incise_scaling_find(&scaling, in, &pairs);
	incise_scaling_row(&scaling, rows, row);
	assert_true(fabs(row[1]) < 1e-14);
	assert_true(scaling.scale[1] == 0.7);
}

/* Scaled premises fire as the raw ones do, and come back. */
static void test_premises(void **state)
{
	for (int type = 0; type < 2; type++) {
		struct incise_scaling scaling = {2, {-3, 5, 0}, {20, 1e-3, 1}};
		struct incise_model *model = paper_model(type, 1, 1);
		struct incise_basis raw, scaled, back;
		double x[] = {4, 5.0004, 0}, s[3], a[20], b[20];

		assert_int_equal(incise_basis_init(&raw, model), 0);
		scaled = raw;
		incise_scaling_premises(&scaling, &scaled, false);
		back = scaled;
		incise_scaling_premises(&scaling, &back, true);
		for (int k = 0; k < raw.n_premises; k++)
			assert_true(fabs(back.p[k] - raw.p[k]) <=
				    1e-14 * fmax(1, fabs(raw.p[k])));
		incise_scaling_row(&scaling, x, s);
		incise_basis_firing(&raw, x, a);
		incise_basis_firing(&scaled, s, b);
		/* Centres up to 5e4 in scaled units are rounded to 1e-11. */
		for (int r = 0; r < 20; r++)
			assert_true(fabs(a[r] - b[r]) < 1e-10);
		incise_model_free(model);
	}
}

/* The same plane in both units; what overflows is told. */
static void test_consequents(void **state)
{
	struct incise_scaling scaling = {2, {-3, 5, 7}, {20, 0.5, 3}};
	double p[] = {0.4, -1, 2}, x[] = {4, 5.2, 0}, s[3], y;

	incise_scaling_row(&scaling, x, s);
	y = 7 + 3 * (p[0] + p[1] * s[0] + p[2] * s[1]);
	assert_int_equal(incise_scaling_consequents(&scaling, 1, p), 0);
	assert_true(fabs(p[0] + p[1] * x[0] + p[2] * x[1] - y) < 1e-13);
	scaling.scale[0] = DBL_MIN;
	assert_int_equal(incise_scaling_consequents(&scaling, 1, (double[]){1, 1e10, 1}),
			 -EDOM);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_output),
		cmocka_unit_test(test_constant_output),
		cmocka_unit_test(test_premises),
		cmocka_unit_test(test_consequents),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
