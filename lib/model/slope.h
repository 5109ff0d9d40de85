/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The slopes of a model over its support by each input: ∂y/∂x from the lowest to the
 * highest. The highest slope of a cutting model by depth is the stiffness that the hand
 * meets, N/mm; the slope by velocity, N s/mm, acts as damping: a check of stability needs
 * both before a model is felt.
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
#include <incise/fixed.h>
#include <incise/model.h>

/* Slopes by one input, output's unit per input's, the other inputs being anywhere. */
struct incise_slope {
	double lowest, highest;
	/*
	 * Every slope lies within lowest … highest, by interval arithmetic, and each end is
	 * off by about 1 % of the larger one. Else a search found lowest and highest: it met
	 * no slopes beyond.
	 */
	bool certified;
};

/*
 * The slopes of a model, one result per input.
 *
 * Certified for full grids of Gaussians over one or two inputs, unless they are too wild to
 * be enclosed. For all others an estimate: slopes of secants over 1/1024 of an input's
 * support, at some thousand points spread evenly and from the best of these on uphill. A
 * step, as upright edges have, counts as its height over such a secant.
 *
 * Outside the support a model that clamps its inputs has slope 0; other models are not
 * examined there.
 *
 * 0; -ENOMEM. Takes some 20 ms for a model of 20 rules, up to 0.3 s for the largest.
 */
int incise_model_slopes(const struct incise_model *model, struct incise_slope *slopes);

/*
 * The slopes of a compiled model: an estimate as above, by secants over 1/256 of the
 * support, and of 64 LSB at least where the support has as many. One output LSB over
 * a shorter one would measure rounding: between two neighbouring inputs the output stands
 * still or takes a whole step.
 */
void incise_fixed_slopes(const struct incise_fixed *fx, struct incise_slope *slopes);

/* A function whose lowest and highest slope over a box are searched for by secants. */
struct incise_secant {
	const void *of;
	int n_inputs;
	int n_points; /* to start from */
	double min[INCISE_MODEL_INPUTS_MAX], max[INCISE_MODEL_INPUTS_MAX];
	/* The slope of a secant by input i at x, which lies within the box. */
	double (*slope)(const void *of, const double *x, int i);
};

/* Calls slope() for real numbers within min … max only, and allocates nothing. */
void incise_secant_search(const struct incise_secant *secant,
			  struct incise_slope *slopes);

#endif
