// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The certified error of a plan in integers: how far its force can be from the force of the same plan in double, tick
 * by tick, on the same poses. The stages of lib/tissue say it themselves, as they run on the numbers of
 * ../number/bounded.h: from a state with the largest possible errors, along all paths.
 *
 *   a pose ─▶ filter: Σ |Aʲ| r ─▶ predict ─▶ contact ─▶ normal ─▶ membrane ─▶ forces ─▶ the largest
 *                 ▲                             │                     ▲         error
 *            what adds up                       └─ opening, front, anchor: what a stage keeps
 *
 * A stage that keeps something from tick to tick says here how far off that becomes: no further without a
 * contraction, or for as long as a contact lasts. Else errors in each tick would add up.
 */
#define _Static_assert static_assert
extern "C" {
#include "../base/vector.h"
#include "../fixed/input.h"
#include "plan.h"
}
#include <stdlib.h>
#include "../number/bounded.h"

/* --- the kind ----------------------------------------------------------------------------- */

struct T(cut) {
	num at_mm[3];
	dir along[3], side[3], normal[3];
	num from_mm, to_mm;
	int32_t incision;
	struct {
		num depth_mm, open_mm;
	} place[1];
};

struct T(opening) {
	int32_t in, cut;
	num at_mm, depth_mm, open_mm, length_mm;
	dir along[3];
};

