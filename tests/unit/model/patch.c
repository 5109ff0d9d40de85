// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Enclosures over patches hold the derivatives that differences find at their points, and
 * shrink onto them with the patch.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "../../../lib/model/patch.h"
#include "paper_model.h"

static double y(const struct incise_model *model, double a, double b)
{
	return incise_model_eval(model, (double[]){a, b}, NULL);
}

enum { F1, F2, F11, F22, F12, KINDS };

/* Central differences: off by h² of the next but one derivative, some 1e-5 here. */
static void differences(const struct incise_model *model, double a, double b, double *d)
{
	const double h = 2e-3;
	double m = y(model, a, b);

	d[F1] = (y(model, a + h, b) - y(model, a - h, b)) / (2 * h);
	d[F2] = (y(model, a, b + h) - y(model, a, b - h)) / (2 * h);
	d[F11] = (y(model, a + h, b) - 2 * m + y(model, a - h, b)) / (h * h);
	d[F22] = (y(model, a, b + h) - 2 * m + y(model, a, b - h)) / (h * h);
	d[F12] = (y(model, a + h, b + h) - y(model, a + h, b - h) -
		  y(model, a - h, b + h) + y(model, a - h, b - h)) /
		 (4 * h * h);
}

static void test_encloses_differences(void **state)
{
	uint64_t seed = 1;

	for (int n = 0; n < 300; n++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1 + n % 9, 1);
		struct incise_grid *grid = malloc(sizeof(*grid));
		double width = pow(10, -2 * (n % 3)), d[KINDS];
		double a = 10 + 7 * paper_random(&seed);
		double b = 25 + 20 * paper_random(&seed);
		struct interval got[KINDS];
		struct incise_block ba, bb;
		struct incise_patch patch;

		paper_disturb(model, 1 + (uint64_t)n, 0.5);
		assert_int_equal(incise_grid_init(grid, model, NULL), 0);
		incise_block_over(&ba, &grid->a, (struct interval){a, a + width});
		incise_block_over(&bb, &grid->b, (struct interval){b, b + width});
		incise_patch_over(&patch, grid, &ba, &bb);
		got[F1] = patch.f1;
		got[F2] = patch.f2;
		got[F11] = patch.f11;
		got[F22] = patch.f22;
		got[F12] = incise_patch_mixed(grid, &ba, &bb);
		for (int k = 0; k <= 8; k++) {
			differences(model, a + width * (k % 3) / 2,
				    b + width * (k / 3) / 2, d);
			for (int i = 0; i < KINDS; i++) {
				assert_true(d[i] > got[i].lo - 1e-4);
				assert_true(d[i] < got[i].hi + 1e-4);
				/* Over 0.1 µm nothing changes by as much. */
				if (n % 3 == 2)
					assert_true(got[i].hi - got[i].lo < 2e-2);
			}
		}
		free(grid);
		incise_model_free(model);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_encloses_differences),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
