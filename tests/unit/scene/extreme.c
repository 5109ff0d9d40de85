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
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"
#include "ground.h"

#ifdef __SANITIZE_ADDRESS__
static long poses_wanted = 300000;
#else
static long poses_wanted = 10000000;
#endif
static uint64_t seed = 1;

#define MS 1000000
#define YEAR_NS 31557600000000000
/* Ticks between two recoveries. */
#define EPISODE 20000

/* What must have been met for the test to mean anything. */
enum met {
	MET_CONTACT,
	MET_INSERTION,
	MET_CLAMPED,
	MET_SLEWED,
	MET_STALE,
	MET_GUARDED,
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
	"contact",	"insertion", "clamped",	   "slewed",	"stale",  "guarded",
	"extrapolated", "starting",  "on surface", "on proxy",	"at age", "no time",
	"years",	"handle",    "tube",	   "recovered",
};

/* A run on one scene. */
struct run {
	char what[80];
	const struct ground *ground;
	struct incise_plan *plan;
	struct incise_touch top;
	enum incise_tool tool; /* what is gone back to */
	int64_t t_ns;
	long ticks;
	struct incise_tick tick; /* the last one */
	double last_N[3];
	bool waved;				     /* in free air */
	double at_mm[3], speed_mm_s[3], attitude[4]; /* of a stroke */
};

static uint64_t rng;
static long n_poses, n_ticks, met[METS];

static uint64_t any(void)
{
	rng ^= rng << 13;
	rng ^= rng >> 7;
	rng ^= rng << 17;
	return rng * 0x2545f4914f6cdd1d;
}

static uint32_t below(uint32_t n)
{
	return (uint32_t)((any() >> 32) * n >> 32);
}

static double between(double low, double high)
{
	return low + (high - low) * ((double)(any() >> 11) * 0x1p-53);
}

static double any_bits(void)
{
	union {
		uint64_t bits;
		double value;
	} u = {.bits = any()};

	return u.value;
}

static double special(void)
{
	static const double values[] = {
		0,	 -0.0,		NAN,	     -NAN,	   INFINITY, -INFINITY,
		DBL_MAX, -DBL_MAX,	DBL_MIN,     DBL_TRUE_MIN, 1,	     -DBL_MIN,
		-1,	 -DBL_TRUE_MIN, DBL_EPSILON, 1e4,	   -1e4,     1e308,
		0x1p31,	 -32768,	9999.9999,   1e-160,	   1e160,    1e5,
		20,	 32767,		0x1p-1022,   0x1p53,	   -0x1p63,  1e-300,
	};
	const size_t n = sizeof(values) / sizeof(*values);

	return below(8) ? values[below((uint32_t)n)] : nextafter(1e4, below(2) ? 0 : 2e4);
}

#define FAIL(run, ...)                                                             \
	do {                                                                       \
		print_error("seed %llu, %s, tick %ld: ", (unsigned long long)seed, \
			    (run)->what, (run)->ticks);                            \
		fail_msg(__VA_ARGS__);                                             \
	} while (0)

