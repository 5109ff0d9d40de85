/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How far the forces of a plan in integers are from those of the same plan in double, on the same poses, and
 * whether they are so by a decision that incise_plan_bound() lists: another phase, tool, flag, side of the tissue, place
 * of a cut or of a tear, or a front that follows a rise of its texture. That is no error of a force.
 */
#ifndef INCISE_TEST_APART_H
#define INCISE_TEST_APART_H

#include <math.h>
#include "../lib/base/vector.h"
#include "../lib/scene/plan.h"

/* cos 60°: normals farther apart are of two sides of a tissue, as where it was gone through. */
#define APART_SAME_SIDE 0.5

/* Rest of a difference that a decision made, as part of the bound. */
#define APART_ENDED 0.1

/* A tick of the slew's limit rounds a length, its share and three parts: by no more, each time that it holds. */
#define APART_SLEW_N (4 * 0x1p-16)

/* A tip that breaks through to what is torn, or goes on to another line, does so at one tick: here its way is some parts of a place. */
#define APART_BREAKS_MM 0.05

/* A thousand ticks round a ramp by less. */
#define APART_GAIN 1e-5

struct apart {
	struct incise_plan *const *plan; /* in double, in integers */
	bool is; /* by a decision, until the forces are as near as APART_ENDED once more */
	int slewed;  /* ticks so far in a row */
	bool unpaid; /* in one of them, or just before them */
};

static inline bool apart_tears_alike(struct incise_plan *const plan[2])
{
	const struct incise_double_tears *a = &plan[0]->doubles.state.tears;
	const struct incise_fixed_tears *b = &plan[1]->integers->state.tears;

	return a->in == b->in &&
	       fabs(a->tip - b->tip / (double)INCISE_FIXED_ONE) < APART_BREAKS_MM;
}

/* The opening that handle or tube went into: a place of a cut. */
static inline bool apart_openings_alike(struct incise_plan *const plan[2])
{
	const struct incise_opening *a = &plan[0]->doubles.state.opening;
	const struct incise_fixed_opening *b = &plan[1]->integers->state.opening;

	return a->in == b->in &&
	       incise_cut_place(a->at_mm) ==
		       incise_cut_place(b->at_mm / (double)INCISE_FIXED_ONE);
}

/* The place of its cut in which a blade is. */
static inline int apart_find_place(struct incise_plan *plan, int growing,
				   const struct incise_tick *tick)
{
	struct incise_cut cut;
	double off[3];

	if (!plan->ops.cut(plan, growing, &cut))
		return 0;
	v3_sub(off, tick->proxy_mm, cut.at_mm);
	return incise_cut_place(
		fmin(fmax(v3_dot(off, cut.along), cut.from_mm), cut.to_mm));
}

/* Whether both blades are in tissue that was cut before, in the same place of it, or neither is. */
static inline bool apart_cuts_alike(struct incise_plan *const plan[2],
				    const struct incise_tick *a,
				    const struct incise_tick *b)
{
	const struct incise_double_incision *mine = plan[0]->doubles.state.incision;
	const struct incise_fixed_incision *other = &plan[1]->integers->state.incision;

	if (!mine || (mine->open > 0) != (other->open > 0))
		return !mine;
	return !(mine->open > 0 && mine->cutting && other->cutting) ||
	       apart_find_place(plan[0], mine->growing, a) ==
		       apart_find_place(plan[1], other->growing, b);
}

/* A force that fades to nothing a tick later returns a tick later. */
static inline bool apart_ramps_alike(struct incise_plan *const plan[2])
{
	return fabs(plan[0]->doubles.state.gain -
		    plan[1]->integers->state.gain * 0x1p-30) < APART_GAIN;
}

/* Whether both fronts follow a rise of their texture, or neither does. */
static inline bool apart_fronts_alike(struct incise_plan *const plan[2])
{
	const struct incise_double_front *a = &plan[0]->doubles.state.front;
	const struct incise_fixed_front *b = &plan[1]->integers->state.front;

	return a->rises == b->rises && a->climbs == b->climbs;
}

/* Both plans are in tissue, in the same phase. */
static inline bool apart_places_alike(struct incise_plan *const plan[2],
				      const struct incise_tick *a,
				      const struct incise_tick *b)
{
	return v3_dot(a->normal, b->normal) > APART_SAME_SIDE &&
	       apart_ramps_alike(plan) &&
	       (a->phase == INCISE_PHASE_CUTTING
			? apart_tears_alike(plan) && apart_cuts_alike(plan, a, b) &&
				  apart_fronts_alike(plan)
			: apart_openings_alike(plan));
}

/* A force that is slewed in one of them only began to change a tick earlier, as after a fade. */
static inline bool apart_decide_alike(struct incise_plan *const plan[2],
				      const struct incise_tick *a,
				      const struct incise_tick *b)
{
	const unsigned int limits =
		INCISE_TICK_CLAMPED | INCISE_TICK_EXTRAPOLATED | INCISE_TICK_UNPAID;

	return a->phase == b->phase && a->tool == b->tool &&
	       !((a->flags ^ b->flags) & ~limits) &&
	       (a->phase == INCISE_PHASE_FREE || apart_places_alike(plan, a, b));
}

/* @return the difference of a tick, N, less what the slew's limit rounded so far */
static inline double apart_N(struct apart *apart, const struct incise_tick *a,
			     const struct incise_tick *b, double bound_N)
{
	bool slewed = (a->flags | b->flags) & INCISE_TICK_SLEWED;
	double off[3], off_N;

	v3_sub(off, a->command_N, b->command_N);
	apart->slewed = slewed ? apart->slewed + 1 : 0;
	off_N = fmax(v3_length(off) - apart->slewed * APART_SLEW_N, 0);
	if (!apart_decide_alike(apart->plan, a, b))
		apart->is = true;
	else if (off_N <= APART_ENDED * bound_N)
		apart->is = false;
	/* At the end of an account roundings decide, of nothing but this tick and what the slew's limit keeps of it. */
	apart->unpaid =
		(a->flags | b->flags) & INCISE_TICK_UNPAID || (apart->unpaid && slewed);
	return apart->unpaid ? 0 : off_N;
}

#endif