#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wunused-function"
#include "../tissue/touch.proto.h"
#undef T_AXES_MAX
#undef T_AVERAGE_MAX
#undef T_FRONT_CUTS
#undef T_PUNCTURES
#undef T_WITHDRAWS
/* The certificate's own tick, which no other file calls. */
namespace
{
#include "../tissue/tick.proto.h"

/* Errors of a filter's state: mm, mm/s, mm/s². */
struct errors {
	double x, v, a;
};

struct T(plan) {
	struct T(numbers) numbers;
	bool has_model;
	const struct incise_plan *of;
	double reach_mm;
	double bend;	     /* between facets of the surface that meet */
	struct errors poses; /* of what is shown, by their rounding */
	/* The error of a normal at any tick of the contact. */
	double turned_in, turned_own;
	const struct incise_fixed_texture *texture; /* or NULL */
	double steepest;			    /* slope of its τ, 1/mm */
};

#include "../tissue/predict.proto.c"
#include "../tissue/front.proto.c"
#undef BESIDE
#include "../tissue/incision.proto.c"
#include "../tissue/tick.proto.c"

/* --- conditions of the bound; see incise_plan_bound() -------------------------------------- */

/* A hand's speed at most, mm/s, and its largest acceleration that the filter lets pass, mm/s². */
#define SPEED_MM_S 1000
#define HARD_MM_S2 100000

/* A hand's own acceleration, at most: errors of its direction count by that. Below this speed the direction counts
 * in proportion to the speed: see lib/tissue/predict.c. */
#define HAND_MM_S2 2000
#define SLOW_MM_S 5

/* Sine of 6°: a place where a tool enters is as uncertain along the surface as its depth divided by this. */
#define ENTERS 0.1

/* A surface's own place is no farther from a contact, mm: a rounded direction counts by that. */
#define AWAY_MM 1024

/* Ticks of a contact in which the skin's anchor is rounded: an hour at 1 kHz. */
#define ANCHOR_TICKS 3.6e6

static double lsb_mm(void)
{
	return lsb(16);
}

/* --- surface and model --------------------------------------------------------------------- */

/* A touch of this depth, with a normal that is off by so much, and a point. */
static void set_touch(struct T(touch) *touch, const struct T(plan) *plan, uint32_t depth,
		      const struct bounds &tool, double turned_in, double turned_own,
		      double glides)
{
	touch->depth = num::of(depth);
	set_ball(touch->normal, ball(1, fmin(turned_in, 2),
				     fmin(turned_own, 2) + sqrt3() * lsb(30), 30));
	set_ball(touch->point,
		 ball(plan->reach_mm, glides * tool.in,
		      glides * tool.own + 4 * sqrt3() * lsb_mm() + AWAY_MM * lsb(29),
		      16));
}

/* The direction to the nearest point of a mesh turns by no more than its facets do. */
static double turned_by(double by_mm, double left_mm, double bend)
{
	return left_mm > 0 ? fmin(by_mm / left_mm, bend) : bend;
}

/* Twice the largest difference between the normals of a facet and of a corner: of facets that meet. */
static double bend_of(const struct mesh *mesh)
{
	double most = 0;

	for (uint32_t i = 0; mesh && i < mesh->n_triangles; i++) {
		const uint32_t *corner = mesh->corner[i];
		double n[3], off[3];

		triangle_area_normal(n, mesh->vertex[corner[0]], mesh->vertex[corner[1]],
				     mesh->vertex[corner[2]]);
		v3_unit(n, n, 0);
		for (int k = 0; k < 3; k++) {
			v3_sub(off, n, mesh->normal[corner[k]]);
			most = fmax(most, 2 * v3_length(off));
		}
	}
	return fmin(most, 2);
}

/*
 * The nearest point of a surface: the depth is off by no more than the tool is. On a capsule the normal turns
 * by that over what is left of the radius, half of it at least, and the point goes by twice as much. On a mesh the
 * normal is the direction from tool to point, in proportion to the depth.
 */
void T(surface_move)(const struct T(plan) *plan, struct T(proxy) *proxy,
		     const num tool[3])
{
	const struct incise_surface *surface = plan->of->surface;
	struct bounds at_tool = at(ball_of(tool));
	double left_mm;
	uint32_t depth =
		put({-at(plan->numbers.leave.id).high, plan->reach_mm, at_tool.in,
		     at_tool.own + 4 * lsb_mm() + AWAY_MM * lsb(29), 16, false});

	proxy->touching = true;
	proxy->began = choose(2);
	if (surface->mesh) {
		left_mm = part_of(depth);
		set_touch(&proxy->touch, plan, depth, at_tool,
			  turned_by(2 * at_tool.in, left_mm, plan->bend),
			  turned_by(2 * at_tool.own + 4 * sqrt3() * lsb_mm(), left_mm,
				    plan->bend),
			  1);
	} else if (surface->kind == INCISE_SURFACE_PLANE) {
		set_touch(&proxy->touch, plan, depth, at_tool, 0, 0, 1);
	} else {
		set_touch(&proxy->touch, plan, depth, at_tool, plan->turned_in,
			  plan->turned_own, 2);
	}
	if (!proxy->began)
		return;
	proxy->first = proxy->touch;
	proxy->first.depth = 0;
	set_ball(proxy->first.point,
		 ball(0, at_tool.in / ENTERS,
		      (at_tool.own + 4 * sqrt3() * lsb_mm()) / ENTERS, 16));
}

/* Heights are asked for to choose a tool, which is no part of an error. */
num T(surface_above)(const struct T(plan) *, const num place[3])
{
	fail("what it asks for is in no bound");
	return place[0];
}

void T(surface_restart)(const struct T(plan) *)
{
}

/* Along the motion: by the vector's error, and by the error of the direction. */
num T(input_acceleration)(const num velocity[3], const wide acceleration[3])
{
	struct bounds v = at(ball_of(velocity)), a = at(ball_of(acceleration));

	a.in += paths->hard_mm_s2;
	return num::of(put(
		{-32768, 32768, a.in + HAND_MM_S2 * v.in / SLOW_MM_S,
		 a.own + HAND_MM_S2 * v.own / SLOW_MM_S +
			 lsb(INCISE_FIXED_INPUT_ACCELERATION_BITS) +
			 ldexp(HARD_MM_S2, -INCISE_FIXED_INPUT_ACCELERATION_SHARE_BITS),
		 16, false}));
}

num T(input_tilt)(const dir axis[3], const dir normal[3])
{
	struct bounds a = at(ball_of(axis)), n = at(ball_of(normal));

	return num::of(put({0, 180, (a.in + n.in) * 180 / M_PI,
			    (a.own + n.own) * 180 / M_PI + INCISE_FIXED_INPUT_TILT_DEG,
			    16, false}));
}

/* A contact may begin a tick earlier: of the longest tick there is, that is. */
num T(input_time)(int64_t, int64_t)
{
	return num::of(put({0, 32767, paths->tick_s, 2 * lsb_mm(), 16, false}));
}

wide T(input_path)(wide path, num, int64_t, int64_t)
{
	return path;
}

/* A mean is as far off as its speeds; a contact that begins a tick earlier has one speed more, a tick's change away. */
num T(input_mean_speed)(wide, num speed, int64_t, int64_t)
{
	struct bounds s = at(speed.id);

	s.in += HAND_MM_S2 * paths->tick_s;
	s.own += lsb_mm() + ldexp(most_of(s), -INCISE_FIXED_INPUT_MEAN_SPEED_SHARE_BITS);
	return num::of(put(s));
}

/* The tip is as far off as settle_tear() says; at this tick it is no farther away than the tissue gives way. */
void T(stage_fracture)(const struct T(plan) *plan, struct T(state) *state,
		       struct T(tick) *tick)
{
	const struct T(line) *line = &state->front.line;
	struct bounds stretch =
		at(n_sub(place_along(line, tick->tool), state->tears.tip).id);

