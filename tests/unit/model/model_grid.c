// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A model as a grid: what has a fixed form and what is refused by name; enclosures hold what
 * they enclose, checked against long double and differences; certified bounds are never below
 * an error that is found, and not uselessly far above.
 */
#include "../../../lib/model/model.h"
#include "../../../lib/model/model_grid.h"
#include "../unit.h"
#include "../fixed/compiled.h"
#include "paper_model.h"
#include "../cases.h"

static bool holds(struct interval a, long double x)
{
	return a.lo <= x && x <= a.hi;
}

/* Long double sees what outward rounding has to make room for. */
TEST(test_operations)
{
	uint64_t seed = 1;

	for (int n = 0; n < cases_of(100000, 5000); n++) {
		double v[4], scale = pow(10, 6 * paper_random(&seed));
		struct interval a, b;
		long double x, y;

		for (int i = 0; i < 4; i++)
			v[i] = scale * paper_random(&seed);
		a = (struct interval){fmin(v[0], v[1]), fmax(v[0], v[1])};
		b = (struct interval){fmin(v[2], v[3]), fmax(v[2], v[3])};
		x = n % 3 ? (long double)v[0] : a.lo + (a.hi - a.lo) * 0.3L;
		y = n % 2 ? (long double)v[2] : b.lo + (b.hi - b.lo) * 0.7L;
		x = fmaxl(a.lo, fminl(a.hi, x));
		y = fmaxl(b.lo, fminl(b.hi, y));
		assert_true(holds(iv_add(a, b), x + y));
		assert_true(holds(iv_sub(a, b), x - y));
		assert_true(holds(iv_mul(a, b), x * y));
		assert_true(holds(iv_square(a), x * x));
		if (a.lo > 0)
			assert_true(holds(iv_inverse(a), 1 / x));
		if (scale < 100)
			assert_true(holds(iv_exp(a), expl(x)));
	}
}

TEST(test_extremes)
{
	/* Overflow opens the interval, it does not lose it. */
	assert_true(isinf(iv_exp(iv(1000)).hi));
	assert_true(iv_exp(iv(-1000)).lo >= 0 && iv_exp(iv(-1000)).hi > 0);
	assert_true(iv_add(iv(0), iv(0)).lo < 0 && iv_add(iv(0), iv(0)).hi > 0);
}

/* Derivatives by symmetric differences of the degrees. */
TEST(test_degrees_over_an_interval)
{
	for (int seed = 1; seed <= cases_of(20, 3); seed++) {
		struct incise_model *model = paper_model(INCISE_MF_GAUSS, seed, 1);
		struct incise_axis axis;
		uint64_t points = (uint64_t)seed;

		paper_disturb(model, seed, 0.6);
		incise_axis_init(&axis, model, seed % 2);
		for (int n = 0; n < 300; n++) {
			double u = (paper_random(&points) + 1) / 2;
			double at = axis.min + (axis.max - axis.min) * u;
			double half = (axis.max - axis.min) * pow(10, -1 - 3 * (n % 4));
			struct interval x = {at - half, at + half};
			struct incise_axis_range range;
			long double a[3][INCISE_FIXED_MFS_MAX], h = 1e-4L, sum = 0;

			incise_axis_over(&axis, x, &range);
			at += half * 0.9 * paper_random(&points);
			for (int k = 0; k < 3; k++)
				incise_axis_at(&axis, at + (k - 1) * h, a[k]);
			for (int i = 0; i < axis.n; i++) {
				/* Differences are off by h² times higher derivatives (of order
				 * 1), and by rounding of 1e-19/h². */
				long double d1 = (a[2][i] - a[0][i]) / (2 * h);
				long double d2 =
					(a[2][i] - 2 * a[1][i] + a[0][i]) / (h * h);

				assert_true(holds(range.a[i], a[1][i]));
				assert_true(range.d1[i].lo - 1e-7 <= d1 &&
					    d1 <= range.d1[i].hi + 1e-7);
				assert_true(range.d2[i].lo - 1e-6 <= d2 &&
					    d2 <= range.d2[i].hi + 1e-6);
				/* And they are tight where the interval is narrow. */
				if (n % 4 == 3)
					assert_true(range.a[i].hi - range.a[i].lo < 1e-7);
				sum += a[1][i];
			}
			assert_true(fabsl(sum - 1) < 1e-17L);
		}
		incise_model_free(model);
	}
}

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
	assert_error(incise_grid_init(grid, model, &err), code, &err, says);
	incise_model_free(model);
	free(grid);
}

TEST(test_refusals)
{
	struct incise_model *model;

	refused(square(3, 2, 1), E2BIG, "3 inputs");
	refused(square(1, 2, 20000), ERANGE, "16383");
	refused(square(2, 2, 1e-4), ERANGE, "0.001");
	refused(paper_model(INCISE_MF_GBELL, 1, 1), ENOTSUP, "very_shallow is a gbellmf");
	model = square(2, 2, 1);
	model->info.and_method = INCISE_AND_MIN;
	refused(model, ENOTSUP, "AndMethod is min");
	model = square(1, 2, 1);
	incise_model_set_mf(model, 0, 1, (double[4]){1e-12, 0.5});
	refused(model, ERANGE, "high: its width");
	model = square(1, 2, 1);
	incise_model_set_mf(model, 0, 0, (double[4]){1, -1e9});
	refused(model, ERANGE, "low: its centre");
}