static void check_tick(struct run *run, const struct incise_tick *before)
{
	const struct incise_tick *t = &run->tick;
	bool contact = t->flags & INCISE_TICK_CONTACT;
	double change[3];

	if (!v3_finite(t->position_mm) || !v3_finite(t->tool_mm) ||
	    !v3_finite(t->proxy_mm) || !v3_finite(t->normal) ||
	    !v3_finite(t->command_N) || !isfinite(t->depth_mm) ||
	    !isfinite(t->velocity_mm_s) || !isfinite(t->rendered_N))
		FAIL(run, "not finite");
	if (t->flags & (INCISE_TICK_NOT_FINITE | INCISE_TICK_FAULT) ||
	    t->flags >> INCISE_TICK_FLAGS)
		FAIL(run, "flags %#x", t->flags);
	if (!(v3_length(t->command_N) <= GROUND_FORCE_N))
		FAIL(run, "force of %.17g N", v3_length(t->command_N));
	v3_sub(change, t->command_N, run->last_N);
	/* What limit.h allows for rounding. */
	if (!(v3_length(change) <= GROUND_SLEW_N + 8 * DBL_EPSILON * GROUND_FORCE_N))
		FAIL(run, "change of %.17g N", v3_length(change));
	v3_copy(run->last_N, t->command_N);
	if ((unsigned int)t->phase > INCISE_PHASE_INSERTION ||
	    (t->tool != INCISE_TOOL_BLADE && t->tool != INCISE_TOOL_HANDLE &&
	     t->tool != INCISE_TOOL_TUBE))
		FAIL(run, "phase %d, tool %d", t->phase, t->tool);
	if (t->phase != (!contact			? INCISE_PHASE_FREE
			 : t->tool == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
							: INCISE_PHASE_INSERTION))
		FAIL(run, "phase %d, tool %d, flags %#x", t->phase, t->tool, t->flags);
	if (before->flags & INCISE_TICK_CONTACT && t->tool != before->tool)
		FAIL(run, "tool %d became %d in the tissue", before->tool, t->tool);
	if (contact && t->flags & INCISE_TICK_STALE)
		FAIL(run, "contact by an old pose");
	/* Of unit length, but for some roundings. */
	if (contact && !(fabs(v3_length(t->normal) - 1) < 1e-12))
		FAIL(run, "normal of length %.17g", v3_length(t->normal));
	if (!(t->depth_mm >= 0))
		FAIL(run, "depth %.17g", t->depth_mm);
	/* The slew is wide enough for a damping that follows a hand. */
	if (run->waved && v3_length(t->command_N) >
				  run->plan->guard.cap_N_s_mm * t->velocity_mm_s + 1e-9)
		FAIL(run, "%g N at %g mm/s in free air", v3_length(t->command_N),
		     t->velocity_mm_s);
}

static void count(const struct run *run)
{
	const struct incise_tick *t = &run->tick;
	bool contact = t->flags & INCISE_TICK_CONTACT;

	met[MET_CONTACT] += contact;
	met[MET_INSERTION] += t->phase == INCISE_PHASE_INSERTION;
	met[MET_CLAMPED] += !!(t->flags & INCISE_TICK_CLAMPED);
	met[MET_SLEWED] += !!(t->flags & INCISE_TICK_SLEWED);
	met[MET_STALE] += !!(t->flags & INCISE_TICK_STALE);
	met[MET_GUARDED] += !!(t->flags & INCISE_TICK_GUARDED);
	met[MET_EXTRAPOLATED] += !!(t->flags & INCISE_TICK_EXTRAPOLATED);
	met[MET_STARTING] += !!(t->flags & INCISE_TICK_STARTING);
	met[MET_ON_SURFACE] += contact && run->plan->proxy.touch.depth_mm == 0;
	met[MET_ON_PROXY] += contact && t->tool_mm[0] == t->proxy_mm[0] &&
			     t->tool_mm[1] == t->proxy_mm[1] &&
			     t->tool_mm[2] == t->proxy_mm[2];
	met[MET_HANDLE] += t->tool == INCISE_TOOL_HANDLE;
	met[MET_TUBE] += t->tool == INCISE_TOOL_TUBE;
}

static void tick_at(struct run *run, int64_t t_ns)
{
	double dt_ns = (double)t_ns - (double)run->t_ns;
	struct incise_tick before = run->tick;

	met[MET_NO_TIME] += t_ns == run->t_ns;
	met[MET_YEARS] += dt_ns > YEAR_NS;
	run->t_ns = t_ns;
	run->ticks++;
	n_ticks++;
	if (incise_plan_tick(run->plan, t_ns, &run->tick))
		FAIL(run, "fault");
	check_tick(run, &before);
	count(run);
}

