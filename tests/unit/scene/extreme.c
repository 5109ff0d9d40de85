// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Millions of poses that no tracker should send, on scenes with every effect on: whatever
 * comes, a tick is finite, its force within the limits, and no state is one for ever.
 *
 *     poses  ── chaos of some thousand ticks ──▶ away: free, no force ──▶ press: a force
 *                     ▲                                                     │
 *                     └─────────────────────────────────────────────────────┘
 *
 * Usage: extreme [POSES [SEED]]; by default 10^7, under sanitizers 3·10^5.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <float.h>
#include <math.h>
#include "../../../tools/bench/any_pose.h"
#include "fed_run.h"

#ifdef __SANITIZE_ADDRESS__
static long poses_wanted = 300000;
#else
static long poses_wanted = 10000000;
#endif

static const char *const met_names[METS] = {
	"contact",	"insertion", "clamped",	   "slewed",	"stale",  "guarded",
	"extrapolated", "starting",  "on surface", "on proxy",	"at age", "no time",
	"years",	"handle",    "tube",	   "recovered",
};

/* Ticks between two recoveries. */
#define EPISODE 20000

static int64_t any_stamp(const struct run *run)
{
	switch (below(40)) {
	case 0:
		return (int64_t)any();
	case 1:
		return INT64_MAX;
	case 2:
		return INT64_MIN;
	case 3:
		return run->plan->predict.t_ns; /* as long ago as the last was late */
	case 4:
		return run->plan->predict.arrival_ns;
	case 5:
		return run->t_ns < INT64_MAX ? run->t_ns + 1 : INT64_MAX;
	case 6:
		return -1;
	default:
		return run->t_ns;
	}
}

/*
 * Places that decide something, reached to the bit: a pose more than 20 mm off is taken as
 * it is, without a filter.
 */
static void exact_place(const struct run *run, double p[3])
{
	static const double heights[] = {0, -0.0, GROUND_LEAVE_MM, -0x1p-20, 1e-6, 1e-9};
	double height;

	switch (below(4)) {
	case 0:
		v3_copy(p, run->tick.proxy_mm);
		return;
	case 1:
		/* The centre of sphere and ball, the end of the capsule's axis. */
		p[0] = p[1] = 0;
		p[2] = !strcmp(run->ground->name, "capsule") ? -55 : -40;
		return;
	default:
		height = heights[below(6)];
		for (int n = (int)below(3); n; n--)
			height = nextafter(height, below(2) ? -1 : 1);
		above_top(run, height, p);
	}
}

/* A hand at work around the top, one pose in 8 ticks. */
static void stroke(struct run *run)
{
	double off[3];

	for (int i = 0; i < 3; i++) {
		run->at_mm[i] += 0.001 * run->speed_mm_s[i];
		off[i] = run->at_mm[i] - run->top.point_mm[i];
		if (!(fabs(off[i]) < 30))
			run->speed_mm_s[i] = -copysign(run->speed_mm_s[i], off[i]);
		if (!(fabs(off[i]) < 35))
			run->at_mm[i] = run->top.point_mm[i];
	}
	if (run->ticks % 8)
		return;
	if (!below(20))
		for (int i = 0; i < 3; i++)
			run->speed_mm_s[i] = between(-200, 200);
	feed(run, run->t_ns, run->at_mm, run->attitude);
}

enum mode { STROKE, NEAR, METRES, BITS, SPECIAL, EXACT, SILENT, CROWD, MODES };

static void pose(struct run *run, enum mode mode)
{
	double p[3], q[4];

	if (mode == STROKE) {
		stroke(run);
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
				       : run->top.point_mm[i] + between(-60, 60);
		/* In turns: far off, then the exact place. */
		if (mode == EXACT && (n & 1))
			exact_place(run, p);
		feed(run, any_stamp(run), p, q);
	}
}

static int64_t time_step(struct run *run)
{
	int64_t at_ns;

	switch (below(256)) {
	case 0:
		return below(16) ? 1 : (int64_t)between(0, 3e9);
	case 1:
		return below(64) ? (int64_t)between(0, 2e7)
				 : (int64_t)between(0, 4.0 * YEAR_NS);
	case 2:
	case 3:
		/* To where the last pose is as old as may be. */
		at_ns = run->plan->predict.t_ns;
		at_ns += at_ns < INT64_MAX - YEAR_NS ? GROUND_AGE_NS - 1 + below(3) : 0;
		if (run->plan->predict.started && at_ns > run->t_ns) {
			met[MET_AT_AGE]++;
			return at_ns - run->t_ns;
		}
		return 0;
	case 4:
	case 5:
	case 6:
	case 7:
		return 0;
	default:
		return MS;
	}
}

static void chaos(struct run *run, int ticks)
{
	enum mode mode = STROKE;
	int left = 0;

	while (ticks--) {
		if (!left--) {
			mode = below(3) ? (enum mode)below(MODES) : STROKE;
			left = (int)below(mode == STROKE ? 600 : 120);
			any_attitude(run->attitude);
			if (below(2))
				exact_place(run, run->at_mm);
		}
		pose(run, mode);
		if (!below(1024))
			assert_int_equal(incise_plan_set_tool(run->plan,
							      (enum incise_tool)below(4)),
					 0);
		if (!below(1024))
			assert_int_equal(
				incise_plan_set_tool(run->plan,
						     (enum incise_tool)(4 + below(1000))),
				-EINVAL);
		if (!below(256))
			incise_plan_set_tool(run->plan, run->tool);
		step(run, time_step(run));
	}
}