	if (tick->phase != INCISE_PHASE_CUTTING)
		return;
	stretch.high = most_of(at(n_times(plan->numbers.gives, state->depth).id));
	stretch.low = -stretch.high;
	push(state, n_times(plan->numbers.fracture, num::of(put(stretch))), line->along);
}

uint32_t T(model_inputs)(const struct T(plan) *plan, int32_t phase)
{
	return plan->of->doubles.plan.inputs[phase];
}

/* By the steepest slope of each input, and the rounding of its table. */
num T(model_force)(const struct T(plan) *plan, int32_t phase, const num *x, bool *)
{
	double gain = plan->of->gain,
	       most_N = plan->of->unloading_N_mm * plan->reach_mm / gain;
	struct bounds force = {-most_N, most_N, 0, 0, 16, false};
	uint32_t kinds = T(model_inputs)(plan, phase);

	if (!(gain > 0))
		return 0;
	for (int i = 0; kinds; i++, kinds >>= 4) {
		double slope = plan->of->input_slope[(kinds & 15) - 1] / gain;

		force.in += slope * at(x[i].id).in;
		force.own += slope * at(x[i].id).own;
	}
	force.own += incise_fixed_bound(plan->of->fixed) + lsb_mm() / 2;
	return num::of(put(force));
}

/* A texture is as far off as its steepest tooth goes in the error of the way, and no farther than it goes at all. */
num T(texture_at)(const struct T(plan) *plan, const struct T(way) *way, num *factor)
{
	double most = (double)plan->texture->most / INCISE_TEXTURE_ONE;
	struct bounds s = at(way->most.id);

	*factor = num::of(
		put({0, ldexp(plan->texture->factor_most, -16), 0, 0, 16, false}));
	return num::of(
		put({1 - most, 1 + most, fmin(plan->steepest * s.in, 2 * most),
		     fmin(plan->steepest * s.own, 2 * most) + lsb_mm() / 2, 16, false}));
}

static void set_texture(struct T(plan) *plan)
{
	const struct incise_fixed_texture *texture = plan->of->texture;
	int steepest = 0;

	plan->texture = texture;
	for (int i = 0; texture && i < INCISE_TEXTURE_KNOTS; i++) {
		int rise =
			texture->knot[(i + 1) % INCISE_TEXTURE_KNOTS] - texture->knot[i];

		steepest = abs(rise) > steepest ? abs(rise) : steepest;
	}
	if (texture)
		plan->steepest = (double)steepest / INCISE_TEXTURE_ONE /
				 ldexp(1, texture->step_shift - 16);
}

/* --- the plan's numbers -------------------------------------------------------------------- */

template <int Bits> static void set(bounded<Bits> &to, double value)
{
	to = bounded<Bits>::of(constant(value, Bits));
}

static void set_unit(dir to[3])
{
	set_ball(to, ball(1, 0, sqrt3() * lsb(31), 30));
}

static void set_numbers(struct T(plan) *plan)
{
	const struct incise_double_numbers *from = &plan->of->doubles.plan.numbers;
	struct T(numbers) *to = &plan->numbers;

	to->pose_age_ns = INT64_MAX;
	to->inserts = from->inserts;
	to->average_ticks = from->average_ticks;
	to->printed = from->printed;
	to->phases = from->phases;
	set(to->filter.alpha, from->filter.alpha);
	set(to->filter.beta, from->filter.beta);
	set(to->filter.gamma, from->filter.gamma);
	to->filter.period_ns = from->filter.period_ns;
	to->filter.latency_ns = from->filter.latency_ns;
	to->filter.gap_ns = from->filter.gap_ns;
	to->filter.ahead_ns = from->filter.ahead_ns;
	if (v3_length(from->tip) > 0)
		set_ball(to->tip, ball(v3_length(from->tip), 0, rounding(16, true), 16));
	set_unit(to->axis);
	set_unit(to->side);
	set(to->handle, from->handle);
	set(to->leave, from->leave);
	set(to->gain, from->gain);
	set(to->support, from->support);
	set(to->beyond, from->beyond);
	set(to->incision.stretch, from->incision.stretch);
	set(to->incision.cut_from, from->incision.cut_from);
	set(to->incision.handle_width, from->incision.handle_width);
	set(to->incision.handle_thickness, from->incision.handle_thickness);
	set(to->incision.tube, from->incision.tube);
#define FORCE(...)
#define NUMBER(row, i, member, ...) set(to->member, from->member);
#define MORE(member)
#include "../tissue/forces.def"
#undef FORCE
#undef NUMBER
#undef MORE
	set_ball(to->membrane.point, ball(plan->reach_mm, 0, sqrt3() * lsb(17), 16));
	set_unit(to->membrane.normal);
	set(to->upright, from->upright);
	set(to->membrane.radius, from->membrane.radius);
	set(to->membrane.thickness, from->membrane.thickness);
	set(to->membrane.stiffness, from->membrane.stiffness);
	set(to->membrane.back_wall, from->membrane.back_wall);
	plan->has_model = plan->of->doubles.plan.has_model;
	set_texture(plan);
}

/* --- poses: the state of a filter ---------------------------------------------------------- */

/* A state of the filter, or its errors, from one pose to the next: A = (I - K C) F. */
static struct errors step_bound(const struct incise_predict *p, const struct errors &from)
{
	double T = p->period_s, x = from.x + from.v * T + from.a * T * T / 2;

