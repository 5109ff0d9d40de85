// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The stages from the tracker's poses to where the tool is in the tissue.
 */
#include <errno.h>
#include <string.h>
#include "../base/vector.h"
#include "plan.h"

/*
 * Below this depth the direction from tool to proxy is rounding: the surface's own normal
 * takes its place. Positions within 10 m are good to 2e-12 mm.
 */
#define SHALLOW_MM 1e-6

/*
 * The handle's end is predicted by itself. It cannot be found from the tip's prediction:
 * the attitude is not extrapolated, and on an arm of 120 mm its lag is more than 1 mm.
 */
static void take_handle(struct incise_plan *plan, struct incise_tracker_sample sample)
{
	struct incise_instrument handle = plan->instrument;
	double end_mm[3];

	handle.held = INCISE_TOOL_HANDLE;
	incise_instrument_end(&handle, sample.position_mm, plan->predict.q, end_mm);
	v3_copy(sample.position_mm, end_mm);
	incise_predict_add(plan->handle, &sample);
}

static bool is_tube(const struct incise_plan *plan, uint8_t station)
{
	return plan->tube_station && station == plan->tube_station;
}

/* Station 0 is not known: a tracker, or a program that feeds poses, with only one. */
static bool is_scalpel(const struct incise_plan *plan, uint8_t station)
{
	return !is_tube(plan, station) &&
	       (!plan->scalpel_station || !station || station == plan->scalpel_station);
}

/*
 * Whether a pose is used, by its flag. One that is not is left out as if it had not come, so
 * that the last one ages.
 */
static bool is_usable(struct incise_plan *plan,
		      const struct incise_tracker_sample *sample, int64_t now_ns)
{
	bool usable = incise_pose_count(&plan->poses, sample->status);

	if (!usable && !plan->none_usable)
		plan->unusable_ns = now_ns;
	plan->none_usable = !usable;
	if (is_tube(plan, sample->station)) {
		plan->tube_unusable = !usable;
		return usable;
	}
	plan->pose_flag = sample->status;
	plan->unusable = !usable;
	return usable;
}

static void take_scalpel(struct incise_plan *plan, struct incise_tracker_sample *sample)
{
	double arm_mm[3];

	v3_rotate(arm_mm, sample->quaternion, plan->tip_mm);
	v3_add(sample->position_mm, sample->position_mm, 1, arm_mm);
	incise_predict_add(&plan->predict, sample);
	if (plan->inserts)
		take_handle(plan, *sample);
}

static void take(struct incise_plan *plan, struct incise_tracker_sample *samples, int n,
		 struct incise_tick *tick)
{
	int64_t now_ns = tick->t_ns;

	for (int i = 0; i < n; i++) {
		bool tube = is_tube(plan, samples[i].station);

		if (!tube && !is_scalpel(plan, samples[i].station))
			continue;
		if (!is_usable(plan, &samples[i], now_ns))
			continue;
		/* A timestamp from the future would keep all later poses out. */
		if (samples[i].t_ns > now_ns)
			samples[i].t_ns = now_ns;
		if (plan->feeds)
			incise_plan_give(plan, tube, &samples[i], now_ns);
		else if (plan->integers)
			incise_integers_pose(plan->integers, tube, &samples[i], now_ns);
		else if (!tube)
			take_scalpel(plan, &samples[i]);
		else if (plan->tube)
			incise_predict_add(plan->tube, &samples[i]);
	}
	if (plan->unusable)
		tick->flags |= INCISE_TICK_UNUSABLE;
}

int incise_stage_pose(struct incise_plan *plan, struct incise_tick *tick)
{
	struct incise_tracker_sample samples[INCISE_PLAN_POSES];
	int n = incise_tracker_read(plan->tracker, samples, INCISE_PLAN_POSES);

	take(plan, samples, n, tick);
	plan->blind = n > 0 && plan->none_usable &&
		      tick->t_ns - plan->unusable_ns >= INCISE_PLAN_BLIND_NS;
	if (plan->blind)
		return -ENODEV;
	return n < 0 ? n : 0;
}

int incise_stage_fed(struct incise_plan *plan, struct incise_tick *tick)
{
	take(plan, plan->fed, plan->n_fed, tick);
	plan->n_fed = 0;
	return 0;
}

int incise_stage_predict(struct incise_plan *plan, struct incise_tick *tick)
{
	if (incise_predict_age(&plan->predict, tick->t_ns) > plan->pose_age_ns)
		tick->flags |= INCISE_TICK_STALE;
	incise_predict_at(&plan->predict, tick->t_ns, tick->position_mm,
			  plan->velocity_mm_s, plan->attitude);
	memcpy(tick->quaternion, plan->attitude, sizeof(tick->quaternion));
	v3_copy(tick->tool_mm, tick->position_mm);
	tick->velocity_mm_s = v3_length(plan->velocity_mm_s);
	return 0;
}

