/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The least squares of all pairs at fixed premises: rows (w(1), w(1)·x, …, w(r)·x, 1, t) in an
 * exact Gram matrix (gram.h), x scaled to 0 … 1 over the premises' ranges and
 * t = (y - middle)/2ᵏ to -1 … 1 over the output's. Neither depends on the pairs, so designs of parts
 * add up to the design of the whole.
 */
#ifndef INCISE_DESIGN_H
#define INCISE_DESIGN_H

#include "basis.h"
#include "gram.h"
#include "pairs.h"

struct incise_design {
	struct incise_basis basis;     /* scaled */
	struct incise_scaling scaling; /* of x and t */
	struct incise_gram *gram;
	double largest[INCISE_MODEL_RULES_MAX]; /* firing of each rule */
};

/*
 * At a model's premises and input ranges, with the output's range given. Returns 0, -ENOTSUP as
 * incise_basis_init(), -ENOMEM; incise_design_free() in either case.
 */
int incise_design_init(struct incise_design *design, const struct incise_model *model,
		       double min, double max);
void incise_design_free(struct incise_design *design);

/*
 * Add a raw pair to the gram of a design of these premises, of the same width, with a weight above 0
 * and at most 1 of its square; inputs outside the ranges are clamped. -ERANGE if its output is a
 * whole range or more outside, -EOVERFLOW (gram.h).
 */
int incise_design_add_to(struct incise_design *design, struct incise_gram *gram,
			 const double *raw, double weight);

/*
 * Scaling for learning, which has the output about its mean in standard deviations, over the
 * rows of a gram; mean and scale are the same in units of t.
 */
void incise_design_target(const struct incise_design *design, struct incise_gram *gram,
			  struct incise_scaling *scaling, double *mean, double *scale);

/* A rule that never fires stronger than this learns nothing from the data. */
#define DESIGN_UNFIRED 0.05

#endif
