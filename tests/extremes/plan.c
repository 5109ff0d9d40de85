// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Whole plans on each kind of ground with all effects on, fed with poses that no tracker should
 * send. Each tick is checked.
 *
 *     good poses ──▶ bad ones ──▶ good ones ── … ──▶ away: no force ──▶ press: a force
 *        in the tissue               in the tissue
 *
 * The poses of a property are bad in one way each; those of the last are bad in all of them.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "../../lib/base/vector.h"
#include "../../lib/scene/plan.h"
#include "extremes.h"
#include "fed_run.h"
#include "numbers.h"

#define TICKS 12000 /* of each kind on each ground */
#define BURST 40    /* good or bad ones in a row, at most */
#define HOUR_NS INT64_C(3600000000000)

/* ---- one kind of bad poses after the other ---- */

/* In what a burst is bad. */
enum bad {
	BAD_NAN,
	BAD_HUGE,
	BAD_TINY,
	BAD_BITS,
	BAD_JUMPS,
	BAD_TURNS,
	BAD_BACK,
	BAD_REPEAT,
	BAD_NS,
	BAD_HOURS,
	BAD_TIMES,
	BAD_CROWD,
	BAD_SILENCE,
	BAD_TICKS,
	BAD_EXACT,
	BAD_TOOLS,
	BADS,
};

struct run {
	struct fed_run fed;
	int64_t step_ns;
	double upright[4]; /* the handle away from the tissue */
};

/* A hand at work below the surface, 125 poses a second; ticks of the run's rate. */
static void stroke(struct run *run, int ticks)
{
	double p[3];

	for (int k = 0; k < ticks; k++) {
		double t = (double)run->fed.t_ns * 1e-9;

		fed_run_above(&run->fed, -2 + 2.5 * sin(6 * t), p);
		p[0] += 4 * sin(5 * t);
		if (k % 8 == 0)
			fed_run_feed(&run->fed, run->fed.t_ns, p, run->upright);
		fed_run_step(&run->fed, run->step_ns);
	}
}

static void bad_number(enum bad bad, double *x)
{
	static const double none[] = {NAN, -NAN, INFINITY, -INFINITY};

	switch (bad) {
	case BAD_NAN:
		*x = none[below(4)];
		break;
	case BAD_HUGE:
		*x = copysign(pow(10, between(5, 308)), between(-1, 1));
		break;
	case BAD_TINY:
		*x = DBL_TRUE_MIN * (below(2) ? 1 : between(-1e9, 1e9));
		break;
	case BAD_BITS:
		*x = below(2) ? any_bits() : special();
		break;
	default:
		break;
	}
}

static void bad_pose(const struct run *run, enum bad bad, double p[3], double q[4])
{
	fed_run_above(&run->fed, between(-4, 4), p);
	memcpy(q, run->upright, 4 * sizeof(*q));
	for (int i = 0; i < 4; i++) {
		bad_number(bad, i < 3 && below(2) ? &p[i] : &q[i]);
		if (bad == BAD_JUMPS)
			p[i % 3] = between(-12000, 12000);
		if (bad == BAD_TURNS) {
			any_attitude(q);
			if (below(2))
				q[i] *= pow(10, between(-308, 308));
		}
	}
	if (bad != BAD_EXACT)
		return;
	if (below(2))
		v3_copy(p, run->fed.tick.proxy_mm);
	else if (below(2))
		fed_run_above(&run->fed, below(2) ? 0 : nextafter(0, between(-1, 1)), p);
	else
		v3_copy(p, (const double[3]){0, 0, -40});
}

static int64_t bad_time(const struct run *run, enum bad bad, int64_t *last)
{
	switch (bad) {
	case BAD_BACK:
		return *last -= (int64_t)between(0, 1e8);
	case BAD_REPEAT:
		return *last;
	case BAD_NS:
		return *last += 1;
	case BAD_HOURS:
		return *last += HOUR_NS;
	case BAD_TIMES:
		return below(4) ? (int64_t)any() : below(2) ? INT64_MAX : INT64_MIN;
	default:
		return run->fed.t_ns;
	}
}