TEST(test_sizes)
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

TEST(test_encloses_differences)
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
		got[F12] = incise_patch_mixed(&patch, grid, &ba, &bb);
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

/* Largest error found at random points and beside knots, where interpolation is worst. */
static double found(const struct incise_fixed *fx, const struct incise_model *model)
{
	double largest = 0;
	uint64_t seed = 3;

	for (int n = 0; n < 60000; n++) {
		double x[2];

		for (int i = 0; i < fx->n_inputs; i++) {
			double min = fx->input[i].min / (double)INCISE_FIXED_ONE;
			double max = fx->input[i].max / (double)INCISE_FIXED_ONE;
			double cell = ldexp(1, fx->input[i].cell_shift - 16);

			x[i] = min + (max - min) * (paper_random(&seed) + 1) / 2;
			/* Mid-cell in turn. */
			if (n & 1 << i && fx->input[i].cells)
				x[i] = min + (floor((x[i] - min) / cell) + 0.5) * cell;
			x[i] = fmin(x[i], max);
		}
		largest = fmax(largest, fabs(incise_fixed_eval_double(fx, x) -
					     incise_model_eval(model, x, NULL)));
	}
	return largest;
}

TEST(test_never_below_an_error)
{
	for (uint64_t seed = 1; seed <= 12; seed++)
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_model *model =
				seed % 4 ? paper_model(INCISE_MF_GAUSS, seed,
						       1 << seed % 5)
					 : line_model(seed);
			struct incise_fixed *fx;
			double error, bound;

			if (seed % 4)
				paper_disturb(model, seed, 0.6);
			fx = compiled(model, a, seed % 3 ? 64 : 32);
			assert_non_null(fx);
			error = found(fx, model);
			bound = incise_fixed_bound(fx);
			assert_true(error <= bound);
			/* Rounding is bounded by its worst case at every step, which never all
			 * come together: 8 µN aside, interpolation is met within 4. */
			assert_true(bound < 4 * error + 60e-6 * (1 << seed % 5));
			incise_fixed_free(fx);
			incise_model_free(model);
		}
}

/*
 * Supports end anywhere, and are compiled to the nearest LSB: what holds for every real
 * input has to hold at the very ends, and for functions that cross just outside.
 */
TEST(test_ends_between_lsbs)
{
	static const struct incise_variable out = {"y", 0, 1};
	static const int mfs[] = {2};
	uint64_t seed = 1;
	int compiled_models = 0;

	for (int n = 0; n < 300; n++) {
		double min = 2 * paper_random(&seed);
		struct incise_variable in = {"x", min,
					     min + 1.05e-3 + 1e-4 * paper_random(&seed)};
		struct incise_model *model =
			incise_model_new_grid(1, &in, mfs, INCISE_MF_GAUSS, &out, NULL);
		/* Half an LSB is 7.6e-6: the functions cross within that outside an end. */
		double cross = (n % 2 ? in.min : in.max) + 7e-6 * paper_random(&seed);
		double half = 0.0365, width = 3.8e-4 * pow(10, n % 3 - 1);

		incise_model_set_mf(model, 0, 0, (double[4]){width, cross - half});
		incise_model_set_mf(model, 0, 1, (double[4]){width, cross + half});
		incise_model_set_consequent(model, 0, (double[]){1, 0});
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_fixed *fx = compiled(model, a, 32);

			if (!fx)
				continue;
			compiled_models++;
			for (int k = 0; k <= 200; k++) {
				double u = k / 200.0,
				       x[] = {in.min * (1 - u) + in.max * u};

				assert_true(fabs(incise_fixed_eval_double(fx, x) -
						 incise_model_eval(model, x, NULL)) <=
					    incise_fixed_bound(fx));
			}
			incise_fixed_free(fx);
		}
		incise_model_free(model);
	}
	assert_true(compiled_models > 300);
}

TEST(test_finer_cells_lower_bound)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 5, 4);
	struct incise_grid *grid = malloc(sizeof(*grid));
	struct incise_survey *survey;
	double last = INFINITY;

	assert_int_equal(incise_grid_init(grid, model, NULL), 0);
	survey = incise_survey_new(grid);
	for (double w = 1; w > 1e-3; w /= 2) {
		double table = incise_survey_table(survey, w, 2 * w);

		assert_true(table < last);
		/* Weights and outputs are smoother than their product's cell by cell. */
		assert_true(incise_survey_force(survey, w, 2 * w) > 0);
		last = table;
	}
	incise_survey_free(survey);
	free(grid);
	incise_model_free(model);
}
