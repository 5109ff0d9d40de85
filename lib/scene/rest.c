// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The search for swings that do not end; see rest.h. N, mm, s; positions from a place of the surface, along the
 * axes in which the device moves.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/random.h"
#include "../base/vector.h"
#include "../control/plant.h"
#include "rest.h"

void incise_plan_copy(struct incise_plan *copy, const struct incise_plan *plan,
		      double gain)
{
	*copy = *plan;
	copy->integers = NULL;
	copy->ops = incise_double_ops;
	incise_plan_set_gain(copy, gain);
	incise_plan_set_numbers(copy);
}

/*
 * A run: in the air until the force's ramp has ended, then the hand leans. It ends when nothing moved for two
 * windows, or little and ever less, or with a quarter without a swing. If the swing of the last quarter is not less
 * than before, it stays: the run ends, too, and swings; so it does after LONGEST quarters.
 */
#define AIR_S 0.1 /* and the scene's ramp */
#define WINDOW_S 0.2
#define LOOK_S 2e-3
#define STILL_MM 1e-4
#define FADES_MM 2e-3 /* a fifth of a swing that counts, and less in each window */
#define QUARTER_S 1.5
#define QUARTERS 4 /* at least */
#define LONGEST 16
#define FALLS 0.9

#define POSES_MOST 64 /* on their way */

/*
 * The supports: nothing; a spring across the normal, which keeps the bare device in its place; a firm hand. It has
 * the mass, damping and stiffness of the arm that van Beek, Bergmann Tiest, Mugge and Kappers measured in a typical
 * trial (Haptic perception of force magnitude and its relation to postural arm dynamics in 3D, Scientific Reports 5,
 * 18004, 2015, fig. 3: 0.554 kg, 6.45 N s/m, 135 N/m), with four times its damping and stiffness.
 */
static const struct incise_hand_impedance holds[] = {
	[INCISE_HELD_ACROSS] = {0, 0, 0.54},
	[INCISE_HELD_IN_HAND] = {0.554, 0.0258, 0.54},
};

/*
 * A hand's mass on a haptic device that is held across: one that is light and strongly damped may swing with some of
 * them, though neither bare nor in a firm hand.
 */
static const double fingers_kg[] = {0.03, 0.06, 0.12, 0.25, 0.5};

/*
 * Ways to lean, with equal steps up to this share of the scene's largest force.
 *
 * Runs of all scenes: at the top, in the deepest valley and on the sharpest crest, free in all directions, in no
 * hand and in each, straight from a touch, and askew from a drop. Where a model stands |v| has its corner, and a swing is found
 * at some leans only: held across there are the most of them.
 *
 * Further runs with a model: guided along the normal of the top, while it makes a slow or a fast cut.
 */
#define LEANS 40
#define HALVES_MOST 6 /* of the least, where all of them sink away */
#define LEAN_MOST 0.96
#define TOUCH_MM 0.1
#define DROP_MM 3
#define TILT (40 * M_PI / 180)
static const struct {
	double start_mm, along_mm_s;
	int every; /* of the leans */
} guided[] = {{TOUCH_MM, 10, 4}, {DROP_MM, 10, 8}, {TOUCH_MM, 60, 4}, {DROP_MM, 60, 8}};

#define FREE_EVERY 10
#define LOOK_EVERY 20
#define PLACES 5
static const double askew[] = {0.02, 0.25};
/* The first run that swings is named, if possible one that does not slide away. */
static const enum incise_held held[] = {INCISE_HELD_ACROSS, INCISE_HELD_IN_HAND,
					INCISE_HELD_FREE};

/* A tool that goes farther along the skin than this in a quarter slides on it: over hills that is no swing. */
#define SLIDES_MM 1
#define KICK_MM (5 * INCISE_REST_SWING_MM)
#define AWAY_MM 40 /* so far aside it is where no search began … */
#define DEEP_MM 80 /* … and so deep, or nearly as deep as there is tissue, it has sunk */

/* A push, along each axis, at one of the leans: a swing that keeps itself up does so at many. */
#define PUSH_MM_S 20
#define PUSHED 10

/*
 * Between the leans on a model that are tried there may be worse: forces count as so much larger, and the device's
 * damping as so much smaller. The linear check has such a reserve for springs: for a scene without a model a part of
 * it is left here.
 */
#define FREE_RESERVE 0.04
#define RESERVE 0.05

#define N(array) ((int)(sizeof(array) / sizeof(*(array))))

/* Parts of a plan that a tick changes, apart from the plan itself. */
struct parts {
	struct incise_double_ends ends;
	struct incise_double_average average;
};

/* A way to lean. */
struct way {
	const struct incise_touch *at;
	const struct incise_surface *on;
	enum incise_tool tool;
	double start_mm;
	bool guided;	       /* along the normal … */
	double along_mm_s;     /* … while it goes along the skin */
	enum incise_held held; /* else so … */
	double askew;	       /* … with this share along the skin */
	bool tilted;	       /* TILT about the way that it would cut, else upright */
	double reserve;
	int every; /* of the leans */
};

struct search {
	struct incise_plan plan; /* at work */
	struct parts parts;
	struct incise_tracker_sample fed[INCISE_PLAN_POSES];
	struct incise_plan rested; /* as before a first tick */
	struct parts rested_parts;
	struct incise_plan air; /* … and before the hand leans */
	struct parts air_parts;
	struct incise_plan leaned; /* … and where a run came to rest */
	struct parts leaned_parts;
	struct incise_touch place[PLACES]; /* the first one is the top */
	int n_places;
	double crease;		      /* angle of the sharpest edge, up to a right one */
	struct incise_surface *plane; /* at the top, without an end */
	struct incise_device device;
	struct way way;
	bool decides; /* a run of the way did */
	int64_t ticks;
	double along[3]; /* in the skin */
	double turn[4];	 /* of the tool */
	double deep_mm;	 /* a deeper tool has sunk: it nears another side */
	double axis[3]
		   [3]; /* in which the device moves: of a guided one the normal first */
};

