// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The search for swings that do not end; see rest.h. N, mm, s; positions along the normal of the
 * surface's top, 0 at the top, outwards.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/random.h"
#include "../base/vector.h"
#include "../control/plant.h"
#include "rest.h"

/*
 * A run: in the air until the force's ramp has ended, then the hand leans. It ends when nothing
 * moved for two windows, or after LONGEST_S, when the swing of the last quarter counts.
 */
#define AIR_S 0.1 /* and the scene's ramp */
#define LONGEST_S 6.0
#define WINDOW_S 0.2
#define STILL_MM 1e-4

#define POSES_MOST 64 /* on their way */

const struct incise_hand_impedance incise_hands[INCISE_HANDS] = {
	{0.554, 0.00645, 0.135},
	{0.1385, 0.0016125, 0.03375},
	{0.554, 0.0258, 0.54},
};

/*
 * Equal steps up to this share of the scene's largest force. Starts above the surface: a touch,
 * and a drop. Along the skin: standing, where |v| has its corner and a swing is found at some
 * leans only, so that there are the most of them; a slow and a fast cut.
 */
#define LEANS 40
#define LEAN_MOST 0.96
#define TOUCH_MM 0.1
#define DROP_MM 3
static const struct {
	double start_mm, along_mm_s;
	int every; /* of the leans */
} ways[] = {{TOUCH_MM, 0, 1}, {DROP_MM, 0, 2},	 {TOUCH_MM, 10, 4},
	    {DROP_MM, 10, 8}, {TOUCH_MM, 60, 4}, {DROP_MM, 60, 8}};

/* Between the leans that are tried there may be worse: forces count as so much larger, and the
 * device's damping as so much smaller. */
#define RESERVE 0.05

#define N(array) ((int)(sizeof(array) / sizeof(*(array))))

/* Parts of a plan that a tick changes, apart from the plan itself. */
struct parts {
	struct incise_double_ends ends;
	struct incise_double_average average;
};

struct search {
	struct incise_plan plan; /* at work */
	struct parts parts;
	struct incise_tracker_sample fed[INCISE_PLAN_POSES];
	struct incise_plan rested; /* as before a first tick */
	struct parts rested_parts;
	struct incise_touch top;
	struct incise_surface *plane; /* in place of the surface: it has no end */
	double along[3];	      /* in it */
	double pose_s, latency_s, tick_s;
	int late;
	double slew_N; /* the actuator's, in a tick; infinite: none */
	struct incise_plant device;
};

/* A run at work. */
struct run {
	double lean_N, along_mm_s;
	struct incise_plant device;
	double t_s, next_pose_s, path_mm;
	struct {
		double arrival_s, height_mm, path_mm;
	} way[POSES_MOST]; /* ring of poses on their way */
	unsigned int first, last;
	double late_N[INCISE_STABILITY_DELAY_MAX + 1];
	double sent_N;	 /* after the actuator's slew */
	double noise_mm; /* of each pose, sd */
	uint64_t random; /* its key */
};

/* Copies that run without a device, in memory of their own. */
static void set_plans(struct search *s, const struct incise_plan *plan,
		      const struct incise_rest_trial *trial)
{
	struct incise_plan *own = &s->plan;
	struct incise_double_state *state = &own->doubles.state;
	int n = 0;

	incise_plan_copy(own, plan, trial->gain * (1 + RESERVE));
	own->surface = s->plane;
	incise_proxy_init(&own->proxy, s->plane, plan->proxy.leave_mm);
	own->poses.tracker = NULL;
	own->poses.tube_station = 0;
	own->axes.n = 0;
	own->poses.fed = s->fed;
	own->poses.n_fed = 0;
	incise_plan_set_numbers(own);
	if (state->ends)
		s->parts.ends = *state->ends;
	if (state->average)
		s->parts.average = *state->average;
	state->ends = state->ends ? &s->parts.ends : NULL;
	state->average = state->average ? &s->parts.average : NULL;
	for (int i = 0; i < own->n_stages; i++) {
		/* Only handle and tube ask for the cuts. */
		if (own->stage[i].run == incise_stage_actuate ||
		    own->stage[i].numbers.in_double == incise_double_stage_incision)
			continue;
		own->stage[n] = own->stage[i];
		if (own->stage[n].run == incise_stage_pose)
			own->stage[n].run = incise_stage_fed;
		n++;
	}
	own->n_stages = n;
	s->rested = s->plan;
	s->rested_parts = s->parts;
}