	return {x - p->alpha * x, from.v + from.a * T - p->beta / T * x,
		from.a - p->gamma / (T * T) * x};
}

static struct errors sum_of(const struct errors &a, double share, const struct errors &b)
{
	return {a.x + share * b.x, a.v + share * b.v, a.a + share * b.a};
}

static struct errors sizes(const struct errors &of)
{
	return {fabs(of.x), fabs(of.v), fabs(of.a)};
}

static struct errors larger(const struct errors &a, const struct errors &b)
{
	return {fmax(a.x, b.x), fmax(a.v, b.v), fmax(a.a, b.a)};
}

/* A sum over poses has ended; its rest falls by more than 1/10 in ten poses, as gains make it. */
static bool ends(const struct errors &sum, const struct errors &last)
{
	return last.x <= 1e-9 * sum.x && last.v <= 1e-9 * sum.v && last.a <= 1e-9 * sum.a;
}

#define POSES_MOST 100000
#define REST 1.001

/*
 * The filter is linear: the addition r of each pose passes through A for each later pose, so that Σ |Aʲ| r bounds the
 * sum, for poses that come a period apart. Infinite where it does not settle.
 */
static struct errors settle_filter(const struct incise_predict *p, const struct errors &r)
{
	struct errors x = {1, 0, 0}, v = {0, 1, 0}, a = {0, 0, 1}, sum = {}, last;

	for (int j = 0; j < POSES_MOST; j++) {
		last = sum_of({}, r.x, sizes(x));
		last = sum_of(last, r.v, sizes(v));
		last = sum_of(last, r.a, sizes(a));
		sum = sum_of(sum, 1, last);
		if (ends(sum, last))
			return sum_of({}, REST, sum);
		x = step_bound(p, x);
		v = step_bound(p, v);
		a = step_bound(p, a);
	}
	return {INFINITY, INFINITY, INFINITY};
}

/* A state as it is shown at this age, with a share of the rest that is to blend out. */
static struct errors shown_of(const struct errors &state, double age_s, double share,
			      const struct errors &left)
{
	struct errors now = {state.x + age_s * (state.v + age_s * state.a / 2),
			     state.v + age_s * state.a, state.a};

	return sum_of(now, share, left);
}

/*
 * The rounding of poses as it is shown: for ±1 each, the sum of their largest effects, from the arrival of a pose to
 * the next. That is less than the sum in the filter's state, where place, speed and acceleration of one pose's error
 * count apart.
 *
 *   place(age) = x + v age + a age²/2 + share · (what was shown when the pose arrived - what is)
 */
static struct errors respond(const struct incise_predict *p, double ahead_s)
{
	double T = p->period_s, begin = (double)p->latency_ns * 1e-9, end = begin + T;
	double top = fmin(ahead_s, end), from = fmin(ahead_s, begin);
	struct errors now = {p->alpha, p->beta / T, p->gamma / (T * T)}, before = {},
		      sum = {};

	for (int j = 0; j < POSES_MOST; j++) {
		struct errors left = sum_of(shown_of(before, top, 0, {}), -1,
					    shown_of(now, from, 0, {}));
		/* The vertex of the parabola, where it lies between. */
		double vertex = fmin(fmax((left.x / T - now.v) / now.a, from), top);
		struct errors most = larger(
			larger(sizes(shown_of(now, from, 1, left)),
			       sizes(shown_of(now, top, (end - top) / T, left))),
			larger(sizes(shown_of(now, top, 0, left)),
			       sizes(shown_of(now, vertex, (end - vertex) / T, left))));

		sum = sum_of(sum, 1, most);
		if (ends(sum, most))
			return sum_of({}, REST, sum);
		before = now;
		now = step_bound(p, now);
	}
	return {INFINITY, INFINITY, INFINITY};
}

#define BEGIN_NS 10000000000

static void set_filter(struct T(predict) *p, const struct T(plan) *plan,
		       const struct errors &e)
{
	T(predict_init)(p);
	p->started = true;
	p->arrival_ns = BEGIN_NS;
	p->t_ns = BEGIN_NS - (int64_t)plan->numbers.filter.latency_ns;
	set_ball(p->x, ball(plan->reach_mm, e.x, 0, 32));
	set_ball(p->v, ball(SPEED_MM_S, e.v, 0, 20));
	set_ball(p->a, ball(HARD_MM_S2, e.a, 0, 16));
}

/* The rest to blend out: as shown when a pose arrived, less the filter's value then. */
static void set_shown(wide to[3], const wide before[3], const wide now[3], double most,
		      int bits)
{
	struct bounds b = at(ball_of(before)), n = at(ball_of(now));

	set_ball(to,
		 ball(most, b.in + n.in, b.own + n.own + sqrt3() * lsb(bits + 1), bits));
}

static struct errors errors_of(const struct T(predict) *p)
{
	return {off(at(ball_of(p->x))), off(at(ball_of(p->v))), off(at(ball_of(p->a)))};
}

/* The errors that a pose adds to a filter without any, of the end that is the farthest from the tracker's sensor. */
static struct errors add_pose_of(const struct T(plan) *plan, double rounded_mm)
{
	struct T(state) from = {}, to;
	struct T(pose) pose = {};
	struct errors r = {};
	struct fork fork;

