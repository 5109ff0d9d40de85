// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * guards: what a guard behind the tissue's forces would add. The stages of the
 * real plan in a closed loop with a late tracker and a late actuator, at gains that plans accept
 * and above, with each guard and with none.
 *
 *   hand leans ─▶ device ─▶ tracker ─▶ predict ─▶ [coupling] ─▶ forces ─▶ [guard] ─┐
 *                   ▲                                                              │
 *                   └────── held for a tick ◀── late ticks ◀── start, limit ◀──────┘
 *
 *   passivity        observer and controller of Hannaford and Ryu (2002), by the energy of the
 *                    force that is held; no more damping than half of what the loop can spare
 *   delayed          time-domain passivity with the delay counted, after Ryu, Artigas and
 *                    Preusche (2010): what came out until now against what went in as far as
 *                    the poses tell; no more damping than is stable so late
 *   energy_bounding  after Kim and Ryu (2010): the force changes by what the device's damping
 *                    can take over the delay
 *   coupling         a spring between tool and tissue that makes what is stiffer than the plan
 *                    accepts as soft as that
 *
 * Up along the normal of the surface's top; N, mm, s.
 */
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "../../lib/base/random.h"
#include "../../lib/base/vector.h"
#include "../../lib/control/plant.h"
#include "../../lib/scene/rest.h"
#include "../../tools/cli/scene_argument.h"
#include "../../tools/bench/stability.h"
#include "../wall_limit.h"
#include "program.h"

enum guard { NONE, PASSIVITY, DELAYED, ENERGY_BOUNDING, COUPLING, GUARDS };
static const char *const guard_names[GUARDS] = {"none", "passivity", "delayed",
						"energy_bounding", "coupling"};

/* --- the guards --- */

#define FORCES 64 /* that are remembered, ticks */

struct guarded {
	enum guard kind;
	double period_s, reserve_N_mm, cap_N_s_mm; /* settings */
	double bound_N_mm; /* energy bounding: a spring that the delay leaves passive */
	double coupling_N_mm; /* infinite: none */
	double tissue_N_mm;
	int late; /* ticks */

	bool placed;
	double energy_N_mm, at_mm; /* passivity, energy bounding */
	double in_N_mm, out_N_mm, pose_mm,
		force_N[FORCES]; /* delayed: by poses, and sent */
	long tick, pose_tick;
	double tool_mm, tissue_N; /* coupling: of the tick before */
};

/* Mean of the forces that acted from the last pose up to a tick. */
static double acted_N(const struct guarded *g, long until)
{
	long from = g->pose_tick < until ? g->pose_tick : until - 1;
	double sum = 0;

	for (long k = from; k < until; k++)
		sum += k > g->late ? g->force_N[(k - g->late) % FORCES] : 0;
	return sum / (double)(until - from);
}

/* A pose arrives: what the force that was held has done on the way to it. */
static void guard_pose(struct guarded *g, double at_mm, double taken_s)
{
	long taken = lround(taken_s / g->period_s);
	double work_N_mm = acted_N(g, taken) * (at_mm - g->pose_mm);

	*(work_N_mm > 0 ? &g->out_N_mm : &g->in_N_mm) += fabs(work_N_mm);
	g->pose_mm = at_mm;
	g->pose_tick = taken;
}

/* Damping that pays a debt of energy within a tick, against the speed. */
static double damped(const struct guarded *g, double debt_N_mm, double speed_mm_s,
		     double force_N)
{
	double power = speed_mm_s * speed_mm_s * g->period_s;

	if (!(debt_N_mm > 0) || !(power > 0))
		return force_N;
	return force_N - fmin(g->cap_N_s_mm, debt_N_mm / power) * speed_mm_s;
}

/* Held forces lag by some ticks. What they make by it is less than the device's damping takes if
 * the force changes by no more than so much along the way; and no more comes out than went in. */
