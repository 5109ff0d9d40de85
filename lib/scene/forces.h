/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The forces of a scene's tissue, a row each. Reading a scene, choosing and running stages,
 * the gain, the stability check, and the fixed-point bound walk these
 * rows, so a new force is a row and its function in forces.c, its test, and its text in
 * incise-scene(5) and incise-haptic(1), which a test compares with the rows.
 */
#ifndef INCISE_FORCES_H
#define INCISE_FORCES_H

#include <incise/export.h>
#include "../tissue/tick.h"

/* A plan keeps at most INCISE_PLAN_STAGES_MAX stages, forces among them. */
#define INCISE_FORCES_MAX 6
#define INCISE_FORCE_NUMBERS 3

/* The meaning of a force's first number. Springs store energy: F²/2K at most. */
enum incise_force_kind {
	INCISE_SPRING_NORMAL, /* N/mm along the normal of the surface */
	INCISE_SPRING_ACROSS, /* N/mm across the normal, every direction */
	INCISE_SPRING_SIDE, /* N/mm along one direction, which may be either of the two */
	INCISE_DAMPER,	    /* N s/mm against the velocity */
	INCISE_FRICTION,    /* N against the motion */
};

/* The rows, in the order in which they run. */
enum incise_tissue_row {
	INCISE_FORCE_REACTION,
	INCISE_FORCE_PLANE,
	INCISE_FORCE_DAMPING,
	INCISE_FORCE_INSERTION,
	INCISE_FORCE_SPREAD,
};

/* Numbers of the reaction besides its stiffness: with a model. */
#define INCISE_REACTION_UNLOADING 1
#define INCISE_REACTION_FRICTION 2

/* A number of the group `tissue` of a scene, 0 … max; see ../base/settings.h. */
struct incise_force_number {
	const char *key, *unit;
	double max;
	const char *initial;
	double skin; /* of neck.scene: what tests and benchmarks take */
	const char *help;
};

/*
 * Over so much more depth the force goes from that of the puncture to that of the cut: a blade that is
 * pushed as it opens the skin loses the hold of it on that way, and not at once. OPENS_OVER of
 * ../tissue/tick.proto.c.
 */
#define INCISE_PUNCTURE_MM 0.5

/* A stage of lib/tissue, for both kinds of numbers: one that lacks either does not build. */
struct incise_stage_pair {
	incise_double_stage_fn *in_double;
	incise_fixed_stage_fn *in_integers;
};
#define INCISE_STAGE(name)                                            \
	{                                                             \
		incise_double_stage_##name, incise_fixed_stage_##name \
	}

/* A force as a plan runs it. */
struct incise_acting_force {
	const struct incise_tissue_force *force;
	double number[INCISE_FORCE_NUMBERS]; /* of the scene; the first times the gain */
};

struct incise_tissue_force {
	const char *name;    /* of its stage */
	unsigned int phases; /* bits 1 << enum incise_phase */
	enum incise_force_kind kind;
	/* The stage is left out where the first number is 0, for the reason @zero. */
	struct incise_force_number number[INCISE_FORCE_NUMBERS];
	const char *zero;
	bool model; /* one takes the place of the first number */
	struct incise_stage_pair stage;
};

/* In the order in which they run. */
extern const struct incise_tissue_force incise_tissue_forces[];
extern const int incise_n_tissue_forces;

#endif