/* Along the normal from one height to another, at a hand's speed. */
static void move(struct run *run, double from_mm, double to_mm, double mm_s,
		 const double attitude[4])
{
	int n = (int)ceil(fabs(to_mm - from_mm) / mm_s * 1000);
	double p[3];

	for (int i = 0; i < n; i += 8) {
		above_top(run, from_mm + (to_mm - from_mm) * i / n, p);
		hold(run, p, attitude, 8);
	}
	above_top(run, to_mm, p);
	hold(run, p, attitude, 80);
}

static void check_free(struct run *run)
{
	if (run->tick.phase != INCISE_PHASE_FREE)
		FAIL(run, "still in phase %d in free air", run->tick.phase);
	if (v3_length(run->tick.command_N) != 0)
		FAIL(run, "still %g N in free air, flags %#x, debt of %g N mm",
		     v3_length(run->tick.command_N), run->tick.flags,
		     -run->plan->guard->energy_N_mm);
}

/*
 * The guard takes energy that it is still owed in free air, by damping: force against speed, and
 * no other force.
 */
static void wave(struct run *run, const double attitude[4])
{
	double before_N_mm = run->plan->guard->energy_N_mm;
	double away_mm = run->ground->away_mm;

	run->waved = true;
	move(run, away_mm, away_mm - 20, 100, attitude);
	move(run, away_mm - 20, away_mm, 100, attitude);
	run->waved = false;
	if (before_N_mm < 0 && !(run->plan->guard->energy_N_mm > before_N_mm))
		FAIL(run, "a debt of %g N mm became one of %g", -before_N_mm,
		     -run->plan->guard->energy_N_mm);
}

/* Out, and in again: nothing of what was before is left. */
static void recover(struct run *run)
{
	static const double turns[][4] = {{1}, {0, 1}, {M_SQRT1_2, M_SQRT1_2}};
	const double *attitude = turns[below(3)];
	double away[3], push_N;

	/* No tracker's stamps are below 0. Farther than an int64_t holds, from its end. */
	if (run->t_ns < 0)
		tick_at(run, 20 * YEAR_NS);
	incise_plan_set_tool(run->plan, run->tool);
	above_top(run, run->ground->away_mm, away);
	hold(run, away, attitude, 1000);
	check_free(run);
	wave(run, attitude);
	move(run, run->ground->away_mm, 5, 200, attitude);
	move(run, 5, -6, 50, attitude);
	push_N = v3_dot(run->tick.command_N, run->top.normal);
	/* 6 mm of at least 0.1 N/mm, less what dents of the surface take off. */
	if (!(run->tick.flags & INCISE_TICK_CONTACT) || !(push_N > 0.1))
		FAIL(run, "pressed in, and only %g N, flags %#x", push_N,
		     run->tick.flags);
	move(run, -6, 5, 50, attitude);
	move(run, 5, run->ground->away_mm, 200, attitude);
	hold(run, away, attitude, 200);
	check_free(run);
	met[MET_RECOVERED]++;
}

/* Where time begins; a plan's last_ns of 0 has a meaning of its own. */
static const int64_t starts[] = {
	0, 1000000000, 1, INT64_MIN, -1, -MS, MS, INT64_MAX - 3 * (int64_t)MS *EPISODE};

static void run_on(const struct incise_scene *scene, const struct ground *ground,
		   const char *arithmetic, enum incise_tool tool, int start, long poses)
{
	struct run run = {.ground = ground, .tool = tool, .t_ns = starts[start]};
	int64_t last_ns = INT64_MAX - YEAR_NS;

	snprintf(run.what, sizeof(run.what), "%s in %s with tool %d from %lld ns",
		 ground->name, arithmetic, tool, (long long)run.t_ns);
	run.plan = ground_plan(scene);
	incise_plan_top(run.plan, &run.top);
	for (poses += n_poses; n_poses < poses;) {
		chaos(&run, EPISODE);
		if (run.t_ns < last_ns)
			recover(&run);
	}
	incise_plan_free(run.plan);
}

static void test_any_poses(void **state)
{
	static const char *const arithmetics[] = {"fixed", "double"};
	static const enum incise_tool tools[] = {INCISE_TOOL_AUTO, INCISE_TOOL_TUBE};
	/* The large mesh is the same to the code as the small one. */
	const int n = (int)GROUNDS - 1;
	struct ground_folder folder;

	rng = seed * 0x9e3779b97f4a7c15 | 1;
	ground_folder_make(&folder);
	for (int g = 0; g < n; g++) {
		for (int a = 0; a < 2; a++) {
			struct incise_scene *scene = ground_scene(
				&folder, &grounds[g], arithmetics[a], (g + a) % 2);

			for (int k = 0; k < 2; k++)
				run_on(scene, &grounds[g], arithmetics[a], tools[k],
				       (g * 4 + a * 2 + k) % 8, poses_wanted / (n * 4));
			incise_scene_free(scene);
		}
	}
	ground_folder_remove(&folder);
	print_message("%ld poses, %ld ticks", n_poses, n_ticks);
	for (int m = 0; m < METS; m++)
		print_message(", %s %ld", met_names[m], met[m]);
	print_message("\n");
	/* Even a short run meets everything. */
	for (int m = 0; m < METS; m++)
		if (met[m] < 10)
			fail_msg("%s was met %ld times only", met_names[m], met[m]);
}

int main(int argc, char **argv)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_any_poses),
	};

	if (argc > 1)
		poses_wanted = atol(argv[1]);
	if (argc > 2)
		seed = strtoull(argv[2], NULL, 0);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