/* Whether the tool that is held stays: in the tissue it does until the force has faded. */
static bool keeps_tool(struct incise_plan *plan)
{
	bool faded = !(plan->start.gain > 0) && v3_length(plan->limit.last_N) == 0;

	plan->changing =
		plan->proxy.touching && incise_instrument_waits(&plan->instrument);
	return plan->proxy.touching && !(plan->changing && faded);
}

/* From here on the tube counts as nearer; a tracker's noise and a tremor are far less. */
#define NEARER_MM 5

/* A height above the surface, between two numbers. */
struct height {
	double low_mm, high_mm;
};

/* Since the surface was searched a height changed by no more than the end went. */
static struct height height_of(const struct incise_above *above, const double end_mm[3])
{
	double way_mm[3], went_mm = INFINITY;

	v3_sub(way_mm, end_mm, above->end_mm);
	if (above->known)
		went_mm = v3_length(way_mm);
	return (struct height){above->above_mm - went_mm, above->above_mm + went_mm};
}

static void search(const struct incise_plan *plan, struct incise_above *above,
		   const double end_mm[3])
{
	struct incise_touch touch;

	incise_surface_nearest(plan->surface, end_mm, &touch);
	*above = (struct incise_above){.known = true, .above_mm = -touch.depth_mm};
	v3_copy(above->end_mm, end_mm);
}

/* The surface is only searched where what is known of the heights does not decide it. */
static bool is_tube_nearer(struct incise_plan *plan, const struct incise_tick *tick)
{
	bool tube_held = plan->instrument.held == INCISE_TOOL_TUBE, searched = false;
	double end_mm[INCISE_PLAN_ENDS][3], speed_mm_s[3], attitude[4];
	/* Of how much a tube that is nearer stays below the scalpel. */
	double less_mm = tube_held ? -NEARER_MM : NEARER_MM;

	v3_copy(end_mm[INCISE_PLAN_TIP], tick->position_mm);
	incise_predict_at(plan->handle, tick->t_ns, end_mm[INCISE_PLAN_HANDLE],
			  speed_mm_s, attitude);
	incise_predict_at(plan->tube, tick->t_ns, end_mm[INCISE_PLAN_TUBE], speed_mm_s,
			  attitude);
	for (;;) {
		struct height h[INCISE_PLAN_ENDS], scalpel, tube;

		for (int i = 0; i < INCISE_PLAN_ENDS; i++)
			h[i] = height_of(&plan->above[i], end_mm[i]);
		scalpel.low_mm =
			fmin(h[INCISE_PLAN_TIP].low_mm, h[INCISE_PLAN_HANDLE].low_mm);
		scalpel.high_mm =
			fmin(h[INCISE_PLAN_TIP].high_mm, h[INCISE_PLAN_HANDLE].high_mm);
		tube = h[INCISE_PLAN_TUBE];
		if (tube.high_mm + less_mm < scalpel.low_mm)
			return true;
		if (tube.low_mm + less_mm > scalpel.high_mm || searched)
			return tube_held && searched &&
			       tube.low_mm + less_mm <= scalpel.high_mm;
		for (int i = 0; i < INCISE_PLAN_ENDS; i++)
			search(plan, &plan->above[i], end_mm[i]);
		searched = true;
	}
}

static bool is_tube_stale(const struct incise_plan *plan, const struct incise_tick *tick)
{
	return incise_predict_age(plan->tube, tick->t_ns) > plan->pose_age_ns;
}

/*
 * Find out whether the tube is nearer. One of the two that is silent is far away, also in the
 * tissue; of two that are not, the held one stays there.
 */
static bool find_tube(struct incise_plan *plan, const struct incise_tick *tick)
{
	struct incise_instrument *instrument = &plan->instrument;
	bool keeps;

	if (is_tube_stale(plan, tick))
		instrument->tube_nearer = false;
	else if (tick->flags & INCISE_TICK_STALE)
		instrument->tube_nearer = true;
	keeps = keeps_tool(plan);
	if (!keeps && instrument->wanted == INCISE_TOOL_AUTO &&
	    !is_tube_stale(plan, tick) && !(tick->flags & INCISE_TICK_STALE))
		instrument->tube_nearer = is_tube_nearer(plan, tick);
	return keeps;
}

