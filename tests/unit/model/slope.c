// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Slopes of models: certified ones are never exceeded by finite differences on a dense
 * grid and are close to them; estimates are held against models whose slopes are known.
 */
#include "../unit.h"
#include <incise/fixed.h>
#include "../../../lib/model/slope.h"
#include "../fixed/compiled.h"
#include "any_model.h"
#include "../cases.h"

/* Points per input, both ends included. */
#define DENSE 120

/* Central differences of 1e-5 of the range: off by some 1e-9 of the slope. */
static double difference(const struct incise_model *model, const double *x, int i)
{
	const struct incise_model_info *info = incise_model_info(model);
	const struct incise_variable *v = &info->input[i];
	double h = (v->max - v->min) * 1e-5, lo[2], hi[2];

	for (int k = 0; k < info->n_inputs; k++)
		lo[k] = hi[k] = x[k];
	lo[i] = fmax(v->min, x[i] - h);
	hi[i] = fmin(v->max, x[i] + h);
	return (incise_model_eval(model, hi, NULL) - incise_model_eval(model, lo, NULL)) /
	       (hi[i] - lo[i]);
}

static void look(const struct incise_model *model, struct incise_slope *found)
{
	const struct incise_model_info *info = incise_model_info(model);
	int n = info->n_inputs;

	for (int i = 0; i < n; i++)
		found[i] = (struct incise_slope){INFINITY, -INFINITY, false};
	for (int k = 0; k < (n == 1 ? DENSE : DENSE * DENSE); k++) {
		int at[] = {k % DENSE, k / DENSE};
		double x[2];

		for (int i = 0; i < n; i++) {
			const struct incise_variable *v = &info->input[i];

			x[i] = v->min + (v->max - v->min) * at[i] / (DENSE - 1);
		}
		for (int i = 0; i < n; i++) {
			double slope = difference(model, x, i);

			found[i].lowest = fmin(found[i].lowest, slope);
			found[i].highest = fmax(found[i].highest, slope);
		}
	}
}

static double largest(const struct incise_slope *slope)
{
	return fmax(fabs(slope->lowest), fabs(slope->highest));
}

/* No slope is found outside, and the ends are off by no more than @share of the larger. */
static void assert_encloses(const struct incise_slope *slope,
			    const struct incise_slope *found, double share)
{
	double most = largest(found);

	if (!(slope->lowest <= found->lowest + 1e-7 * most &&
	      slope->highest >= found->highest - 1e-7 * most &&
	      slope->lowest >= found->lowest - share * most &&
	      slope->highest <= found->highest + share * most))
		fail_msg("%g … %g, found %g … %g", slope->lowest, slope->highest,
			 found->lowest, found->highest);
}

/* 1 % of tolerance, and what a grid of 1/120 misses of a peak: 1 %, says one of 1/1500. */
#define TIGHT 0.03

TEST(test_certified)
{
	for (int seed = 1; seed <= cases_of(10, 4); seed++) {
		struct incise_model *model =
			seed % 4 ? paper_model(INCISE_MF_GAUSS, seed, 1 << seed % 5)
				 : line_model(seed);
		struct incise_slope slopes[2], found[2];

		if (seed % 4 > 1)
			paper_disturb(model, seed, 0.6);
		assert_int_equal(incise_model_slopes(model, slopes), 0);
		look(model, found);
		for (int i = 0; i < incise_model_info(model)->n_inputs; i++) {
			assert_true(slopes[i].certified);
			assert_encloses(&slopes[i], &found[i], TIGHT);
		}
		incise_model_free(model);
	}
}