static double bounded(struct guarded *g, double force_N, double sent_N, double way_mm,
		      double deeper_mm)
{
	double most = g->bound_N_mm * way_mm;

	force_N = fmax(sent_N - most, fmin(sent_N + most, force_N));
	if (deeper_mm < 0)
		force_N = fmin(force_N, fmax(0, g->energy_N_mm) / -deeper_mm);
	g->energy_N_mm += force_N * deeper_mm;
	return force_N;
}

static double guard_apply(struct guarded *g, double at_mm, double speed_mm_s,
			  double way_mm, double sent_N, double force_N, bool contact,
			  bool began)
{
	double now_N_mm;

	g->force_N[(++g->tick - 2 + FORCES) % FORCES] = sent_N; /* of the tick before */
	if (began) {
		g->energy_N_mm = g->in_N_mm = g->out_N_mm = 0;
		g->placed = false;
	}
	switch (g->kind) {
	case PASSIVITY:
		if (g->placed)
			g->energy_N_mm =
				fmin(g->reserve_N_mm,
				     g->energy_N_mm - sent_N * (at_mm - g->at_mm));
		force_N = damped(g, -g->energy_N_mm, speed_mm_s, force_N);
		break;
	case DELAYED:
		now_N_mm = acted_N(g, g->tick - 1) * (at_mm - g->pose_mm);
		force_N = damped(g, g->out_N_mm + fmax(0, now_N_mm) - g->in_N_mm,
				 speed_mm_s, force_N);
		break;
	case ENERGY_BOUNDING:
		if (contact && g->placed)
			force_N = bounded(g, force_N, sent_N, way_mm, g->at_mm - at_mm);
		break;
	case COUPLING:
		g->tissue_N = force_N;
		if (contact && isfinite(g->coupling_N_mm))
			force_N = fmax(0, g->coupling_N_mm * (g->tool_mm - at_mm));
		break;
	case NONE:
	case GUARDS:
		break;
	}
	g->at_mm = at_mm;
	g->placed = true;
	return force_N;
}

/* --- the plan in a loop --- */

#define LATENCY_S 4.2e-3
#define START_S 0.4 /* in the air, until the force may be whole */
#define RUN_S 6.0
#define STILL_S 0.2 /* twice: it rests */
#define STILL_MM 1e-4
#define POSES 64 /* on their way */

struct loop {
	struct incise_plan plan; /* first: its stages find the rest by it */
	struct incise_double_average average;
	struct incise_tracker_sample fed[INCISE_PLAN_POSES];
	struct incise_touch top;
	struct incise_surface *plane; /* in place of the surface: it has no end */
	double along[3], along_mm_s, path_mm;
	struct guarded guard;
	double tool_mm;		 /* as predicted, before a coupling */
	double at_mm[3], way_mm; /* at the last tick, and from there */
	struct incise_plant device;
	double t_s, next_s, pose_s, noise_mm;
	double way[POSES][3]; /* arrival, height, path */
	unsigned int first, last;
	double late_N[INCISE_POSE_LOOP_LATE_MAX + 1], sent_N;
};

/* The loop of the plan whose stages run. */
static struct loop *loop_of(const struct incise_double_plan *plan)
{
	return (struct loop *)((uintptr_t)plan -
			       offsetof(struct loop, plan.doubles.plan));
}

/* The tool that meets the tissue hangs on a spring: where both forces are equal. */
static void stage_coupling(const struct incise_double_plan *plan,
			   struct incise_double_state *state,
			   struct incise_double_tick *tick)
{
	struct loop *l = loop_of(plan);
	struct guarded *g = &l->guard;
	double stiffness = g->coupling_N_mm + g->tissue_N_mm, way[3];

	(void)state;
	v3_sub(way, tick->tool, l->at_mm);
	v3_copy(l->at_mm, tick->tool);
	l->way_mm = v3_length(way);
	l->tool_mm = v3_dot(tick->tool, l->top.normal) -
		     v3_dot(l->top.point_mm, l->top.normal);
	if (g->kind != COUPLING || !isfinite(stiffness))
		return;
	g->tool_mm +=
		(g->coupling_N_mm * (l->tool_mm - g->tool_mm) + g->tissue_N) / stiffness;
	v3_add(tick->tool, tick->tool, g->tool_mm - l->tool_mm, l->top.normal);
}