/* The flags of the tube's station take the place of the scalpel's. */
static void flag_tube(const struct incise_plan *plan, struct incise_tick *tick)
{
	tick->flags &= ~(unsigned int)(INCISE_TICK_STALE | INCISE_TICK_UNUSABLE);
	if (is_tube_stale(plan, tick))
		tick->flags |= INCISE_TICK_STALE;
	if (plan->tube_unusable)
		tick->flags |= INCISE_TICK_UNUSABLE;
}

int incise_stage_tool(struct incise_plan *plan, struct incise_tick *tick)
{
	bool keeps = plan->tube ? find_tube(plan, tick) : keeps_tool(plan);
	double attitude[4];

	/* The way from the end of one to that of the other is no motion. */
	if (incise_instrument_choose(&plan->instrument, plan->attitude, plan->up,
				     keeps)) {
		incise_proxy_init(&plan->proxy, plan->surface, plan->proxy.leave_mm);
		plan->start.gain = 0;
		plan->changing = false;
	}
	tick->tool = plan->instrument.held;
	if (plan->instrument.held == INCISE_TOOL_HANDLE)
		incise_predict_at(plan->handle, tick->t_ns, tick->tool_mm,
				  plan->velocity_mm_s, plan->attitude);
	if (plan->instrument.held == INCISE_TOOL_TUBE && plan->tube) {
		/* The attitude stays the scalpel's. */
		incise_predict_at(plan->tube, tick->t_ns, tick->tool_mm,
				  plan->velocity_mm_s, attitude);
		flag_tube(plan, tick);
	}
	return 0;
}

static void contact_begins(struct incise_plan *plan, int64_t t_ns)
{
	const struct incise_touch *first = &plan->proxy.first;

	v3_copy(plan->p0_mm, first->point_mm);
	plan->touched_ns = t_ns;
	plan->deepest_mm = 0;
	plan->skin_open = false;
	v3_copy(plan->sn, first->normal);
	if (plan->instrument.held == INCISE_TOOL_BLADE)
		v3_rotate(plan->side, plan->attitude, plan->instrument.side);
	if (plan->average)
		incise_average_reset(plan->average);
}

/*
 * Bhasin et al.'s Sn = (Q - P)/|Q - P|, which is no direction where Q and P meet. Where the
 * proxy is the nearest point of a smooth surface it is the surface's normal.
 */
static void find_normal(struct incise_plan *plan, const double tool_mm[3])
{
	const struct incise_touch *touch = &plan->proxy.touch;
	double out[3];

	v3_sub(out, touch->point_mm, tool_mm);
	if (touch->face < 0 || !(touch->depth_mm > SHALLOW_MM) ||
	    !v3_unit(plan->sn, out, SHALLOW_MM))
		v3_copy(plan->sn, touch->normal);
	v3_copy(plan->normal, plan->sn);
}

int incise_stage_contact(struct incise_plan *plan, struct incise_tick *tick)
{
	struct incise_proxy *proxy = &plan->proxy;

	for (int i = 0; i < 3; i++)
		plan->force_N[i] = 0;
	incise_proxy_move(proxy, tick->tool_mm);
	tick->tool = plan->instrument.held;
	plan->depth_mm = 0;
	if (!proxy->touching)
		return 0;
	if (proxy->began)
		contact_begins(plan, tick->t_ns);
	find_normal(plan, tick->tool_mm);
	plan->depth_mm = fmax(proxy->touch.depth_mm, 0);
	tick->flags |= INCISE_TICK_CONTACT;
	tick->phase = plan->instrument.held == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
								 : INCISE_PHASE_INSERTION;
	tick->depth_mm = plan->depth_mm;
	v3_copy(tick->proxy_mm, proxy->touch.point_mm);
	v3_copy(tick->normal, plan->normal);
	return 0;
}

/* Bhasin et al.'s Snavg. */
int incise_stage_normal(struct incise_plan *plan, struct incise_tick *tick)
{
	if (tick->phase == INCISE_PHASE_FREE)
		return 0;
	incise_average_add(plan->average, plan->sn, plan->normal);
	v3_copy(tick->normal, plan->normal);
	return 0;
}

/*
 * The cuts that this tick makes or widens. An instrument meets the opening as it was when it went
 * in: it makes the way easier for the next one.
 */
int incise_stage_incision(struct incise_plan *plan, struct incise_tick *tick)
{
	bool inserts = tick->phase == INCISE_PHASE_INSERTION;

	/* No tool goes into its cuts: there are none to fill up. */
	if (!plan->inserts)
		return 0;
	if (!incise_incision_tick(plan->incision, tick))
		tick->flags |= INCISE_TICK_FULL;
	if (inserts && (plan->proxy.began || !plan->opening.in)) {
		plan->opening = *incise_incision_met(plan->incision);
		plan->tightness = incise_incision_tightness(plan->incision,
							    &plan->opening, tick->tool);
	} else if (!inserts && !(tick->flags & INCISE_TICK_STALE)) {
		plan->opening.in = false;
	}
	if (inserts && plan->opening.in)
		tick->flags |= INCISE_TICK_IN_CUT;
	return 0;
}

