/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The stages that a plan can have. Each does its few lines at each tick and returns 0, or
 * a negative errno of a device.
 */
#ifndef INCISE_STAGES_H
#define INCISE_STAGES_H

#include "plan.h"

/* Poses, and where they put the tool on the surface. */
int incise_stage_pose(struct incise_plan *plan, struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_fed(struct incise_plan *plan, struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_predict(struct incise_plan *plan,
			 struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_tool(struct incise_plan *plan, struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_contact(struct incise_plan *plan,
			 struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_normal(struct incise_plan *plan,
			struct incise_tick *tick) INCISE_REALTIME;

/* Forces of the tissue, in double and in fixed point. */
int incise_stage_reaction(struct incise_plan *plan,
			  struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_reaction_fixed(struct incise_plan *plan,
				struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_fuzzy(struct incise_plan *plan,
		       struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_fuzzy_fixed(struct incise_plan *plan,
			     struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_plane(struct incise_plan *plan,
		       struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_plane_fixed(struct incise_plan *plan,
			     struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_damping(struct incise_plan *plan,
			 struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_insertion(struct incise_plan *plan,
			   struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_spread(struct incise_plan *plan,
			struct incise_tick *tick) INCISE_REALTIME;

/* What may be rendered of them, and rendering it. */
int incise_stage_guard(struct incise_plan *plan,
		       struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_start(struct incise_plan *plan,
		       struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_limit(struct incise_plan *plan,
		       struct incise_tick *tick) INCISE_REALTIME;
int incise_stage_actuate(struct incise_plan *plan,
			 struct incise_tick *tick) INCISE_REALTIME;

#endif
