// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bounds of membership functions: whatever the step, they stay in order and overlap.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>
#include "../../../lib/learn/premises.h"
#include "../../../lib/learn/shuffle.h"

static void even(struct incise_basis *basis, enum incise_mf_type type, int n, int m)
{
	static const struct incise_variable in[] = {{"a", 0, 1}, {"b", 0, 1}};
	const int mfs[] = {n, m};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, type, &in[0], NULL);

	assert_int_equal(incise_basis_init(basis, model), 0);
	incise_model_free(model);
}

static double degree(const struct incise_basis *basis, int i, int k, double x)
{
	struct incise_mf mf = {.type = basis->type[i][k]};

	memcpy(mf.p, basis->p + basis->at[i][k], 3 * sizeof(double));
	return incise_mf_eval(&mf, x);
}

static void check_bounds(const struct incise_basis *basis)
{
	/* Bounds are computed with a rounding or two. */
	const double eps = 1e-12;

	for (int i = 0; i < 2; i++) {
		int n = basis->n_mfs[i];
		double gap = n > 1 ? 0.25 / (n - 1) : 0;

		for (int k = 0; k < n; k++) {
			double c = basis->p[incise_basis_centre(basis, i, k)], next;

			assert_true(c >= -eps && c <= 1 + eps);
			assert_true(isfinite(basis->p[basis->at[i][k]]));
			if (k == 0)
				assert_true(degree(basis, i, k, 0) > 0.1 - eps);
			if (k + 1 == n) {
				assert_true(degree(basis, i, k, 1) > 0.1 - eps);
				break;
			}
			next = basis->p[incise_basis_centre(basis, i, k + 1)];
			assert_true(next - c > gap - eps);
			assert_true(degree(basis, i, k, (c + next) / 2) > 0.1 - eps);
			assert_true(degree(basis, i, k + 1, (c + next) / 2) > 0.1 - eps);
		}
	}
}

static void test_even_grid_is_left_alone(void **state)
{
	for (int type = 0; type < 2; type++)
		for (int n = 1; n <= 6; n++) {
			struct incise_basis basis, before;

			even(&basis, type, n, 3);
			before = basis;
			incise_premises_project(&basis);
			for (int k = 0; k < basis.n_premises; k++)
				assert_true(fabs(basis.p[k] - before.p[k]) < 1e-15);
			check_bounds(&basis);
		}
}

static void test_any_step_ends_within_bounds(void **state)
{
	uint64_t seed = 4;

	for (int round = 0; round < 400; round++) {
		struct incise_basis basis;
		double step[64], size = pow(10, round % 4 - 1);

		even(&basis, round & 1 ? INCISE_MF_GBELL : INCISE_MF_GAUSS, 1 + round % 7,
		     4);
		for (int times = 0; times < 3; times++) {
			for (int k = 0; k < basis.n_premises; k++)
				step[k] = size * incise_random(&seed);
			incise_premises_step(&basis, step);
			check_bounds(&basis);
		}
	}
}

/* Functions on one spot are pulled apart, in their order. */
static void test_collapsed(void **state)
{
	for (int type = 0; type < 2; type++) {
		struct incise_basis basis;

		even(&basis, type, 5, 4);
		for (int k = 0; k < 5; k++) {
			basis.p[incise_basis_centre(&basis, 0, k)] = 0.5;
			basis.p[basis.at[0][k]] = 1e-12;
		}
		incise_premises_project(&basis);
		check_bounds(&basis);
	}
}

/* The scale is the derivative of a step, away from bounds. */
static void test_scale(void **state)
{
	for (int type = 0; type < 2; type++) {
		struct incise_basis basis, moved;
		double step[64] = {0}, scale[64];

		even(&basis, type, 3, 4);
		incise_premises_jitter(&basis, 3);
		incise_premises_scale(&basis, scale);
		for (int k = 0; k < basis.n_premises; k++) {
			moved = basis;
			step[k] = 1e-7;
			incise_premises_step(&moved, step);
			step[k] = 0;
			/* Second order 1e-7, rounding 1e-16/1e-7; a bound stops some. */
			if (moved.p[k] != basis.p[k])
				assert_true(fabs((moved.p[k] - basis.p[k]) / 1e-7 -
						 scale[k]) < 1e-5);
		}
	}
}

static void test_jitter_depends_on_seed_alone(void **state)
{
	struct incise_basis a, b, c;

	even(&a, INCISE_MF_GAUSS, 5, 4);
	b = c = a;
	incise_premises_jitter(&a, 7);
	incise_premises_jitter(&b, 7);
	incise_premises_jitter(&c, 8);
	assert_memory_equal(a.p, b.p, sizeof(a.p));
	assert_true(memcmp(a.p, c.p, sizeof(a.p)));
	check_bounds(&a);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_even_grid_is_left_alone),
		cmocka_unit_test(test_any_step_ends_within_bounds),
		cmocka_unit_test(test_collapsed),
		cmocka_unit_test(test_scale),
		cmocka_unit_test(test_jitter_depends_on_seed_alone),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