static void bad_burst(struct run *run, enum bad bad)
{
	static const int64_t steps[] = {0, 1, MS, YEAR_NS, 3000 * MS};
	int64_t last_ns = run->fed.t_ns;
	double p[3], q[4];

	for (int k = (int)below(BURST); k; k--) {
		int n = bad == BAD_CROWD     ? (int)below(60)
			: bad == BAD_SILENCE ? 0
					     : (int)below(3);

		while (n--) {
			bad_pose(run, bad, p, q);
			fed_run_feed(&run->fed, bad_time(run, bad, &last_ns), p, q);
		}
		if (bad == BAD_TOOLS)
			incise_plan_set_tool(run->fed.plan, (enum incise_tool)below(5));
		if (bad == BAD_TICKS)
			fed_run_step(&run->fed,
				     steps[below(run->fed.t_ns > INT64_MAX / 2 ? 3 : 5)]);
		else
			fed_run_step(&run->fed, bad == BAD_HOURS && !below(4)
							? HOUR_NS
							: run->step_ns);
	}
}

/*
 * 6 mm of at least 0.1 N/mm, less what dents of the surface take off; an open cut has less: of a front any, of a
 * spring a tenth, where cuts are kept.
 */
static bool pushes(const struct fed_run *fed, double push_N)
{
	return fed->tick.flags & INCISE_TICK_CONTACT &&
	       (fed->plan->dissipates ? isfinite(push_N)
				      : push_N > (fed->plan->inserts ? 0.01 : 0.1));
}

/* Nothing of what was before is left: no force in the air, and one in the tissue. */
static void recover(struct run *run)
{
	struct fed_run *fed = &run->fed;
	double away_mm = fed->ground->away_mm, push_N;

	if (fed->t_ns > INT64_MAX - YEAR_NS)
		return;
	incise_plan_set_tool(fed->plan, INCISE_TOOL_BLADE);
	fed_run_move(fed, away_mm, away_mm, 0, 1000, run->upright);
	push_N = v3_length(fed->tick.command_N);
	extremes_check(fed->row, push_N == 0, "%s: still %a N in free air",
		       fed->ground->name, push_N);
	fed_run_move(fed, away_mm, 5, 304, 296, run->upright);
	fed_run_move(fed, 5, -6, 400, 400, run->upright);
	push_N = v3_dot(fed->tick.command_N, fed->top.normal);
	extremes_check(fed->row, pushes(fed, push_N),
		       "%s: pressed in, and only %a N, depth %a, flags %#x",
		       fed->ground->name, push_N, fed->tick.depth_mm, fed->tick.flags);
	fed_run_move(fed, -6, 5, 200, 200, run->upright);
}

/*
 * Run @work on each ground, in integers and in double, and check that it recovers. Half of them
 * have a model; of a part of the cases a sixth, and another one for each kind of property, as a
 * model's plan searches for swings.
 */
static void on_each_ground(struct extremes_row *row, const struct property *property,
			   void (*work)(struct run *run, const struct property *property))
{
	static const char *const names[] = {"plane",   "sphere", "capsule",
					    "heights", "mesh",	 "cavity"};

	for (int g = 0; g < 12; g++) {
		const struct ground *ground = ground_of(names[g / 2]);
		bool fixed = g % 2;
		bool model = (g / 2 + fixed) % 2 &&
			     (row->setup->part == 1 || g / 2 % 3 == property->kind % 3);
		struct run run = {.step_ns = MS};
		struct incise_scene *scene;

		/* Of a part of the cases a kind has a third of the grounds. */
		if (row->setup->part > 1 && (g + property->kind) % 3)
			continue;
		scene = ground_scene(ground, fixed, model);
		fed_run_begin(&run.fed, row, ground, scene, MS);
		run.upright[run.fed.top.normal[2] < 0] = 1; /* in the cavity about x */
		incise_plan_set_tool(run.fed.plan, INCISE_TOOL_BLADE);
		work(&run, property);
		if (!run.fed.contacts)
			extremes_check(row, false, "%s: never in contact", ground->name);
		fed_run_end(&run.fed);
		incise_scene_free(scene);
	}
}

