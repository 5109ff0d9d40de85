/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Units for learning: inputs from 0 to 1 over the model's ranges, the output about its
 * mean in standard deviations. So a ridge and a step mean the same for every dataset, and
 * squares of 1e-9 N or 1e9 N neither vanish nor overflow.
 */
#ifndef INCISE_SCALING_H
#define INCISE_SCALING_H

#include "basis.h"

/* Scaled = (raw - offset) / scale, per column; the output is the last. */
struct incise_scaling {
	int n_inputs;
	double offset[INCISE_MODEL_INPUTS_MAX + 1];
	double scale[INCISE_MODEL_INPUTS_MAX + 1];
};

void incise_scaling_find(struct incise_scaling *scaling,
			 const struct incise_variable *inputs,
			 const struct incise_pairs *pairs);

/* One row, output included. */
void incise_scaling_row(const struct incise_scaling *scaling, const double *raw,
			double *scaled);

/* Premises into scaled units, or back. */
void incise_scaling_premises(const struct incise_scaling *scaling,
			     struct incise_basis *basis, bool to_raw);

/* Consequents into raw units; -EDOM when one overflows. */
int incise_scaling_consequents(const struct incise_scaling *scaling, int n_rules,
			       double *consequents);

#endif