/* Time ends. */
static void step(struct run *run, int64_t dt_ns)
{
	bool ends = run->t_ns > 0 && dt_ns > INT64_MAX - run->t_ns;

	tick_at(run, ends ? INT64_MAX : run->t_ns + dt_ns);
}

static void feed(struct run *run, int64_t t_ns, const double position_mm[3],
		 const double quaternion[4])
{
	struct incise_tracker_sample s = {.t_ns = t_ns, .seq = any(), .status = ' '};

	memcpy(s.position_mm, position_mm, sizeof(s.position_mm));
	memcpy(s.quaternion, quaternion, sizeof(s.quaternion));
	n_poses += incise_plan_feed(run->plan, &s, 1);
}

/* A turn of the scalpel; sometimes just where blade and handle part, or none at all. */
static void any_attitude(double q[4])
{
	static const double lengths[] = {0, DBL_TRUE_MIN, 0.9, 1.1, 1, 2};
	double length = 1;

	switch (below(8)) {
	case 0:
		for (int i = 0; i < 4; i++)
			q[i] = special();
		return;
	case 1:
		for (int i = 0; i < 4; i++)
			q[i] = any_bits();
		return;
	case 2:
		/* About x: the axis' z is 1 - 2 sin², to the ulp at ±0.2. */
		q[1] = sqrt(below(2) ? 0.4 : 0.6);
		for (int n = (int)below(4); n; n--)
			q[1] = nextafter(q[1], below(2) ? 0 : 1);
		q[0] = sqrt(1 - q[1] * q[1]);
		q[2] = q[3] = 0;
		return;
	case 3:
		length = lengths[below(6)];
		length = nextafter(length, below(2) ? 0 : 3);
		break;
	default:
		break;
	}
	do {
		for (int i = 0; i < 4; i++)
			q[i] = between(-1, 1);
	} while (!(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-3));
	length /= sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
	for (int i = 0; i < 4; i++)
		q[i] *= length;
}

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

