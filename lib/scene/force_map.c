// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The forces of a plan about a state of contact, by its own tick: each number of the tool's motion is changed by a
 * little, from the state on, and the change of the force is a column of a matrix. A place that stays changed shows in
 * the force at once, and by the normal that is averaged within as many ticks:
 *
 *   place  ____,-----------    force ____,--.
 *              δ                        now  '--.____ now + mean
 */
#include <math.h>
#include "../base/vector.h"
#include "rest.h"

/* So much is within a piece without a switch, and far above rounding. */
#define STEP_MM 1e-4
#define STEP_MM_S 0.01
#define STEP_MM_S2 10

/* All that a tick changes. */
struct force_map_state {
	struct incise_double_state state;
	struct incise_double_ends ends;
	struct incise_double_average average;
	struct incise_proxy proxy;
};

static void keep_force_map(struct force_map_state *to, const struct incise_plan *plan)
{
	to->state = plan->doubles.state;
	to->proxy = plan->proxy;
	if (to->state.ends)
		to->ends = *to->state.ends;
	if (to->state.average)
		to->average = *to->state.average;
}

static void restore(struct incise_plan *plan, const struct force_map_state *from)
{
	plan->doubles.state = from->state;
	plan->proxy = from->proxy;
	if (from->state.ends)
		*from->state.ends = from->ends;
	if (from->state.average)
		*from->state.average = from->average;
}

/* A change of the motion: of place, speed and acceleration. */
struct change {
	double x[3], v[3], a[3];
};

/* As if the filter knew the motion, and had known it. */
static void set_filter(struct incise_double_predict *p,
		       const struct incise_double_predict *from,
		       const struct change *change, int64_t t_ns)
{
	v3_add(p->x, from->x, 1, change->x);
	v3_copy(p->v, change->v);
	v3_copy(p->a, change->a);
	for (int i = 0; i < 3; i++)
		p->x_shown[i] = p->v_shown[i] = p->a_shown[i] = 0;
	p->t_ns = p->arrival_ns = t_ns;
}

static void force_after(struct incise_plan *plan, const struct force_map_state *from,
			int64_t t_ns, int ticks, const struct change *change,
			double force_N[3])
{
	struct incise_double_state *state = &plan->doubles.state;
	struct incise_tick tick;

	restore(plan, from);
	for (int k = 1; k <= ticks; k++) {
		t_ns += plan->doubles.plan.numbers.tick_ns;
		set_filter(&state->scalpel, &from->state.scalpel, change, t_ns);
		if (state->ends) {
			set_filter(&state->ends->handle, &from->ends.handle, change,
				   t_ns);
			set_filter(&state->ends->tube, &from->ends.tube, change, t_ns);
		}
		incise_plan_tick(plan, t_ns, &tick);
	}
	v3_copy(force_N, state->force);
}

/* A column: the change of the force by a change of this size in @part. */
static void measure_column(struct incise_plan *plan, const struct force_map_state *from,
			   int64_t t_ns, int ticks, struct change *change, double part[3],
			   const double along[3], double size, double column[3])
{
	double with_N[3], without_N[3];

	force_after(plan, from, t_ns, ticks, change, without_N);
	v3_add(part, part, size, along);
	force_after(plan, from, t_ns, ticks, change, with_N);
	v3_sub(column, without_N, with_N);
	for (int i = 0; i < 3; i++)
		column[i] /= size;
	v3_copy(part, (double[3]){0});
}

/* Speeds and accelerations to both sides: the search covers corners at rest, such as |v|'s. */
static void measure_mean_column(struct incise_plan *plan,
				const struct force_map_state *from, int64_t t_ns,
				struct change *change, double part[3],
				const double along[3], double size, double column[3])
{
	double other[3];

	measure_column(plan, from, t_ns, 1, change, part, along, size, column);
	measure_column(plan, from, t_ns, 1, change, part, along, -size, other);
	for (int i = 0; i < 3; i++)
		column[i] = (column[i] + other[i]) / 2;
}

/* The stages between forces and command limit a force, and pay for it: a state of rest is within them. */
static void drop_limits(struct incise_plan *plan)
{
	int n = 0;

	for (int i = 0; i < plan->n_stages; i++) {
		incise_double_stage_fn *stage = plan->stage[i].numbers.in_double;

		if (plan->stage[i].run || (stage != incise_double_stage_start &&
					   stage != incise_double_stage_work &&
					   stage != incise_double_stage_limit))
			plan->stage[n++] = plan->stage[i];
	}
	plan->n_stages = n;
}

void incise_plan_force_map(struct incise_plan *plan, int64_t t_ns,
			   const double axis[3][3], bool against,
			   struct incise_force_map *map)
{
	const struct incise_stage *all = plan->stage;
	struct incise_stage kept[INCISE_PLAN_STAGES_MAX];
	double size = against ? -STEP_MM : STEP_MM;
	int n_stages = plan->n_stages, n = plan->average_ticks;
	struct change change = {.x = {0}};
	struct force_map_state from;

	for (int i = 0; i < n_stages; i++)
		kept[i] = all[i];
	keep_force_map(&from, plan);
	drop_limits(plan);
	*map = (struct incise_force_map){.mean_ticks = n};
	for (int j = 0; j < 3; j++) {
		double first[3], all_of_it[3], damping[3], mass[3] = {0};

		measure_column(plan, &from, t_ns, 1, &change, change.x, axis[j], size,
			       first);
		v3_copy(all_of_it, first);
		if (n > 1)
			measure_column(plan, &from, t_ns, n + 1, &change, change.x,
				       axis[j], size, all_of_it);
		measure_mean_column(plan, &from, t_ns, &change, change.v, axis[j],
				    STEP_MM_S, damping);
		if (plan->input_slope[INCISE_INPUT_ACCELERATION] > 0)
			measure_mean_column(plan, &from, t_ns, &change, change.a, axis[j],
					    STEP_MM_S2, mass);
		for (int i = 0; i < 3; i++) {
			double at_once = v3_dot(axis[i], first);
			double later = v3_dot(axis[i], all_of_it) - at_once;

			/* The last place is a part of the mean. */
			map->mean[i][j] = n > 1 ? later * n / (n - 1) : 0;
			map->now[i][j] = at_once + later - map->mean[i][j];
			map->damping[i][j] = v3_dot(axis[i], damping);
			map->mass[i][j] = v3_dot(axis[i], mass);
		}
	}
	for (int i = 0; i < n_stages; i++)
		plan->stage[i] = kept[i];
	plan->n_stages = n_stages;
	restore(plan, &from);
}