static void stage_guard(const struct incise_double_plan *plan,
			struct incise_double_state *state,
			struct incise_double_tick *tick)
{
	struct loop *l = loop_of(plan);
	double force_N = v3_dot(state->force, l->top.normal);
	double guarded_N =
		guard_apply(&l->guard, l->tool_mm, v3_dot(state->velocity, l->top.normal),
			    l->way_mm, v3_dot(state->last, l->top.normal), force_N,
			    tick->flags & INCISE_TICK_CONTACT, state->proxy.began);

	v3_add(state->force, state->force, guarded_N - force_N, l->top.normal);
}

/* A copy with more gain, and with a guard's stages. They share the predictor of the handle's end,
 * which is not held. */
static void copy_plan(struct loop *l, const struct incise_plan *plan, double gain,
		      bool stages)
{
	struct incise_plan *own = &l->plan;
	struct incise_stage stage[INCISE_PLAN_STAGES_MAX];
	int n = plan->n_stages;

	incise_plan_copy(own, plan, gain * plan->gain);
	own->poses.fed = l->fed;
	if (own->doubles.state.average)
		own->doubles.state.average = &l->average;
	if (!stages)
		return;
	memcpy(stage, own->stage, sizeof(stage));
	own->n_stages = 0;
	for (int i = 0; i < n; i++) {
		if (stage[i].numbers.in_double == incise_double_stage_contact)
			own->stage[own->n_stages++] = (struct incise_stage){
				.name = "coupling", .numbers.in_double = stage_coupling};
		if (stage[i].numbers.in_double == incise_double_stage_start)
			own->stage[own->n_stages++] = (struct incise_stage){
				.name = "guard", .numbers.in_double = stage_guard};
		own->stage[own->n_stages++] = stage[i];
	}
}

static int64_t to_ns(double t_s)
{
	return 2000000000 + llround(t_s * 1e9);
}

static void feed(struct loop *l)
{
	const double *pose = l->way[l->first++ % POSES];
	struct incise_tracker_sample sample = {
		.t_ns = to_ns(pose[0]), .status = ' ', .quaternion = {1}};

	v3_add(sample.position_mm, l->top.point_mm, pose[1], l->top.normal);
	v3_add(sample.position_mm, sample.position_mm, pose[2], l->along);
	guard_pose(&l->guard, pose[1], pose[0] - LATENCY_S);
	incise_plan_feed(&l->plan, &sample, 1);
}

/* To a time: leaning with a force, or led at a speed. */
static void go_to(struct loop *l, double t_s, double lean_N, double led_mm_s)
{
	double time_s = fmax(t_s - l->t_s, 0);

	if (lean_N > 0)
		incise_plant_step(&l->device, l->sent_N - lean_N, time_s);
	else
		l->device.position_mm += led_mm_s * time_s;
	l->path_mm += l->along_mm_s * time_s;
	l->t_s = t_s;
}

/* Returns the force that is commanded now. */
static double step(struct loop *l, double lean_N, double led_mm_s)
{
	int late = l->guard.late;
	double next_s = l->t_s + l->guard.period_s, command_N;
	struct incise_tick tick;

	while (l->first != l->last && l->way[l->first % POSES][0] <= l->t_s)
		feed(l);
	incise_plan_tick(&l->plan, to_ns(l->t_s), &tick);
	command_N = l->late_N[late] = v3_dot(tick.command_N, l->top.normal);
	l->sent_N = l->late_N[0];
	memmove(l->late_N, l->late_N + 1, (size_t)late * sizeof(*l->late_N));
	for (; l->next_s < next_s; l->next_s += l->pose_s) {
		go_to(l, l->next_s, lean_N, led_mm_s);
		l->way[l->last % POSES][0] = l->t_s + LATENCY_S;
		l->way[l->last % POSES][1] =
			l->device.position_mm +
			l->noise_mm * incise_random_normal(1, l->last);
		l->way[l->last++ % POSES][2] = l->path_mm;
	}
	go_to(l, next_s, lean_N, led_mm_s);
	return command_N;
}