static void set_loop(struct search *s, const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker,
		     const struct incise_rest_trial *trial)
{
	const struct incise_haptic_device *device = &plan->stability.device;
	const double across[2][3] = {{1, 0, 0}, {0, 1, 0}};

	for (int i = 0; i < 2 && v3_length(s->along) == 0; i++) {
		v3_copy(s->along, across[i]);
		v3_add(s->along, s->along, -v3_dot(across[i], s->top.normal),
		       s->top.normal);
		if (!v3_unit(s->along, s->along, 0.5))
			v3_copy(s->along, (double[3]){0, 0, 0});
	}
	s->tick_s = device->period_s;
	s->latency_s = (double)tracker->latency_ns / INCISE_NS_PER_S;
	s->pose_s = fmax(1 / tracker->rate_hz, fmax(s->latency_s / (POSES_MOST - 2),
						    s->tick_s / (INCISE_PLAN_POSES - 1)));
	s->late = plan->stability.late_ticks;
	s->slew_N = INFINITY;
	for (int i = 0; i < plan->axes.n; i++) {
		const struct incise_stepper_info *info = &plan->axes.axis[i].info;

		s->slew_N = fmin(s->slew_N,
				 info->spring_N_mm * info->velocity_mm_s * s->tick_s);
	}
	if (plan->stability.own_delay) {
		/* The scene says how late all of the loop is, poses and all. */
		s->late = plan->scene->device.delay_ticks;
		s->latency_s = 0;
		s->pose_s = s->tick_s;
		incise_predict_init(
			&s->plan.predict,
			&(struct incise_tracker_info){.rate_hz = 1 / s->tick_s}, 0);
		incise_plan_set_numbers(&s->plan);
		s->rested = s->plan;
	}
	s->device = (struct incise_plant){
		.mass_kg = device->mass_kg,
		.damping_N_s_mm = trial->damping_N_s_mm * (1 - RESERVE),
	};
}

/* Times of a clock that is far from 0. */
static int64_t to_ns(double t_s)
{
	return 2 * INCISE_NS_PER_S + llround(t_s * INCISE_NS_PER_S);
}

static void go_to(struct run *run, double t_s)
{
	double way_s = fmax(t_s - run->t_s, 0);

	incise_plant_step(&run->device, run->sent_N - run->lean_N, way_s);
	run->path_mm += run->along_mm_s * way_s;
	run->t_s = t_s;
}

static void feed(struct search *s, const struct run *run, unsigned int pose)
{
	struct incise_tracker_sample sample = {
		.t_ns = to_ns(run->way[pose % POSES_MOST].arrival_s),
		.status = ' ',
		.quaternion = {1},
	};

	v3_copy(sample.position_mm, s->top.point_mm);
	v3_add(sample.position_mm, sample.position_mm,
	       run->way[pose % POSES_MOST].height_mm, s->top.normal);
	v3_add(sample.position_mm, sample.position_mm,
	       run->way[pose % POSES_MOST].path_mm, s->along);
	incise_plan_feed(&s->plan, &sample, 1);
}

static void tick(struct search *s, struct run *run)
{
	struct incise_tick out;
	double force_N;

	for (; run->first != run->last &&
	       run->way[run->first % POSES_MOST].arrival_s <= run->t_s;
	     run->first++)
		feed(s, run, run->first);
	incise_plan_tick(&s->plan, to_ns(run->t_s), &out);
	run->late_N[s->late] = v3_dot(out.command_N, s->top.normal);
	force_N = run->late_N[0] - run->sent_N;
	run->sent_N += fmax(-s->slew_N, fmin(s->slew_N, force_N));
	memmove(run->late_N, run->late_N + 1, (size_t)s->late * sizeof(*run->late_N));
	while (run->next_pose_s < run->t_s + s->tick_s) {
		go_to(run, run->next_pose_s);
		run->way[run->last % POSES_MOST].arrival_s = run->t_s + s->latency_s;
		run->way[run->last % POSES_MOST].height_mm =
			run->device.position_mm +
			run->noise_mm * incise_random_normal(run->random, run->last);
		run->way[run->last++ % POSES_MOST].path_mm = run->path_mm;
		run->next_pose_s += s->pose_s;
	}
}

/* In the air, until the force may start. */
static void start(struct search *s, struct run *run, double height_mm)
{
	double air_s = AIR_S + s->plan.scene->limits.ramp_ms * 1e-3;
	int ticks = (int)(air_s / s->tick_s);

	*run = (struct run){.device = s->device, .along_mm_s = run->along_mm_s};
	run->device.position_mm = height_mm;
	s->plan = s->rested;
	s->parts = s->rested_parts;
	for (int k = 1; k <= ticks; k++) {
		tick(s, run);
		run->device.position_mm = height_mm;
		run->device.velocity_mm_s = 0;
		go_to(run, k * s->tick_s);
		run->device.position_mm = height_mm;
		run->device.velocity_mm_s = 0;
	}
}

