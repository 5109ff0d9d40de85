/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The forces of a scene's tissue, a row each, of ../tissue/forces.def. Reading a scene, choosing and
 * running stages, the gain, the stability check, the conversion to integers and the manual walk these rows.
 */
#ifndef INCISE_FORCES_H
#define INCISE_FORCES_H

#include "../tissue/tick.h"

#define INCISE_FORCE_NUMBERS 3

/* The meaning of a force's first number. Springs store energy: F²/2K at most. */
enum incise_force_kind {
	INCISE_SPRING_NORMAL, /* N/mm along the normal of the surface */
	INCISE_SPRING_ACROSS, /* N/mm across the normal, every direction */
	INCISE_SPRING_SIDE, /* N/mm along one direction, which may be either of the two */
	INCISE_DAMPER,	    /* N s/mm against the velocity */
	INCISE_FORCE_KINDS
};

/* The rows, in the order in which they run. */
enum incise_tissue_row {
#define FORCE(row, ...) INCISE_FORCE_##row,
#define NUMBER(...)
#define MORE(member)
#include "../tissue/forces.def"
#undef FORCE
#undef NUMBER
#undef MORE
	INCISE_FORCES
};

/* Numbers of the reaction besides its stiffness: with a model. */
#define INCISE_REACTION_UNLOADING 1
#define INCISE_REACTION_FRICTION 2

/* A number of the group `tissue` of a scene, 0 … max; see ../base/settings.h. */
struct incise_force_number {
	const char *key, *unit;
	double max;
	const char *initial;
	double skin; /* of neck.scene: for tests and benchmarks */
	const char *help;
	const char *zero; /* it is 0 */
};

/*
 * Over so much more depth the force goes from the puncture's to the cut's: skin lets go of a pushed blade
 * on that way, and not at once. OPENS_OVER of ../tissue/tick.proto.c.
 */
#define INCISE_PUNCTURE_MM 0.5

/* A stage of lib/tissue, for both kinds of numbers: a stage that lacks either does not build. */
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
	struct incise_force_number number[INCISE_FORCE_NUMBERS];
	/* The stage is left out where this number is 0, for the reason @zero. */
	int acts;
	const char *zero;
	const char *formula, *does; /* for the manual */
	struct incise_stage_pair stage;
};

/* In the order in which they run. */
extern const struct incise_tissue_force incise_tissue_forces[];
extern const int incise_n_tissue_forces;

#endif
