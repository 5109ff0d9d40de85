/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The slopes of a model over its support, by each input: ∂y/∂x from the lowest to the
 * highest. Of a cutting model the highest slope by depth is the stiffness that the hand
 * meets, N/mm, and that by velocity, N s/mm, acts as damping: what a check of stability
 * needs before a model is felt.
 *
 *   y ▲              ╱ highest
 *     │           __╱
 *     │      ____╱
 *     │   ╲_╱
 *     │   lowest
 *     └───┴──────────┴──▶ x
 *        min        max
 */
#ifndef INCISE_SLOPE_H
#define INCISE_SLOPE_H

#include <stdbool.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_fixed;
struct incise_model;

/** Slopes by one input, output's unit per input's, the other inputs being anywhere. */
struct incise_slope {
	double lowest, highest;
	/**
	 * Every slope lies within lowest … highest, by interval arithmetic, and each end is
	 * off by about 1 % of the larger one. Else they are the lowest and the highest that
	 * a search has found: where it looked, there are none beyond.
	 */
	bool certified;
};

/**
 * The slopes of a model.
 *
 * Certified for what incise_fixed_compile() takes: full grids of Gaussians over one or two
 * inputs, unless they are too wild to be enclosed. For all others an estimate: slopes of
 * secants over 1/1024 of an input's support, at some thousand points spread evenly and
 * from the best of these on uphill. A step, as upright edges have, counts as its height
 * over such a secant.
 *
 * Outside the support a model that clamps its inputs has slope 0, and one that does not
 * is not looked at.
 *
 * @param slopes one per input
 * @return 0; -ENOMEM. Takes some 20 ms for a model of 20 rules, up to 0.3 s for the
 *         largest.
 */
INCISE_API int incise_model_slopes(const struct incise_model *model,
				   struct incise_slope *slopes);

/**
 * The slopes of a compiled model: an estimate as above, by secants over 1/256 of the
 * support, and of 64 LSB at least where the support has as many. One output LSB over
 * a shorter one would measure rounding: between two neighbouring inputs the output stands
 * still or takes a whole step.
 *
 * @param slopes one per input
 */
INCISE_API void incise_fixed_slopes(const struct incise_fixed *fx,
				    struct incise_slope *slopes);

INCISE_END_DECLS
#endif