/* The motion of an axis in a time: all of it is linear, its place is from where the hand holds it. */
struct motion {
	double way_s, xx, xv, xf, vx, vv, vf;
};

/* A run at work: positions along the axes, from the place. */
struct rest_run {
	double lean_N;
	struct incise_plant device[3];
	struct motion tick[3]; /* the motion of each in one */
	double t_s, next_pose_s;
	struct {
		double arrival_s, at_mm[3];
	} pose[POSES_MOST]; /* ring of those on their way */
	unsigned int first, last;
	struct incise_host_place step; /* of a host's last one … */
	int ticks;		       /* … and how many ticks were since the first */
	double command_N[3];	       /* of the plan; a host holds it */
	double late_N[INCISE_STABILITY_DELAY_MAX + 1][3];
	double sent_N[3]; /* after the actuator's slew, along the axes */
	double change_s;  /* when the next one acts, before a tick */
	double noise_mm;  /* of each pose, sd */
	uint64_t random;  /* its key */
};

/* A copy that runs without a device, in memory of its own. */
static void set_plan(struct search *s, const struct incise_plan *plan,
		     const struct incise_rest_trial *trial)
{
	struct incise_plan *own = &s->plan;
	struct incise_double_state *state = &own->doubles.state;
	int n = 0;

	incise_plan_copy(own, plan, trial->gain * (1 + s->way.reserve));
	own->surface = s->way.on;
	incise_proxy_init(&own->proxy, s->way.on, plan->proxy.leave_mm);
	own->poses.tracker = NULL;
	own->poses.tube_station = 0;
	own->axes.n = 0;
	own->stylus = NULL;
	own->off = INCISE_HAPTIC_ON;
	own->poses.fed = s->fed;
	own->poses.n_fed = 0;
	/* The scene says how late all of the loop is, poses and all. */
	if (plan->stability.own_delay)
		incise_predict_init(
			&own->predict,
			&(struct incise_tracker_info){.rate_hz = 1 / s->device.period_s},
			0);
	incise_plan_set_numbers(own);
	if (state->ends)
		s->parts.ends = *state->ends;
	if (state->average)
		s->parts.average = *state->average;
	state->ends = state->ends ? &s->parts.ends : NULL;
	state->average = state->average ? &s->parts.average : NULL;
	for (int i = 0; i < own->n_stages; i++) {
		/* Beside a cut tissue is the stiffest. */
		if (own->stage[i].run == incise_stage_actuate ||
		    own->stage[i].run == incise_stage_push ||
		    own->stage[i].numbers.in_double == incise_double_stage_incision)
			continue;
		own->stage[n] = own->stage[i];
		if (own->stage[n].run == incise_stage_pose)
			own->stage[n].run = incise_stage_fed;
		n++;
	}
	own->n_stages = n;
	incise_plan_set_tool(own, s->way.tool);
	s->rested = s->plan;
	s->rested_parts = s->parts;
}

/* The device of a plan, and the loop that it is in. */
static void describe_device(const struct incise_plan *plan,
			    const struct incise_tracker_info *tracker,
			    struct incise_device *device)
{
	const struct incise_haptic_device *of = &plan->stability.device;

	*device = (struct incise_device){
		.axis = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
		.mass_kg = {of->mass_kg, of->mass_kg, of->mass_kg},
		.damping_N_s_mm = of->damping_N_s_mm,
		.period_s = of->period_s,
		.pose_s = 1 / tracker->rate_hz,
		.latency_s = (double)tracker->latency_ns / INCISE_NS_PER_S,
		.late_ticks = plan->stability.late_ticks,
		.early_s = plan->early_s,
		.touched = tracker->haptic,
		.slew_N_s = INFINITY,
		.force_N = plan->scene->limits.force_N,
		.continuous_N = plan->scene->limits.force_N,
	};
	for (int i = 0; i < plan->axes.n; i++) {
		const struct incise_stepper_info *info = &plan->axes.axis[i].info;

		device->slew_N_s =
			fmin(device->slew_N_s, info->spring_N_mm * info->velocity_mm_s);
	}
	if (plan->stability.own_delay) {
		device->late_ticks = plan->scene->device.delay_ticks;
		device->latency_s = 0;
		device->pose_s = of->period_s;
	}
}

/* The least turn of a unit vector to another, w first. */
static void set_turn(double turn[4], const double from[3], const double to[3])
{
	double axis[3], middle[3];

	v3_add(middle, from, 1, to);
	if (!v3_unit(middle, middle, 1e-6))
		v3_any_across(middle, from);
	v3_cross(axis, from, middle);
	turn[0] = v3_dot(from, middle);
	v3_copy(turn + 1, axis);
}

/* Tilt a rotation about a unit vector. */
static void tilt(double turn[4], const double about[3], double angle)
{
	double c = cos(angle / 2), s = sin(angle / 2), *v = turn + 1, cross[3];
	double w = c * turn[0] - s * v3_dot(about, v);

	v3_cross(cross, about, v);
	for (int i = 0; i < 3; i++)
		v[i] = c * v[i] + s * (turn[0] * about[i] + cross[i]);
	turn[0] = w;
}

/* Twice as deep it is still nearer to here than to another side. */
static double deep_of(const struct way *way)
{
	double deep_mm = DEEP_MM, at_mm[3];
	struct incise_touch touch;

	for (;; deep_mm *= 0.8) {
		v3_add(at_mm, way->at->point_mm, -2 * deep_mm, way->at->normal);
		incise_surface_nearest(way->on, at_mm, &touch);
		if (touch.depth_mm >= deep_mm || deep_mm < DEEP_MM * 1e-3)
			return deep_mm;
	}
}

