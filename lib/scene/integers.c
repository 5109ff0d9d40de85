// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan's numbers in integers; see integers.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "../fixed/vector.h"
#include "integers.h"
#include "plan.h"

#define ONE 65536.0	     /* Q16.16 */
#define UNIT 1073741824.0    /* Q2.30 */
#define DAMPING 268435456.0  /* Q28 */
#define LARGEST 2147483647.0 /* of 32 bits */

/* Below this depth the direction from tool to proxy is rounding: see stages.c. */
#define SHALLOW_MM 1e-6

/* A conversion at work: the first number that does not fit is named. */
struct conversion {
	const struct incise_plan *plan;
	struct incise_error *err;
	int rc;
};

static int32_t to_integer(struct conversion *c, const char *name, double value,
			  double one, double most)
{
	double scaled = value * one;

	if (c->rc)
		return 0;
	if (!(fabs(value) <= most) || !(fabs(scaled) <= LARGEST)) {
		c->rc = incise_error_set(
			c->err, ERANGE,
			"%s: %s is %g: integers are limited to %g; reduce it, or set "
			"arithmetic to \"double\"",
			c->plan->scene->path, name, value, fmin(most, LARGEST / one));
		return 0;
	}
	return (int32_t)lrint(scaled);
}

static int32_t number(struct conversion *c, const char *name, double value)
{
	return to_integer(c, name, value, ONE, 32767);
}

static int32_t length(struct conversion *c, const char *name, double mm)
{
	return to_integer(c, name, mm, ONE, 4096);
}

static int32_t period(struct conversion *c, const char *name, double s)
{
	return to_integer(c, name, s, 1e9, 2.1);
}

