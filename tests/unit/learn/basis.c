// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Premises laid out for learning: firing strengths, outputs and slopes against the model
 * and against finite differences, and what is no grid.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/basis.h"
#include "../model/paper_model.h"

TEST(test_firing_is_the_model_s)
{
	static const double far[] = {-200, -20, -3, 0, 7.7, 20, 60, 200};
	static const double further[] = {-1e300, -1e9, 1e9, 1e300};

	for (int type = 0; type < 2; type++) {
		struct incise_model *model = paper_model(type, 5, 1);
		struct incise_basis basis;
		double a[20], b[20];

		paper_disturb(model, 9, 0.3);
		assert_int_equal(incise_basis_init(&basis, model), 0);
		assert_int_equal(basis.n_premises, type ? 27 : 18);
		for (int i = 0; i < 64; i++) {
			double x[] = {far[i % 8], far[i / 8]}, sum = 0;

			incise_model_firing(model, x, a);
			incise_basis_firing(&basis, x, b);
			/* Exponents reach 1e4 here, and the model adds them up. */
			for (int r = 0; r < 20; r++) {
				assert_true(fabs(a[r] - b[r]) < 1e-9);
				sum += b[r];
			}
			assert_true(fabs(sum - 1) < 1e-14);
		}
		for (int i = 0; i < 16; i++) {
			double x[] = {further[i % 4], further[i / 4]}, sum = 0;

			incise_basis_firing(&basis, x, b);
			for (int r = 0; r < 20; r++)
				sum += b[r];
			assert_true(fabs(sum - 1) < 1e-14);
		}
		incise_model_free(model);
	}
}

TEST(test_output_is_the_model_s)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 5, 1);
	double w[20], f[20], consequents[60];
	struct incise_basis basis;
	uint64_t seed = 8;

	assert_int_equal(incise_basis_init(&basis, model), 0);
	for (int r = 0; r < 20; r++)
		memcpy(consequents + 3 * r, incise_model_rule(model, r)->p,
		       3 * sizeof(double));
	for (int i = 0; i < 100; i++) {
		double x[] = {10 + 10 * paper_random(&seed),
			      25 + 25 * paper_random(&seed)};
		double row[60], y = 0;

		incise_basis_firing(&basis, x, w);
		incise_basis_row(&basis, w, x, row);
		for (int k = 0; k < 60; k++)
			y += row[k] * consequents[k];
		assert_true(fabs(y - incise_model_eval(model, x, NULL)) < 1e-14);
		assert_true(fabs(y - incise_basis_output(&basis, w, x, consequents, f)) <
			    1e-14);
	}
	incise_model_free(model);
}

/* slope·share = ∂y/∂p, by central differences. */
TEST(test_derivative)
{
	for (int type = 0; type < 2; type++) {
		struct incise_model *model = paper_model(type, 5, 1);
		double w[20], f[20], consequents[60], slopes[27], shares[9];
		struct incise_basis basis;
		uint64_t seed = 2;

		paper_disturb(model, 9, 0.3);
		assert_int_equal(incise_basis_init(&basis, model), 0);
		for (int k = 0; k < 60; k++)
			consequents[k] = paper_random(&seed);
		for (int i = 0; i < 30; i++) {
			double x[] = {10 + 10 * paper_random(&seed),
				      25 + 25 * paper_random(&seed)};
			double y;
			int width = type ? 3 : 2;

			incise_basis_firing(&basis, x, w);
			y = incise_basis_output(&basis, w, x, consequents, f);
			incise_basis_slopes(&basis, x, slopes);
			incise_basis_shares(&basis, w, f, y, shares);
			for (int k = 0; k < basis.n_premises; k++) {
				double p = basis.p[k], h = 1e-6 * fmax(fabs(p), 1), up;

				basis.p[k] = p + h;
				incise_basis_firing(&basis, x, w);
				up = incise_basis_output(&basis, w, x, consequents, f);
				basis.p[k] = p - h;
				incise_basis_firing(&basis, x, w);
				up -= incise_basis_output(&basis, w, x, consequents, f);
				basis.p[k] = p;
				/* Outputs of order 50 are rounded to 1e-14, over 2h. */
				assert_true(fabs(up / (2 * h) -
						 slopes[k] * shares[k / width]) < 1e-6);
			}
		}
		incise_model_free(model);
	}
}

/* A weight, an input left out, or rules in another order: not a plain grid. */
TEST(test_what_is_no_grid)
{
	static const char *const rules[] = {"1, 1 (0.5) : 1\n2, 2 (1) : 1\n",
					    "1, 1 (1) : 1\n0, 2 (1) : 1\n",
					    "2, 1 (1) : 1\n1, 2 (1) : 1\n",
					    "1, 1 (1) : 1\n1, 2 (1) : 1\n"};
	char path[] = "/tmp/incise-basis-XXXXXX";
	int fd = mkstemp(path);

	assert_true(fd >= 0);
	close(fd);
	for (size_t i = 0; i <= sizeof(rules) / sizeof(*rules); i++) {
		FILE *file = fopen(path, "w");
		struct incise_basis basis;
		struct incise_model *model;
		bool good = i == sizeof(rules) / sizeof(*rules);

		fputs("[System]\nType='sugeno'\nNumInputs=1\nNumRules=2\n[Input1]\n"
		      "Name='x'\nRange=[0 1]\nNumMFs=2\nMF1='a':'gaussmf',[0.4 0]\n"
		      "MF2='b':'gaussmf',[0.4 1]\n[Output1]\nNumMFs=2\n"
		      "MF1='a':'constant',[0]\nMF2='b':'constant',[1]\n[Rules]\n",
		      file);
		fputs(good ? "1, 1 (1) : 1\n2, 2 (1) : 1\n" : rules[i], file);
		fclose(file);
		model = incise_model_load(path, NULL);
		assert_non_null(model);
		assert_int_equal(incise_basis_init(&basis, model), good ? 0 : -ENOTSUP);
		incise_model_free(model);
	}
	unlink(path);
}

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

/* Centres at quantiles but for a tenth; each function is a half between its nearer neighbours. */
TEST(test_place)
{
	double rows[400 * 3];
	const struct incise_pairs pairs = {.rows = rows, .n = 400, .n_inputs = 2};

	for (int i = 0; i < 400; i++) {
		double even = i / 399.0;

		rows[3 * i] = pow(even, 4);
		rows[3 * i + 1] = i < 300 ? 0 : 1;
	}
	for (int type = 0; type < 2; type++) {
		struct incise_basis basis;
		double last = 0;

		even(&basis, type, 5, 4);
		assert_int_equal(incise_basis_place(&basis, &pairs), 0);
		for (int k = 0; k < 5; k++) {
			double c = basis.p[incise_basis_centre(&basis, 0, k)];

			assert_true(fabs(c - (0.9 * pow(k / 4.0, 4) + 0.1 * k / 4)) <
				    0.01);
			if (k)
				assert_true(fabs(degree(&basis, 0, k, (c + last) / 2) -
						 0.5) < 1e-12);
			last = c;
		}
		/* Quantiles that coincide leave the functions apart. */
		for (int k = 1; k < 4; k++)
			assert_true(
				basis.p[incise_basis_centre(&basis, 1, k)] -
					basis.p[incise_basis_centre(&basis, 1, k - 1)] >
				0.03);
	}
}