/* The device and its axes in a way. */
static void set_way(struct search *s, const struct incise_scene *scene,
		    const struct way *way)
{
	const double *n = way->at->normal;
	double across[3];

	s->way = *way;
	s->deep_mm = deep_of(way);
	set_turn(s->turn, scene->tool.axis, n);
	/* A guided blade cuts, a free tool leans to both sides of that. */
	v3_rotate(across, s->turn, scene->tool.side);
	v3_cross(s->along, across, n);
	if (!v3_unit(s->along, s->along, 0.1))
		v3_any_across(s->along, n);
	if (way->tilted)
		tilt(s->turn, s->along, TILT);
	if (!way->guided) {
		v3_cross(across, n, s->along);
		v3_add(s->along, s->along, 1, across);
		v3_unit(s->along, s->along, 0);
	}
	memcpy(s->axis, s->device.axis, sizeof(s->axis));
	if (!way->guided && way->held != INCISE_HELD_ACROSS)
		return;
	v3_copy(s->axis[0], n);
	v3_copy(s->axis[1], s->along);
	v3_cross(s->axis[2], n, s->along);
}

static struct incise_plant plant(const struct search *s, int i)
{
	bool loose = s->way.held == INCISE_HELD_FREE ||
		     (s->way.held == INCISE_HELD_ACROSS && !i);
	double mass_kg = 0;

	for (int k = 0; k < 3; k++) {
		double share = v3_dot(s->device.axis[k], s->axis[i]);

		mass_kg += share * share * s->device.mass_kg[k];
	}
	return incise_pose_loop_plant(mass_kg,
				      s->device.damping_N_s_mm * (1 - s->way.reserve),
				      loose ? NULL : &holds[s->way.held]);
}

/* Times of a clock that is far from 0. */
static int64_t to_ns(double t_s)
{
	return 2 * INCISE_NS_PER_S + llround(t_s * INCISE_NS_PER_S);
}

/* Set the motion of an axis over a time. */
static void set_motion(struct motion *to, const struct incise_plant *of, double way_s)
{
	struct incise_plant plant = *of;

	plant.wall_mm = plant.velocity_mm_s = 0;
	plant.position_mm = 1;
	incise_plant_step(&plant, 0, way_s);
	to->xx = plant.position_mm;
	to->vx = plant.velocity_mm_s;
	plant.position_mm = 0;
	plant.velocity_mm_s = 1;
	incise_plant_step(&plant, 0, way_s);
	to->xv = plant.position_mm;
	to->vv = plant.velocity_mm_s;
	plant.position_mm = plant.velocity_mm_s = 0;
	incise_plant_step(&plant, 1, way_s);
	to->xf = plant.position_mm;
	to->vf = plant.velocity_mm_s;
	to->way_s = way_s;
}

/* Times of a tick are one time, but for rounding. */
#define SAME_S 1e-12

static void move_axis(struct incise_plant *plant, const struct motion *tick,
		      double force_N, double way_s)
{
	double x = plant->position_mm - plant->wall_mm, v = plant->velocity_mm_s;

	if (fabs(way_s - tick->way_s) > SAME_S) {
		incise_plant_step(plant, force_N, way_s);
		return;
	}
	plant->position_mm =
		plant->wall_mm + tick->xx * x + tick->xv * v + tick->xf * force_N;
	plant->velocity_mm_s = tick->vx * x + tick->vv * v + tick->vf * force_N;
}

static void set_lean(const struct search *s, const struct rest_run *run, double lean_N[3])
{
	for (int i = 0; i < 3; i++)
		lean_N[i] =
			run->lean_N * (s->way.askew * s->along[i] - s->way.at->normal[i]);
}

static void go_straight(const struct search *s, struct rest_run *run, double t_s)
{
	double way_s = t_s - run->t_s, lean_N[3];

	if (!(way_s > 0))
		return;
	set_lean(s, run, lean_N);
	for (int i = 0; i < (s->way.guided ? 1 : 3); i++)
		move_axis(&run->device[i], &run->tick[i],
			  run->sent_N[i] + v3_dot(lean_N, s->axis[i]), way_s);
	if (s->way.guided)
		run->device[1].position_mm += s->way.along_mm_s * way_s;
	run->t_s = t_s;
}

static void go_to(const struct search *s, struct rest_run *run, double t_s)
{
	if (run->change_s > run->t_s && run->change_s <= t_s) {
		go_straight(s, run, run->change_s);
		v3_copy(run->sent_N, run->late_N[0]);
	}
	go_straight(s, run, t_s);
}

/* Feed a place along the axes. */
static void feed_place(struct search *s, const double at_mm[3], double t_s)
{
	struct incise_tracker_sample sample = {.t_ns = to_ns(t_s), .status = ' '};

	memcpy(sample.quaternion, s->turn, sizeof(s->turn));
	v3_copy(sample.position_mm, s->way.at->point_mm);
	for (int i = 0; i < 3; i++)
		v3_add(sample.position_mm, sample.position_mm, at_mm[i], s->axis[i]);
	incise_plan_feed(&s->plan, &sample, 1);
}

static void tick_plan(struct search *s, struct rest_run *run, double t_s)
{
	struct incise_tick out;

	incise_plan_tick(&s->plan, to_ns(t_s), &out);
	s->ticks++;
	for (int i = 0; i < 3; i++)
		run->command_N[i] = v3_dot(out.command_N, s->axis[i]);
}

/* A guided device has its noise along the normal. */
static void sense(const struct search *s, const struct rest_run *run, uint64_t n,
		  struct incise_host_place *place)
{
	for (int i = 0; i < 3; i++) {
		place->at_mm[i] = run->device[i].position_mm;
		place->mm_s[i] = run->device[i].velocity_mm_s;
	}
	if (s->way.guided)
		place->mm_s[1] = s->way.along_mm_s;
	if (run->noise_mm > 0)
		place->at_mm[0] += run->noise_mm * incise_random_normal(run->random, n);
}