/* Outward travel and range of force within a time. */
struct window {
	double low_mm, travel_mm, high_mm, low_N, high_N;
};

static const struct window empty = {INFINITY, 0, -INFINITY, INFINITY, -INFINITY};

static void see(struct window *window, const struct run *run)
{
	double at = run->device.position_mm;

	window->low_mm = fmin(window->low_mm, at);
	window->high_mm = fmax(window->high_mm, at);
	/* Outward travel only: a hand that sinks does not swing. */
	window->travel_mm = fmax(window->travel_mm, at - window->low_mm);
	window->low_N = fmin(window->low_N, run->sent_N);
	window->high_N = fmax(window->high_N, run->sent_N);
}

/* Lean from the air on. Returns the time until it rested, or LONGEST_S. */
static double lean(struct search *s, struct run *run, struct window *last)
{
	int ticks = (int)(LONGEST_S / s->tick_s), quarter = ticks - ticks / 4;
	int long_window = (int)fmax(WINDOW_S / s->tick_s, 1), still = 0;
	struct window window = empty;
	double begin_s = run->t_s;

	*last = empty;
	for (int k = 1; k <= ticks; k++) {
		tick(s, run);
		go_to(run, begin_s + k * s->tick_s);
		see(&window, run);
		if (k > quarter)
			see(last, run);
		if (k % long_window)
			continue;
		still = window.high_mm - window.low_mm < STILL_MM ? still + 1 : 0;
		if (still == 2) {
			*last = window;
			return k * s->tick_s;
		}
		window = empty;
	}
	return LONGEST_S;
}

/* Returns whether it rests; notes the run when it is the worst so far. */
static bool try(struct search *s, struct run *run, int way, struct incise_rest *rest)
{
	struct window last;
	double settle_s = lean(s, run, &last);
	bool rests = last.travel_mm <= INCISE_REST_SWING_MM;

	rest->runs++;
	if (!rests || settle_s > rest->settle_s)
		*rest = (struct incise_rest){
			.rests = rests,
			.runs = rest->runs,
			.lean_N = run->lean_N,
			.along_mm_s = run->along_mm_s,
			.depth_mm = -(last.low_mm + last.high_mm) / 2,
			.swing_mm = last.travel_mm,
			.swing_N = last.high_N - last.low_N,
			.settle_s = settle_s,
			.way = way,
		};
	return rests;
}

static void search(struct search *s, double most_N, int way, struct incise_rest *rest)
{
	*rest = (struct incise_rest){.rests = true};
	for (int w = 0; w < N(ways); w++) {
		struct run air = {.along_mm_s = ways[w].along_mm_s}, run;
		struct incise_plan plan;
		struct parts parts;

		if (way >= 0 && w != way)
			continue;
		start(s, &air, ways[w].start_mm);
		plan = s->plan;
		parts = s->parts;
		for (int i = LEANS; i > 0; i -= ways[w].every) {
			run = air;
			run.lean_N = LEAN_MOST * i / LEANS * most_N;
			s->plan = plan;
			s->parts = parts;
			if (!try(s, &run, w, rest))
				return;
		}
	}
}

/* Seconds that a hand leans on it with noise: the second half counts. */
#define NOISE_S 2.0

static void shake(struct search *s, double most_N, struct incise_rest *rest)
{
	int ticks = (int)(NOISE_S / s->tick_s);
	struct window window = empty;
	struct run run = {0};

	start(s, &run, TOUCH_MM);
	run.lean_N = most_N / 2;
	run.noise_mm = INCISE_REST_NOISE_MM;
	run.random = incise_random_key(1, INCISE_RANDOM_TRACKER);
	for (int k = 1; k <= ticks; k++) {
		double t_s = run.t_s + s->tick_s;

		tick(s, &run);
		go_to(&run, t_s);
		if (k > ticks / 2)
			see(&window, &run);
	}
	rest->noise_mm = window.high_mm - window.low_mm;
	rest->noise_N = window.high_N - window.low_N;
}

int incise_plan_rest(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker,
		     const struct incise_rest_trial *trial, struct incise_rest *rest)
{
	struct search *s = calloc(1, sizeof(*s));

	if (!s)
		return -ENOMEM;
	incise_surface_top(plan->surface, &s->top);
	s->plane = incise_surface_new_plane(s->top.point_mm, s->top.normal, NULL);
	if (!s->plane) {
		free(s);
		return -ENOMEM;
	}
	set_plans(s, plan, trial);
	set_loop(s, plan, tracker, trial);
	search(s, plan->scene->limits.force_N, trial->way, rest);
	if (rest->rests)
		shake(s, plan->scene->limits.force_N, rest);
	incise_surface_free(s->plane);
	free(s);
	return 0;
}
