// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Whole plans on each kind of ground with all effects on, fed with poses that no tracker
 * should send. Each tick is judged.
 *
 *     good poses ──▶ bad ones ──▶ good ones ── … ──▶ away: no force ──▶ press: a force
 *        in the tissue               in the tissue
 */
#include <stdio.h>
#include <string.h>
#include <incise/plan.h>
#include "any_pose.h"
#include "../cli/cli.h"
#include "extremes.h"
#include "extremes_ground.h"

#define TICKS 12000 /* of each kind on each ground */
#define BURST 40    /* good or bad ones in a row, at most */
#define MS INT64_C(1000000)
#define HOUR_NS INT64_C(3600000000000)
#define YEAR_NS INT64_C(31557600000000000)

struct run {
	const struct ground *ground;
	struct incise_plan *plan;
	struct incise_scene_limits limits;
	struct incise_touch top;
	int64_t t_ns, step_ns;
	double slew_N;
	double upright[4]; /* the handle away from the tissue */
	struct incise_tick tick;
	long touched; /* ticks in contact */
	struct extremes_row *row;
};

/* How a burst is bad. */
enum bad {
	BAD_NAN,
	BAD_HUGE,
	BAD_TINY,
	BAD_BITS,
	BAD_LEAPS,
	BAD_TURNS,
	BAD_BACK,
	BAD_REPEAT,
	BAD_NS,
	BAD_HOURS,
	BAD_STAMPS,
	BAD_CROWD,
	BAD_SILENCE,
	BAD_TICKS,
	BAD_EXACT,
	BAD_TOOLS,
	BADS,
};

static const struct {
	const char *name, *what;
} bads[BADS] = {
	{"pose_nan",
	 "poses of NaN and infinities on plane, sphere, capsule, heights, mesh and cavity, "
	 "all effects on, in integers and in double: each tick finite, its force within "
	 "limits.force_N, its change within the slew, no fault"},
	{"pose_huge", "the same with places of 1e5 to 1e308"},
	{"pose_tiny", "the same with denormals"},
	{"pose_bits", "the same with any 64 bits"},
	{"pose_leaps", "the same with leaps of metres"},
	{"pose_turns", "the same with quaternions of any length, and of none"},
	{"time_back", "the same with times that go back"},
	{"time_repeats", "the same with times that repeat"},
	{"time_1ns", "the same with poses 1 ns apart"},
	{"time_1h", "the same with poses 1 h apart, and ticks too"},
	{"time_any", "the same with any time stamp"},
	{"pose_crowd", "the same with up to 60 poses for a tick"},
	{"pose_none", "the same with none for longer than they may be old"},
	{"tick_any", "the same with ticks that repeat, 1 ns apart, and after years"},
	{"place_exact",
	 "the same with places on the surface, on the proxy and in centres"},
	{"tool_any", "the same with tools that are changed at any time"},
};

