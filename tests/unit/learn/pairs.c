// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Training pairs: units there and back, what cannot be learnt from, samples, spread explained,
 * and rows kept back: the share, whole groups, both sides filled.
 */
#include "../unit.h"
#include <float.h>
#include "../../../lib/learn/pairs.h"
#include "../model/paper_model.h"

/* Outputs of any size come out with mean 0 and variance 1. */
TEST(test_output)
{
	static const double sizes[] = {1e-300, 1e-9, 1, 1e9, 1e300};
	static const struct incise_variable in[] = {{"x", 2, 6}};

	for (int s = 0; s < 5; s++) {
		double rows[20], row[2], mean = 0, square = 0;
		struct incise_pairs pairs = {.rows = rows, .n = 10, .n_inputs = 1};
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

/* Scaled premises fire as the raw ones do, and come back. */
TEST(test_premises)
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

/* The same plane in both units; what overflows is reported. */
TEST(test_consequents)
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

TEST(test_refusals)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 1},
						    {"velocity_mm_s", 0, 1}};
	double rows[30];
	struct incise_pairs pairs = {.rows = rows, .n = 10, .n_inputs = 2},
			    few = {.rows = rows, .n = 4, .n_inputs = 2},
			    none = {.rows = rows, .n = 0, .n_inputs = 2};

	for (int i = 0; i < 30; i++)
		rows[i] = i;
	assert_int_equal(incise_pairs_check(&pairs, "training", &err), 0);
	assert_int_equal(incise_pairs_check_inputs(&pairs, in, &err), 0);
	assert_error(incise_pairs_check(&none, "check", &err), EINVAL, &err, "check");
	assert_int_equal(incise_pairs_check_inputs(&few, in, &err), -ENODATA);
	rows[14] = INFINITY;
	assert_error(incise_pairs_check(&pairs, "training", &err), EINVAL, &err,
		     "training pair 5 ");
	for (int i = 0; i < 10; i++)
		rows[3 * i + 1] = 7;
	assert_error(incise_pairs_check_inputs(&pairs, in, &err), EINVAL, &err,
		     "velocity_mm_s");
}

/* Each pair at most once, in order, with its group; all of them where there is room. */
TEST(test_sample)
{
	static double rows[2000];
	static int groups[1000];
	struct incise_pairs pairs = {.rows = rows, .n = 1000, .n_inputs = 1};
	struct incise_scaling scaling = {1, {0, 0}, {1, 1}};

	for (int i = 0; i < 1000; i++) {
		rows[2 * i] = i / 1024.0;
		groups[i] = i / 10;
	}
	for (size_t most = 10; most <= 100000; most *= 100) {
		struct incise_sample a = {0}, b = {0}, c = {0};
		size_t n = most < 1000 ? most : 1000;

		assert_int_equal(
			incise_sample_take(&a, &scaling, &pairs, groups, most, 1), 0);
		assert_int_equal(incise_sample_take(&b, &scaling, &pairs, NULL, most, 1),
				 0);
		assert_int_equal(incise_sample_take(&c, &scaling, &pairs, NULL, most, 2),
				 0);
		assert_int_equal(a.pairs.n, n);
		for (size_t i = 0; i < n; i++) {
			if (i)
				assert_true(a.rows[2 * i] > a.rows[2 * i - 2]);
			assert_int_equal(a.groups[i], (int)(1024 * a.rows[2 * i]) / 10);
		}
		assert_memory_equal(a.rows, b.rows, n * 2 * sizeof(double));
		assert_int_equal(!memcmp(a.rows, c.rows, n * 2 * sizeof(double)),
				 most >= 1000);
		assert_null(b.groups);
		incise_sample_free(&a);
		incise_sample_free(&b);
		incise_sample_free(&c);
	}
}

TEST(test_r2)
{
	static const double sizes[] = {1e-200, 1, 1e200};

	for (int s = 0; s < 3; s++) {
		double rows[] = {0, 1 * sizes[s], 0, 2 * sizes[s], 0, 3 * sizes[s]};
		struct incise_pairs pairs = {.rows = rows, .n = 3, .n_inputs = 1};

		/* The variance is 2/3. */
		assert_true(fabs(incise_pairs_r2(&pairs, sizes[s]) + 0.5) < 1e-14);
		assert_true(incise_pairs_r2(&pairs, 0) == 1);
		rows[1] = rows[3] = rows[5] = 0.1 * sizes[s];
		assert_true(isnan(incise_pairs_r2(&pairs, 0)));
	}
}

TEST(test_groups_stay_whole)
{
	for (uint64_t seed = 0; seed < 50; seed++) {
		int groups[500], side[20], n = 0;
		bool check[500];

		/* 20 groups of 5 to 45 rows. */
		for (int i = 0; i < 20; i++)
			side[i] = -1;
		for (int i = 0; i < 500; i++)
			groups[i] = (int)sqrt(i * 0.8);
		assert_int_equal(incise_split(500, groups, 0.3, seed, check, NULL), 0);
		for (int i = 0; i < 500; i++) {
			n += check[i];
			if (side[groups[i]] < 0)
				side[groups[i]] = check[i];
			assert_int_equal(side[groups[i]], check[i]);
		}
		/* Off by less than half of the largest group. */
		assert_true(abs(n - 150) <= 25);
	}
}

TEST(test_both_sides_keep_something)
{
	const int groups[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 1};

	for (uint64_t seed = 0; seed < 20; seed++)
		for (int s = 1; s < 10; s++) {
			bool check[10];
			int n = 0;

			assert_int_equal(
				incise_split(10, groups, s / 10.0, seed, check, NULL), 0);
			for (int i = 0; i < 10; i++)
				n += check[i];
			assert_true(n == 1 || n == 9);
		}
}

TEST(test_split_refusals)
{
	const int one[] = {0, 0, 0};
	bool check[3];

	assert_int_equal(incise_split(3, one, 0.5, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(1, NULL, 0.5, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(3, NULL, 0, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(3, NULL, 1, 1, check, &err), -EINVAL);
	assert_int_equal(incise_split(3, NULL, NAN, 1, check, &err), -EINVAL);
}