/* --- what is tried --- */

static const char *const scenes[] = {"liver", "liver paper", "neck", "wall"};
static const double trackers_hz[] = {120, 60, 240};
static const int lates[] = {5, 0, 2}; /* ticks */
static const struct {
	double mass_kg, damping_N_s_mm;
} devices[] = {{0.05, 0.01}, {0.03, 0.02}};
/* Of the largest gain that the plan accepts; 0: the scene's own, where that is accepted. */
static const double gains[] = {0, 1, 1.25, 1.5, 2};
static const struct {
	double lean_N, from_mm, along_mm_s;
} leans[] = {{1, 0.1, 0},   {2.5, 0.1, 10}, {0.3, 0.1, 0},
	     {1.9, 0.1, 0}, {3, 3, 0},	    {3.5, 0.1, 60}};

/*
 * A hand notices a force that is off by more than 7 % (Pang, Tan and Durlach, Perception &
 * Psychophysics 49, 1991), a stiffness by more than 23 % (Jones and Hunter, Experimental Brain
 * Research 79, 1990).
 */
#define FORCE_NOTICED 0.07
#define STIFFNESS_NOTICED 0.23

/* A guard at a gain, over all setups; a guard in a scene, at all gains. */
struct row {
	const char *guard;
	double gain; /* NaN: the scene's own */
	bool own;
	int cases, rests;
	double rest_share, swing_mm; /* the largest */
	double force_N, error_N; /* rms in a slow cut: without a guard, and from that */
	double error_share;
	int cuts;
};

struct stiffest {
	const char *guard, *scene;
	int setups, stiffer, softer; /* than without a guard */
	double felt_N_mm;	     /* mean of the stiffest that rests */
	double of_none;
};

static struct row rows[GUARDS * N(gains)];
static struct stiffest stiffests[GUARDS * N(scenes)];

static const struct bench_table guard_table = {
	.key = "guards",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "guard", guard), COLUMN(row, "gain", gain),
		    COLUMN(row, "own", own), COLUMN(row, "cases", cases),
		    COLUMN(row, "rests", rests), COLUMN(row, "rest_share", rest_share),
		    COLUMN(row, "swing_mm", swing_mm), COLUMN(row, "force_N", force_N),
		    COLUMN(row, "error_N", error_N),
		    COLUMN(row, "error_share", error_share)},
	.metrics = {METRIC(EXACT, row, rest_share, "1",
			   "guard {guard}, gain {gain}: rest", .more_is_better = true)},
};

static const struct bench_table stiffest_table = {
	.key = "guards_stiffest",
	.row_bytes = sizeof(struct stiffest),
	.columns = {COLUMN(stiffest, "guard", guard), COLUMN(stiffest, "scene", scene),
		    COLUMN(stiffest, "setups", setups),
		    COLUMN(stiffest, "felt_N_mm", felt_N_mm),
		    COLUMN(stiffest, "of_none", of_none),
		    COLUMN(stiffest, "stiffer", stiffer),
		    COLUMN(stiffest, "softer", softer)},
};

/* A scene on a device, with a tracker and an actuator. */
struct setup {
	struct incise_scene *scene;
	struct incise_plan *plan; /* with the largest gain accepted */
	double tracker_hz;
	double own;		  /* gain of the scene as part of that; 0: not accepted */
	double felt_N_mm[GUARDS]; /* the stiffest that rests and whose force is right */
};