static void work_badly(struct run *run, const struct property *property)
{
	const struct extremes_row *row = run->fed.row;
	long until = row->tried + extremes_cases(row, property->cases);

	stroke(run, 600); /* past the start, where there is little force */
	while (row->tried < until && run->fed.t_ns < INT64_MAX - YEAR_NS) {
		bad_burst(run, (enum bad)property->kind);
		stroke(run, (int)below(4 * BURST));
	}
	recover(run);
}

static void try_bad(struct extremes_row *row, const struct property *property)
{
	on_each_ground(row, property, work_badly);
}

/* A plan is made for a rate, but is ticked when it is ticked. */
static void work_at_any_rate(struct run *run, const struct property *property)
{
	static const double rates[] = {1, 10, 100, 1000, 8000, 20000, 64000};

	for (size_t k = 0; k < sizeof(rates) / sizeof(*rates); k++) {
		run->step_ns = (int64_t)(1e9 / rates[k]);
		stroke(run, 300);
		for (long n = extremes_cases(run->fed.row, property->cases); n; n--) {
			/* Not to the end of time. */
			enum bad bad = (enum bad)below(BADS);

			bad_burst(run, bad == BAD_TICKS ? BAD_BITS : bad);
			stroke(run, (int)below(4 * BURST));
		}
		run->step_ns = MS;
		recover(run);
	}
}

static void try_rates(struct extremes_row *row, const struct property *property)
{
	on_each_ground(row, property, work_at_any_rate);
}

/* ---- all kinds at once, and states that only chance meets ---- */

/* Ticks between two recoveries. */
#define EPISODE 20000

/* States that a run must have met to mean anything. */
enum met {
	MET_CONTACT,
	MET_INSERTION,
	MET_CLAMPED,
	MET_SLEWED,
	MET_STALE,
	MET_EXTRAPOLATED,
	MET_STARTING,
	MET_ON_SURFACE, /* a depth of 0 in contact, to the bit */
	MET_ON_PROXY,	/* tool and proxy in one place, to the bit */
	MET_AT_AGE,	/* a pose as old as may be, to the ns, or 1 ns more or less */
	MET_NO_TIME,	/* two ticks at one time */
	MET_YEARS,
	MET_HANDLE,
	MET_TUBE,
	MET_RECOVERED,
	METS,
};

static const char *const met_names[METS] = {
	"contact",	"insertion", "clamped",	   "slewed",   "stale",
	"extrapolated", "starting",  "on surface", "on proxy", "at age",
	"no time",	"years",     "handle",	   "tube",     "recovered",
};

struct chaos {
	struct fed_run fed;
	enum incise_tool tool; /* what is gone back to */
	long ticks, poses, *met;
	double at_mm[3], speed_mm_s[3], attitude[4]; /* of a stroke */
};

static void count(struct chaos *run, int64_t was_ns)
{
	const struct incise_tick *t = &run->fed.tick;
	bool contact = t->flags & INCISE_TICK_CONTACT;
	const bool is[METS] = {
		[MET_CONTACT] = contact,
		[MET_INSERTION] = t->phase == INCISE_PHASE_INSERTION,
		[MET_CLAMPED] = t->flags & INCISE_TICK_CLAMPED,
		[MET_SLEWED] = t->flags & INCISE_TICK_SLEWED,
		[MET_STALE] = t->flags & INCISE_TICK_STALE,
		[MET_EXTRAPOLATED] = t->flags & INCISE_TICK_EXTRAPOLATED,
		[MET_STARTING] = t->flags & INCISE_TICK_STARTING,
		[MET_ON_SURFACE] = contact && run->fed.plan->proxy.touch.depth_mm == 0,
		[MET_ON_PROXY] = contact && t->tool_mm[0] == t->proxy_mm[0] &&
				 t->tool_mm[1] == t->proxy_mm[1] &&
				 t->tool_mm[2] == t->proxy_mm[2],
		[MET_NO_TIME] = run->fed.t_ns == was_ns,
		[MET_YEARS] = (double)run->fed.t_ns - (double)was_ns > YEAR_NS,
		[MET_HANDLE] = t->tool == INCISE_TOOL_HANDLE,
		[MET_TUBE] = t->tool == INCISE_TOOL_TUBE,
	};

	for (int m = 0; m < METS; m++)
		run->met[m] += is[m];
}

