/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What holds for both arithmetics that interpolate between knots, table and force.
 */
#ifndef INCISE_TEST_INTERPOLATED_H
#define INCISE_TEST_INTERPOLATED_H

#include <math.h>
#include "compiled.h"

/* At a knot nothing is interpolated: half an LSB of the output and a few of the table. */
static inline void exact_at_knots(int arithmetic)
{
	struct incise_model *models[] = {paper_model(INCISE_MF_GAUSS, 7, 2),
					 line_model(2)};

	for (int m = 0; m < 2; m++) {
		struct incise_fixed *fx = compiled(models[m], arithmetic, 64);
		int last = fx->n_inputs - 1;

		for (int k = 0; k < fx->input[0].cells; k++)
			for (int l = 0; l < (last ? fx->input[1].cells : 1); l++) {
				int32_t q[] = {fx->input[0].min +
						       (k << fx->input[0].cell_shift),
					       fx->input[1].min +
						       (l << fx->input[1].cell_shift)};
				double x[] = {q[0] / (double)INCISE_FIXED_ONE,
					      q[1] / (double)INCISE_FIXED_ONE};

				assert_true(fabs(incise_fixed_eval(fx, q) /
							 (double)INCISE_FIXED_ONE -
						 incise_model_eval(models[m], x, NULL)) <
					    8e-6);
			}
		incise_fixed_free(fx);
		incise_model_free(models[m]);
	}
}

/* Linear interpolation: four times the cells per input, a sixteenth of the error. */
static inline void error_falls_with_the_square(int arithmetic)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 7, 4);
	double error[2] = {0};

	for (int k = 0; k < 2; k++) {
		struct incise_fixed *fx = compiled(model, arithmetic, k ? 128 : 32);
		uint64_t seed = 1;

		for (int n = 0; n < 50000; n++) {
			double x[] = {10 + 10 * paper_random(&seed),
				      25 + 25 * paper_random(&seed)};

			error[k] =
				fmax(error[k], fabs(incise_fixed_eval_double(fx, x) -
						    incise_model_eval(model, x, NULL)));
		}
		incise_fixed_free(fx);
	}
	/* Sampling, and the next order, take their part. */
	assert_true(error[0] / error[1] > 11 && error[0] / error[1] < 23);
	incise_model_free(model);
}

#endif