/* Some way along the normal at the top: < 0 is into the tissue. */
static void above_top(const struct run *run, double height_mm, double p[3])
{
	for (int i = 0; i < 3; i++)
		p[i] = run->top.point_mm[i] +
		       (height_mm == 0 ? height_mm : height_mm * run->top.normal[i]);
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

/* Hold the end of whatever is held there for some time, by a good tracker. */
static void hold(struct run *run, const double end_mm[3], const double attitude[4],
		 int ticks)
{
	double axis[3], p[3];

	for (int i = 0; i < ticks; i++) {
		v3_copy(p, end_mm);
		v3_rotate(axis, attitude, (const double[3]){0, 0, 1});
		if (run->tick.tool == INCISE_TOOL_HANDLE)
			v3_add(p, p, -GROUND_HANDLE_MM, axis);
		if (i % 8 == 0)
			feed(run, run->t_ns, p, attitude);
		step(run, MS);
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
		     -run->plan->guard.energy_N_mm);
}

/*
 * What the guard is still owed it takes in free air, by damping: force against speed, and
 * no other force.
 */
static void wave(struct run *run, const double attitude[4])
{
	double before_N_mm = run->plan->guard.energy_N_mm;
	double away_mm = run->ground->away_mm;

	run->waved = true;
	move(run, away_mm, away_mm - 20, 100, attitude);
	move(run, away_mm - 20, away_mm, 100, attitude);
	run->waved = false;
	if (before_N_mm < 0 && !(run->plan->guard.energy_N_mm > before_N_mm))
		FAIL(run, "a debt of %g N mm became one of %g", -before_N_mm,
		     -run->plan->guard.energy_N_mm);
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

/* A plan whose force has been let through, far above a plane. */
static void begin(struct run *run, struct ground_folder *folder,
		  struct incise_scene **scene)
{
	ground_folder_make(folder);
	*scene = ground_scene(folder, &grounds[0], "double", false);
	*run = (struct run){.ground = &grounds[0], .t_ns = 1000000000};
	snprintf(run->what, sizeof(run->what), "thresholds");
	run->plan = ground_plan(*scene);
	incise_plan_top(run->plan, &run->top);
	hold(run, (const double[3]){0, 0, 80}, (const double[4]){1}, 200);
}

static void end(struct run *run, struct ground_folder *folder, struct incise_scene *scene)
{
	incise_plan_free(run->plan);
	incise_scene_free(scene);
	ground_folder_remove(folder);
}

/* Go there in one leap, which no filter changes. */
static bool touches_at(struct run *run, double z)
{
	for (int i = 0; i < 8; i++)
		step(run, MS);
	feed(run, run->t_ns, (const double[3]){0, 0, z}, (const double[4]){1});
	tick_at(run, run->t_ns);
	assert_true(run->tick.position_mm[2] == z);
	return run->tick.flags & INCISE_TICK_CONTACT;
}

static void test_thresholds_of_contact(void **state)
{
	const double leave = GROUND_LEAVE_MM;
	struct ground_folder folder;
	struct incise_scene *scene;
	struct run run;

	begin(&run, &folder, &scene);
	/* A contact begins on the surface, and not the least above it. */
	assert_false(touches_at(&run, 50));
	assert_false(touches_at(&run, DBL_TRUE_MIN));
	assert_false(touches_at(&run, 50));
	assert_true(touches_at(&run, 0));
	assert_false(touches_at(&run, 50));
	assert_true(touches_at(&run, -0.0));
	assert_false(touches_at(&run, 50));
	assert_true(touches_at(&run, -DBL_TRUE_MIN));
	/* It ends beyond leave_mm, and not there. */
	assert_true(touches_at(&run, -50));
	assert_true(touches_at(&run, nextafter(leave, 0)));
	assert_true(touches_at(&run, -50));
	assert_true(touches_at(&run, leave));
	assert_true(touches_at(&run, -50));
	assert_false(touches_at(&run, nextafter(leave, 1)));
	end(&run, &folder, scene);
}

static void test_threshold_of_age(void **state)
{
	struct ground_folder folder;
	struct incise_scene *scene;
	struct run run;

	for (int late = -1; late <= 1; late++) {
		begin(&run, &folder, &scene);
		tick_at(&run, run.plan->predict.t_ns + GROUND_AGE_NS + late);
		assert_int_equal(!!(run.tick.flags & INCISE_TICK_STALE), late > 0);
		end(&run, &folder, scene);
	}
}

/* From blade to handle, and by a tracker's leap, the end of the tool goes no way. */
static void test_no_debt_without_a_way(void **state)
{
	struct ground_folder folder;
	struct incise_scene *scene;
	struct run run;

	for (int turn = 0; turn < 2; turn++) {
		begin(&run, &folder, &scene);
		hold(&run, (const double[3]){0, 0, -8}, (const double[4]){1}, 100);
		assert_true(run.tick.command_N[2] > 1);
		/* Out at once: for some ticks there is still a force, held by the slew. */
		feed(&run, run.t_ns, (const double[3]){0, 0, 500}, (const double[4]){1});
		step(&run, MS);
		assert_true(run.tick.command_N[2] > 1);
		if (turn) {
			incise_plan_set_tool(run.plan, INCISE_TOOL_HANDLE);
			step(&run, MS);
			assert_int_equal(run.tick.tool, INCISE_TOOL_HANDLE);
		}
		assert_false(run.plan->guard.energy_N_mm < 0);
		end(&run, &folder, scene);
	}
}

int main(int argc, char **argv)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_thresholds_of_contact),
		cmocka_unit_test(test_threshold_of_age),
		cmocka_unit_test(test_no_debt_without_a_way),
		cmocka_unit_test(test_any_poses),
	};

	if (argc > 1)
		poses_wanted = atol(argv[1]);
	if (argc > 2)
		seed = strtoull(argv[2], NULL, 0);
	return cmocka_run_group_tests(tests, NULL, NULL);
}