/* The scalpel's last pose: when it was acquired, and when it came. */
struct last {
	int64_t t_ns, arrival_ns;
	bool started;
};

static struct last last_pose(const struct incise_plan *plan)
{
	const struct incise_double_predict *p = &plan->doubles.state.scalpel;
	const struct incise_fixed_predict *f;

	if (!plan->integers)
		return (struct last){p->t_ns, p->arrival_ns, p->started};
	f = &plan->integers->state.scalpel;
	return (struct last){f->t_ns, f->arrival_ns, f->started};
}

static int64_t any_time(const struct chaos *run)
{
	int64_t t_ns = run->fed.t_ns;
	struct last last = last_pose(run->fed.plan);

	switch (below(40)) {
	case 0:
		return (int64_t)any();
	case 1:
		return INT64_MAX;
	case 2:
		return INT64_MIN;
	case 3:
		return last.t_ns; /* as long ago as the last was late */
	case 4:
		return last.arrival_ns;
	case 5:
		return t_ns < INT64_MAX ? t_ns + 1 : INT64_MAX;
	case 6:
		return -1;
	default:
		return t_ns;
	}
}

/*
 * Places that decide something, reached to the bit: a pose more than 20 mm off is taken as
 * it is, without a filter.
 */
static void exact_place(const struct chaos *run, double p[3])
{
	static const double heights[] = {0, -0.0, GROUND_LEAVE_MM, -0x1p-20, 1e-6, 1e-9};
	double height;

	switch (below(4)) {
	case 0:
		v3_copy(p, run->fed.tick.proxy_mm);
		return;
	case 1:
		/* The centre of sphere and ball, the end of the capsule's axis. */
		p[0] = p[1] = 0;
		p[2] = !strcmp(run->fed.ground->name, "capsule") ? -55 : -40;
		return;
	default:
		height = heights[below(6)];
		for (int n = (int)below(3); n; n--)
			height = nextafter(height, below(2) ? -1 : 1);
		fed_run_above(&run->fed, height, p);
	}
}

static void feed(struct chaos *run, int64_t t_ns, const double p[3], const double q[4])
{
	run->poses += fed_run_feed(&run->fed, t_ns, p, q);
}

/* A hand at work around the top, one pose in 8 ticks. */
static void stroke_about(struct chaos *run)
{
	const double *top = run->fed.top.point_mm;

	for (int i = 0; i < 3; i++) {
		double off;

		run->at_mm[i] += 0.001 * run->speed_mm_s[i];
		off = run->at_mm[i] - top[i];
		if (!(fabs(off) < 30))
			run->speed_mm_s[i] = -copysign(run->speed_mm_s[i], off);
		if (!(fabs(off) < 35))
			run->at_mm[i] = top[i];
	}
	if (run->ticks % 8)
		return;
	if (!below(20))
		for (int i = 0; i < 3; i++)
			run->speed_mm_s[i] = between(-200, 200);
	feed(run, run->fed.t_ns, run->at_mm, run->attitude);
}

enum mode { STROKE, NEAR, METRES, BITS, SPECIAL, EXACT, SILENT, CROWD, MODES };

static void any_pose(struct chaos *run, enum mode mode)
{
	double p[3], q[4];

	if (mode == STROKE) {
		stroke_about(run);
		return;
	}
	if (mode == SILENT)
		return;
	for (int n = mode == CROWD ? (int)below(60) : 1 + (int)below(3); n; n--) {
		any_attitude(q);
		for (int i = 0; i < 3; i++)
			p[i] = mode == METRES ? between(-12000, 12000)
			       : mode == BITS ? any_bits()
			       : mode == SPECIAL
				       ? special()
				       : run->fed.top.point_mm[i] + between(-60, 60);
		/* In turns: far off, then the exact place. */
		if (mode == EXACT && (n & 1))
			exact_place(run, p);
		feed(run, any_time(run), p, q);
	}
}

