// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan's numbers in integers; see integers.h.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include "../base/monotonic.h"
#include "../base/vector.h"
#include "../fixed/vector.h"
#include "integers.h"
#include "plan.h"

#define ONE 65536.0 /* Q16.16 */
#define Q16 ONE
#define UNIT 1073741824.0 /* Q2.30 */
#define Q28 268435456.0
#define LARGEST 2147483647.0 /* of 32 bits */

/* Below this depth the direction from tool to proxy is rounding: see ../tissue/tick.c. */
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

/* A number of a plan: where it stands in both kinds, its scale, and the most that integers hold. */
struct quantity {
	const char *name;
	size_t from, to;
	int n;
	double one, most;
};

#define AT(member)                                      \
	offsetof(struct incise_double_numbers, member), \
		offsetof(struct incise_fixed_numbers, member)
#define PLAIN(member, name)                     \
	{                                       \
		name, AT(member), 1, ONE, 32767 \
	}
#define LENGTH(member, name)                   \
	{                                      \
		name, AT(member), 1, ONE, 4096 \
	}
#define EXTENT(member, name)                   \
	{                                      \
		name, AT(member), 1, ONE, 1000 \
	}

static const struct quantity quantities[] = {
	{"the predictor's gain", AT(filter.alpha), 1, UNIT, 1},
	{"the predictor's gain", AT(filter.beta), 1, ONE, 32767},
	{"the predictor's gain", AT(filter.gamma), 1, 4096, 524287},
	{"the tracker's period", AT(filter.period_ns), 1, 1, LARGEST},
	{"the tracker's latency", AT(filter.latency_ns), 1, 1, LARGEST},
	{"the tracker's gap", AT(filter.gap_ns), 1, 1, LARGEST},
	{"the tracker's gap", AT(filter.ahead_ns), 1, 1, LARGEST},
	{"the calibration's tip_mm", AT(tip), 3, ONE, 4096},
	LENGTH(handle, "tool.handle_mm"),
	LENGTH(leave, "tissue.leave_mm"),
	PLAIN(gain, "tissue.gain"),
	PLAIN(support, "the model's depth"),
	PLAIN(beyond, "the model's slope"),
	PLAIN(account, "the stiffness of all springs"),
	PLAIN(upright, "the membrane's lean"),
	EXTENT(incision.cut_from, "tissue.cut_from_mm"),
	EXTENT(incision.stretch, "tissue.stretch_mm"),
	EXTENT(incision.handle_width, "tool.handle_width_mm"),
	EXTENT(incision.handle_thickness, "tool.handle_thickness_mm"),
	EXTENT(incision.tube, "tool.tube_mm"),
#define FORCE(...)
#define NUMBER(row, i, member, scale, most, key, ...) \
	{"tissue." key, AT(member), 1, scale, most},
#define MORE(member)
#include "../tissue/forces.def"
	{"membrane.point_mm", AT(membrane.point), 3, ONE, 8191},
	LENGTH(membrane.radius, "membrane.radius_mm"),
	LENGTH(membrane.thickness, "membrane.thickness_mm"),
	PLAIN(membrane.stiffness, "the membrane's stiffness"),
	LENGTH(membrane.back_wall, "membrane.back_wall_mm"),
	PLAIN(small, "limits.start_N"),
	LENGTH(force, "limits.force_N"),
	LENGTH(slew, "limits.slew_N_s"),
};

static void convert(struct conversion *c, const struct incise_double_numbers *from,
		    struct incise_fixed_numbers *to)
{
	for (size_t i = 0; i < sizeof(quantities) / sizeof(*quantities); i++) {
		const struct quantity *q = &quantities[i];

		for (int k = 0; k < q->n; k++) {
			double value;
			int32_t whole;

			memcpy(&value,
			       (const char *)from + q->from + (size_t)k * sizeof(value),
			       sizeof(value));
			whole = to_integer(c, q->name, value, q->one, q->most);
			memcpy((char *)to + q->to + (size_t)k * sizeof(whole), &whole,
			       sizeof(whole));
		}
	}
}

/* Trackers from 20 Hz on. */
static void check_tracker(struct conversion *c, const struct incise_fixed_filter *filter)
{
	if (!c->rc && filter->period_ns > INCISE_FIXED_PERIOD_MAX_NS)
		c->rc = incise_error_set(
			c->err, ERANGE,
			"%s: the tracker has %g Hz: integers need at least 20 Hz; set "
			"arithmetic to \"double\"",
			c->plan->scene->path, 1 / c->plan->predict.period_s);
}