static double length(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static bool finite3(const double v[3])
{
	return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

static void tick_at(struct run *run, int64_t t_ns)
{
	struct incise_tick was = run->tick, *t = &run->tick;
	double change[3];
	int rc = incise_plan_tick(run->plan, t_ns, t);

	run->t_ns = t_ns;
	for (int i = 0; i < 3; i++)
		change[i] = t->command_N[i] - was.command_N[i];
	run->touched += !!(t->flags & INCISE_TICK_CONTACT);
	if (extremes_first_wrong(
		    run->row,
		    !rc && finite3(t->position_mm) && finite3(t->tool_mm) &&
			    finite3(t->proxy_mm) && finite3(t->normal) &&
			    finite3(t->command_N) && isfinite(t->depth_mm) &&
			    isfinite(t->velocity_mm_s) && isfinite(t->rendered_N) &&
			    !(t->flags & (INCISE_TICK_FAULT | INCISE_TICK_NOT_FINITE)) &&
			    length(t->command_N) <= run->limits.force_N &&
			    length(change) <= run->slew_N * (1 + 1e-12)))
		extremes_tell(
			run->row,
			"%s: tick at %lld ns, case %ld: %d, force (%a, %a, %a) after (%a, "
			"%a, %a), depth %a, v %a, flags %#x",
			run->ground->name, (long long)t_ns, run->row->tried, rc,
			t->command_N[0], t->command_N[1], t->command_N[2],
			was.command_N[0], was.command_N[1], was.command_N[2], t->depth_mm,
			t->velocity_mm_s, t->flags);
}

static void feed(struct run *run, int64_t t_ns, const double p[3], const double q[4])
{
	struct incise_tracker_sample s = {.t_ns = t_ns, .status = ' ', .station = 1};

	memcpy(s.position_mm, p, sizeof(s.position_mm));
	memcpy(s.quaternion, q, sizeof(s.quaternion));
	incise_plan_feed(run->plan, &s, 1);
}

static void above_top(const struct run *run, double mm, double p[3])
{
	for (int i = 0; i < 3; i++)
		p[i] = run->top.point_mm[i] + mm * run->top.normal[i];
}

/* Time goes on, as far as it goes. */
static void step(struct run *run, int64_t ns)
{
	tick_at(run, run->t_ns > INT64_MAX - ns ? INT64_MAX : run->t_ns + ns);
}

/* A hand at work below the surface, 125 poses a second; ticks of the run's rate. */
static void stroke(struct run *run, int ticks)
{
	double p[3];

	for (int k = 0; k < ticks; k++) {
		double t = (double)run->t_ns * 1e-9;

		above_top(run, -2 + 2.5 * sin(6 * t), p);
		p[0] += 4 * sin(5 * t);
		if (k % 8 == 0)
			feed(run, run->t_ns, p, run->upright);
		step(run, run->step_ns);
	}
}

static void bad_pose(const struct run *run, enum bad bad, double p[3], double q[4])
{
	static const double none[] = {NAN, -NAN, INFINITY, -INFINITY};

	above_top(run, between(-4, 4), p);
	memcpy(q, run->upright, 4 * sizeof(*q));
	for (int i = 0; i < 4; i++) {
		double *x = i < 3 && below(2) ? &p[i] : &q[i];

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
		case BAD_LEAPS:
			p[i % 3] = between(-12000, 12000);
			break;
		case BAD_TURNS:
			any_attitude(q);
			if (below(2))
				q[i] *= pow(10, between(-308, 308));
			break;
		default:
			break;
		}
	}
	if (bad != BAD_EXACT)
		return;
	if (below(2))
		memcpy(p, run->tick.proxy_mm, 3 * sizeof(*p));
	else if (below(2))
		above_top(run, below(2) ? 0 : nextafter(0, between(-1, 1)), p);
	else
		memcpy(p, (const double[3]){0, 0, -40}, 3 * sizeof(*p));
}

static int64_t bad_stamp(struct run *run, enum bad bad, int64_t *last)
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
	case BAD_STAMPS:
		return below(4) ? (int64_t)any() : below(2) ? INT64_MAX : INT64_MIN;
	default:
		return run->t_ns;
	}
}

static void bad_burst(struct run *run, enum bad bad)
{
	int64_t last_ns = run->t_ns, steps[] = {0, 1, MS, YEAR_NS, 3000 * MS};
	double p[3], q[4];

	for (int k = (int)below(BURST); k; k--) {
		int n = bad == BAD_CROWD     ? (int)below(60)
			: bad == BAD_SILENCE ? 0
					     : (int)below(3);

		while (n--) {
			bad_pose(run, bad, p, q);
			feed(run, bad_stamp(run, bad, &last_ns), p, q);
		}
		if (bad == BAD_TOOLS)
			incise_plan_set_tool(run->plan, (enum incise_tool)below(5));
		if (bad == BAD_TICKS)
			step(run, steps[below(run->t_ns > INT64_MAX / 2 ? 3 : 5)]);
		else
			step(run, bad == BAD_HOURS && !below(4) ? HOUR_NS : run->step_ns);
	}
}

/* Held still so far along the normal, by a good tracker. */
static void hold(struct run *run, double from_mm, double to_mm, int ticks)
{
	double p[3];

	for (int k = 0; k < ticks; k++) {
		above_top(run, from_mm + (to_mm - from_mm) * fmin(1, 2.0 * k / ticks), p);
		if (k % 8 == 0)
			feed(run, run->t_ns, p, run->upright);
		step(run, MS);
	}
}