static void place(struct conversion *c, const char *name, int32_t to[3],
		  const double mm[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = to_integer(c, name, mm[i], ONE, 8191);
}

/* Rounded components of a unit vector; the integers make it one to their last bit. */
static void direction(int32_t to[3], const double unit[3])
{
	int64_t wide[3];

	for (int i = 0; i < 3; i++)
		wide[i] = llrint(unit[i] * UNIT);
	incise_fx_unit(to, wide, 3, 0);
}

static void set_filter(struct conversion *c, struct incise_fixed_filter *filter)
{
	const struct incise_predict *p = &c->plan->predict;
	double per_s = 1 / p->period_s;
	int64_t ahead_ns =
		p->gap_ns > INCISE_PREDICT_AHEAD_NS ? p->gap_ns : INCISE_PREDICT_AHEAD_NS;

	filter->alpha = to_integer(c, "the predictor's gain", p->alpha, UNIT, 1);
	filter->beta = to_integer(c, "the predictor's gain", p->beta * per_s, ONE, 32767);
	filter->gamma = to_integer(c, "the predictor's gain", p->gamma * per_s * per_s,
				   4096, 524287);
	filter->period_ns = (int32_t)lrint(p->period_s * 1e9);
	filter->latency_ns = (int32_t)p->latency_ns;
	if (!c->rc && filter->period_ns > INCISE_FIXED_PERIOD_MAX_NS)
		c->rc = incise_error_set(
			c->err, ERANGE,
			"%s: the tracker has %g Hz: integers need at least 20 Hz; set "
			"arithmetic to \"double\"",
			c->plan->scene->path, 1 / p->period_s);
	if (c->rc)
		return;
	filter->gap_ns = (int32_t)p->gap_ns;
	filter->ahead_ns = (int32_t)ahead_ns;
}

static void set_scalpel(struct conversion *c, struct incise_fixed_numbers *numbers)
{
	const struct incise_plan *plan = c->plan;

	for (int i = 0; i < 3; i++)
		numbers->tip[i] = length(c, "the calibration's tip_mm", plan->tip_mm[i]);
	direction(numbers->axis, plan->instrument.axis);
	direction(numbers->side, plan->instrument.side);
	numbers->handle = length(c, "tool.handle_mm", plan->instrument.handle_mm);
	numbers->inserts = plan->inserts;
	numbers->tube = plan->inserts && plan->tube_station;
}

static void set_shape(struct conversion *c, struct incise_fixed_shape *shape)
{
	const struct incise_surface *surface = c->plan->surface;
	const struct capsule *capsule = &surface->capsule;
	double axis[3], unit[3] = {0, 0, 1}, top[3] = {0, 0, 1};

	*shape = (struct incise_fixed_shape){.kind = INCISE_FIXED_PLANE};
	direction(shape->normal, top);
	if (surface->kind == INCISE_SURFACE_PLANE) {
		place(c, "the surface's point", shape->point, surface->plane.point);
		direction(shape->normal, surface->plane.normal);
	} else if (!surface->mesh) {
		shape->kind = INCISE_FIXED_CAPSULE;
		place(c, "the surface's position", shape->point, capsule->a);
		v3_sub(axis, capsule->b, capsule->a);
		v3_unit(unit, axis, 0);
		direction(shape->normal, unit);
		shape->length =
			to_integer(c, "the capsule's length", v3_length(axis), ONE, 8191);
		shape->radius =
			to_integer(c, "surface.radius_mm", capsule->radius, ONE, 8191);
	}
}

_Static_assert(INCISE_FIXED_INPUT_DEPTH == INCISE_INPUT_DEPTH + 1 &&
		       INCISE_FIXED_INPUT_SPEED == INCISE_INPUT_SPEED + 1 &&
		       INCISE_FIXED_INPUT_ACCELERATION == INCISE_INPUT_ACCELERATION + 1 &&
		       INCISE_FIXED_INPUT_TILT == INCISE_INPUT_TILT + 1 &&
		       INCISE_FIXED_INPUT_TIME == INCISE_INPUT_TIME + 1,
	       "the same, from 1");

/* Depth, or depth and speed, are 0: so plans say it whose format is the first. */
static int32_t inputs_of(const struct incise_scene *scene)
{
	const struct incise_scene_model *cut = &scene->cut[INCISE_CUT];
	int32_t inputs = 0;

	for (int i = 0; i < cut->n_inputs; i++)
		inputs |= (int32_t)(cut->input[i] + 1) << 4 * i;
	return inputs == INCISE_FIXED_INPUT_DEPTH ||
			       inputs == (INCISE_FIXED_INPUT_DEPTH |
					  INCISE_FIXED_INPUT_SPEED << 4)
		       ? 0
		       : inputs;
}

static void set_tissue(struct conversion *c, struct incise_fixed_numbers *numbers)
{
	const struct incise_plan *plan = c->plan;
	const struct incise_acting_force *acting = plan->acting;
	bool model = plan->model || plan->fixed;

	numbers->leave = length(c, "tissue.leave_mm", plan->scene->tissue.leave_mm);
	numbers->average_ticks = plan->average_ticks;
	if (model) {
		numbers->inputs = inputs_of(plan->scene);
		numbers->gain = number(c, "tissue.gain", plan->gain);
		numbers->support = number(c, "the model's depth", plan->support_mm);
		numbers->beyond = number(c, "the model's slope", plan->beyond_N_mm);
	} else {
		numbers->reaction = number(c, "tissue.reaction_N_mm",
					   acting[INCISE_FORCE_REACTION].number[0]);
	}
	if (model && plan->dissipates) {
		numbers->unloading = number(c, "the unloading", plan->unloading_N_mm);
		numbers->friction = number(
			c, "tissue.friction",
			acting[INCISE_FORCE_REACTION].number[INCISE_REACTION_FRICTION]);
	}
	numbers->plane =
		number(c, "tissue.plane_N_mm", acting[INCISE_FORCE_PLANE].number[0]);
	numbers->damping =
		to_integer(c, "tissue.damping_N_s_mm",
			   acting[INCISE_FORCE_DAMPING].number[0], DAMPING, 7.99);
	numbers->insertion = number(c, "tissue.insertion_N_mm",
				    acting[INCISE_FORCE_INSERTION].number[0]);
	numbers->aligned =
		number(c, "tissue.aligned", acting[INCISE_FORCE_INSERTION].number[1]);
	numbers->printed = plan->printed_orientation;
	numbers->spread =
		number(c, "tissue.spread_N_mm", acting[INCISE_FORCE_SPREAD].number[0]);
}

static void set_incision(struct conversion *c, struct incise_fixed_incision_setup *setup)
{
	const struct incise_scene *scene = c->plan->scene;

	setup->cuts_most = scene->tissue.cuts_most;
	if (!c->rc && setup->cuts_most > INCISE_FIXED_CUTS_MAX)
		c->rc = incise_error_set(
			c->err, ERANGE,
			"%s: tissue.cuts_most is %d: integers are limited to %d; "
			"reduce it, or set arithmetic to \"double\"",
			scene->path, setup->cuts_most, INCISE_FIXED_CUTS_MAX);
	setup->cut_from =
		to_integer(c, "tissue.cut_from_mm", scene->tissue.cut_from_mm, ONE, 1000);
	setup->stretch =
		to_integer(c, "tissue.stretch_mm", scene->tissue.stretch_mm, ONE, 1000);
	setup->handle_width = to_integer(c, "tool.handle_width_mm",
					 scene->tool.handle_width_mm, ONE, 1000);
	setup->handle_thickness = to_integer(c, "tool.handle_thickness_mm",
					     scene->tool.handle_thickness_mm, ONE, 1000);
	setup->tube = to_integer(c, "tool.tube_mm", scene->tool.tube_mm, ONE, 1000);
}

static void set_membrane(struct conversion *c, struct incise_fixed_membrane *to)
{
	const struct incise_scene_membrane *membrane = &c->plan->scene->membrane;

	if (!(membrane->thickness_mm > 0))
		return;
	place(c, "membrane.point_mm", to->point, membrane->point_mm);
	direction(to->normal, membrane->normal);
	to->radius = length(c, "membrane.radius_mm", membrane->radius_mm);
	to->thickness = length(c, "membrane.thickness_mm", membrane->thickness_mm);
	to->stiffness =
		number(c, "the membrane's stiffness",
		       c->plan->gain * membrane->puncture_N / membrane->thickness_mm);
	to->back_wall = length(c, "membrane.back_wall_mm", membrane->back_wall_mm);
}

static void set_limits(struct conversion *c, struct incise_fixed_numbers *numbers)
{
	const struct incise_plan *plan = c->plan;

	numbers->pose_age_ns = plan->pose_age_ns;
	numbers->tick_ns = (int32_t)lrint(1e9 / plan->scene->rate_hz);
	numbers->small = number(c, "limits.start_N", plan->start.small_N);
	numbers->ramp_ns = period(c, "limits.ramp_ms", plan->start.ramp_s);
	numbers->fade_ns = period(c, "limits.fade_ms", plan->start.fade_s);
	/* Rounded down: never above. */
	numbers->force = to_integer(c, "limits.force_N",
				    floor(plan->limit.force_N * ONE) / ONE, ONE, 4096);
	numbers->slew =
		to_integer(c, "limits.slew_N_s",
			   fmax(floor(plan->limit.slew_N * ONE), 1) / ONE, ONE, 4096);
}

int incise_integers_numbers(const struct incise_plan *plan,
			    struct incise_fixed_numbers *numbers,
			    struct incise_error *err)
{
	struct conversion c = {.plan = plan, .err = err};

	*numbers = (struct incise_fixed_numbers){0};
	set_filter(&c, &numbers->filter);
	set_scalpel(&c, numbers);
	set_shape(&c, &numbers->shape);
	direction(numbers->up, plan->up);
	set_tissue(&c, numbers);
	set_incision(&c, &numbers->incision);
	set_membrane(&c, &numbers->membrane);
	set_limits(&c, numbers);
	if (!c.rc && !incise_fixed_numbers_good(numbers))
		c.rc = incise_error_set(
			err, ERANGE,
			"%s: the combination of its numbers exceeds integers; set "
			"arithmetic to \"double\"",
			plan->scene->path);
	return c.rc;
}

/* --- as a file ---------------------------------------------------------------------------- */

/* Of the places where a contact began, mm: what the bound is certified for. */
#define REACH_MM 20

/* Heights are off by no more than the first of these that lets a tool go deep enough, mm. */
static const double wanted_mm[] = {0.01, 0.03, 0.1};
#define WANTED ((int)(sizeof(wanted_mm) / sizeof(*wanted_mm)))

/* Deep enough is where the force is at its limit: it grows no further. */
#define HEIGHT_REACH_MM 40

static int make_heights(const struct incise_plan *plan, struct incise_heights *heights,
			struct incise_error *err)
{
	double enough_mm = fmin(HEIGHT_REACH_MM, plan->scene->limits.force_N /
							 plan->stability.stiffness_N_mm);
	double reach_mm = 0;

	for (int i = 0; i < WANTED; i++) {
		int rc;

		incise_heights_free(heights);
		rc = incise_heights_make(plan->surface, plan->up,
					 plan->scene->tissue.leave_mm, HEIGHT_REACH_MM,
					 wanted_mm[i], heights, err);
		if (rc)
			return rc;
		reach_mm = ldexp(heights->frame.reach, -16);
		if (reach_mm >= enough_mm)
			return 0;
	}
	return incise_error_set(
		err, ERANGE,
		"%s: its surface is too curved: its heights are valid to a depth of "
		"%.1f mm, but the force reaches limits.force_N at %.1f; remove "
		"--in-kernel",
		plan->scene->path, reach_mm, enough_mm);
}

static void set_axis(struct conversion *c, const struct incise_axis *axis,
		     struct incise_fixed_axis *to)
{
	const struct incise_stepper_info *info = &axis->info;

	direction(to->direction, axis->direction);
	for (int k = 0; k < 3; k++)
		to->dual[k] = to_integer(c, "an actuator's share of a force",
					 axis->dual[k], 16777216.0, 127);
	to->compliance =
		to_integer(c, "1 / spring_N_mm", 1 / info->spring_N_mm, 1048576.0, 2047);
	to->steps_per_mm = number(c, "an actuator's steps per mm", 1 / info->step_mm);
	to->origin = length(c, "an actuator's origin", info->origin_mm);
	to->travel = length(c, "travel_mm", info->travel_mm);
	to->rest = length(c, "rest_mm", info->rest_mm);
	to->rest = to->rest < to->travel ? to->rest : to->travel;
}

static void set_bound(struct conversion *c, struct incise_fixed_numbers *numbers,
		      const struct incise_heights *heights)
{
	double reach_mm = ldexp(heights->frame.reach, -16);
	double bound_N = incise_plan_bound(c->plan, REACH_MM) +
			 c->plan->stability.stiffness_N_mm *
				 (heights->depth_bound_mm + heights->point_bound_mm +
				  reach_mm * heights->normal_bound_rad);

	if (!c->rc && !(bound_N < 4096))
		c->rc = incise_error_set(c->err, ERANGE,
					 "%s: its error in integers is not bounded; "
					 "set arithmetic to \"double\"",
					 c->plan->scene->path);
	if (!c->rc)
		numbers->bound = (int64_t)ceil(ldexp(bound_N, 32));
}

int incise_integers_file(const struct incise_plan *plan,
			 struct incise_fixed_numbers *numbers,
			 struct incise_heights *heights, struct incise_error *err)
{
	struct conversion c = {.plan = plan, .err = err};

	*heights = (struct incise_heights){0};
	c.rc = incise_integers_numbers(plan, numbers, err);
	numbers->n_axes = plan->axes.n;
	for (int i = 0; i < plan->axes.n; i++)
		set_axis(&c, &plan->axes.axis[i], &numbers->axes[i]);
	if (!c.rc && plan->surface->mesh) {
		c.rc = make_heights(plan, heights, err);
		numbers->shape.kind = INCISE_FIXED_GRID;
		numbers->grid = heights->frame;
	}
	set_bound(&c, numbers, heights);
	return c.rc;
}

/* --- a mesh, with its proxy in double ---------------------------------------------------- */

static int32_t near_integer(double value, double one)
{
	return (int32_t)lrint(fmax(-LARGEST, fmin(LARGEST, value * one)));
}

static void to_integers(int32_t to[3], const double from[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = near_integer(from[i], ONE);
}

static void to_double(double to[3], const int32_t from[3], double one)
{
	for (int i = 0; i < 3; i++)
		to[i] = from[i] / one;
}

static void take_touch(struct incise_fixed_touch *to, const struct incise_touch *touch,
		       const double tool_mm[3])
{
	double out[3], sn[3];

	v3_copy(sn, touch->normal);
	v3_sub(out, touch->point_mm, tool_mm);
	if (touch->depth_mm > SHALLOW_MM)
		v3_unit(sn, out, SHALLOW_MM);
	to_integers(to->point, touch->point_mm);
	direction(to->normal, sn);
	to->depth = near_integer(touch->depth_mm, ONE);
}

static INCISE_REALTIME void mesh_move(void *context, const int32_t tool[3],
				      struct incise_fixed_proxy *proxy)
{
	struct incise_integers *integers = context;
	double tool_mm[3];

	to_double(tool_mm, tool, ONE);
	incise_proxy_move(&integers->proxy, tool_mm);
	proxy->touching = integers->proxy.touching;
	proxy->began = integers->proxy.began;
	if (proxy->began)
		/* Of the place itself: a normal, not a direction from the tool. */
		take_touch(&proxy->first,
			   &(struct incise_touch){
				   .point_mm = {integers->proxy.first.point_mm[0],
						integers->proxy.first.point_mm[1],
						integers->proxy.first.point_mm[2]},
				   .normal = {integers->proxy.first.normal[0],
					      integers->proxy.first.normal[1],
					      integers->proxy.first.normal[2]}},
			   tool_mm);
	if (proxy->touching)
		take_touch(&proxy->touch, &integers->proxy.touch, tool_mm);
}

static INCISE_REALTIME int32_t mesh_above(void *context, const int32_t place[3])
{
	const struct incise_integers *integers = context;
	struct incise_touch touch;
	double place_mm[3];

	to_double(place_mm, place, ONE);
	incise_surface_nearest(integers->proxy.surface, place_mm, &touch);
	return near_integer(-touch.depth_mm, ONE);
}

static INCISE_REALTIME void mesh_restart(void *context)
{
	struct incise_integers *integers = context;

	incise_proxy_init(&integers->proxy, integers->proxy.surface,
			  integers->proxy.leave_mm);
}

/* --- cuts of another plan ---------------------------------------------------------------- */

void incise_integers_take_over(struct incise_integers *integers,
			       const struct incise_integers *before)
{
	struct incise_fixed_incision *to = &integers->state.incision;
	int most = integers->plan.numbers.incision.cuts_most;

	integers->state.membrane.punctured = before->state.membrane.punctured;
	*to = before->state.incision;
	to->n = to->n < most ? to->n : most;
	incise_fixed_incision_leave(to);
}

_Static_assert(INCISE_CUT_PLACES == INCISE_FIXED_CUT_PLACES, "the same places");

bool incise_integers_cut(const struct incise_integers *integers, int i,
			 struct incise_cut *cut)
{
	const struct incise_fixed_incision *cuts = &integers->state.incision;
	const struct incise_fixed_cut *from = &cuts->cut[i];

	if (i < 0 || i >= cuts->n)
		return false;
	to_double(cut->at_mm, from->at, ONE);
	to_double(cut->along, from->along, UNIT);
	to_double(cut->side, from->side, UNIT);
	to_double(cut->normal, from->normal, UNIT);
	cut->from_mm = from->from / ONE;
	cut->to_mm = from->to / ONE;
	cut->incision = from->incision;
	for (int k = 0; k < INCISE_CUT_PLACES; k++) {
		cut->place[k].depth_mm = (float)(from->place[k].depth / ONE);
		cut->place[k].open_mm = (float)(from->place[k].open / ONE);
	}
	return true;
}

bool incise_integers_add_cut(struct incise_integers *integers,
			     const struct incise_cut *cut)
{
	struct incise_fixed_incision *cuts = &integers->state.incision;
	struct incise_fixed_cut *to = &cuts->cut[cuts->n];

	if (cuts->n >= integers->plan.numbers.incision.cuts_most)
		return false;
	cuts->n++;
	to_integers(to->at, cut->at_mm);
	direction(to->along, cut->along);
	direction(to->side, cut->side);
	direction(to->normal, cut->normal);
	to->from = near_integer(cut->from_mm, ONE);
	to->to = near_integer(cut->to_mm, ONE);
	to->incision = cut->incision;
	for (int k = 0; k < INCISE_CUT_PLACES; k++) {
		to->place[k].depth = near_integer(cut->place[k].depth_mm, ONE);
		to->place[k].open = near_integer(cut->place[k].open_mm, ONE);
	}
	return true;
}

/* --- running ----------------------------------------------------------------------------- */

struct incise_integers *incise_integers_new(const struct incise_plan *plan,
					    struct incise_error *err)
{
	struct incise_integers *integers = calloc(1, sizeof(*integers));
	int rc;

	if (!integers) {
		incise_error_set(err, ENOMEM, "no memory for a plan");
		return NULL;
	}
	rc = incise_integers_numbers(plan, &integers->plan.numbers, err);
	if (rc) {
		free(integers);
		errno = -rc;
		return NULL;
	}
	integers->plan.has_model = plan->fixed;
	if (plan->fixed)
		integers->plan.model = *plan->fixed;
	incise_proxy_init(&integers->proxy, plan->surface, plan->proxy.leave_mm);
	integers->mesh = (struct incise_fixed_surface){
		.context = integers,
		.move = mesh_move,
		.above = mesh_above,
		.restart = mesh_restart,
	};
	if (plan->surface->mesh)
		integers->plan.surface = &integers->mesh;
	incise_fixed_plan_begin(&integers->plan, &integers->state);
	return integers;
}

void incise_integers_hold(struct incise_integers *integers, enum incise_tool tool,
			  bool fading)
{
	if (integers->plan.numbers.inserts)
		integers->state.wanted = (int32_t)tool;
	integers->state.fading = fading;
}

int incise_integers_set_tip(struct incise_integers *integers, const double tip_mm[3])
{
	for (int i = 0; i < 3; i++)
		if (!(fabs(tip_mm[i]) <= 4096))
			return -EINVAL;
	to_integers(integers->plan.numbers.tip, tip_mm);
	return 0;
}

void incise_integers_pose(struct incise_integers *integers, bool tube,
			  const struct incise_tracker_sample *sample, int64_t now_ns)
{
	struct incise_fixed_pose pose = {
		.t_ns = sample->t_ns,
		.tool = (uint32_t)integers->state.wanted |
			(tube ? INCISE_FIXED_POSE_TUBE : 0) |
			(integers->state.fading ? INCISE_FIXED_POSE_FADE : 0),
	};

	if (!v3_finite(sample->position_mm))
		return;
	to_integers(pose.position, sample->position_mm);
	/* One that is no quaternion leaves the attitude as it was; 0 would be no pose. */
	for (int i = 0; i < 4; i++)
		pose.quaternion[i] = isfinite(sample->quaternion[i])
					     ? near_integer(sample->quaternion[i], UNIT)
					     : 0;
	pose.quaternion[0] += !pose.quaternion[0];
	incise_fixed_plan_pose(&integers->plan, &integers->state, &pose, now_ns);
}

void incise_integers_begin(struct incise_integers *integers,
			   const struct incise_tick *tick)
{
	integers->tick = (struct incise_fixed_tick){.t_ns = tick->t_ns};
}

void incise_integers_end(const struct incise_integers *integers, struct incise_tick *tick)
{
	const struct incise_fixed_tick *from = &integers->tick;

	to_double(tick->position_mm, from->position, ONE);
	for (int i = 0; i < 4; i++)
		tick->quaternion[i] = from->attitude[i] / UNIT;
	to_double(tick->tool_mm, from->tool, ONE);
	to_double(tick->proxy_mm, from->proxy, ONE);
	to_double(tick->normal, from->normal, UNIT);
	to_double(tick->command_N, from->command, ONE);
	tick->depth_mm = from->depth / ONE;
	tick->velocity_mm_s = from->speed / ONE;
	tick->flags |= from->flags;
	tick->phase = (enum incise_phase)from->phase;
	tick->tool = (enum incise_tool)from->held;
}

bool incise_integers_faded(const struct incise_integers *integers)
{
	const int32_t *last = integers->state.last;

	return integers->state.gain <= 0 && !last[0] && !last[1] && !last[2];
}

void incise_integers_zero(struct incise_integers *integers)
{
	for (int i = 0; i < 3; i++)
		integers->state.last[i] = 0;
}
