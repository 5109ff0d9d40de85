/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A plan with arithmetic = "fixed": the numbers of ../fixed/plan.h, from those of the plan in double,
 * and their way through the plan's stages.
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
 * The numbers of a plan, without actuators and without a surface that is a mesh: its shape is left a
 * plane. Returns 0; -ERANGE: the message names what integers do not hold.
 */
int incise_integers_numbers(const struct incise_plan *plan,
			    struct incise_fixed_numbers *numbers,
			    struct incise_error *err);

/*
 * The same of a plan as a file: with its actuators and its certified error, and with heights in
 * place of a mesh, else none. *heights is freed by the caller, also after an error.
 */
int incise_integers_file(const struct incise_plan *plan,
			 struct incise_fixed_numbers *numbers,
			 struct incise_heights *heights, struct incise_error *err);

/*
 * Make the integers of a plan. Returns NULL with errno of incise_integers_numbers(), ENOMEM. Freed
 * with free().
 */
struct incise_integers *incise_integers_new(const struct incise_plan *plan,
					    struct incise_error *err);

/* The tool in the hand, and whether the force is let go of, from now on. */
void incise_integers_hold(struct incise_integers *integers, enum incise_tool tool,
			  bool fading) INCISE_REALTIME;

/* As incise_plan_set_tip(). Returns 0; -EINVAL (farther than integers hold). */
int incise_integers_set_tip(struct incise_integers *integers, const double tip_mm[3]);

/* Take a pose in, as incise_predict_add() of the scalpel or the tube. */
void incise_integers_pose(struct incise_integers *integers, bool tube,
			  const struct incise_tracker_sample *sample,
			  int64_t now_ns) INCISE_REALTIME;

/* As incise_plan_take_over(), of other integers. */
void incise_integers_take_over(struct incise_integers *integers,
			       const struct incise_integers *before) INCISE_REALTIME;

/* Their cut of a number from 0 on, in double. Returns whether there is one. */
bool incise_integers_cut(const struct incise_integers *integers, int i,
			 struct incise_cut *cut) INCISE_REALTIME;

/* Add a cut of a plan in double. Returns whether there was room. */
bool incise_integers_add_cut(struct incise_integers *integers,
			     const struct incise_cut *cut) INCISE_REALTIME;

/* Before the first stage; @tick has its time. */
void incise_integers_begin(struct incise_integers *integers,
			   const struct incise_tick *tick) INCISE_REALTIME;

/* Behind the last one: all that it found, in double. */
void incise_integers_end(const struct incise_integers *integers,
			 struct incise_tick *tick) INCISE_REALTIME;

/* Whether no force is asked for or left. */
bool incise_integers_faded(const struct incise_integers *integers) INCISE_REALTIME;

/* No force from now on, at once. */
void incise_integers_zero(struct incise_integers *integers) INCISE_REALTIME;

#endif
