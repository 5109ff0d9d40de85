/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A plan with arithmetic = "fixed": the numbers of ../fixed/plan.h, from the plan in double, and
 * their way through the plan's stages.
 */
#ifndef INCISE_INTEGERS_H
#define INCISE_INTEGERS_H

#include <incise/incision.h>
#include <incise/plan.h>
#include "../fixed/plan.h"
#include "../surface/surface.h"
#include "heights.h"

struct incise_integers {
	struct incise_fixed_plan plan;
	struct incise_fixed_state state;
	struct incise_fixed_tick tick;
	/* A mesh stays as it is, with its proxy in double. */
	struct incise_fixed_surface mesh;
	struct incise_proxy proxy;
};

/*
 * The numbers of a plan as a file: with its actuators and its certified error, and with heights in
 * place of a mesh. *heights is freed by the caller, also after an error.
 */
int incise_integers_file(const struct incise_plan *plan,
			 struct incise_fixed_numbers *numbers,
			 struct incise_heights *heights, struct incise_error *err);

/*
 * Make the integers of a plan. Returns NULL with ERANGE (the message names the number that integers do not hold), ENOMEM. Freed
 * with free().
 */
struct incise_integers *incise_integers_new(const struct incise_plan *plan,
					    struct incise_error *err);

#endif