/* A step of a host: the ticks since its last one. */
static void step_rest(struct search *s, struct rest_run *run)
{
	const struct incise_host_hold *hold = &s->plan.hold;
	double step_s = hold->ticks * s->device.period_s, at_mm[3];
	struct incise_host_place to;

	sense(s, run, (uint64_t)run->ticks, &to);
	for (int k = 1; k <= hold->ticks; k++) {
		double t_s = run->t_s + (k - hold->ticks) * s->device.period_s;

		incise_host_between(at_mm, &run->step, &to, step_s,
				    (double)k / hold->ticks, hold->cubic);
		feed_place(s, at_mm, t_s);
		tick_plan(s, run, t_s);
	}
	run->step = to;
}

/* The poses of a tracker in the time of a tick. */
static void track(struct search *s, struct rest_run *run)
{
	double end_s = run->t_s + s->device.period_s;

	while (run->next_pose_s < end_s) {
		unsigned int pose = run->last++ % POSES_MOST;
		struct incise_host_place place;

		go_to(s, run, run->next_pose_s);
		sense(s, run, run->last - 1, &place);
		run->pose[pose].arrival_s = run->t_s + s->device.latency_s;
		v3_copy(run->pose[pose].at_mm, place.at_mm);
		run->next_pose_s += s->device.pose_s;
	}
}

static void tick(struct search *s, struct rest_run *run)
{
	double most_N = s->device.slew_N_s * s->device.period_s;
	bool hosted = s->plan.hold.ticks > 1;

	for (; run->first != run->last &&
	       run->pose[run->first % POSES_MOST].arrival_s <= run->t_s;
	     run->first++)
		feed_place(s, run->pose[run->first % POSES_MOST].at_mm,
			   run->pose[run->first % POSES_MOST].arrival_s);
	if (!hosted)
		tick_plan(s, run, run->t_s);
	else if (run->ticks++ % s->plan.hold.ticks == 0)
		step_rest(s, run);
	for (int i = 0; i < 3; i++) {
		double change_N;

		run->late_N[s->device.late_ticks][i] = run->command_N[i];
		change_N = run->late_N[0][i] - run->sent_N[i];
		run->sent_N[i] += fmax(-most_N, fmin(most_N, change_N));
	}
	memmove(run->late_N, run->late_N + 1,
		(size_t)s->device.late_ticks * sizeof(*run->late_N));
	run->change_s =
		run->t_s +
		(s->device.early_s > 0 ? s->device.period_s - s->device.early_s : 0);
	if (hosted)
		run->next_pose_s = run->t_s + s->device.period_s;
	else
		track(s, run);
}

/* Where it starts; a guided one goes along the skin meanwhile. */
static void hold_rest(const struct search *s, struct rest_run *run)
{
	for (int i = 0; i < (s->way.guided ? 1 : 3); i++) {
		run->device[i].position_mm =
			s->way.start_mm * v3_dot(s->way.at->normal, s->axis[i]);
		run->device[i].velocity_mm_s = 0;
	}
}

/* In the air, until the force may start. */
static void start_rest(struct search *s, struct rest_run *run)
{
	double air_s = AIR_S + s->plan.doubles.plan.numbers.ramp_ns * 1e-9;
	int ticks = (int)(air_s / s->device.period_s);

	*run = (struct rest_run){.lean_N = 0};
	for (int i = 0; i < 3; i++)
		run->device[i] = plant(s, i);
	hold_rest(s, run);
	for (int i = 0; i < 3; i++)
		run->device[i].wall_mm = run->device[i].position_mm;
	for (int i = 0; i < 3; i++)
		set_motion(&run->tick[i], &run->device[i], s->device.period_s);
	s->plan = s->rested;
	s->parts = s->rested_parts;
	sense(s, run, 0, &run->step);
	for (int k = 1; k <= ticks; k++) {
		tick(s, run);
		hold_rest(s, run);
		go_to(s, run, k * s->device.period_s);
		hold_rest(s, run);
	}
}

/*
 * A number as it rises from its lowest and falls from its highest: a swing does both, and more than once. A sinking
 * or creeping tool turns in one, a tool that slides over an edge once in both.
 */
struct rest_range {
	double low, high, rise, fall;
	double turn; /* the farthest since it last turned */
	int legs;    /* ways to or fro of more than a swing that counts */
};

#define LEGS 3

static const struct rest_range none = {INFINITY, -INFINITY, 0, 0, 0, 0};

static void see(struct rest_range *range, double at)
{
	double sign = range->legs % 2 ? -1 : 1;

	range->turn = range->high < range->low
			      ? at
			      : sign * fmax(sign * range->turn, sign * at);
	if (sign * (range->turn - at) > INCISE_REST_SWING_MM) {
		range->turn = at;
		range->legs++;
	}
	range->low = fmin(range->low, at);
	range->high = fmax(range->high, at);
	range->rise = fmax(range->rise, at - range->low);
	range->fall = fmax(range->fall, range->high - at);
}

struct window {
	struct rest_range at_mm[3], N[3];
	double from_mm[3], to_mm[3];
	bool seen;
};

static struct window empty(void)
{
	struct window window = {.seen = false};

	for (int i = 0; i < 3; i++)
		window.at_mm[i] = window.N[i] = none;
	return window;
}

static void see_run(struct window *window, const struct rest_run *run)
{
	for (int i = 0; i < 3; i++) {
		see(&window->at_mm[i], run->device[i].position_mm);
		see(&window->N[i], run->sent_N[i]);
		window->to_mm[i] = run->device[i].position_mm;
		if (!window->seen)
			window->from_mm[i] = window->to_mm[i];
	}
	window->seen = true;
}

/* The largest of the axes that move by themselves. */
static double swing_of(const struct search *s, const struct rest_range range[3])
{
	double most = 0;

	for (int i = 0; i < (s->way.guided ? 1 : 3); i++)
		if (range[i].legs >= LEGS)
			most = fmax(most, fmin(range[i].rise, range[i].fall));
	return most;
}

static double moved_of(const struct search *s, const struct rest_range range[3])
{
	double most = 0;

	for (int i = 0; i < (s->way.guided ? 1 : 3); i++)
		most = fmax(most, range[i].high - range[i].low);
	return most;
}