/* Whatever the functions are, rules that agree make a plane. */
TEST(test_plane)
{
	static const enum incise_mf_type types[] = {INCISE_MF_GAUSS, INCISE_MF_GBELL,
						    INCISE_MF_GAUSS2, INCISE_MF_TRI,
						    INCISE_MF_TRAP};

	for (size_t t = 0; t < sizeof(types) / sizeof(*types); t++) {
		struct incise_model *model = paper_model(types[t], 1, 1);
		struct incise_slope slopes[2];

		for (int r = 0; r < 20; r++)
			incise_model_set_consequent(model, r,
						    (double[]){0.5, 0.1, -0.003});
		assert_int_equal(incise_model_slopes(model, slopes), 0);
		for (int i = 0; i < 2; i++) {
			double right = i ? -0.003 : 0.1;

			/* A force of some N rounds to 1e-15, over secants of 0.02 mm. */
			assert_true(fabs(slopes[i].lowest - right) < 1e-12);
			assert_true(fabs(slopes[i].highest - right) < 1e-12);
			assert_int_equal(slopes[i].certified,
					 types[t] == INCISE_MF_GAUSS);
		}
		incise_model_free(model);
	}
}

/* Triangles with constant consequents are linear interpolation between their peaks. */
TEST(test_known_estimates)
{
	static const struct incise_variable in[] = {{"x", -3, 7}, {"z", 0, 8}};
	static const int mfs[] = {11, 9};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, INCISE_MF_TRI, &in[0], NULL);
	struct incise_slope slopes[2],
		right[2] = {{INFINITY, -INFINITY, false}, {INFINITY, -INFINITY, false}};
	double y[11][9];
	uint64_t seed = 7;

	for (int r = 0; r < 99; r++) {
		double *v = &y[r / 9][r % 9];

		*v = paper_random(&seed);
		incise_model_set_consequent(model, r, (double[]){*v, 0, 0});
	}
	/* Bilinear between peaks 1 apart: the steepest runs from peak to peak. */
	for (int i = 0; i < 11; i++)
		for (int j = 0; j < 9; j++) {
			double by_a = i ? y[i][j] - y[i - 1][j] : y[1][j] - y[0][j];
			double by_b = j ? y[i][j] - y[i][j - 1] : y[i][1] - y[i][0];

			right[0].lowest = fmin(right[0].lowest, by_a);
			right[0].highest = fmax(right[0].highest, by_a);
			right[1].lowest = fmin(right[1].lowest, by_b);
			right[1].highest = fmax(right[1].highest, by_b);
		}
	assert_int_equal(incise_model_slopes(model, slopes), 0);
	for (int i = 0; i < 2; i++) {
		assert_false(slopes[i].certified);
		/* The last step uphill is 1/4096 of 10 units, which is what a corner may be
		 * missed by: 0.25 %. */
		assert_true(fabs(slopes[i].lowest - right[i].lowest) < 5e-3);
		assert_true(fabs(slopes[i].highest - right[i].highest) < 5e-3);
		/* Secants are not steeper than the function itself. */
		assert_true(slopes[i].lowest > right[i].lowest - 1e-9);
		assert_true(slopes[i].highest < right[i].highest + 1e-9);
	}
	incise_model_free(model);
}

/* Shapes of any kind, up to eight inputs: numbers in order, a step as steep as it is. */
TEST(test_any_shape)
{
	struct incise_model *model = calloc(1, sizeof(*model));
	uint64_t seed = 1;

	for (int n = 0; n < 16; n++) {
		struct incise_slope slopes[INCISE_MODEL_INPUTS_MAX];
		int n_inputs = 1 + n % INCISE_MODEL_INPUTS_MAX;

		any_model(model, &seed, n_inputs, 6 + n, 1);
		assert_int_equal(incise_model_slopes(model, slopes), 0);
		for (int i = 0; i < n_inputs; i++) {
			assert_true(slopes[i].lowest <= slopes[i].highest);
			/* Outputs are within 1 + 8·10, secants 20/1024 wide. */
			assert_true(largest(&slopes[i]) < 2 * 81 * 1024 / 20.0);
		}
	}
	free(model);
}

/* Consequents beyond all formats, and functions that are next to steps. */
TEST(test_too_wild_to_certify)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	struct incise_slope slopes[2];

	incise_model_set_consequent(model, 3, (double[]){1e300, 1e307, -1e300});
	assert_int_equal(incise_model_slopes(model, slopes), 0);
	for (int i = 0; i < 2; i++) {
		assert_false(slopes[i].certified);
		assert_true(slopes[i].lowest <= slopes[i].highest);
	}
	incise_model_free(model);
}

