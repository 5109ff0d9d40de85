// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Which stages a scene needs, and why it does not need the others. In the order in which
 * they run. With everything kept (incise_scene_set_full()) the ones that are not needed
 * are neutral.
 */
#include <stddef.h>
#include "stages.h"

typedef int run_fn(struct incise_plan *plan, struct incise_tick *tick) INCISE_REALTIME;

/* How a stage is done, where there are several ways. */

static run_fn *pose(const struct incise_plan *plan)
{
	return plan->tracker ? incise_stage_pose : incise_stage_fed;
}

static run_fn *reaction(const struct incise_plan *plan)
{
	if (plan->fixed)
		return incise_stage_fuzzy_fixed;
	if (plan->model)
		return incise_stage_fuzzy;
	return plan->scene->fixed ? incise_stage_reaction_fixed : incise_stage_reaction;
}

static run_fn *plane(const struct incise_plan *plan)
{
	return plan->scene->fixed ? incise_stage_plane_fixed : incise_stage_plane;
}

/* Why a stage is not needed, or NULL. */

/* A constant may be 0 because of the gain, whatever the file says of it. */
static const char *zero(const struct incise_plan *plan, const char *why)
{
	return plan->gain > 0 ? why : "tissue.gain is 0";
}

static const char *no_tool(const struct incise_plan *plan)
{
	if (plan->inserts)
		return NULL;
	return zero(plan, "nothing is inserted: tissue.insertion_N_mm and "
			  "tissue.spread_N_mm are 0");
}

static const char *no_normal(const struct incise_plan *plan)
{
	if (plan->average_ticks > 1)
		return NULL;
	return plan->scene->effects.average_ticks > 1
		       ? "a plane has one normal: there is nothing to average"
		       : "effects.average_ticks is 1";
}

static const char *no_reaction(const struct incise_plan *plan)
{
	if (plan->fixed || plan->model)
		return zero(plan, NULL);
	return plan->reaction_N_mm > 0
		       ? NULL
		       : zero(plan, "no model, and tissue.reaction_N_mm is 0");
}

static const char *no_plane(const struct incise_plan *plan)
{
	return plan->plane_N_mm > 0 ? NULL : zero(plan, "tissue.plane_N_mm is 0");
}

static const char *no_damping(const struct incise_plan *plan)
{
	return plan->damping_N_s_mm > 0 ? NULL : zero(plan, "tissue.damping_N_s_mm is 0");
}

static const char *no_insertion(const struct incise_plan *plan)
{
	return plan->insertion_N_mm > 0 ? NULL : zero(plan, "tissue.insertion_N_mm is 0");
}

static const char *no_spread(const struct incise_plan *plan)
{
	return plan->spread_N_mm > 0 ? NULL : zero(plan, "tissue.spread_N_mm is 0");
}

static const char *no_guard(const struct incise_plan *plan)
{
	return plan->scene->effects.guard ? NULL : "effects.guard is false";
}

static const struct {
	const char *name;
	bool always;
	run_fn *run; /* or @how */
	run_fn *(*how)(const struct incise_plan *plan);
	const char *(*why_not)(const struct incise_plan *plan); /* NULL: always needed */
} all[] = {
	{"pose", true, NULL, pose, NULL},
	{"predict", true, incise_stage_predict, NULL, NULL},
	{"tool", true, incise_stage_tool, NULL, no_tool},
	{"contact", false, incise_stage_contact, NULL, NULL},
	{"normal", false, incise_stage_normal, NULL, no_normal},
	{"reaction", false, NULL, reaction, no_reaction},
	{"plane", false, NULL, plane, no_plane},
	{"damping", false, incise_stage_damping, NULL, no_damping},
	{"insertion", false, incise_stage_insertion, NULL, no_insertion},
	{"spread", false, incise_stage_spread, NULL, no_spread},
	{"guard", false, incise_stage_guard, NULL, no_guard},
	{"start", true, incise_stage_start, NULL, NULL},
	{"limit", true, incise_stage_limit, NULL, NULL},
};

static void leave_out(struct incise_plan *plan, const char *name, const char *why)
{
	plan->left_out[plan->n_left_out].name = name;
	plan->left_out[plan->n_left_out++].why = why;
}

static void keep(struct incise_plan *plan, const char *name, bool always, run_fn *run)
{
	plan->stage[plan->n_stages++] = (struct incise_stage){name, always, run};
}

void incise_plan_choose(struct incise_plan *plan)
{
	const char *drawn = "the loop draws nothing: that is for incise view";

	for (size_t i = 0; i < sizeof(all) / sizeof(*all); i++) {
		run_fn *run = all[i].how ? all[i].how(plan) : all[i].run;
		const char *why = all[i].why_not ? all[i].why_not(plan) : NULL;

		if (why && !plan->scene->full)
			leave_out(plan, all[i].name, why);
		else
			keep(plan, all[i].name, all[i].always, run);
	}
	/* A device that is not there cannot be kept. */
	if (plan->stepper)
		keep(plan, "actuate", true, incise_stage_actuate);
	else
		leave_out(plan, "actuate",
			  plan->tracker ? "the rig has no stepper"
					: "there is no rig, and no stepper");
	leave_out(plan, "wound",
		  plan->scene->picture.wound ? drawn : "picture.wound is false");
	leave_out(plan, "bleeding",
		  plan->scene->picture.bleeding ? drawn : "picture.bleeding is false");
}