/* Nothing of what was before is left: no force in the air, and one in the tissue. */
static void recover(struct run *run, const char *after)
{
	double push_N;

	if (run->t_ns > INT64_MAX - YEAR_NS)
		return;
	incise_plan_set_tool(run->plan, INCISE_TOOL_BLADE);
	hold(run, run->ground->away_mm, run->ground->away_mm, 1000);
	push_N = length(run->tick.command_N);
	if (extremes_first_wrong(run->row, push_N == 0))
		extremes_tell(run->row, "%s, after %s: still %a N in free air",
			      run->ground->name, after, push_N);
	hold(run, run->ground->away_mm, 5, 600);
	hold(run, 5, -6, 800);
	push_N = run->tick.command_N[0] * run->top.normal[0] +
		 run->tick.command_N[1] * run->top.normal[1] +
		 run->tick.command_N[2] * run->top.normal[2];
	if (extremes_first_wrong(run->row, push_N > 0.1))
		extremes_tell(
			run->row,
			"%s, after %s: pressed in, and only %a N, depth %a, flags %#x",
			run->ground->name, after, push_N, run->tick.depth_mm,
			run->tick.flags);
	hold(run, -6, 5, 400);
}

static struct run begin(struct extremes_row *row, const struct ground *ground,
			const struct incise_scene *scene, const char *name)
{
	struct run run = {.ground = ground, .row = row, .t_ns = MS, .step_ns = MS};
	struct incise_error err = {0};

	run.plan = incise_plan_new(scene, NULL, &err);
	if (!run.plan)
		cli_fail("%s: %s", name, err.text);
	incise_scene_limits(scene, &run.limits);
	run.slew_N = run.limits.slew_N_s / incise_scene_rate_hz(scene);
	incise_plan_top(run.plan, &run.top);
	run.upright[run.top.normal[2] < 0] = 1; /* in the cavity about x */
	incise_plan_set_tool(run.plan, INCISE_TOOL_BLADE);
	return run;
}

static void end(struct run *run)
{
	if (!run->touched && extremes_first_wrong(run->row, false))
		extremes_tell(run->row, "%s: never in contact, so nothing was tried",
			      run->ground->name);
	incise_plan_free(run->plan);
}

static void try_bad(struct extremes *all, const struct grounds *grounds, enum bad bad)
{
	struct extremes_row *row = extremes_begin(all, bads[bad].name, bads[bad].what);

	rng = extremes_seed(all, row);
	for (int g = 0; g < grounds->n; g++) {
		struct run run = begin(row, &grounds->ground[g], grounds->scene[g],
				       bads[bad].name);
		long until = row->tried + extremes_cases(all, TICKS);

		stroke(&run, 600); /* past the start, where there is little force */
		while (row->tried < until && run.t_ns < INT64_MAX - YEAR_NS) {
			bad_burst(&run, bad);
			stroke(&run, (int)below(4 * BURST));
		}
		recover(&run, bads[bad].name);
		end(&run);
	}
}

/* A plan is made for a rate, but is ticked when it is ticked. */
static void try_rates(struct extremes *all, const struct grounds *grounds)
{
	static const double rates[] = {1, 10, 100, 1000, 8000, 20000, 64000};
	struct extremes_row *row = extremes_begin(
		all, "rates",
		"ticks 1, 10, 100, 1000, 8000, 20000 and 64000 times a second, of plans made "
		"for 1 kHz, with good and bad poses: as above");

	rng = extremes_seed(all, row);
	for (int g = 0; g < grounds->n; g++) {
		struct run run =
			begin(row, &grounds->ground[g], grounds->scene[g], "rates");

		for (size_t k = 0; k < sizeof(rates) / sizeof(*rates); k++) {
			run.step_ns = (int64_t)(1e9 / rates[k]);
			stroke(&run, 300);
			for (long n = extremes_cases(all, TICKS / 400); n; n--) {
				/* Not to the end of time. */
				enum bad bad = (enum bad)below(BADS);

				bad_burst(&run, bad == BAD_TICKS ? BAD_BITS : bad);
				stroke(&run, (int)below(4 * BURST));
			}
			run.step_ns = MS;
			recover(&run, "rates");
		}
		end(&run);
	}
}

void extremes_plan(struct extremes *all)
{
	struct grounds grounds;

	grounds_make(&grounds);
	for (int bad = 0; bad < BADS; bad++)
		try_bad(all, &grounds, (enum bad)bad);
	try_rates(all, &grounds);
	grounds_free(&grounds);
}