static void set_guard(struct loop *l, const struct setup *s, enum guard kind, double gain)
{
	const struct incise_plan_stability *st = &s->plan->stability;
	double period_s = st->device.period_s, stiffness = gain * st->stiffness_N_mm;
	double unit = st->device.mass_kg * N_S2_PER_MM_KG / period_s, low = 0;
	double force_N = s->scene->limits.force_N;
	double reaction = gain * s->plan->acting[0].number[0];
	int late = s->scene->device.late_ticks, age = st->device.delay_ticks + late;
	/* Damping that acts so late is itself stable below this. */
	double cap = 0.5 * unit * fmin(1, 2 * sin(M_PI / (4.0 * age + 2)));

	for (double high = 2 * cap; kind == PASSIVITY && high - low > cap / 64;) {
		double middle = (low + high) / 2;

		*(wall_rests(&st->device, &s->plan->predict, stiffness,
			     gain * st->damping_N_s_mm + middle, late)
			  ? &low
			  : &high) = middle;
	}
	l->guard = (struct guarded){
		.kind = kind,
		.period_s = period_s,
		.reserve_N_mm = reaction > 0 ? force_N * force_N / 2 / reaction
					     : force_N * st->support_mm,
		.cap_N_s_mm = kind == PASSIVITY ? low / 2 : cap,
		.bound_N_mm = fmin(st->stiffness_N_mm,
				   st->device.damping_N_s_mm / period_s / (age + 1)),
		.coupling_N_mm = gain > 1 ? stiffness / (gain - 1) : INFINITY,
		.tissue_N_mm = stiffness,
		.late = late,
	};
}

static struct loop *new_loop(const struct setup *s, enum guard kind, double gain,
			     double from_mm)
{
	struct loop *l = cli_alloc(1, sizeof(*l));

	copy_plan(l, s->plan, gain, kind != NONE);
	incise_surface_top(s->plan->surface, &l->top);
	l->plane = incise_surface_new_plane(l->top.point_mm, l->top.normal, NULL);
	if (!l->plane)
		cli_fail("guards: no memory");
	l->plan.surface = l->plane;
	incise_proxy_init(&l->plan.proxy, l->plane, s->plan->proxy.leave_mm);
	/* Across the normal; a surface's top has none along y. */
	v3_cross(l->along, (double[3]){0, 1, 0}, l->top.normal);
	set_guard(l, s, kind, gain);
	l->pose_s = 1 / s->tracker_hz;
	l->device = (struct incise_plant){
		.mass_kg = s->scene->device.mass_kg,
		.damping_N_s_mm = s->scene->device.damping_N_s_mm,
		.position_mm = from_mm,
	};
	l->guard.pose_mm = l->guard.at_mm = l->guard.tool_mm = from_mm;
	return l;
}

static void free_loop(struct loop *l)
{
	incise_surface_free(l->plane);
	free(l);
}

/* Lean on it until nothing moves, or to the end. Returns whether it rests. */
static bool lean(const struct setup *s, enum guard kind, double gain, int which,
		 double *swing_mm)
{
	struct loop *l = new_loop(s, kind, gain, leans[which].from_mm);
	double low = INFINITY, high = -INFINITY;
	int window = (int)(STILL_S / l->guard.period_s), still = 0;
	int ticks = (int)(RUN_S / l->guard.period_s), quarter = ticks - ticks / 4;

	while (l->t_s < START_S)
		step(l, 0, 0);
	l->along_mm_s = leans[which].along_mm_s;
	*swing_mm = 0;
	for (int k = 1; k <= ticks && still < 2; k++) {
		step(l, leans[which].lean_N, 0);
		low = fmin(low, l->device.position_mm);
		high = fmax(high, l->device.position_mm);
		/* Outward travel only: a hand that sinks does not swing. */
		*swing_mm = fmax(*swing_mm, l->device.position_mm - low);
		if (k % window || k > quarter)
			continue;
		still = high - low < STILL_MM ? still + 1 : 0;
		if (still == 2)
			break;
		low = INFINITY;
		high = -INFINITY;
		*swing_mm = 0;
	}
	free_loop(l);
	return *swing_mm <= INCISE_REST_SWING_MM;
}

/* In, along and out, slowly led, with a tracker's noise. Returns the number of forces. */
#define CUT_MM_S 10
#define CUT_S 0.5 /* each of them */

