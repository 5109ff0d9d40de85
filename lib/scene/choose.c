// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The choice of stages that a scene needs, in the order in which they run, with a reason for
 * each that is left out. The forces come before the start. With everything kept
 * (incise_scene_set_full()) the stages that are not needed are neutral.
 */
#include <stddef.h>
#include "plan.h"

/* Reasons why a stage is not needed, or NULL. */

/* A constant may be 0 because of the gain, whatever the file says of it. */
static const char *zero(const struct incise_plan *plan, const char *why)
{
	return plan->gain > 0 ? why : "tissue.gain is 0";
}

static const char *no_tool(const struct incise_plan *plan)
{
	return plan->inserts ? NULL : zero(plan, plan->no_tool);
}

static const char *no_normal(const struct incise_plan *plan)
{
	if (plan->average_ticks > 1)
		return NULL;
	return plan->scene->effects.average_ticks > 1
		       ? "the normal of a plane is constant"
		       : "effects.average_ticks is 1";
}

static const char *no_force(const struct incise_plan *plan,
			    const struct incise_acting_force *own)
{
	if (incise_plan_has_model(plan, own))
		return zero(plan, NULL);
	if (own->number[0] > 0)
		return NULL;
	/* A force by a share of others is left out if its stiffness is 0, too. */
	return zero(plan, own->force->acts && own->number[own->force->acts] > 0
				  ? own->force->number[0].zero
				  : own->force->zero);
}

static const char *no_membrane(const struct incise_plan *plan)
{
	return plan->scene->membrane.thickness_mm > 0 ? NULL
						      : "the scene has no membrane";
}

static const char *no_texture(const struct incise_plan *plan)
{
	const char *left_out = plan->scene->texture_left_out;

	if (plan->texture)
		return zero(plan, NULL);
	return left_out ? left_out : "the scene has no texture";
}

static const char *no_work(const struct incise_plan *plan)
{
	return plan->accounts && plan->gain > 0
		       ? NULL
		       : zero(plan, "its forces give back no more than they take");
}

static const struct {
	const char *name;
	struct incise_stage_pair numbers;
	const char *(*why_not)(const struct incise_plan *plan); /* NULL: always needed */
	bool forces;						/* come before it */
} all[] = {
	{"predict", INCISE_STAGE(predict), NULL, false},
	{"tool", INCISE_STAGE(tool), no_tool, false},
	{"contact", INCISE_STAGE(contact), NULL, false},
	{"normal", INCISE_STAGE(normal), no_normal, false},
	{"incision", INCISE_STAGE(incision), no_tool, false},
	{"membrane", INCISE_STAGE(membrane), no_membrane, false},
	{"texture", INCISE_STAGE(texture), no_texture, false},
	{"start", INCISE_STAGE(start), NULL, true},
	{"work", INCISE_STAGE(work), no_work, false},
	{"limit", INCISE_STAGE(limit), NULL, false},
};
_Static_assert(sizeof(all) / sizeof(*all) + 2 == INCISE_PLAN_OTHER_STAGES,
	       "with pose and actuate these are INCISE_PLAN_OTHER_STAGES");

static void leave_choose_out(struct incise_plan *plan, const char *name, const char *why)
{
	plan->left_out[plan->n_left_out].name = name;
	plan->left_out[plan->n_left_out++].why = why;
}

static void keep_choose(struct incise_plan *plan, struct incise_stage stage)
{
	plan->stage[plan->n_stages++] = stage;
}

static void choose_forces(struct incise_plan *plan)
{
	for (int i = 0; i < incise_n_tissue_forces; i++) {
		struct incise_acting_force *own = &plan->acting[i];
		const char *why = no_force(plan, own);

		if (why && !plan->scene->full)
			leave_choose_out(plan, own->force->name, why);
		else
			keep_choose(plan, (struct incise_stage){own->force->name, NULL,
								own->force->stage});
	}
}

void incise_plan_choose(struct incise_plan *plan)
{
	const char *drawn = "incise view draws it, not the loop";

	keep_choose(plan,
		    (struct incise_stage){.name = "pose",
					  .run = plan->poses.tracker ? incise_stage_pose
								     : incise_stage_fed});
	for (size_t i = 0; i < sizeof(all) / sizeof(*all); i++) {
		const char *why = all[i].why_not ? all[i].why_not(plan) : NULL;

		if (all[i].forces)
			choose_forces(plan);
		if (why && !plan->scene->full)
			leave_choose_out(plan, all[i].name, why);
		else
			keep_choose(plan, (struct incise_stage){all[i].name, NULL,
								all[i].numbers});
	}
	/* A device that is not there cannot be kept. */
	if (plan->stylus)
		keep_choose(plan, (struct incise_stage){.name = "push",
							.run = incise_stage_push});
	if (plan->axes.n)
		keep_choose(plan, (struct incise_stage){.name = "actuate",
							.run = incise_stage_actuate});
	else
		leave_choose_out(plan, "actuate",
				 plan->stylus	       ? "a haptic device takes the force"
				 : plan->poses.tracker ? "the rig has no stepper"
						       : "no rig, and so no stepper");
	leave_choose_out(plan, "wound",
			 plan->scene->picture.wound ? drawn : "picture.wound is false");
	leave_choose_out(plan, "bleeding",
			 plan->scene->picture.bleeding ? drawn
						       : "picture.bleeding is false");
}