TEST(test_compiled)
{
	for (int seed = 1; seed <= cases_of(4, 2); seed++)
		for (int a = 0; a < ARITHMETICS; a++) {
			struct incise_model *model =
				seed % 4 ? paper_model(INCISE_MF_GAUSS, seed, 2)
					 : line_model(seed);
			struct incise_fixed *fx = compiled(model, a, 128);
			struct incise_slope slopes[2], right[2];

			assert_int_equal(incise_model_slopes(model, right), 0);
			incise_fixed_slopes(fx, slopes);
			for (int i = 0; i < fx->n_inputs; i++) {
				assert_false(slopes[i].certified);
				/* 1 % of the certified ones, 1 of interpolation and rounding, 1 of
				 * secants over 1/256. */
				double may = 0.03 * largest(&right[i]);

				assert_true(fabs(slopes[i].lowest - right[i].lowest) <
					    may);
				assert_true(fabs(slopes[i].highest - right[i].highest) <
					    may);
			}
			incise_fixed_free(fx);
			incise_model_free(model);
		}
}

/* The narrowest support that compiles is 64 LSB: one secant, and no rounding of two. */
TEST(test_narrow_compiled)
{
	static const struct incise_variable in = {"x", 1, 1 + 64.0 / INCISE_FIXED_ONE};
	static const int mfs[] = {1};
	struct incise_model *model =
		incise_model_new_grid(1, &in, mfs, INCISE_MF_GAUSS, &in, NULL);
	struct incise_fixed *fx;
	struct incise_slope slope;

	incise_model_set_consequent(model, 0, (double[]){0, 100});
	fx = compiled(model, INCISE_FIXED_DIRECT, 0);
	assert_non_null(fx);
	incise_fixed_slopes(fx, &slope);
	/* Half an LSB at each end of 64 */
	assert_true(fabs(slope.lowest - 100) <= 1.0 / 64);
	assert_true(fabs(slope.highest - 100) <= 1.0 / 64);
	incise_fixed_free(fx);
	incise_model_free(model);
}

#define N_POINTS 4096

struct hills {
	int n;
	int *asked;
};

/*
 * Waves whose crests rise towards the upper corner; -1 … 1 times the number of inputs,
 * and that only at the ends.
 */
static double slope(const void *of, const double *x, int i)
{
	const struct hills *hills = of;
	double sum = 0;

	++*hills->asked;
	for (int k = 0; k < hills->n; k++) {
		assert_true(x[k] >= -1 && x[k] <= 3);
		sum += 0.8 * cos(M_PI * (x[k] + 1)) * (k == i ? 1 : 0.1) +
		       0.1 * (x[k] - 1);
	}
	return sum;
}

TEST(test_finds_the_highest_hill)
{
	for (int n = 1; n <= INCISE_MODEL_INPUTS_MAX; n++) {
		struct incise_slope slopes[INCISE_MODEL_INPUTS_MAX];
		int asked = 0;
		struct hills hills = {n, &asked};
		struct incise_secant secant = {.of = &hills,
					       .n_inputs = n,
					       .n_points = N_POINTS,
					       .slope = slope};
		/* At 3 in every input: cos 4π, and the rise of 0.1·2. */
		double highest = 0.8 + 0.08 * (n - 1) + 0.2 * n;

		for (int i = 0; i < n; i++) {
			secant.min[i] = -1;
			secant.max[i] = 3;
		}
		incise_secant_search(&secant, slopes);
		/* Bounded work: points, and climbs of both ends, each with a last round. */
		assert_true(asked <= n * (2 * N_POINTS + 8 * 2 * n));
		for (int i = 0; i < n; i++) {
			assert_false(slopes[i].certified);
			assert_true(slopes[i].highest <= highest + 1e-12);
			/* A few inputs are searched well; of eight, 4096 points see little. */
			assert_true(slopes[i].highest >
				    highest - (n <= 3 ? 0.005 : 0.2 * n));
			assert_true(slopes[i].lowest < -0.8);
		}
	}
}
