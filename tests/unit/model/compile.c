// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Compiling: the cheapest arithmetic within the budget, refusals, and files.
 */
#include "../unit.h"
#include "../base/temp_file.h"
#include "../fixed/compiled.h"

static struct incise_model *smooth_model(void)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);

	for (int r = 0; r < 20; r++)
		incise_model_set_consequent(model, r,
					    (double[]){0.02 * (r % 4),
						       0.05 + 0.002 * (r / 4), 0.005});
	return model;
}

/* A looser budget takes a cheaper form; a tighter one a finer. */
TEST(test_budget_chooses)
{
	static const struct {
		double budget;
		enum incise_fixed_arithmetic arithmetic;
	} cases[] = {{1e-2, INCISE_FIXED_FORCE},
		     {1e-3, INCISE_FIXED_FORCE},
		     {2e-5, INCISE_FIXED_TABLE}};
	struct incise_model *model = smooth_model();

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_fixed_options o = {.budget = cases[i].budget,
						 .arithmetic = -1};
		struct incise_fixed *fx = incise_fixed_compile(model, &o, NULL);

		assert_non_null(fx);
		assert_int_equal(fx->arithmetic, cases[i].arithmetic);
		assert_true(incise_fixed_bound(fx) <= cases[i].budget);
		incise_fixed_free(fx);
	}
	incise_model_free(model);
}

/* The default budget certifies 0.1 mN for models of the paper's size over 0–20 mm × 0–50 mm/s. */
TEST(test_default_budget_holds)
{
	for (uint64_t seed = 1; seed <= 10; seed++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, seed, 3);
		struct incise_fixed *fx;

		paper_disturb(model, seed, 0.3);
		fx = incise_fixed_compile(model, NULL, NULL);
		assert_non_null(fx);
		assert_true(incise_fixed_bound(fx) <= 1e-4);
		incise_fixed_free(fx);
		incise_model_free(model);
	}
}

/* Three and four inputs: within the bound that is certified, and as good as two. */
TEST(test_many_inputs_hold_their_bound)
{
	for (uint64_t seed = 1; seed <= 12; seed++) {
		int n = 3 + (int)(seed % 2);
		struct incise_model *model = many_model(n, seed);
		struct incise_fixed *fx = incise_fixed_compile(model, NULL, NULL);
		double worst = 0;
		uint64_t points = seed;

		assert_non_null(fx);
		assert_int_equal(fx->n_inputs, n);
		assert_int_equal(fx->arithmetic, INCISE_FIXED_DIRECT);
		assert_true(incise_fixed_bound(fx) <= 1e-4);
		for (int k = 0; k < 20000; k++) {
			double x[4];

			for (int i = 0; i < n; i++) {
				const struct incise_variable *in =
					&incise_model_info(model)->input[i];
				double u = (paper_random(&points) + 1) / 2;

				/* The ends, too. */
				u = k % 5 ? u : u < 0.3 ? 0 : u > 0.7 ? 1 : u;
				x[i] = in->min + (in->max - in->min) * u;
			}
			worst = fmax(worst, fabs(incise_fixed_eval_double(fx, x) -
						 incise_model_eval(model, x, NULL)));
		}
		assert_true(worst <= incise_fixed_bound(fx));
		/* The bound is no empty word: some tens of what is met. */
		assert_true(worst > incise_fixed_bound(fx) / 100);
		incise_fixed_free(fx);
		incise_model_free(model);
	}
}

TEST(test_refusals)
{
	struct incise_fixed_options o = {.budget = 1e-6, .arithmetic = -1};
	struct incise_model *model = smooth_model();
	struct incise_error err = {0};

	/* Half an LSB of the output is 7.6 µN. */
	assert_error(incise_fixed_compile(model, &o, &err), ERANGE, &err, "bound");
	o = (struct incise_fixed_options){.arithmetic = 3};
	assert_null(incise_fixed_compile(model, &o, &err));
	assert_int_equal(err.code, EINVAL);
	incise_model_free(model);
	model = many_model(3, 1);
	o = (struct incise_fixed_options){.arithmetic = INCISE_FIXED_TABLE};
	assert_error(incise_fixed_compile(model, &o, &err), ENOTSUP, &err, "3 inputs");
	incise_model_free(model);
}

/* Sizes that no format holds, up to those that are not even finite once added up. */
TEST(test_extreme_consequents)
{
	static const double sizes[] = {1e6, 1e12, 1e100, 1e308, 1.7e308};

	for (size_t i = 0; i < sizeof(sizes) / sizeof(*sizes); i++)
		for (int a = -1; a < ARITHMETICS; a++) {
			struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
			struct incise_error err = {0};
			struct incise_fixed_options o = {.arithmetic = a};

			incise_model_set_consequent(model, 3,
						    (double[]){sizes[i], sizes[i], 2});
			assert_null(incise_fixed_compile(model, &o, &err));
			assert_int_equal(err.code, ERANGE);
			incise_model_free(model);
		}
}

/* Functions so narrow that between them the nearest cannot be determined by 128 widths. */
TEST(test_narrow_functions)
{
	struct incise_fixed_options o = {.arithmetic = INCISE_FIXED_DIRECT};
	struct incise_model *model = smooth_model();

	for (int k = 0; k < 5; k++)
		incise_model_set_mf(model, 0, k,
				    (double[4]){1e-3,
						incise_model_mf(model, 0, k)->p[1]});
	assert_null(incise_fixed_compile(model, &o, NULL));
	assert_int_equal(errno, ERANGE);
	incise_model_free(model);
}

TEST(test_files)
{
	struct temp_file file = temp_file_new("m.fx", "");
	struct incise_model *model = smooth_model();
	struct incise_fixed *fx, *back;
	struct incise_error err = {0};

	for (int a = 0; a < ARITHMETICS; a++) {
		fx = compiled(model, a, 32);
		assert_int_equal(incise_fixed_save(fx, file.path, NULL), 0);
		back = incise_fixed_load(file.path, NULL);
		assert_non_null(back);
		assert_int_equal(back->size, fx->size);
		assert_memory_equal(back->blob, fx->blob, fx->size);
		assert_true(incise_fixed_eval_double(back, (double[]){5, 20}) > 0);
		incise_fixed_free(back);
		incise_fixed_free(fx);
	}
	assert_int_equal(truncate(file.path, 100), 0);
	assert_error(incise_fixed_load(file.path, &err), EINVAL, &err, "damaged");
	/* Larger than any blob: read no further than that. */
	assert_int_equal(truncate(file.path, 100 << 20), 0);
	assert_null(incise_fixed_load(file.path, &err));
	assert_int_equal(err.code, EFBIG);
	temp_file_free(&file);
	assert_null(incise_fixed_load(file.path, &err));
	assert_int_equal(err.code, ENOENT);
	incise_model_free(model);
}