static int cut(const struct setup *s, enum guard kind, double gain, double *force_N,
	       int most, double *felt_N_mm)
{
	struct loop *l = new_loop(s, kind, gain, 0.5);
	double period_s = l->guard.period_s;
	int n = (int)(3 * CUT_S / period_s);

	l->noise_mm = INCISE_REST_NOISE_MM;
	while (l->t_s < START_S)
		step(l, 0, 0);
	*felt_N_mm = 0;
	for (int k = 0; k < n && k < most; k++) {
		int part = (int)(k * period_s / CUT_S);

		l->along_mm_s = part == 1 ? CUT_MM_S : 0;
		force_N[k] = step(l, 0, (part - 1) * CUT_MM_S);
		if (part == 1)
			*felt_N_mm -=
				force_N[k] / l->device.position_mm * period_s / CUT_S;
	}
	free_loop(l);
	return n < most ? n : most;
}

/* The plan with the largest gain that is known to be accepted: the scene's own, or what the refusal
 * of the largest one of all says. */
static void accept(struct setup *s)
{
	static const char advice[] = "tissue.gain to at most ";
	const struct incise_tracker_info tracker = {
		.rate_hz = s->tracker_hz, .latency_ns = llround(LATENCY_S * 1e9)};
	struct incise_plan *own = incise_plan_new_fed(s->scene, &tracker, NULL);
	double gain = s->scene->tissue.gain;
	struct incise_error err = {0};
	const char *at = advice;

	for (s->scene->tissue.gain = 10;
	     at && !(s->plan = incise_plan_new_fed(s->scene, &tracker, &err));) {
		at = strstr(err.text, advice);
		if (at)
			s->scene->tissue.gain = atof(at + strlen(advice));
	}
	if (own && (!s->plan || gain > s->plan->gain)) {
		incise_plan_free(s->plan);
		s->plan = own;
	}
	s->own = own ? gain / s->plan->gain : 0;
	if (s->plan != own)
		incise_plan_free(own);
}

static void try(struct setup *s, int g, bool quick)
{
	enum { MOST = 4000 };
	static double unguarded_N[MOST], force_N[MOST];
	double gain = gains[g] > 0 ? gains[g] : s->own;

	for (enum guard kind = NONE; gain > 0 && kind < GUARDS; kind++) {
		struct row *row = &rows[kind * N(gains) + g];
		double felt, swing_mm, force2 = 0, error2 = 0;
		bool all = true;
		int n = cut(s, kind, gain, kind == NONE ? unguarded_N : force_N, MOST,
			    &felt);

		for (int i = 0; i < n; i++) {
			double error_N = kind == NONE ? 0 : force_N[i] - unguarded_N[i];

			force2 += unguarded_N[i] * unguarded_N[i] / n;
			error2 += error_N * error_N / n;
		}
		for (int i = 0; i < (quick ? 2 : N(leans)); i++) {
			bool rests = lean(s, kind, gain, i, &swing_mm);

			all &= rests;
			row->cases++;
			row->rests += rests;
			row->swing_mm = fmax(row->swing_mm, swing_mm);
		}
		if (all && error2 <= FORCE_NOTICED * FORCE_NOTICED * force2)
			s->felt_N_mm[kind] = fmax(s->felt_N_mm[kind], felt);
		row->force_N += force2; /* squared until all are in */
		row->error_N += error2;
		row->cuts++;
	}
}

static struct setup new_setup(int scene, double tracker_hz, int late, int device)
{
	struct setup s = {.tracker_hz = tracker_hz};
	struct scene_argument argument = {0};

	if (!scene_argument_find(&argument,
				 cli_text("%.*s", (int)strcspn(scenes[scene], " "),
					  scenes[scene])))
		cli_fail("guards: there is no scene %s", argument.path);
	s.scene = scene_argument_load(&argument);
	s.scene->tissue.dissipates &= !strchr(scenes[scene], ' ');
	s.scene->effects.average_ticks = 1; /* of a plane */
	s.scene->device.mass_kg = devices[device].mass_kg;
	s.scene->device.damping_N_s_mm = devices[device].damping_N_s_mm;
	s.scene->device.late_ticks = late;
	accept(&s);
	if (!s.plan)
		cli_fail("guards: no gain of %s is accepted", scenes[scene]);
	return s;
}