/* Whether a tool meets the membrane here, and not uncut skin above it or tissue beside it. */
static bool hits_membrane(const struct incise_plan *plan, const struct incise_tick *tick,
			  const double off_mm[3], double beyond_mm)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;
	double across_mm[3];

	v3_add(across_mm, off_mm, beyond_mm, membrane->normal);
	return v3_length(across_mm) <= membrane->radius_mm &&
	       (tick->phase == INCISE_PHASE_CUTTING || plan->opening.in);
}

/* N against a tool so far beyond the plane of the membrane. */
static double membrane_N(struct incise_plan *plan, struct incise_tick *tick,
			 double beyond_mm)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;
	double K = plan->gain * membrane->puncture_N / membrane->thickness_mm;

	plan->membrane.punctured |= beyond_mm >= membrane->thickness_mm;
	tick->flags |=
		plan->membrane.punctured ? INCISE_TICK_LUMEN : INCISE_TICK_MEMBRANE;
	if (!plan->membrane.punctured)
		return K * beyond_mm;
	if (!(beyond_mm > membrane->back_wall_mm))
		return 0;
	tick->flags |= INCISE_TICK_BACK_WALL;
	return K * (beyond_mm - membrane->back_wall_mm);
}

/*
 * A membrane over an airway. Tissue in front of it holds the tool up to the membrane's depth and
 * no more beyond it; the membrane yields, and is open from then on.
 */
int incise_stage_membrane(struct incise_plan *plan, struct incise_tick *tick)
{
	const struct incise_scene_membrane *membrane = &plan->scene->membrane;
	double off_mm[3], beyond_mm;

	v3_sub(off_mm, tick->tool_mm, membrane->point_mm);
	beyond_mm = -v3_dot(off_mm, membrane->normal);
	/* Another tool did not come there the way that the last one did. */
	if (plan->proxy.began)
		plan->membrane.met = plan->membrane.hit = false;
	if (tick->phase == INCISE_PHASE_FREE || !(beyond_mm > 0)) {
		plan->membrane.met = plan->membrane.hit = false;
		return 0;
	}
	if (!plan->membrane.met) {
		plan->membrane.met = true;
		plan->membrane.hit = hits_membrane(plan, tick, off_mm, beyond_mm);
		plan->membrane.depth_mm = fmax(plan->depth_mm - beyond_mm, 0);
	}
	if (!plan->membrane.hit)
		return 0;
	plan->depth_mm = fmin(plan->depth_mm, plan->membrane.depth_mm);
	v3_add(plan->force_N, plan->force_N, membrane_N(plan, tick, beyond_mm),
	       membrane->normal);
	return 0;
}

/* Without a fresh pose the last force stays, and fades. */
int incise_stage_start(struct incise_plan *plan, struct incise_tick *tick)
{
	/* Unsigned: two times may be farther apart than an int64_t holds. */
	uint64_t gone_ns = (uint64_t)tick->t_ns - (uint64_t)plan->last_ns;
	double dt_s = plan->last_ns && tick->t_ns > plan->last_ns
			      ? (double)gone_ns / INCISE_NS_PER_S
			      : 0;
	bool fresh =
		!(tick->flags & INCISE_TICK_STALE) && !plan->fading && !plan->changing;
	double gain =
		incise_start_gain(&plan->start, v3_length(plan->force_N), fresh, dt_s);

	plan->last_ns = tick->t_ns;
	if (gain < 1)
		tick->flags |= INCISE_TICK_STARTING;
	for (int i = 0; i < 3; i++)
		tick->command_N[i] = gain * plan->force_N[i];
	return 0;
}

int incise_stage_limit(struct incise_plan *plan, struct incise_tick *tick)
{
	unsigned int held = incise_limit_apply(&plan->limit, tick->command_N);

	if (held & INCISE_LIMIT_FORCE)
		tick->flags |= INCISE_TICK_CLAMPED;
	if (held & INCISE_LIMIT_SLEW)
		tick->flags |= INCISE_TICK_SLEWED;
	if (held & INCISE_LIMIT_NOT_FINITE)
		tick->flags |= INCISE_TICK_NOT_FINITE;
	return 0;
}

int incise_stage_actuate(struct incise_plan *plan, struct incise_tick *tick)
{
	return incise_axes_render(&plan->axes, plan->limit.last_N, tick);
}