/* Whether it slides, or sinks: goes on by more than it swings. */
static bool goes_on(const struct search *s, const struct window *last)
{
	return moved_of(s, last->at_mm) > SLIDES_MM + 2 * swing_of(s, last->at_mm);
}

/* Along the skin, and into it, of a way along the axes. */
static double split(const struct search *s, const double way[3], double *into)
{
	double at[3] = {0};

	for (int i = 0; i < 3; i++)
		v3_add(at, at, way[i], s->axis[i]);
	*into = -v3_dot(at, s->way.at->normal);
	v3_add(at, at, *into, s->way.at->normal);
	return v3_length(at);
}

/* Whether it slides, or left the places where searches begin. */
static bool has_left(const struct search *s, const struct window *last)
{
	double way_mm[3], into_mm;

	if (s->way.guided)
		return false;
	v3_sub(way_mm, last->to_mm, last->from_mm);
	if (goes_on(s, last) && split(s, way_mm, &into_mm) > SLIDES_MM)
		return true;
	return split(s, last->to_mm, &into_mm) > AWAY_MM || into_mm > s->deep_mm;
}

/* The swing of the device; below 0 if it left the place, or goes on: that decides nothing. */
static double depth_of(const struct search *s, const struct window *last)
{
	double middle_mm[3], into_mm;

	for (int i = 0; i < 3; i++)
		middle_mm[i] = (last->at_mm[i].low + last->at_mm[i].high) / 2;
	split(s, middle_mm, &into_mm);
	/* A tool that jumps may be above it. */
	return !s->way.guided && (has_left(s, last) || goes_on(s, last))
		       ? -1
		       : fmax(into_mm, 0);
}

/* Lean from the air on. Returns the time until it rested, or 0: it swings. */
static double lean(struct search *s, struct rest_run *run, struct window *last)
{
	int quarter = (int)fmax(QUARTER_S / s->device.period_s, 1), still = 0;
	int long_window = (int)fmax(WINDOW_S / s->device.period_s, 1);
	int often = (int)fmax(LOOK_S / s->device.period_s, 1);
	double begin_s = run->t_s, before_mm = INFINITY, last_mm = 0;
	struct window window = empty();

	*last = empty();
	for (int k = 1;; k++) {
		double swing_mm;
		bool sinks;

		tick(s, run);
		go_to(s, run, begin_s + k * s->device.period_s);
		if (k % often == 0) {
			see_run(&window, run);
			see_run(last, run);
		}
		if (k % long_window == 0) {
			double moved_mm = moved_of(s, window.at_mm);

			still = moved_mm < STILL_MM || (moved_mm < FADES_MM &&
							moved_mm < last_mm)
					? still + 1
					: 0;
			last_mm = moved_mm;
			if (still == 2) {
				*last = window;
				return k * s->device.period_s;
			}
			window = empty();
		}
		if (k % quarter)
			continue;
		swing_mm = swing_of(s, last->at_mm);
		sinks = !s->way.guided && goes_on(s, last);
		/* After the first, in which it goes in. A tool that sinks may swing when it is deeper. */
		if ((k > quarter && has_left(s, last)) ||
		    (sinks && k >= LONGEST * quarter))
			return k * s->device.period_s;
		if (k >= QUARTERS * quarter && !sinks) {
			bool falls = swing_mm < FALLS * before_mm;

			if (swing_mm <= INCISE_REST_SWING_MM &&
			    (falls || swing_mm < INCISE_REST_SWING_MM / 10))
				return k * s->device.period_s;
			if (!falls || k >= LONGEST * quarter)
				return 0;
		}
		before_mm = swing_mm;
		*last = empty();
	}
}

/* Notes the run when it is the worst so far. */
static void note_rest(const struct search *s, const struct rest_run *run,
		      const struct window *last, double settle_s, int way,
		      struct incise_rest *rest)
{
	const double *at_mm = s->way.at->point_mm;
	double depth_mm = depth_of(s, last), lean_N[3];
	struct incise_rest before = *rest;

	if (settle_s > 0 && !(depth_mm >= 0 && settle_s > rest->worst.settle_s))
		return;
	set_lean(s, run, lean_N);
	*rest = (struct incise_rest){
		.rests = settle_s > 0,
		.runs = before.runs,
		.worst = {.lean_N = run->lean_N,
			  .along_mm_s = s->way.along_mm_s,
			  .askew = s->way.askew,
			  .place_mm = {at_mm[0], at_mm[1], at_mm[2]},
			  .tool = s->way.tool,
			  .held = s->way.held,
			  .guided = s->way.guided,
			  .tilted = s->way.tilted,
			  .depth_mm = depth_mm,
			  .swing_mm = swing_of(s, last->at_mm),
			  .settle_s = settle_s},
		.force_N = {lean_N[0], lean_N[1], lean_N[2]},
		.swing_N = moved_of(s, last->N),
		.way = way,
		.hold_ticks = s->plan.hold.ticks,
		.weakest = before.weakest,
	};
}

/* As if its normal were not averaged: the account of work lets the late part give no work. */
static struct incise_force_map paid_for(const struct incise_force_map *map)
{
	struct incise_force_map springs = *map;

	springs.mean_ticks = 1;
	for (int i = 0; i < 9; i++) {
		springs.now[i / 3][i % 3] += map->mean[i / 3][i % 3];
		springs.mean[i / 3][i % 3] = 0;
	}
	return springs;
}

/* Without a switch forces are the same on both sides, except for curvature. */
static bool is_same(const struct incise_force_map *a, const struct incise_force_map *b)
{
	const double *x = (const double *)a, *y = (const double *)b;
	double most = 0, off = 0;

	for (int i = 0; i < 4 * 9; i++) { /* all its matrices */
		most = fmax(most, fabs(x[i]));
		off = fmax(off, fabs(x[i] - y[i]));
	}
	return off <= 1e-4 * most;
}

