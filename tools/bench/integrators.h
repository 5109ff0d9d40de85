/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Ways to step a mass on a spring with a damper under a held force, and the truth.
 *
 *   m x'' + b x' + K x = f
 */
#ifndef INCISE_INTEGRATORS_H
#define INCISE_INTEGRATORS_H

#include "../../lib/control/plant.h"

enum integrator {
	EXPLICIT_EULER,
	SEMI_IMPLICIT_EULER,
	IMPLICIT_EULER,
	TRAPEZOID,
	RK4,
	EXACT_ZOH, /* a matrix, computed once */
	PLANT,	   /* incise_plant_step(), which looks for events too */
	INTEGRATORS
};

/* In SI's kg and N/m, times in s, x in mm. */
struct spring {
	double mass_kg, stiffness_N_m, ratio; /* of damping to the critical one */
};

struct integration {
	double step_s;
	double x, v;
	double rate, omega2, push; /* b/m, K/m, and mm/s² of a N */
	double zoh[2][3];
	struct incise_plant plant;
	void (*step)(struct integration *, double force_N);
};

const char *integrator_name(enum integrator kind);

/* Begin at rest. */
void integration_init(struct integration *in, enum integrator kind,
		      const struct spring *spring, double step_s);

/* Go on from x and v, in long double, without steps: t since then. */
void spring_truth(const struct spring *spring, double force_N, long double t,
		  long double *x, long double *v);

#endif
