/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Compiled models for tests: an arithmetic asked for, without a budget.
 */
#ifndef INCISE_TEST_COMPILED_H
#define INCISE_TEST_COMPILED_H

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

#endif