/* The margin of the device, and of a haptic one with fingers on it. */
static double find_margin(const struct search *s, const struct incise_pose_loop *loop,
			  const struct rest_run *run, const struct incise_force_map *map,
			  double most, struct incise_swing *swing)
{
	bool fingers = s->device.touched && s->way.held == INCISE_HELD_ACROSS;

	most = incise_pose_loop_margin(loop, run->device, map, most, swing);
	for (int i = 0; fingers && i < N(fingers_kg); i++) {
		struct incise_plant device[3];

		memcpy(device, run->device, sizeof(device));
		for (int k = 0; k < 3; k++)
			device[k].mass_kg += fingers_kg[i];
		most = incise_pose_loop_margin(loop, device, map, most, swing);
	}
	return most;
}

/*
 * Where a run came to rest, the loop as a linear one. It must not swing; where only the averaged normal makes it,
 * and the account of work may end it, it is kicked that way, and must come to rest again. Returns whether it does.
 */
static bool judge_linear(struct search *s, const struct rest_run *run, double depth_mm,
			 int way, struct incise_rest *rest)
{
	const struct incise_pose_loop loop = {
		.period_s = s->device.period_s,
		.predict = &s->plan.predict,
		.late_ticks = s->device.late_ticks,
		.early_s = s->device.early_s,
		.hold = s->plan.hold,
	};
	const double *at_mm = s->way.at->point_mm;
	struct incise_force_map map, before;

	if (s->device.late_ticks > INCISE_POSE_LOOP_LATE_MAX)
		return true;
	for (int side = 0; side < 2; side++) {
		struct incise_plan_weakest here = {
			.lean_N = run->lean_N,
			.depth_mm = depth_mm,
			.place_mm = {at_mm[0], at_mm[1], at_mm[2]},
			.tool = s->way.tool,
			.held = s->way.held,
			.tilted = s->way.tilted,
			.states = 1,
		};
		double most = rest->weakest.margin / (1 + s->way.reserve), settle_s = -1;
		struct incise_swing swing = {0};
		struct rest_run kicked = *run;
		struct window last;

		/* A host's next step is a whole one away. */
		kicked.ticks = 1;
		incise_plan_force_map(&s->plan, to_ns(run->t_s), s->axis, side, &map);
		if (side && is_same(&map, &before))
			break;
		before = map;
		here.margin = find_margin(s, &loop, run, &map, most, &swing);
		for (int i = 0; i < 3; i++) {
			kicked.device[i].position_mm += KICK_MM * swing.along[i];
			v3_add(here.along, here.along, swing.along[i], s->axis[i]);
		}
		here.hz = swing.hz;
		if (here.margin < 1) {
			const struct incise_force_map springs = paid_for(&map);

			settle_s = lean(s, &kicked, &last);
			/* Without a frequency there were no eigenvalues: then the run decides. */
			here.paid = !(swing.hz > 0) ||
				    (s->plan.accounts &&
				     incise_pose_loop_margin(&loop, run->device, &springs,
							     1, NULL) >= 1);
			settle_s = here.paid ? settle_s : 0;
			rest->runs++;
			note_rest(s, &kicked, &last, settle_s, way, rest);
		}
		here.margin = here.paid ? INCISE_PLAN_MARGIN_MOST
					: here.margin * (1 + s->way.reserve);
		incise_rest_take_weakest(&rest->weakest, &here);
		/* After a kick the other side belongs to another state. */
		if (settle_s >= 0)
			return settle_s > 0;
	}
	return true;
}

void incise_rest_take_weakest(struct incise_plan_weakest *to,
			      const struct incise_plan_weakest *other)
{
	int states = to->states + other->states, paid = to->paid + other->paid;

	if (other->margin < to->margin)
		*to = *other;
	to->states = states;
	to->paid = paid;
}

/*
 * A host's step may be shorter than the longest, with which a stiffer tissue can be stable. A host that drifts is judged
 * with an old tick before each step, too: such a short hold may swing where the longest hold of a fresh tick rests.
 */
static bool judge_steps(struct search *s, const struct rest_run *run, double depth_mm,
			int way, struct incise_rest *rest)
{
	int longest = s->plan.hold.ticks, late_ticks = s->device.late_ticks;
	bool rests = true;

	s->leaned = s->plan;
	s->leaned_parts = s->parts;
	for (int old = 0; old <= s->leaned.hold.drifts; old++) {
		s->device.late_ticks = late_ticks + old;
		for (int ticks = longest - old * INCISE_HOST_SPARE; ticks && rests;
		     ticks = ticks * 3 / 4) {
			/* A kicked run moves on from there. */
			s->plan = s->leaned;
			s->parts = s->leaned_parts;
			s->plan.hold.ticks = ticks;
			rests = judge_linear(s, run, depth_mm, way, rest);
		}
	}
	s->device.late_ticks = late_ticks;
	s->plan.hold.ticks = longest;
	return rests;
}

/*
 * As if the tool had entered beyond an edge: spread is across the normal of there, and so adds to the insertion along the
 * normal of here. Returns whether it rests.
 */
static bool judge_crease(struct search *s, const struct rest_run *run, double depth_mm,
			 int way, struct incise_rest *rest)
{
	double *entry = s->plan.doubles.state.entry;

	if (!(s->crease > 0) || s->way.tool == INCISE_TOOL_BLADE ||
	    s->way.held != INCISE_HELD_FREE)
		return true;
	s->plan = s->leaned;
	s->parts = s->leaned_parts;
	for (int i = 0; i < 3; i++)
		entry[i] = cos(s->crease) * entry[i] + sin(s->crease) * s->along[i];
	return judge_linear(s, run, depth_mm, way, rest);
}

/* Returns whether it rests. */
static bool try(struct search *s, struct rest_run *run, int lean_of, int way,
		struct incise_rest *rest)
{
	struct window last;
	double settle_s = lean(s, run, &last), depth_mm = depth_of(s, &last);

