/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Compiled models for tests: an arithmetic asked for, without a budget. */
#ifndef INCISE_TEST_COMPILED_H
#define INCISE_TEST_COMPILED_H

#include <math.h>
#include <incise/fixed.h>
#include "../model/paper_model.h"

#define ARITHMETICS 3

static inline struct incise_fixed *compiled(const struct incise_model *model,
					    int arithmetic, int cells)
{
	struct incise_fixed_options o = {.arithmetic = arithmetic, .cells = cells};

	return incise_fixed_compile(model, &o, NULL);
}

/* A model of one input, 0 to 10, three functions. */
static inline struct incise_model *line_model(uint64_t seed)
{
	static const struct incise_variable in = {"depth_mm", 0, 10},
					    out = {"force_N", 0, 2};
	static const int mfs[] = {3};
	struct incise_model *model =
		incise_model_new_grid(1, &in, mfs, INCISE_MF_GAUSS, &out, NULL);

	for (int r = 0; r < 3; r++)
		incise_model_set_consequent(model, r,
					    (double[]){paper_random(&seed),
						       paper_random(&seed) / 5});
	return model;
}

/* Of one to four inputs, 3, 2, 2 and 2 functions that are moved a little; some N. */
static inline struct incise_model *many_model(int n, uint64_t seed)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50},
						    {"acceleration_mm_s2", -500, 500},
						    {"tilt_deg", 0, 60}},
					    out = {"force_N", 0, 4};
	static const int mfs[] = {3, 2, 2, 2};
	struct incise_model *model =
		incise_model_new_grid(n, in, mfs, INCISE_MF_GAUSS, &out, NULL);

	for (int i = 0; i < n; i++)
		for (int k = 0; k < mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			incise_model_set_mf(
				model, i, k,
				(double[4]){mf->p[0] * (1 + 0.4 * paper_random(&seed)),
					    mf->p[1] + mf->p[0] * 0.3 *
							       paper_random(&seed)});
		}
	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		double p[5] = {paper_random(&seed)};

		for (int i = 0; i < n; i++)
			p[i + 1] = paper_random(&seed) / fmax(fabs(in[i].min), in[i].max);
		incise_model_set_consequent(model, r, p);
	}
	return model;
}

#endif