	set_filter(&from.scalpel, plan, r);
	from.ends.handle = from.scalpel;
	pose.t_ns = BEGIN_NS + (int64_t)plan->numbers.filter.period_ns;
	set_ball(pose.position, ball(plan->reach_mm, 0, rounded_mm, 16));
	set_ball(pose.quaternion, ball(1, 0, 2 * lsb(31), 30), 4);
	fork.begin();
	do {
		to = from;
		if (T(plan_pose)(plan, &to, &pose, pose.t_ns) == INCISE_FIXED_POSE_TAKEN)
			r = larger(r, errors_of(plan->numbers.inserts ? &to.ends.handle
								      : &to.scalpel));
	} while (fork.next());
	return r;
}

/* The filter's own rounding, of a pose that is not rounded. */
static struct errors add_exact(const struct T(plan) *plan)
{
	struct T(predict) p;
	num position[3];
	dir attitude[4];

	set_filter(&p, plan, {});
	set_ball(position, ball(plan->reach_mm, 0, 0, 16));
	set_ball(attitude, ball(1, 0, 0, 30), 4);
	correct(&p, &plan->numbers.filter, BEGIN_NS, position);
	return errors_of(&p);
}

/*
 * The errors of the filter by its own rounding, and the effect of the rounding of poses on its output.
 * An attitude comes from the last poses; its errors do not add up.
 */
static void set_poses(struct T(plan) *plan, struct T(state) *state)
{
	const struct T(filter) *filter = &plan->numbers.filter;
	const struct incise_predict *of = &plan->of->predict;
	int64_t period_ns = (int64_t)filter->period_ns;
	struct T(predict) *p = &state->scalpel;
	struct errors own = add_exact(plan), all = add_pose_of(plan, sqrt3() * lsb(17));
	wide x[3], v[3], shown[3], speed[3];

	plan->poses = sum_of({}, (all.x - own.x) / of->alpha,
			     respond(of, (double)filter->ahead_ns * 1e-9));
	set_filter(p, plan, settle_filter(of, own));
	show(p, filter, BEGIN_NS + period_ns, shown, speed);
	extrapolate(p, filter, BEGIN_NS, x, v);
	set_shown(p->x_shown, shown, x, INCISE_PREDICT_JUMP_MM, 24);
	set_shown(p->v_shown, speed, v, SPEED_MM_S, 20);
	set_shown(p->a_shown, p->a, p->a, HARD_MM_S2, 16);
	set_ball(p->q, ball(1, 0, 4 * lsb(30), 30), 4);
	set_ball(p->q_shown, ball(1, 0, 8 * lsb(30), 30), 4);
}

/* --- a tick -------------------------------------------------------------------------------- */

/* A tick in one phase, and the state of its stages. */
struct tick {
	struct T(plan) plan;
	struct T(state) state;
	struct T(tick) tick;
	/* Found along all paths: the force, and the numbers that settling needs. */
	struct worst force, normal, depth, cutting;
};

/*
 * The opening of a tool: where the blade once was, which is as uncertain along it as where it entered. A place's
 * depth and width are the largest of many ticks, a stretch's depth the least of its places'; the error of a maximum or
 * minimum is not larger than theirs. Length only decides.
 */
static void set_opening(const struct T(plan) *plan, struct T(state) *state,
			const struct T(tick) *tick)
{
	struct T(opening) *opening = &state->opening;
	struct bounds tool = at(ball_of(tick->tool)), flat = at(ball_of(state->flat)),
		      depth = at(state->depth.id);
	double turned_mm;

	opening->in = choose(2);
	if (!opening->in)
		return;
	set_ball(opening->along,
		 ball(1, fmin((flat.in + plan->turned_in) / STANDS, 2),
		      (flat.own + plan->turned_own) / STANDS + 4 * lsb(30), 30));
	opening->depth_mm =
		num::of(put({0, plan->reach_mm, depth.in + tool.in / ENTERS,
			     depth.own + tool.own / ENTERS + lsb_mm(), 16, false}));
	turned_mm = plan->of->scene->tool.handle_width_mm *
		    (flat.in + flat.own + at(opening->along[0].id).in +
		     at(opening->along[0].id).own);
	opening->open_mm = num::of(put({0, plan->reach_mm, depth.in + turned_mm,
					depth.own + lsb_mm(), 16, false}));
	state->tightness = joined(state, [&] {
		return T(incision_tightness)(&plan->numbers.incision, opening,
					     (enum incise_tool)state->held);
	});
}

/* The cut in which a blade is: of it only the depth counts, of a place as of an opening. */
static void set_open(const struct T(plan) *plan, struct T(state) *state,
		     const struct T(tick) *tick)
{
	struct bounds tool = at(ball_of(tick->tool)), depth = at(state->depth.id);

	state->open = 0;
	if (plan->numbers.inserts && !plan->has_model && choose(2))
		state->open = num::of(
			put({0, plan->reach_mm, depth.in + tool.in / ENTERS,
			     depth.own + tool.own / ENTERS + lsb_mm(), 16, false}));
}

/* Where the tool meets the membrane, at this tick or before: it changes depth and force. */
static void meet_membrane(const struct T(plan) *plan, struct T(state) *state,
			  struct T(tick) *tick)
{
	const struct T(state) from = *state;
	struct worst depth = {}, force = {};
	struct fork fork;

