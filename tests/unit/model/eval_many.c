// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Many evaluations at once: outputs are those of single ones, to the bit; gradients are the
 * difference quotients of the formulas in long double; sd the same as one by one.
 */
#include "../unit.h"
#include <float.h>
#include <incise/uncertainty.h>
#include "any_model.h"

#define POINTS 64

/*
 * The slope by input i to one side, h of the range away. Of a smooth function with second
 * derivatives of order 1 over widths s the error is h/s²; long double adds 1e-18/h.
 */
static double quotient(const struct incise_model *model, const double *x, int i, double h)
{
	double to[INCISE_MODEL_INPUTS_MAX];

	for (int k = 0; k < model->info.n_inputs; k++)
		to[k] = x[k];
	to[i] += h; /* rounded as the difference below */
	return (double)((any_output(model, to) - any_output(model, x)) /
			((long double)to[i] - x[i]));
}

TEST(outputs_are_those_of_single_points)
{
	struct incise_model *model = calloc(1, sizeof(*model));
	uint64_t seed = 5;

	for (int m = 0; m < 200; m++) {
		double x[POINTS * 4], y[POINTS], gradient[POINTS * 4];
		int n = 1 + any_below(&seed, 4);

		any_model(model, &seed, n, 12, 1);
		for (int k = 0; k < POINTS * n; k++)
			x[k] = k % 17 == 3   ? NAN
			       : k % 17 == 4 ? INFINITY
			       : k % 17 == 5 ? -DBL_MAX
					     : 12 * paper_random(&seed);
		incise_model_set_clamp(model, m % 2);
		incise_model_eval_many(model, x, POINTS, y, m % 3 ? gradient : NULL);
		for (int k = 0; k < POINTS; k++) {
			assert_true(y[k] == incise_model_eval(model, x + k * n, NULL));
			for (int i = 0; i < n && m % 3; i++) {
				assert_true(isfinite(gradient[k * n + i]));
				if (isnan(x[k * n + i]) || isinf(x[k * n + i]))
					assert_true(gradient[k * n + i] == 0);
			}
		}
	}
	incise_model_eval_many(model, NULL, 0, NULL, NULL);
	free(model);
}

/*
 * Where the quotients to both sides agree with each other there is no kink between, and the
 * gradient has to be what they are: to 1e-4 of the largest, as their own error is some 1e-5 at
 * h = 1e-7 for widths from 0.1 on, and second differences tell that it is.
 */
TEST(gradients_are_difference_quotients)
{
	struct incise_model *model = calloc(1, sizeof(*model));
	int compared = 0, kinks = 0;
	uint64_t seed = 9;

	for (int m = 0; m < 300; m++) {
		long double w[INCISE_MODEL_RULES_MAX];
		double x[4], y, gradient[4];
		int n = 1 + any_below(&seed, 4);

		any_model(model, &seed, n, 12, 1);
		for (int k = 0; k < 20; k++) {
			for (int i = 0; i < n; i++)
				x[i] = model->info.input[i].min +
				       (model->info.input[i].max -
					model->info.input[i].min) *
					       (0.5 + 0.45 * paper_random(&seed));
			/* nothing fires: the nearest rule answers */
			if (any_strengths(model, x, w) < 1e-300L)
				continue;
			incise_model_eval_many(model, x, 1, &y, gradient);
			for (int i = 0; i < n; i++) {
				double up = quotient(model, x, i, 1e-7);
				double down = quotient(model, x, i, -1e-7);
				double near = 1e-4 * fmax(1, fabs(up));

				if (!(fabs(up - down) < near)) {
					kinks++;
					continue;
				}
				compared++;
				if (!(fabs(gradient[i] - (up + down) / 2) < near))
					fail_msg("model %d, input %d: %.9g, not %.9g", m,
						 i, gradient[i], (up + down) / 2);
			}
		}
	}
	/* kinks are narrow, and so few are hit */
	assert_true(compared > 5000 && kinks < compared / 20);
	free(model);
}

TEST(sd_is_that_of_single_points)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 1);
	enum { N = 60 };
	double *factor = calloc(N * N, sizeof(*factor)), x[2 * POINTS], sd[POINTS];
	struct incise_uncertainty *uncertainty;
	const struct incise_variable *input = incise_model_info(model)->input;
	uint64_t seed = 3;
	int n_outside = 0;

	for (int i = 0; i < N; i++)
		factor[i * N + i] = 2;
	uncertainty = incise_uncertainty_new(model, 0.25, factor, N, NULL);
	assert_non_null(uncertainty);
	for (int k = 0; k < 2 * POINTS; k++)
		x[k] = 30 * paper_random(&seed);
	incise_uncertainty_sd_many(uncertainty, model, x, POINTS, sd);
	for (int k = 0; k < POINTS; k++) {
		bool outside = false;

		for (int i = 0; i < 2; i++)
			outside |= x[2 * k + i] < input[i].min ||
				   x[2 * k + i] > input[i].max;
		n_outside += outside;
		assert_true(outside ? isnan(sd[k])
				    : sd[k] == incise_uncertainty_sd(uncertainty, model,
								     x + 2 * k));
	}
	assert_in_range(n_outside, 1, POINTS - 1);
	incise_uncertainty_free(uncertainty);
	incise_model_free(model);
	free(factor);
}
