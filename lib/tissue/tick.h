/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A tick in double: the physics of tick.proto.h with a scene's own surface and models. ../fixed/plan.h
 * has the same in integers.
 */
#ifndef INCISE_TISSUE_TICK_H
#define INCISE_TISSUE_TICK_H

#include <incise/fixed.h>
#include <incise/incision.h>
#include <incise/model.h>
#include "../fixed/plan.h"
#include "../surface/surface.h"

/* The public ones. */
#define incise_double_cut incise_cut
#define incise_double_opening incise_opening

#include "../number/double_kind.h"
#include "touch.proto.h"
#include "tick.proto.h"
#include "../number/no_kind.h"

/* A blade so far beside the line of its cut is in new tissue: half the width of a blade. */
#define INCISE_FRONT_BESIDE_MM 1.0

/* Share of the most work put in that no new tissue gives back. */
#define INCISE_FRONT_KEPT 0.0625

/* More inputs a model in the loop does not have. */
#define INCISE_LOOP_INPUTS_MAX 4

struct incise_double_plan {
	struct incise_double_numbers numbers;
	bool has_model;
	struct incise_proxy *proxy; /* on the scene's surface */
	/* Each phase has its model or NULL, and its inputs as in numbers. */
	const struct incise_model *model[INCISE_CUTTING_PHASES];
	uint32_t inputs[INCISE_CUTTING_PHASES];
	const struct incise_fixed
		*compiled; /* in place of the model of the cut, or NULL */
	const struct incise_fixed_texture *texture; /* of the cut, or NULL */
	/* Inputs that a search for swings holds: bits 1 << their kinds, and where. */
	unsigned int holds;
	double held[INCISE_FIXED_INPUT_KINDS];
};

#endif