	rest->runs++;
	note_rest(s, run, &last, settle_s, way, rest);
	s->decides |= depth_mm >= 0;
	if (!(settle_s > 0) || s->way.guided || !(depth_mm > 0))
		return settle_s > 0;
	if (lean_of == PUSHED) {
		for (int i = 0; i < 3; i++)
			run->device[i].velocity_mm_s += PUSH_MM_S;
		return try(s, run, PUSHED + 1, way, rest);
	}
	/* Similar leans have similar loops. */
	return lean_of % LOOK_EVERY || (judge_steps(s, run, depth_mm, way, rest) &&
					judge_crease(s, run, depth_mm, way, rest));
}

/* All leans of a way. Returns whether they rest. */
static bool lean_all(struct search *s, const struct incise_plan *plan,
		     const struct incise_rest_trial *trial, const struct way *way,
		     int number, struct incise_rest *rest)
{
	double most_N = fmin(s->device.force_N, s->device.continuous_N);
	struct rest_run air;

	if (trial->way >= 0 && number != trial->way)
		return true;
	set_way(s, plan->scene, way);
	set_plan(s, plan, trial);
	start_rest(s, &air);
	s->air = s->plan;
	s->air_parts = s->parts;
	s->decides = false;
	for (int i = LEANS, halves = 0; i > 0 || (way->held == INCISE_HELD_ACROSS &&
						  !s->decides && halves < HALVES_MOST);
	     i -= way->every) {
		struct rest_run run = air;

		halves += i <= 0;
		run.lean_N =
			i > 0 ? LEAN_MOST * i / LEANS * most_N
			      : ldexp(LEAN_MOST * way->every / LEANS * most_N, -halves);
		s->plan = s->air;
		s->parts = s->air_parts;
		if (!try(s, &run, i, number, rest))
			return false;
	}
	return true;
}

static void search_rest(struct search *s, const struct incise_plan *plan,
			const struct incise_rest_trial *trial, struct incise_rest *rest)
{
	bool model = plan->model || plan->fixed;
	int n_tools = plan->inserts ? 2 : 1, number = 0;

	*rest = (struct incise_rest){.rests = true,
				     .weakest.margin = INCISE_PLAN_MARGIN_MOST};
	for (int i = 0; i < s->n_places * n_tools * N(held) * N(askew); i++, number++) {
		enum incise_held by = held[i / N(askew) % N(held)];
		int tool = i / N(askew) / N(held) % n_tools;
		const struct way way = {
			.at = &s->place[i / N(askew) / N(held) / n_tools],
			.on = plan->surface,
			.tool = tool ? INCISE_TOOL_TUBE : INCISE_TOOL_BLADE,
			.start_mm = i % N(askew) ? DROP_MM : TOUCH_MM,
			.held = by,
			.askew = askew[i % N(askew)],
			.tilted = i % N(askew),
			.reserve = model ? RESERVE : FREE_RESERVE,
			.every = model && by == INCISE_HELD_ACROSS && !tool
					 ? 1 + i % N(askew)
					 : FREE_EVERY};

		if (!lean_all(s, plan, trial, &way, number, rest))
			return;
	}
	for (int i = 0; i < N(guided); i++, number++) {
		const struct way way = {.at = s->place,
					.on = s->plane,
					.tool = INCISE_TOOL_BLADE,
					.start_mm = guided[i].start_mm,
					.guided = true,
					.along_mm_s = guided[i].along_mm_s,
					.reserve = RESERVE,
					.every = guided[i].every};

		if (model && !lean_all(s, plan, trial, &way, number, rest))
			return;
	}
}

/* Seconds that a hand leans on it with noise: the second half counts. */
#define NOISE_S 2.0

static void shake(struct search *s, const struct incise_plan *plan,
		  const struct incise_rest_trial *trial, struct incise_rest *rest)
{
	const struct incise_acting_force *reaction = &plan->acting[INCISE_FORCE_REACTION];
	bool cuts = incise_plan_has_model(plan, reaction) || reaction->number[0] > 0;
	const struct way way = {.at = s->place,
				.on = s->plane,
				.tool = cuts ? INCISE_TOOL_BLADE : INCISE_TOOL_TUBE,
				.start_mm = TOUCH_MM,
				.guided = true,
				.reserve = RESERVE};
	int ticks = (int)(NOISE_S / s->device.period_s);
	struct window window = empty();
	struct rest_run run;

	set_way(s, plan->scene, &way);
	set_plan(s, plan, trial);
	start_rest(s, &run);
	run.lean_N = plan->scene->limits.force_N / 2;
	run.noise_mm = INCISE_REST_NOISE_MM;
	run.random = incise_random_key(1, INCISE_RANDOM_TRACKER);
	for (int k = 1; k <= ticks; k++) {
		double t_s = run.t_s + s->device.period_s;

		tick(s, &run);
		go_to(s, &run, t_s);
		if (k > ticks / 2)
			see_run(&window, &run);
	}
	/* To and fro: noise does not move a sinking tool, as nothing holds it. */
	rest->noise_mm = fmin(window.at_mm[0].rise, window.at_mm[0].fall);
	rest->noise_N = fmin(window.N[0].rise, window.N[0].fall);
}

/* Whether the skin goes on around a place: at a border a contact ends. */
#define AROUND_MM 5
static bool is_inside(const struct incise_surface *surface, const double at_mm[3],
		      const double normal[3])
{
	double along[3], across[3];

	v3_any_across(along, normal);
	v3_cross(across, normal, along);
	for (int i = 0; i < 8; i++) {
		double turn = M_PI / 4 * i, to_mm[3], way[3];
		struct incise_touch touch;

		v3_add(to_mm, at_mm, AROUND_MM * cos(turn), along);
		v3_add(to_mm, to_mm, AROUND_MM * sin(turn), across);
		incise_surface_nearest(surface, to_mm, &touch);
		v3_sub(way, touch.point_mm, at_mm);
		if (v3_length(way) < AROUND_MM / 2.0)
			return false;
	}
	return true;
}