/* To where the last pose is as old as may be. */
static int64_t step_to_age(struct chaos *run)
{
	struct last last = last_pose(run->fed.plan);
	int64_t at_ns = last.t_ns;

	at_ns += at_ns < INT64_MAX - YEAR_NS ? GROUND_AGE_NS - 1 + below(3) : 0;
	if (!last.started || at_ns <= run->fed.t_ns)
		return 0;
	run->met[MET_AT_AGE]++;
	return at_ns - run->fed.t_ns;
}

static int64_t any_step(struct chaos *run)
{
	switch (below(256)) {
	case 0:
		return below(16) ? 1 : (int64_t)between(0, 3e9);
	case 1:
		return below(64) ? (int64_t)between(0, 2e7)
				 : (int64_t)between(0, 4.0 * YEAR_NS);
	case 2:
	case 3:
		return step_to_age(run);
	case 4:
	case 5:
	case 6:
	case 7:
		return 0;
	default:
		return MS;
	}
}

/* Now and then another tool, or one that there is not. */
static void any_tool(struct chaos *run)
{
	struct incise_plan *plan = run->fed.plan;
	int rc = 0;

	if (!below(1024))
		rc = incise_plan_set_tool(plan, (enum incise_tool)below(4));
	if (!rc && !below(1024))
		rc = incise_plan_set_tool(plan, (enum incise_tool)(4 + below(1000))) !=
		     -EINVAL;
	if (rc)
		extremes_check(run->fed.row, false, "setting a tool: %d", rc);
	if (!below(256))
		incise_plan_set_tool(plan, run->tool);
}

static void episode(struct chaos *run)
{
	enum mode mode = STROKE;
	int left = 0;

	for (int k = 0; k < EPISODE; k++, run->ticks++) {
		int64_t was_ns = run->fed.t_ns;

		if (!left--) {
			mode = below(3) ? (enum mode)below(MODES) : STROKE;
			left = (int)below(mode == STROKE ? 600 : 120);
			any_attitude(run->attitude);
			if (below(2))
				exact_place(run, run->at_mm);
		}
		any_pose(run, mode);
		any_tool(run);
		fed_run_step(&run->fed, any_step(run));
		count(run, was_ns);
	}
}

static void check_free(struct chaos *run)
{
	const struct incise_tick *t = &run->fed.tick;

	extremes_check(run->fed.row,
		       t->phase == INCISE_PHASE_FREE && v3_length(t->command_N) == 0,
		       "%s: in free air phase %d, %a N, flags %#x", run->fed.ground->name,
		       t->phase, v3_length(t->command_N), t->flags);
}

/* In free air there is no force, however the hand moves. */
static void wave(struct chaos *run, const double attitude[4])
{
	double away_mm = run->fed.ground->away_mm;

	run->fed.waved = true;
	fed_run_move(&run->fed, away_mm, away_mm - 20, 200, 80, attitude);
	fed_run_move(&run->fed, away_mm - 20, away_mm, 200, 80, attitude);
	run->fed.waved = false;
}

/* Out, and in again: nothing of what was before is left. */
static void recover_from_all(struct chaos *run)
{
	static const double turns[][4] = {{1}, {0, 1}, {M_SQRT1_2, M_SQRT1_2}};
	const double *attitude = turns[below(3)];
	double away_mm = run->fed.ground->away_mm, push_N;

	/* No tracker's times are below 0. Farther than an int64_t holds, from its end. */
	if (run->fed.t_ns < 0)
		fed_run_tick(&run->fed, 20 * YEAR_NS);
	incise_plan_set_tool(run->fed.plan, run->tool);
	fed_run_move(&run->fed, away_mm, away_mm, 0, 1000, attitude);
	check_free(run);
	wave(run, attitude);
	fed_run_move(&run->fed, away_mm, 5, 400, 80, attitude);
	fed_run_move(&run->fed, 5, -6, 224, 80, attitude);
	push_N = v3_dot(run->fed.tick.command_N, run->fed.top.normal);
	extremes_check(run->fed.row, pushes(&run->fed, push_N),
		       "%s: pressed in, and only %a N, flags %#x", run->fed.ground->name,
		       push_N, run->fed.tick.flags);
	fed_run_move(&run->fed, -6, 5, 224, 80, attitude);
	fed_run_move(&run->fed, 5, away_mm, 400, 280, attitude);
	check_free(run);
	run->met[MET_RECOVERED]++;
}