	if (!at(plan->numbers.membrane.thickness.id).high || !choose(2))
		return;
	fork.begin();
	do {
		*state = from;
		state->membrane.punctured = choose(2);
		T(stage_membrane)(plan, state, tick);
		if (choose(2)) {
			state->proxy.began = false;
			state->depth = from.depth;
			set_ball(state->force, 0);
			T(stage_membrane)(plan, state, tick);
		}
		if (!paths->dead && state->membrane.hit) {
			take(&depth, state->depth.id);
			take(&force, ball_of(state->force));
		}
	} while (fork.next());
	*state = from;
	state->membrane.hit = true;
	state->depth = worst_of(depth);
	set_ball(state->force, ball(force.high, force.in, force.own, 16));
}

/* As far as the forces, in which @tick's numbers are complete. */
static void run_contact(const struct T(plan) *plan, struct T(state) *state,
			struct T(tick) *tick)
{
	dir now[3];

	T(stage_contact)(plan, state, tick);
	/* The numbers of the ticks before this one have the same errors as any. */
	d_copy(now, state->sn);
	if (plan->numbers.average_ticks > 1)
		set_ball(state->sn, ball(1, plan->turned_in, plan->turned_own, 30));
	for (int i = 1; i < plan->numbers.average_ticks; i++)
		T(stage_normal)(plan, state, tick);
	d_copy(state->sn, now);
	T(stage_normal)(plan, state, tick);
	if (state->held != INCISE_TOOL_BLADE)
		set_opening(plan, state, tick);
	else
		set_open(plan, state, tick);
	meet_membrane(plan, state, tick);
}

/* At a way that is as far off as at any tick: see settle_way(). */
static void run_texture(const struct T(plan) *plan, struct T(state) *state)
{
	if (!plan->texture || state->held != INCISE_TOOL_BLADE)
		return;
	state->fresh = joined(state, [&] { return advance(state); });
	state->tooth = T(texture_at)(plan, &state->front.way, &state->factor);
	state->front.rises = choose(2);
	state->front.climbs = true;
}

typedef void stage(const struct T(plan) *, struct T(state) *, struct T(tick) *);

/* Run a stage along all of its paths, and join its forces. The state's errors cover its numbers. */
static void join_force(stage *run, const struct T(plan) *plan, struct T(state) *state,
		       struct T(tick) *tick)
{
	const struct T(state) from = *state;
	struct worst force = {};
	struct fork fork;