static void free_setup(struct setup *s)
{
	incise_plan_free(s->plan);
	incise_scene_free(s->scene);
}

static void add_setup(int scene, double tracker_hz, int late, int device, bool quick)
{
	struct setup s = new_setup(scene, tracker_hz, late, device);

	cli_progress("guards: %s, %g Hz, %d ticks late", scenes[scene], tracker_hz, late);
	for (int g = 0; g < N(gains); g++)
		try(&s, g, quick);
	for (enum guard kind = NONE; kind < GUARDS; kind++) {
		struct stiffest *stiffest = &stiffests[kind * N(scenes) + scene];

		stiffest->setups++;
		stiffest->felt_N_mm += s.felt_N_mm[kind];
		stiffest->stiffer += s.felt_N_mm[kind] > 1.01 * s.felt_N_mm[NONE];
		stiffest->softer += s.felt_N_mm[kind] < 0.99 * s.felt_N_mm[NONE];
	}
	free_setup(&s);
}

/* Means of all that was added. Returns the number of accepted cases that rest without a guard
 * and not with one. */
static void finish(int lost[GUARDS])
{
	for (int i = 0; i < N(rows); i++) {
		struct row *r = &rows[i];
		const struct row *none = &rows[i % N(gains)];

		r->guard = guard_names[i / N(gains)];
		r->gain = gains[i % N(gains)] > 0 ? gains[i % N(gains)] : NAN;
		r->own = isnan(r->gain);
		r->rest_share = (double)r->rests / r->cases;
		r->force_N = sqrt(r->force_N / r->cuts);
		r->error_N = sqrt(r->error_N / r->cuts);
		r->error_share = r->error_N / r->force_N;
		if (gains[i % N(gains)] <= 1)
			lost[i / N(gains)] += none->rests - r->rests;
	}
	for (int i = 0; i < N(stiffests); i++) {
		struct stiffest *b = &stiffests[i];

		b->guard = guard_names[i / N(scenes)];
		b->scene = scenes[i % N(scenes)];
		b->felt_N_mm /= b->setups;
		b->of_none = b->felt_N_mm / stiffests[i % N(scenes)].felt_N_mm;
	}
}

/* A guard wins if no accepted case is lost by it, and scenes can be noticeably stiffer with it. */
static void judge(struct bench_run *run)
{
	enum guard best = NONE;
	double most = 1 + STIFFNESS_NOTICED;
	int lost[GUARDS] = {0};

	finish(lost);
	for (enum guard kind = PASSIVITY; kind < GUARDS; kind++) {
		double mean = 0;

		for (int i = 0; i < N(scenes); i++)
			mean += stiffests[kind * N(scenes) + i].of_none / N(scenes);
		if (lost[kind] <= 0 && mean > most) {
			most = mean;
			best = kind;
		}
	}
	bench_value(run, "guards_winner", json_string(guard_names[best]));
	bench_rows(run, &guard_table, rows, N(rows));
	bench_rows(run, &stiffest_table, stiffests, N(stiffests));
}

static void run_guards(struct bench_run *run)
{
	bool quick = run->quick;

	for (int i = 0; i < N(scenes); i++)
		for (int t = 0; t < (quick ? 1 : N(trackers_hz)); t++)
			for (int a = 0; a < (quick ? 1 : N(lates)); a++)
				for (int d = 0; d < (quick ? 1 : N(devices)); d++)
					add_setup(i, trackers_hz[t], lates[a], d, quick);
	cli_progress_end();
	judge(run);
}

const struct bench bench_program = {
	.name = "guards",
	.summary = "passivity controllers in the real plan, with delays",
	.run = run_guards,
};