/* @number: of ground, arithmetic and tool. */
static void try_chaos(struct extremes_row *row, const struct incise_scene *scene,
		      const struct ground *ground, int number, long poses, long met[METS])
{
	/* Where time starts; a plan's last_ns of 0 has a meaning of its own. */
	static const int64_t starts[] = {
		0, 1000000000, 1, INT64_MIN, -1, -MS, MS, INT64_MAX - 3 * MS * EPISODE};
	struct chaos run = {.met = met,
			    .tool = number % 2 ? INCISE_TOOL_TUBE : INCISE_TOOL_AUTO};

	fed_run_begin(&run.fed, row, ground, scene, starts[number % 8]);
	while (run.poses < poses) {
		episode(&run);
		if (run.fed.t_ns < INT64_MAX - YEAR_NS)
			recover_from_all(&run);
	}
	fed_run_end(&run.fed);
}

static void try_any_poses(struct extremes_row *row, const struct property *property)
{
	/* The large mesh is the same to the code as the small one. */
	const int n = (GROUNDS - 1) * 4;
	long met[METS] = {0}, poses = extremes_cases(row, property->cases);
	struct incise_scene *scene = NULL;

	for (int k = 0; k < n; k++) {
		const struct ground *ground = &grounds[k / 4];

		if (k % 2 == 0) {
			incise_scene_free(scene);
			scene = ground_scene(ground, k % 4 == 0, (k / 4 + k / 2) % 2);
		}
		try_chaos(row, scene, ground, k, poses / n, met);
	}
	incise_scene_free(scene);
	/* Even a short run meets everything. */
	for (int m = 0; m < METS; m++)
		extremes_check(row, met[m] >= 10, "%s was met %ld times only",
			       met_names[m], met[m]);
}

#define BAD(name, what, bad)                                   \
	{                                                      \
		name, what, TICKS, .all = try_bad, .kind = bad \
	}

const struct property plan_properties[] = {
	BAD("pose_nan",
	    "poses of NaN and infinities on plane, sphere, capsule, heights, mesh and "
	    "cavity, all effects on, in integers and in double: each tick finite, its force "
	    "within limits.force_N, its change within the slew, no fault",
	    BAD_NAN),
	BAD("pose_huge", "the same with places of 1e5 to 1e308", BAD_HUGE),
	BAD("pose_tiny", "the same with denormals", BAD_TINY),
	BAD("pose_bits", "the same with any 64 bits", BAD_BITS),
	BAD("pose_leaps", "the same with leaps of metres", BAD_JUMPS),
	BAD("pose_turns", "the same with quaternions of any length, and of none",
	    BAD_TURNS),
	BAD("time_back", "the same with times that go back", BAD_BACK),
	BAD("time_repeats", "the same with times that repeat", BAD_REPEAT),
	BAD("time_1ns", "the same with poses 1 ns apart", BAD_NS),
	BAD("time_1h", "the same with poses 1 h apart, and ticks too", BAD_HOURS),
	BAD("time_any", "the same with any time stamp", BAD_TIMES),
	BAD("pose_crowd", "the same with up to 60 poses for a tick", BAD_CROWD),
	BAD("pose_none", "the same with none for longer than they may be old",
	    BAD_SILENCE),
	BAD("tick_any", "the same with ticks that repeat, 1 ns apart, and after years",
	    BAD_TICKS),
	BAD("place_exact",
	    "the same with places on the surface, on the proxy and in centres",
	    BAD_EXACT),
	BAD("tool_any", "the same with tools that are changed at any time", BAD_TOOLS),
	{"rates",
	 "ticks 1, 10, 100, 1000, 8000, 20000 and 64000 times a second, of plans made "
	 "for 1 kHz, with good and bad poses: as above",
	 TICKS / 400, .all = try_rates},
	{"pose_any", "the same with all of this at once, and any beginning of time",
	 10000000, .all = try_any_poses, .for_tests_only = true},
	{0},
};
