// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What has a fixed form, and what is refused by name.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/model/grid.h"
#include "../../../lib/model/model.h"
#include "../fixed/compiled.h"

static struct incise_model *square(int n_inputs, int mfs, double max)
{
	static const struct incise_variable out = {"y", 0, 1};
	struct incise_variable in[8];
	int n_mfs[8];

	for (int i = 0; i < 8; i++) {
		in[i] = (struct incise_variable){"x", 0, max};
		n_mfs[i] = mfs;
	}
	return incise_model_new_grid(n_inputs, in, n_mfs, INCISE_MF_GAUSS, &out, NULL);
}

static void refused(struct incise_model *model, int code, const char *says)
{
	struct incise_grid *grid = malloc(sizeof(*grid));
	struct incise_error err = {0};

	assert_non_null(model);
	assert_int_equal(incise_grid_init(grid, model, &err), -code);
	if (!strstr(err.text, says))
		fail_msg("'%s' does not say '%s'", err.text, says);
	incise_model_free(model);
	free(grid);
}

static void test_refusals(void **state)
{
	struct incise_model *model;

	refused(square(3, 2, 1), E2BIG, "3 inputs");
	refused(square(1, 2, 20000), ERANGE, "16383");
	refused(square(2, 2, 1e-4), ERANGE, "0.001");
	refused(paper_model(INCISE_MF_GBELL, 1, 1), ENOTSUP, "in1mf1 is a gbellmf");
	model = square(2, 2, 1);
	model->and_method = INCISE_AND_MIN;
	refused(model, ENOTSUP, "AndMethod is min");
	model = square(1, 2, 1);
	incise_model_set_mf(model, 0, 1, (double[4]){1e-12, 0.5});
	refused(model, ERANGE, "in1mf2: its width");
	model = square(1, 2, 1);
	incise_model_set_mf(model, 0, 0, (double[4]){1, -1e9});
	refused(model, ERANGE, "in1mf1: its centre");
}

static void test_same_model(void **state)
{
	struct incise_model *models[] = {paper_model(INCISE_MF_GAUSS, 2, 3),
					 line_model(3)};
	struct incise_grid *grid = malloc(sizeof(*grid));
	uint64_t seed = 1;

	for (int m = 0; m < 2; m++) {
		assert_int_equal(incise_grid_init(grid, models[m], NULL), 0);
		assert_int_equal(grid->one, m);
		for (int n = 0; n < 1000; n++) {
			double x[] = {5 + 5 * paper_random(&seed),
				      25 + 25 * paper_random(&seed)};
			long double a[INCISE_FIXED_MFS_MAX], b[INCISE_FIXED_MFS_MAX],
				y = 0;
			double xb = m ? x[0] : x[1];

			incise_axis_at(&grid->a, m ? 0 : x[0], a);
			incise_axis_at(&grid->b, xb, b);
			for (int i = 0; i < grid->a.n; i++)
				for (int j = 0; j < grid->b.n; j++)
					y += a[i] * b[j] *
					     (grid->p[i][j][0] + grid->p[i][j][1] * x[0] +
					      grid->p[i][j][2] * xb);
			assert_true(fabsl(y - incise_model_eval(models[m], x, NULL)) <
				    1e-13);
		}
		incise_model_free(models[m]);
	}
	free(grid);
}

static void test_sizes(void **state)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 0);
	struct incise_grid *grid = malloc(sizeof(*grid));
	struct incise_grid_size size;

	/* 3 - 0.5·d + 0.1·v over 0…20 and 0…50: -7 … 8; parts 3 + 10 + 5. */
	incise_model_set_consequent(model, 7, (double[]){3, -0.5, 0.1});
	assert_int_equal(incise_grid_init(grid, model, NULL), 0);
	incise_grid_size(grid, &size);
	assert_true(fabs(size.rule - 8) < 1e-12);
	assert_true(fabs(size.parts - 18) < 1e-12);
	assert_true(size.slope == 0.5);
	incise_model_free(model);
	free(grid);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_refusals),
		cmocka_unit_test(test_same_model),
		cmocka_unit_test(test_sizes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
