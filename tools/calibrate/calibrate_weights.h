/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Weights on the force channel of a rig, one after the other: asked for on a terminal, waited
 * for without one, and hung by itself on a virtual rig. Each is read when it is steady.
 *
 *     g      ___                ___
 *          _|   |             _|   |_      series up and back to zero; the last one
 *        _|     |_  …       _|       |_    comes down by the same loads
 */
#ifndef INCISE_CALIBRATE_WEIGHTS_H
#define INCISE_CALIBRATE_WEIGHTS_H

#include <incise/rig.h>
#include "calibrate_pairs.h"

#define CALIBRATE_WEIGHTS_MAX 100

struct calibrate_weights {
	struct incise_rig *rig; /* with INCISE_RIG_FORCE */
	double mass_g[CALIBRATE_WEIGHTS_MAX];
	int n;
	int series;
	double mean_s;				    /* of a reading, once it is steady */
	double timeout_s;			    /* for it to become so */
	struct incise_calibrate_force_setup *setup; /* learns whether noise dithers */
};

/* "0,50g,0.1kg" into @weights, by rising mass, with the empty pan; bad usage otherwise. */
void calibrate_weights_list(struct calibrate_weights *weights, char *list);

/* Ask for them, on a terminal. */
void calibrate_weights_ask(struct calibrate_weights *weights);

/* Read all of them; fails the program where it is stopped, or nothing gets steady. */
void calibrate_weights_read(const struct calibrate_weights *weights,
			    struct calibrate_pairs *pairs);

#endif
