// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The forces of Bhasin et al. (2005), and Song et al.'s model as the first of them.
 * P is the tool's end, P0
 * where the contact began, n the outward normal (the paper's Sn, or Snavg), d the depth.
 *
 *   cutting     reaction    F += Kn d n                      §2.2, Fn
 *               with a model F += F(d, |v|) n       Song et al. (2006), eq. (3), by the front
 *                                                            of ../tissue/front.h
 *               plane       F -= Kx ((P-P0)·s) s             §2.2, Fx
 *   insertion   insertion   F += Ky d n Fort                 §2.3, Fy
 *               spread      F -= Kxz (I - n nᵀ)(P-P0)        §2.3, Fxz
 *   both        damping     F -= Kd v                        §2.2, Fd
 *
 * Compared with the paper's print:
 *
 * - Fn and Fy print (P-P0)·Sn for the depth and call it the depth of penetration along
 *   Sn. On a plane the two are one. On a curved surface they part: the blade that glides
 *   along a neck without pressing has (P-P0)·Sn > 0, which would pull it in. Here d is
 *   the depth below the surface.
 * - Fd prints +Kd v. It is to damp, so it opposes v.
 * - Fxz prints a product of three distances along (Q0-P0), which is always zero when the
 *   contact starts on the surface. Its sentence asks for a force proportional to the
 *   distance of the instrument from where its contact began: that is what stands here.
 */
#include <math.h>
#include <incise/fixed.h>
#include "../base/vector.h"
#include "forces.h"
#include "plan.h"

static incise_force_fn reaction, reaction_model, reaction_front, plane, damping,
	insertion, spread;

static void reaction(struct incise_plan *plan, struct incise_tick *tick,
		     struct incise_acting_force *own)
{
	(void)tick;
	v3_add(plan->force_N, plan->force_N, own->number[0] * plan->depth_mm,
	       plan->normal);
}

/*
 * Song et al. (2006), eq. (3), as the size of Bhasin et al.'s Fn; tissue does not pull.
 * Beyond the depths that
 * the model knows the force goes on with the slope that it has there.
 */
static double cutting_N(struct incise_plan *plan, struct incise_tick *tick, double size_N,
			bool outside)
{
	double beyond_mm = fmax(plan->depth_mm - plan->support_mm, 0);

	/* With no gain the model is asked only to keep the stage, not for a force. */
	if (outside && plan->gain > 0)
		tick->flags |= INCISE_TICK_EXTRAPOLATED;
	return fmax(plan->gain * size_N, 0) + plan->beyond_N_mm * beyond_mm;
}

static double acceleration(const struct incise_plan *plan, const struct incise_tick *tick)
{
	double hard_mm_s2[3];

	incise_predict_acceleration(&plan->predict, tick->t_ns, hard_mm_s2);
	return incise_input_acceleration(plan->velocity_mm_s, hard_mm_s2);
}

/* Unsigned: two times may be farther apart than an int64_t holds. */
static double time_in_tissue(const struct incise_plan *plan,
			     const struct incise_tick *tick)
{
	return (double)((uint64_t)tick->t_ns - (uint64_t)plan->touched_ns) /
	       INCISE_NS_PER_S;
}

static double find_input(const struct incise_plan *plan, const struct incise_tick *tick,
			 enum incise_model_input kind)
{
	switch (kind) {
	case INCISE_INPUT_SPEED:
		return tick->velocity_mm_s;
	case INCISE_INPUT_ACCELERATION:
		return acceleration(plan, tick);
	case INCISE_INPUT_TILT:
		return incise_input_tilt_deg(plan->attitude, plan->instrument.axis,
					     plan->normal);
	case INCISE_INPUT_TIME:
		return time_in_tissue(plan, tick);
	default:
		return plan->depth_mm;
	}
}

/* A model's inputs, in its order. Only those that it has are computed. */
static void find_inputs(const struct incise_plan *plan, const struct incise_tick *tick,
			enum incise_cutting_phase phase, double x[INCISE_LOOP_INPUTS_MAX])
{
	const struct incise_scene_model *cut = &plan->scene->cut[phase];

	for (int i = 0; i < cut->n_inputs; i++)
		x[i] = plan->holds >> cut->input[i] & 1
			       ? plan->held[cut->input[i]]
			       : find_input(plan, tick, cut->input[i]);
}

/* Of a phase besides the cut, N; 0 without its model. */
static double phase_N(const struct incise_plan *plan, const struct incise_tick *tick,
		      enum incise_cutting_phase phase, unsigned int *flags)
{
	const struct incise_model *model = plan->scene->cut[phase].model;
	double x[INCISE_LOOP_INPUTS_MAX] = {0};

	if (!model)
		return 0;
	find_inputs(plan, tick, phase, x);
	return incise_model_eval(model, x, flags);
}

/* Skin that was not cut before gives way from this depth on … */
static double open_share(struct incise_plan *plan)
{
	/* … over the next INCISE_PUNCTURE_MM; the deepest depth only grows, and so does this. */
	double beyond_mm = plan->deepest_mm - plan->scene->tissue.cut_from_mm;

	return plan->skin_open ? 1 : fmax(0, fmin(beyond_mm / INCISE_PUNCTURE_MM, 1));
}

/* The model's force: of the puncture, of the cut, or between them. */
static double model_N(struct incise_plan *plan, const struct incise_tick *tick,
		      unsigned int *flags)
{
	double x[INCISE_LOOP_INPUTS_MAX] = {0}, share = 1, cut_N = 0;

	plan->deepest_mm = fmax(plan->deepest_mm, plan->depth_mm);
	if (plan->scene->cut[INCISE_PUNCTURE].model)
		share = open_share(plan);
	find_inputs(plan, tick, INCISE_CUT, x);
	if (share > 0)
		cut_N = incise_model_eval(plan->model, x, flags);
	if (share < 1) {
		unsigned int skin = 0;

		cut_N = share * cut_N +
			(1 - share) * phase_N(plan, tick, INCISE_PUNCTURE, &skin);
		*flags |= skin;
	}
	return cut_N;
}

static double cutting(struct incise_plan *plan, struct incise_tick *tick)
{
	double x[INCISE_LOOP_INPUTS_MAX] = {0}, size_N;
	unsigned int flags = 0;
	bool outside = false;

	if (plan->model) {
		size_N = model_N(plan, tick, &flags);
		return cutting_N(plan, tick, size_N, flags);
	}
	/* A compiled one, in a search for swings; its ticks are in integers. */
	find_inputs(plan, tick, INCISE_CUT, x);
	for (int i = 0; i < plan->fixed->n_inputs; i++)
		outside |= x[i] * INCISE_FIXED_ONE < plan->fixed->input[i].min ||
			   x[i] * INCISE_FIXED_ONE > plan->fixed->input[i].max;
	return cutting_N(plan, tick, incise_fixed_eval_double(plan->fixed, x), outside);
}

static void push(struct incise_plan *plan, double force_N)
{
	v3_add(plan->force_N, plan->force_N, force_N, plan->normal);
}

static void reaction_model(struct incise_plan *plan, struct incise_tick *tick,
			   struct incise_acting_force *own)
{
	(void)own;
	if (plan->depth_mm > 0)
		push(plan, cutting(plan, tick));
}

/* New tissue that the blade meets at this tick, mm. */
static double advance_mm(struct incise_plan *plan, struct incise_acting_force *own,
			 bool *fresh)
{
	struct incise_front *cut = &own->front;
	const double *side = plan->side;

	*fresh =
		plan->proxy.began && incise_front_enter(cut, plan->p0_mm, plan->sn, side);
	/* Through a membrane it meets none. */
	if (plan->membrane.hit)
		return 0;
	return incise_front_advance(cut, plan->proxy.touch.point_mm, plan->sn, side);
}

/*
 * Drag on a blade that comes out, as a part of the force of its cut: what the model of the withdrawal
 * says where that pulls, else tissue.friction.
 */
static double friction(const struct incise_plan *plan, struct incise_tick *tick,
		       const struct incise_acting_force *own, double most_N)
{
	unsigned int flags = 0;
	double drag_N;

	if (!plan->scene->cut[INCISE_WITHDRAW].model || !(plan->depth_mm > 0))
		return own->number[INCISE_REACTION_FRICTION];
	drag_N = -plan->gain * phase_N(plan, tick, INCISE_WITHDRAW, &flags);
	/* It goes to 0 at the surface, as the force that unloads does. */
	drag_N = fmin(drag_N, plan->unloading_N_mm * plan->depth_mm);
	return most_N > 0 ? fmax(0, fmin(drag_N / most_N, 1)) : 0;
}

static void reaction_front(struct incise_plan *plan, struct incise_tick *tick,
			   struct incise_acting_force *own)
{
	bool fresh;
	double way_mm = advance_mm(plan, own, &fresh), most_N;

	if (plan->proxy.began)
		plan->skin_open = !fresh;
	most_N = plan->depth_mm > 0 ? cutting(plan, tick) : 0;
	push(plan, incise_front_force(&own->front, plan->unloading_N_mm,
				      friction(plan, tick, own, most_N), plan->depth_mm,
				      way_mm, most_N));
}

/* The blade stays in the plane of its cut: s is Sx(0), its side when the cut began. */
static void plane(struct incise_plan *plan, struct incise_tick *tick,
		  struct incise_acting_force *own)
{
	double off[3];

	v3_sub(off, tick->tool_mm, plan->p0_mm);
	v3_add(plan->force_N, plan->force_N, -own->number[0] * v3_dot(off, plan->side),
	       plan->side);
}

static void damping(struct incise_plan *plan, struct incise_tick *tick,
		    struct incise_acting_force *own)
{
	(void)tick;
	v3_add(plan->force_N, plan->force_N, -own->number[0], plan->velocity_mm_s);
}

/*
 * Turn of a handle out of the cut, 0 … 1: a flat instrument goes in easily when its flat
 * lies along the cut. The flat's normal across the cut's direction then gives 0.
 */
static double turned_across(const struct incise_plan *plan)
{
	double flat[3];

	v3_rotate(flat, plan->attitude, plan->instrument.side);
	return fmin(fabs(v3_dot(flat, plan->opening.along)), 1);
}

/* Fort, aligned … 1: easily, but not freely. A tube is round, it has no turn. */
static double eased(const struct incise_plan *plan, enum incise_tool tool, double aligned)
{
	double across = tool == INCISE_TOOL_TUBE ? 1 : turned_across(plan);

	return aligned + (1 - aligned) * across * plan->tightness;
}

/*
 * Fort as Bhasin et al. (2005) print it, the scalar product of the directions of handle
 * and cut: its flat
 * side, which lies along the cut, resists most.
 */
static double printed(const struct incise_plan *plan)
{
	double flat[3], lies[3];

	v3_cross(flat, plan->instrument.side, plan->instrument.axis);
	v3_rotate(lies, plan->attitude, flat);
	return fmin(fabs(v3_dot(lies, plan->opening.along)), 1);
}

/* Below the cut, and outside of it, tissue holds up like skin. */
static void insertion(struct incise_plan *plan, struct incise_tick *tick,
		      struct incise_acting_force *own)
{
	const struct incise_opening *opening = &plan->opening;
	double cut_mm = opening->in ? fmin(plan->depth_mm, opening->depth_mm) : 0;
	double size_mm = plan->depth_mm - cut_mm;

	/* A tube is round: the paper's product is of the handle's flat side. */
	if (opening->in && plan->printed_orientation && tick->tool == INCISE_TOOL_HANDLE)
		size_mm = plan->depth_mm * printed(plan);
	else if (opening->in)
		size_mm += cut_mm * eased(plan, tick->tool, own->number[1]);
	v3_add(plan->force_N, plan->force_N, own->number[0] * size_mm, plan->normal);
}

/* The tissue around an instrument gives way to a limited extent. */
static void spread(struct incise_plan *plan, struct incise_tick *tick,
		   struct incise_acting_force *own)
{
	double off[3];

	v3_sub(off, tick->tool_mm, plan->p0_mm);
	v3_add(off, off, -v3_dot(off, plan->normal), plan->normal);
	v3_add(plan->force_N, plan->force_N, -own->number[0], off);
}

#define CUTTING (1U << INCISE_PHASE_CUTTING)
#define INSERTION (1U << INCISE_PHASE_INSERTION)

const struct incise_tissue_force incise_tissue_forces[] = {
	[INCISE_FORCE_REACTION] =
		{
			.name = "reaction",
			.phases = CUTTING,
			.kind = INCISE_SPRING_NORMAL,
			.number =
				{{"reaction_N_mm", "N/mm", 1000, "0", 0.14,
				  "Kn: force per depth along the normal; replaces a model"},
				 {"unloading_N_mm", "N/mm", 1000, "0", 0,
				  "stiffness with which the tissue of a model "
				  "unloads; 0: automatic"},
				 {"friction", "", 1, "0.1", 0.1,
				  "share of the model's force that resists the "
				  "blade in its open cut, in both directions"}},
			.zero = "no model, and tissue.reaction_N_mm is 0",
			.run = reaction,
			.integer = incise_fixed_stage_reaction,
			.model = reaction_model,
			.front = reaction_front,
		},
	[INCISE_FORCE_PLANE] =
		{
			.name = "plane",
			.phases = CUTTING,
			.kind = INCISE_SPRING_SIDE,
			.number = {{"plane_N_mm", "N/mm", 1000, "0", 0.17,
				    "Kx: holds the blade in the plane that it had "
				    "when the cut began"}},
			.zero = "tissue.plane_N_mm is 0",
			.run = plane,
			.integer = incise_fixed_stage_plane,
		},
	[INCISE_FORCE_DAMPING] =
		{
			.name = "damping",
			.phases = CUTTING | INSERTION,
			.kind = INCISE_DAMPER,
			.number =
				{{"damping_N_s_mm", "N s/mm", 1, "0", 0.0005,
				  "Kd: opposes the velocity of the tool in the tissue"}},
			.zero = "tissue.damping_N_s_mm is 0",
			.run = damping,
			.integer = incise_fixed_stage_damping,
		},
	[INCISE_FORCE_INSERTION] =
		{
			.name = "insertion",
			.phases = INSERTION,
			.kind = INCISE_SPRING_NORMAL,
			.number = {{"insertion_N_mm", "N/mm", 1000, "0", 0.28,
				    "Ky: force per depth against the handle or a "
				    "tube, across a cut or outside of it"},
				   {"aligned", "", 1, "0.2", 0.2,
				    "share of insertion_N_mm for a handle with its "
				    "flat side along the cut, or a tube in a wide "
				    "enough cut"}},
			.zero = "tissue.insertion_N_mm is 0",
			.run = insertion,
			.integer = incise_fixed_stage_insertion,
		},
	[INCISE_FORCE_SPREAD] =
		{
			.name = "spread",
			.phases = INSERTION,
			.kind = INCISE_SPRING_ACROSS,
			.number = {{"spread_N_mm", "N/mm", 1000, "0", 0.22,
				    "Kxz: pulls a handle or tube back to its point "
				    "of entry, perpendicular to the normal"}},
			.zero = "tissue.spread_N_mm is 0",
			.run = spread,
			.integer = incise_fixed_stage_spread,
		},
};
const int incise_n_tissue_forces =
	sizeof(incise_tissue_forces) / sizeof(*incise_tissue_forces);
_Static_assert(sizeof(incise_tissue_forces) / sizeof(*incise_tissue_forces) <=
		       INCISE_FORCES_MAX,
	       "raise INCISE_FORCES_MAX, and INCISE_PLAN_STAGES_MAX with it");