/* The top, or, where that is at a border, a place on the way to the middle. */
#define STEPS_IN 16
static void set_top(struct search *s, const struct incise_surface *surface)
{
	struct incise_touch top;
	double middle_mm[3] = {0};

	incise_surface_top(surface, &top);
	s->place[s->n_places++] = top;
	for (uint32_t i = 0; surface->mesh && i < surface->mesh->n_vertices; i++)
		v3_add(middle_mm, middle_mm, 1.0 / surface->mesh->n_vertices,
		       surface->mesh->vertex[i]);
	for (int i = 1; surface->mesh && i < STEPS_IN; i++) {
		double at_mm[3];

		if (is_inside(surface, top.point_mm, top.normal)) {
			s->place[0] = top;
			return;
		}
		v3_sub(at_mm, middle_mm, s->place[0].point_mm);
		v3_add(at_mm, s->place[0].point_mm, (double)i / STEPS_IN, at_mm);
		incise_surface_nearest(surface, at_mm, &top);
	}
}

/* Besides the others, unless it is one of them. */
#define APART_MM 2
static void add_place(struct search *s, const struct incise_touch *place)
{
	for (int i = 0; i < s->n_places; i++) {
		double way[3];

		v3_sub(way, place->point_mm, s->place[i].point_mm);
		if (v3_length(way) < APART_MM)
			return;
	}
	s->place[s->n_places++] = *place;
}

/* Above the membrane. */
#define ABOVE_MM 400
static void add_membrane(struct search *s, const struct incise_surface *surface,
			 const struct incise_scene_membrane *membrane)
{
	struct incise_touch skin;
	double from_mm[3];

	v3_add(from_mm, membrane->point_mm, ABOVE_MM, membrane->normal);
	if (membrane->thickness_mm > 0 &&
	    incise_surface_enters(surface, from_mm, membrane->point_mm, &skin))
		add_place(s, &skin);
}

/* On the skin beside a crest, where another face of it is near, too. @way: one on which its normal turns. */
#define BESIDE_MM 8
static void add_beside(struct search *s, const struct incise_surface *surface,
		       const double at_mm[3], const double way[3])
{
	double along[3], to_mm[3];

	if (!v3_unit(along, way, 0))
		return;
	for (int sign = -1; sign <= 1; sign += 2) {
		struct incise_touch place;

		v3_add(to_mm, at_mm, sign * BESIDE_MM, along);
		incise_surface_nearest(surface, to_mm, &place);
		if (is_inside(surface, place.point_mm, place.normal)) {
			add_place(s, &place);
			return;
		}
	}
}

/*
 * The top, above the membrane, and of a mesh the corners where it is the most concave along an edge, and the most
 * convex: there normals turn the most, 1/mm. Faces that meet in a corner differ the most where one differs the most from
 * the corner's normal.
 */
#define LOOKS_MOST 1000
static void set_places(struct search *s, const struct incise_plan *plan)
{
	const struct incise_surface *surface = plan->surface;
	const struct mesh *mesh = surface->mesh;
	uint32_t most[2] = {0, 0}, end[2] = {0, 0};
	double bend[2] = {0, 0}, edge[3], turn[3], face[3], least = 1;
	int looks = 0;

	set_top(s, surface);
	add_membrane(s, surface, &plan->scene->membrane);
	for (uint32_t i = 0; mesh && i < mesh->n_triangles; i++) {
		const uint32_t *corner = mesh->corner[i];

		triangle_area_normal(face, mesh->vertex[corner[0]],
				     mesh->vertex[corner[1]], mesh->vertex[corner[2]]);
		for (int k = 0; k < 3; k++) {
			uint32_t a = corner[k], b = corner[(k + 1) % 3];
			double per_mm;
			int sign;

			if (v3_unit(face, face, 0))
				least = fmin(least, v3_dot(face, mesh->normal[a]));
			if (mesh->neighbour[i][k] == MESH_NONE)
				continue;
			v3_sub(edge, mesh->vertex[b], mesh->vertex[a]);
			v3_sub(turn, mesh->normal[b], mesh->normal[a]);
			per_mm = v3_dot(turn, edge) / v3_dot(edge, edge);
			sign = per_mm > 0;
			if (fabs(per_mm) > bend[sign] && looks++ < LOOKS_MOST &&
			    is_inside(surface, mesh->vertex[a], mesh->normal[a])) {
				bend[sign] = fabs(per_mm);
				most[sign] = a;
				end[sign] = b;
			}
		}
	}
	s->crease = 2 * acos(fmax(least, M_SQRT1_2));
	for (int sign = 0; sign < 2; sign++) {
		const double *at_mm = bend[sign] > 0 ? mesh->vertex[most[sign]] : NULL;
		struct incise_touch place;

		if (!at_mm)
			continue;
		incise_surface_nearest(surface, at_mm, &place);
		v3_copy(place.normal, mesh->normal[most[sign]]);
		add_place(s, &place);
		v3_sub(edge, mesh->vertex[end[sign]], at_mm);
		if (sign)
			add_beside(s, surface, at_mm, edge);
	}
}

int incise_plan_rest(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker,
		     const struct incise_rest_trial *trial, struct incise_rest *rest)
{
	struct search *s = calloc(1, sizeof(*s));

	if (!s)
		return -ENOMEM;
	set_places(s, plan);
	s->plane =
		incise_surface_new_plane(s->place[0].point_mm, s->place[0].normal, NULL);
	if (!s->plane) {
		free(s);
		return -ENOMEM;
	}
	describe_device(plan, tracker, &s->device);
	/* As much as the tables of poses hold. */
	s->device.pose_s = fmax(s->device.pose_s,
				fmax(s->device.latency_s / (POSES_MOST - 2),
				     s->device.period_s / (INCISE_PLAN_POSES - 1)));
	s->device.damping_N_s_mm = trial->damping_N_s_mm;
	search_rest(s, plan, trial, rest);
	if (rest->rests)
		shake(s, plan, trial, rest);
	rest->ticks = s->ticks;
	incise_surface_free(s->plane);
	free(s);
	return 0;
}