/* Depth, or depth and speed, are 0: so plans say it whose format is the first. */
static int32_t inputs_of(uint32_t inputs)
{
	return inputs == INCISE_FIXED_INPUT_DEPTH ||
			       inputs == (INCISE_FIXED_INPUT_DEPTH |
					  INCISE_FIXED_INPUT_SPEED << 4)
		       ? 0
		       : (int32_t)inputs;
}

static void check_cuts(struct conversion *c, int cuts_most)
{
	if (!c->rc && cuts_most > INCISE_FIXED_CUTS_MAX)
		c->rc = incise_error_set(
			c->err, ERANGE,
			"%s: tissue.cuts_most is %d: integers are limited to %d; "
			"reduce it, or set arithmetic to \"double\"",
			c->plan->scene->path, cuts_most, INCISE_FIXED_CUTS_MAX);
}

/*
 * Set the numbers of a plan, without actuators and without a surface that is a mesh: its shape is left a
 * plane. Returns 0; -ERANGE: the message names the number that integers do not hold.
 */
static int set_fixed_numbers(const struct incise_plan *plan,
			     struct incise_fixed_numbers *numbers,
			     struct incise_error *err)
{
	const double top[3] = {0, 0, 1};
	struct incise_double_numbers from = plan->doubles.plan.numbers;
	struct conversion c = {.plan = plan, .err = err};

	/* Limits are rounded down: never above. */
	from.force = floor(from.force * ONE) / ONE;
	from.slew = fmax(floor(from.slew * ONE), 1) / ONE;
	*numbers = (struct incise_fixed_numbers){
		.pose_age_ns = from.pose_age_ns,
		.tick_ns = from.tick_ns,
		.inserts = from.inserts,
		.tube = from.tube,
		.average_ticks = from.average_ticks,
		.printed = from.printed,
		.incision.cuts_most = from.incision.cuts_most,
		.inputs = inputs_of(plan->doubles.plan.inputs[INCISE_CUT]),
		.ramp_ns =
			to_integer(&c, "limits.ramp_ms", from.ramp_ns * 1e-9, 1e9, 2.1),
		.fade_ns =
			to_integer(&c, "limits.fade_ms", from.fade_ns * 1e-9, 1e9, 2.1),
	};
	convert(&c, &from, numbers);
	check_tracker(&c, &numbers->filter);
	check_cuts(&c, from.incision.cuts_most);
	direction(numbers->axis, from.axis);
	direction(numbers->side, from.side);
	direction(numbers->up, from.up);
	direction(numbers->membrane.normal,
		  from.membrane.thickness > 0 ? from.membrane.normal : top);
	set_shape(&c, &numbers->shape);
	if (!c.rc && (!incise_fixed_numbers_good(numbers) ||
		      (from.membrane.thickness > 0 && !numbers->membrane.thickness)))
		c.rc = incise_error_set(
			err, ERANGE,
			"%s: the combination of its numbers exceeds integers; set "
			"arithmetic to \"double\"",
			plan->scene->path);
	return c.rc;
}

/* --- as a file ---------------------------------------------------------------------------- */

/* The places where a contact begins are certified up to here, mm. */
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
	c.rc = set_fixed_numbers(plan, numbers, err);
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
		/* The normal at the place itself, not a direction from the tool. */
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

/* --- running ----------------------------------------------------------------------------- */

struct incise_integers *incise_integers_new(const struct incise_plan *plan,
					    struct incise_error *err)
{
	struct incise_integers *integers = calloc(1, sizeof(*integers));
	int rc;

	if (!integers)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a plan");
	rc = set_fixed_numbers(plan, &integers->plan.numbers, err);
	if (rc) {
		free(integers);
		errno = -rc;
		return NULL;
	}
	integers->plan.has_model = plan->fixed;
	if (plan->fixed)
		integers->plan.model = *plan->fixed;
	integers->plan.texture = plan->texture;
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

#include "../number/fixed_kind.h"
#define OWN(of) ((of)->integers)
#define STAGE in_integers
#define D_LEAST 1

static int32_t n_from(double value)
{
	return near_integer(value, ONE);
}

static int32_t d_from(double value)
{
	return near_integer(value, UNIT);
}

static double n_to(int32_t value)
{
	return value / ONE;
}

static double d_to(int32_t value)
{
	return value / UNIT;
}

static INCISE_REALTIME int set_tip(struct incise_plan *plan, const double tip_mm[3])
{
	for (int i = 0; i < 3; i++)
		if (!(fabs(tip_mm[i]) <= 4096))
			return -EINVAL;
	v3_copy(plan->doubles.plan.numbers.tip, tip_mm);
	to_integers(plan->integers->plan.numbers.tip, tip_mm);
	return 0;
}

#include "run.proto.c"
