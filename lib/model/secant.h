/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The lowest and highest slope of a function over a box, searched for by secants.
 */
#ifndef INCISE_SECANT_H
#define INCISE_SECANT_H

#include <incise/model.h>
#include <incise/slope.h>

/* Whatever has slopes. */
struct incise_secant {
	const void *of;
	int n_inputs;
	int n_points; /* to start from */
	double min[INCISE_MODEL_INPUTS_MAX], max[INCISE_MODEL_INPUTS_MAX];
	/* The slope of a secant by input i at x, which lies within the box. */
	double (*slope)(const void *of, const double *x, int i);
};

/* Real numbers within min … max only are asked for, and nothing is allocated. */
void incise_secant_search(const struct incise_secant *secant,
			  struct incise_slope *slopes);

#endif
