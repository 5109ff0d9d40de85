/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the parts of the force calibration hand to each other; see force.c.
 */
#ifndef INCISE_FORCE_WORK_H
#define INCISE_FORCE_WORK_H

#include <incise/calibrate_force.h>

/* Pairs of one load: weighed once, so that they share what the scale has rounded. */
struct load {
	double F_N;
	double mean_mV; /* of the readings used */
	int n;
};

struct work {
	const struct incise_calibrate_force_pair *pairs;
	const struct incise_calibrate_force_setup *setup;
	int n;
	double *F, *y; /* N, mV */
	enum incise_calibrate_force_state *states;
	int *load_of;	    /* of a pair, in loads; -1: not used */
	struct load *loads; /* by rising force */
	int n_loads;
	bool masses;	 /* some loads are masses */
	double load_u_N; /* of a load by the scale; an empty pan has none */
	double robust_slope;
};

/* Gather the pairs that are used into loads. */
void incise_calibrate_force_loads(struct work *w);

/* The weighted line through the loads, and its budget. */
void incise_calibrate_force_line(struct work *w, struct incise_calibrate_force *result);

/* Linearity, hysteresis and so on, of the line in @result. */
void incise_calibrate_force_figures(const struct work *w,
				    struct incise_calibrate_force *result);

#endif