	fork.begin();
	do {
		*state = from;
		run(plan, state, tick);
		if (!paths->dead)
			take(&force, ball_of(state->force));
	} while (fork.next());
	*state = from;
	set_ball(state->force, ball(force.high, force.in, force.own, 16));
}

static void run_forces(struct tick *t, struct T(state) *state, struct T(tick) *tick)
{
	const struct T(plan) *plan = &t->plan;

#define FORCE(row, name, ...)                                              \
	if (INCISE_FORCE_##row == INCISE_FORCE_SKIN)                       \
		take(&t->normal, v_along(state->force, state->normal).id); \
	join_force(T(stage_##name), plan, state, tick);
#define NUMBER(...)
#define MORE(member)
#include "../tissue/forces.def"
#undef FORCE
#undef NUMBER
#undef MORE
}

static void run_paths(struct tick *t)
{
	struct fork fork;

	t->force = t->normal = t->depth = t->cutting = {};
	fork.begin();
	do {
		struct T(state) state = t->state;
		struct T(tick) tick = t->tick;

		run_contact(&t->plan, &state, &tick);
		run_texture(&t->plan, &state);
		if (t->plan.has_model && at(t->plan.numbers.unloading.id).high > 0 &&
		    state.held == INCISE_TOOL_BLADE)
			take(&t->cutting,
			     T_JOINED(&state,
				      texture(&t->plan, &state, &tick,
					      cutting_force(&t->plan, &state, &tick)))
				     .id);
		run_forces(t, &state, &tick);
		if (paths->dead)
			continue;
		take(&t->depth, state.depth.id);
		take(&t->force, ball_of(state.force));
	} while (fork.next());
}

/* --- the state of stages ------------------------------------------------------------------- */

/*
 * The front's rest stays where it is, to the bit, or is set by depth and force of this tick; rounding does not
 * move it against the way that it is set. So nothing adds up: as far off as the worst of both.
 */
static void settle_front(struct tick *t)
{
	struct fork fork;
	const struct T(numbers) *numbers = &t->plan.numbers;
	uint32_t begin = paths->n;
	double rest = 0, cut = 0, reach = t->plan.reach_mm;
	struct T(front) *front = &t->state.front;
	double way = off(at(ball_of(t->state.p0))) + 4 * off(at(front->line.to.id));
	bool more = true;

	for (int i = 0; i < 20 && more; i++) {
		struct worst rests = {}, cuts = {};
		num depth, cutting;

		paths->n = begin;
		front->depth = num::of(put({0, reach, t->depth.both, 0, 16, false}));
		front->rest = num::of(put({-reach, reach, rest, 0, 16, false}));
		front->cut = num::of(put({0, reach, cut, 0, 16, false}));
		depth = worst_of(t->depth);
		cutting = worst_of(t->cutting);
		fork.begin();
		do {
			struct T(front) next = *front;
			num advance = 0;

			if (choose(2))
				advance = num::of(put({0, 1, 0, 0, 16, false}));
			next.climbs = t->plan.texture && choose(2);
			next.rises = next.climbs;
			T(front_force)(&next, numbers->unloading, numbers->friction,
				       depth, advance, cutting);
			if (paths->dead)
				continue;
			take(&rests, next.rest.id);
			take(&cuts, next.cut.id);
		} while (fork.next());
		more = rests.both > rest * (1 + 1e-9) || cuts.both > cut * (1 + 1e-9);
		rest = fmax(rest, rests.both);
		cut = fmax(cut, cuts.both);
	}
	front->rest = num::of(put({-reach, reach, rest + way, 0, 16, false}));
	front->cut = num::of(put({0, reach, cut + way, 0, 16, false}));
	if (more)
		fail("what it asks for is in no bound");
}

/*
 * The way of the front is the largest of sums of a depth and the length of a line with the way to its side, in all
 * ticks together: no more than their errors add up; of both ways, which are across each other, √2 of one.
 */
static void settle_way(struct tick *t)
{
	const struct T(line) *line = &t->state.front.line;
	double off_mm =
		t->depth.both + off(at(line->from.id)) + 1.5 * off(at(line->to.id));
	num way = num::of(put({0, 4 * t->plan.reach_mm, off_mm, 0, 16, false}));

	t->state.front.way.most = t->state.front.way.before = way;
}

/*
 * The skin's anchor begins where the contact does, which is uncertain along the skin, and goes on with the errors
 * of tool, slip and rounding. A hand that circles it at the slip R = μ N / K draws it round on √(ρ² - R²): from
 * ρ = R on an error δ of either makes up to √(2 R δ) of it.
 */
static void settle_skin(struct tick *t)
{
	const struct incise_double_numbers *numbers = &t->plan.of->doubles.plan.numbers;
	struct bounds tool = at(ball_of(t->tick.tool));
	double e_mm = off(tool), pull_N = numbers->skin_friction * t->normal.both,
	       slip_mm = numbers->skin_friction * t->normal.high / numbers->skin,
	       off_mm = 4 * e_mm + 8 * lsb_mm() + ldexp(ANCHOR_TICKS, -33) +
			pull_N / numbers->skin;

	set_ball(t->state.anchor,
		 ball(t->plan.reach_mm,
		      e_mm / ENTERS + off_mm + sqrt(2 * slip_mm * off_mm), 0, 32));
}

/*
 * The tip of a tear stays, to the bit, or is set by blade and depth of this tick, and by depths of its places, which are
 * maxima over ticks before; a place ends at the same bit of both lines, which are as far apart as where they began.
 */
static void settle_tear(struct tick *t)
{
	num s = place_along(&t->state.front.line, t->tick.tool);
	double off_mm = 2 * off(at(s.id)) +
			2 * most_of(at(t->plan.numbers.gives.id)) * t->depth.both +
			off(at(t->plan.numbers.gives.id)) * t->plan.reach_mm +
			off(at(ball_of(t->state.p0))) + 8 * lsb_mm();

	t->state.tears.tip =
		num::of(put({-t->plan.reach_mm, t->plan.reach_mm, off_mm, 0, 16, false}));
}

/*
 * A cut that is remembered was the front's own, so that its numbers are as far off as that one's; which of them holds
 * the blade is a decision. The line of a cut began where the contact did; from there both ends are as uncertain as
 * the tool. Its length is the rise of the front in all ticks together: no more than that adds up.
 */
static void set_line(struct T(state) *state, const struct T(tick) *tick, double reach,
		     double turned_off)
{
	struct T(line) *line = &state->front.line;
	struct bounds tool = at(ball_of(tick->tool)), flat = at(ball_of(state->flat));
	double turned = (off(flat) + turned_off + 4 * lsb(30)) / STANDS;
	double off_mm = off(tool) + 8 * lsb_mm() + reach * turned;

	line->there = true;
	set_ball(line->at, ball(reach, 0, 0, 16));
	set_ball(line->side, ball(1, flat.in, flat.own, 30));
	set_ball(line->along, ball(1, turned, 0, 30));
	line->from = num::of(put({-reach, 0, off_mm, 0, 16, false}));
	line->to = num::of(put({0, reach, off_mm, 0, 16, false}));
}

/* At half of a capsule's radius; on a mesh at any depth. */
static void set_turned(struct T(plan) *plan, const struct bounds &tool)
{
	const struct incise_surface *surface = plan->of->surface;
	double left_mm = surface->capsule.radius / 2;

	plan->turned_in = plan->turned_own = 0;
	if (surface->mesh) {
		plan->turned_in = plan->bend;
	} else if (surface->kind != INCISE_SURFACE_PLANE) {
		plan->turned_in = tool.in / left_mm;
		plan->turned_own = (tool.own + 4 * sqrt3() * lsb_mm()) / left_mm;
	}
}

static void farther(num v[3], double by)
{
	struct bounds of = at(ball_of(v));

	of.in += by;
	set_ball(v, put(of));
}

static double bound_of(struct tick *t, int32_t held)
{
	const struct incise_double_numbers *numbers = &t->plan.of->doubles.plan.numbers;
	const struct T(state) from = t->state;
	uint32_t begin = paths->n;
	struct bounds tool;

	t->state.held = held;
	t->tick = {};
	t->tick.t_ns = BEGIN_NS + (int64_t)numbers->filter.period_ns;
	T(stage_predict)(&t->plan, &t->state, &t->tick);
	farther(t->tick.position, t->plan.poses.x);
	farther(t->tick.tool, t->plan.poses.x);
	farther(t->state.velocity, t->plan.poses.v);
	t->tick.speed = v_length(t->state.velocity);
	tool = at(ball_of(t->tick.tool));
	set_turned(&t->plan, tool);
	/* Where the contact began, if it did before. */
	set_ball(t->state.p0, ball(0, tool.in / ENTERS,
				   (tool.own + 4 * sqrt3() * lsb_mm()) / ENTERS, 16));
	set_ball(t->state.entry,
		 ball(1, t->plan.turned_in, t->plan.turned_own + 4 * lsb(30), 30));
	d_turn(t->state.side, t->state.attitude, t->plan.numbers.side);
	d_copy(t->state.flat, t->state.side);
	set_line(&t->state, &t->tick, t->plan.reach_mm,
		 t->plan.turned_in + t->plan.turned_own);
	set_ball(t->state.anchor, ball(t->plan.reach_mm, 0, 0, 32));
	t->state.tears.tip =
		num::of(put({-t->plan.reach_mm, t->plan.reach_mm, 0, 0, 16, false}));
	run_paths(t);
	if (t->plan.texture) {
		settle_way(t);
		run_paths(t);
	}
	if (t->cutting.high > 0) {
		settle_front(t);
		run_paths(t);
	}
	if (numbers->fracture > 0) {
		settle_tear(t);
		run_paths(t);
	}
	if (numbers->skin > 0 && numbers->skin_friction > 0) {
		settle_skin(t);
		run_paths(t);
	}
	/* Numbers of this tool do not apply to the next one. */
	t->state = from;
	paths->n = begin;
	return t->force.in + t->force.own;
}

static struct tick *begin_tick(double reach_mm)
{
	struct tick *t = (struct tick *)calloc(1, sizeof(*t));

	if (t && begin_paths()) {
		t->plan.reach_mm = reach_mm;
		return t;
	}
	free(t);
	return NULL;
}

static double end_tick(struct tick *t, double bound_N)
{
	free(t);
	return end_paths(bound_N);
}

} // namespace

double incise_front_bound(double unloading_N_mm, double friction, double most_N,
			  double cutting_bound_N)
{
	double reach_mm = most_N / unloading_N_mm;
	struct tick *t = begin_tick(reach_mm);
	num force, advance = 0;

	if (!t)
		return INFINITY;
	set(t->plan.numbers.unloading, unloading_N_mm);
	set(t->plan.numbers.friction, friction);
	t->depth = {0, reach_mm, lsb_mm() / 2, 0, lsb_mm() / 2};
	t->cutting = {0, most_N, cutting_bound_N, 0, cutting_bound_N};
	settle_front(t);
	force = T(front_force)(&t->state.front, t->plan.numbers.unloading,
			       t->plan.numbers.friction, worst_of(t->depth), advance,
			       worst_of(t->cutting));
	return end_tick(t, off(at(force.id)));
}

double incise_plan_bound(const struct incise_plan *plan, double reach_mm)
{
	struct tick *t;
	double bound_N;

	if (!plan->scene->fixed)
		return 0;
	t = begin_tick(reach_mm);
	if (!t)
		return INFINITY;
	paths->tick_s = 1 / plan->scene->rate_hz;
	t->plan.of = plan;
	t->plan.bend = bend_of(plan->surface->mesh);
	set_numbers(&t->plan);
	set_poses(&t->plan, &t->state);
	paths->hard_mm_s2 = t->plan.poses.a;
	bound_N = bound_of(t, INCISE_TOOL_BLADE);
	if (plan->inserts) {
		bound_N = fmax(bound_N, bound_of(t, INCISE_TOOL_HANDLE));
		bound_N = fmax(bound_N, bound_of(t, INCISE_TOOL_TUBE));
	}
	/* Neither force is above the limit. */
	return end_tick(t, fmin(bound_N, 2 * plan->scene->limits.force_N));
}
