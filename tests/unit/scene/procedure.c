// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2's procedure on the scene that is shipped: cut the skin of a neck, turn the
 * scalpel round, enlarge the cut with its handle, insert a tube. The hand is a tracker's of
 * 120 Hz; what is felt is held against the geometry and the constants, written out here.
 *
 *     z ▲   blade │        handle ║        tube ║
 *       │         ▼               ▼             ▼
 *     0 ┼──────┬──────────────────┬─────────────┬──── skin on the highest line of the neck
 *       │      └──── cut ────┘
 *       └─────10─────────────30──────────▶ x
 */
#include "../unit.h"
#include "../../../lib/scene/plan.h"
#include "fed.h"

/* The shipped scene; tests run in the repository's root. */
#define NECK "scenes/neck.scene"
#define R 55.0
#define KN 0.14
#define KX 0.17
#define KY 0.28
#define KXZ 0.22
#define ALIGNED 0.2
#define TUBE_MM 7.0
#define STRETCH_MM 2.0
#define HANDLE_MM 120.0
#define SLEW_N 0.4	 /* in a tick */
#define ROUNDING_N 1e-14 /* of some sums of 4 N */
#define REACH_MM 50.0	 /* of all that is done here */

/*
 * Of a hand that has rested for 0.7 s. The filter's memory of the way there is some
 * 10 poses, 0.08 s: e^-8 of 10 mm at the most, 3e-3 mm, times 1.5 N/mm at the most of all
 * springs together, comes to 5 mN; what damping makes of its speed is less. The
 * fixed-point bound, below 1 mN, is added where it is used.
 */
#define AT_REST_N 5e-3

/* The hand holds the scalpel; the end that goes first is at the given place. */
struct held {
	double end[3];	/* of blade, tube or handle */
	double about_x; /* π: turned round */
	double about_z;
	bool by_handle; /* end is the handle's */
};

struct theatre {
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct held from, to;
	double begin_s, time_s; /* of the way between them */
	int64_t t_ns;
	struct incise_tick tick; /* the last */
	double bound_N;
	/* Counted over all ticks. */
	int begins, ends, changes;
};

static struct held between(const struct held *a, const struct held *b, double share)
{
	/* Starts and ends at rest. */
	double s = share <= 0 ? 0 : share >= 1 ? 1 : (1 - cos(M_PI * share)) / 2;
	struct held h = *b;

	for (int i = 0; i < 3; i++)
		h.end[i] = a->end[i] + s * (b->end[i] - a->end[i]);
	h.about_x = a->about_x + s * (b->about_x - a->about_x);
	h.about_z = a->about_z + s * (b->about_z - a->about_z);
	return h;
}

static void hand(void *own, double t_s, struct incise_tracker_sample *pose)
{
	struct theatre *th = own;
	struct held h = between(&th->from, &th->to, (t_s - th->begin_s) / th->time_s);
	/* Where the axis of the scalpel points to. */
	double axis[3] = {sin(h.about_z) * sin(h.about_x),
			  -cos(h.about_z) * sin(h.about_x), cos(h.about_x)};

	fed_attitude(pose->quaternion, h.about_x, h.about_z);
	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = h.end[i] - (h.by_handle ? HANDLE_MM * axis[i] : 0);
}

static double force_N(const struct incise_tick *tick)
{
	return sqrt(tick->command_N[0] * tick->command_N[0] +
		    tick->command_N[1] * tick->command_N[1] +
		    tick->command_N[2] * tick->command_N[2]);
}

/* Conditions that hold at every tick. */
static void one_tick(struct theatre *th)
{
	struct incise_tick was = th->tick;

	assert_int_equal(fed_tick(th->plan, th->t_ns, hand, th, &th->tick), 0);
	th->t_ns += 1000000;
	assert_true(fabs(force_N(&th->tick) - force_N(&was)) <= SLEW_N + ROUNDING_N);
	if (th->tick.phase != was.phase && th->tick.tool == was.tool) {
		th->begins += was.phase == INCISE_PHASE_FREE;
		th->ends += th->tick.phase == INCISE_PHASE_FREE;
		/* Never from one into the other without being out. */
		assert_true(was.phase == INCISE_PHASE_FREE ||
			    th->tick.phase == INCISE_PHASE_FREE);
	}
	if (th->tick.tool != was.tool) {
		th->changes++;
		/* Out of the tissue, or after the force has faded. */
		assert_true(was.phase == INCISE_PHASE_FREE || force_N(&was) == 0);
		assert_true(force_N(&th->tick) <= SLEW_N);
	}
	if (th->tick.phase != INCISE_PHASE_FREE)
		assert_int_equal(th->tick.phase, th->tick.tool == INCISE_TOOL_BLADE
							 ? INCISE_PHASE_CUTTING
							 : INCISE_PHASE_INSERTION);
}

/* Move there in that time, and rest for 0.7 s if asked to. */
static void move(struct theatre *th, const struct held *to, double time_s, bool rest)
{
	int ticks = (int)lrint((time_s + (rest ? 0.7 : 0.02)) * 1000);

	th->from = th->to;
	th->to = *to;
	th->begin_s = (double)th->t_ns * 1e-9;
	th->time_s = time_s;
	for (int i = 0; i < ticks; i++)
		one_tick(th);
}

static void go(struct theatre *th, double x, double y, double z, double time_s)
{
	struct held to = th->to;

	to.end[0] = x;
	to.end[1] = y;
	to.end[2] = z;
	move(th, &to, time_s, true);
}

static void start_at(struct theatre *th, double z)
{
	memset(th, 0, sizeof(*th));
	th->scene = incise_scene_load(NECK, NULL, &err);
	succeeds(th->scene);
	/* The force along a cut has a test of its own: ../tissue/tear.c. */
	th->scene->tissue.force[INCISE_FORCE_FRACTURE][1] = 0;
	/* check.c checks the shipped scenes. */
	th->scene->unchecked = true;
	th->plan = incise_plan_new(th->scene, NULL, &err);
	succeeds(th->plan);
	th->bound_N = incise_plan_bound(th->plan, REACH_MM);
	assert_true(th->bound_N > 0 && th->bound_N < 0.01);
	th->t_ns = 1000000000;
	th->to = (struct held){.end = {10, 0, z}};
	th->tick.tool = INCISE_TOOL_BLADE;
	/* The first pose, and the start's ramp of 0.2 s. */
	go(th, 10, 0, z, 0.3);
	assert_false(th->tick.flags & INCISE_TICK_STARTING);
}

static void end(struct theatre *th)
{
	incise_plan_free(th->plan);
	incise_scene_free(th->scene);
}

/* Normal of the neck and depth in it, of a point beside its axis at z = -55. */
static double neck(const double p[3], double n[3])
{
	double length = hypot(p[1], p[2] + R);

	n[0] = 0;
	n[1] = p[1] / length;
	n[2] = (p[2] + R) / length;
	return R - length;
}

static void assert_force(const struct theatre *th, const double want[3])
{
	for (int i = 0; i < 3; i++)
		if (!(fabs(th->tick.command_N[i] - want[i]) < AT_REST_N + th->bound_N))
			fail_msg("%g %g %g N instead of %g %g %g N",
				 th->tick.command_N[0], th->tick.command_N[1],
				 th->tick.command_N[2], want[0], want[1], want[2]);
}

static void assert_free(const struct theatre *th)
{
	assert_int_equal(th->tick.phase, INCISE_PHASE_FREE);
	for (int i = 0; i < 3; i++)
		assert_true(th->tick.command_N[i] == 0);
}

/* Resting in a cut that began at p0, side y: reaction and plane constraint. */
static void assert_cutting(const struct theatre *th)
{
	const double *p = th->to.end;
	double n[3], want[3], depth = neck(p, n);

	assert_int_equal(th->tick.phase, INCISE_PHASE_CUTTING);
	for (int i = 0; i < 3; i++)
		want[i] = KN * depth * n[i];
	want[1] -= KX * p[1];
	assert_force(th, want);
}

/* Resting with handle or tube in, that went in at x0 on the highest line. */
static void assert_inserted(const struct theatre *th, double x0, double factor)
{
	const double *p = th->to.end;
	double n[3], off[3] = {p[0] - x0, p[1], p[2]}, want[3], depth = neck(p, n);
	double along = off[1] * n[1] + off[2] * n[2];

	assert_int_equal(th->tick.phase, INCISE_PHASE_INSERTION);
	for (int i = 0; i < 3; i++)
		want[i] = factor * KY * depth * n[i] - KXZ * (off[i] - along * n[i]);
	assert_force(th, want);
}

/* Turn the scalpel round, high up, with its blade upwards in the end. */
static void turn_round(struct theatre *th)
{
	struct held to = th->to;

	go(th, 20, 0, 150, 0.8);
	to = th->to;
	to.about_x = M_PI;
	th->from = th->to;
	move(th, &to, 0.8, true);
	assert_int_equal(th->tick.tool, INCISE_TOOL_HANDLE);
	/* The same place, said of the handle's end. */
	th->to.by_handle = true;
	th->to.end[2] -= HANDLE_MM;
	th->from = th->to;
	for (int i = 0; i < 3; i++)
		assert_true(fabs(th->tick.tool_mm[i] - th->to.end[i]) < 0.01);
}

static void turn_to(struct theatre *th, double about_z)
{
	struct held to = th->to;

	to.about_z = about_z;
	move(th, &to, 0.4, true);
}

/* Of the test that runs. */
static struct theatre th;
static struct held to;

TEST(test_procedure)
{
	/* Approach, and cut 20 mm along x, 4 mm deep. */
	start_at(&th, 15);
	assert_free(&th);
	go(&th, 10, 0, -4, 0.8);
	assert_cutting(&th);
	go(&th, 30, 0, -4, 1.5);
	assert_cutting(&th);
	assert_true(fabs(th.tick.command_N[2] - 4 * KN) < AT_REST_N + th.bound_N);
	/* Pushed 1 mm aside the tissue pushes back with Kx · 1 mm, to either side. */
	go(&th, 30, 1, -4, 0.3);
	assert_cutting(&th);
	go(&th, 30, -1, -4, 0.5);
	assert_cutting(&th);
	go(&th, 30, 0, -4, 0.3);
	/* Lifted there is nothing. */
	go(&th, 30, 0, 10, 0.6);
	assert_free(&th);
	assert_int_equal(th.begins, 1);
	assert_int_equal(th.ends, 1);
	assert_int_equal(th.changes, 0);

	/* Turned round the handle goes first, into the middle of the cut, along it. */
	turn_round(&th);
	assert_int_equal(th.changes, 1);
	assert_free(&th);
	go(&th, 20, 0, -3, 1);
	assert_inserted(&th, 20, ALIGNED);
	/* Across the cut there is more resistance, and half of it at 30°. */
	turn_to(&th, M_PI / 6);
	assert_inserted(&th, 20, ALIGNED + (1 - ALIGNED) / 2);
	turn_to(&th, M_PI / 2);
	assert_inserted(&th, 20, 1);
	turn_to(&th, 0);
	assert_inserted(&th, 20, ALIGNED);
	/* The cut gives way by 1 mm to 0.22 N, along and across. */
	go(&th, 21, 0, -3, 0.3);
	assert_inserted(&th, 20, ALIGNED);
	go(&th, 20, 1, -3, 0.3);
	assert_inserted(&th, 20, ALIGNED);
	go(&th, 20, 0, -3, 0.3);
	go(&th, 20, 0, 10, 0.6);
	assert_free(&th);

	/* 20 mm beyond the cut's end skin holds the handle up in whatever turn. */
	go(&th, 50, 0, 10, 0.5);
	go(&th, 50, 0, -3, 0.6);
	assert_inserted(&th, 50, 1);
	turn_to(&th, M_PI / 2);
	assert_inserted(&th, 50, 1);
	go(&th, 50, 0, 10, 0.6);
	assert_free(&th);
	assert_int_equal(th.begins, 3);

	/* A tube, whose end is where the tip was; high up that is not in the neck. */
	assert_int_equal(incise_plan_set_tool(th.plan, INCISE_TOOL_TUBE), 0);
	th.to.by_handle = false;
	th.to.end[2] += HANDLE_MM;
	th.from = th.to;
	go(&th, 20, 0, 30, 1);
	assert_int_equal(th.tick.tool, INCISE_TOOL_TUBE);
	assert_free(&th);
	/*
	 * Being round it goes in as easily in any turn: here it is across the cut. That was opened
	 * 3 mm by the handle's width, of which some was elastic, so that 1 mm stays.
	 */
	go(&th, 20, 0, -3, 0.7);
	assert_inserted(&th, 20,
			ALIGNED + (1 - ALIGNED) *
					  (TUBE_MM - STRETCH_MM - (3 - STRETCH_MM)) /
					  TUBE_MM);
	go(&th, 20, 0, 10, 0.6);
	assert_free(&th);
	assert_int_equal(th.begins, 4);
	assert_int_equal(th.ends, 4);
	assert_int_equal(th.changes, 2);

	/* And the scalpel again: by its turn it is the handle. */
	to = th.to;
	assert_int_equal(incise_plan_set_tool(th.plan, INCISE_TOOL_AUTO), 0);
	to.end[2] = 150;
	move(&th, &to, 1, true);
	assert_int_equal(th.tick.tool, INCISE_TOOL_HANDLE);
	end(&th);
}

/*
 * The tool changes out of the tissue while a force of the tissue is still on its way down. The way from one end of the scalpel to the other, 120 mm, is no
 * work of that force.
 */
TEST(test_change_is_no_work)
{
	int changed = 0, since = 0;
	double force_N;

	start_at(&th, 60);
	turn_round(&th);
	go(&th, 20, 0, -0.2, 1);
	/* 5 mm aside, so that it comes out with some N across, and fast. */
	go(&th, 20, 5, -0.45, 0.3);
	assert_true(fabs(th.tick.command_N[1]) > 0.75 * 5 * KXZ);
	to = th.to;
	to.end[2] = 30;
	th.from = th.to;
	th.to = to;
	th.begin_s = (double)th.t_ns * 1e-9;
	th.time_s = 0.3;
	for (int i = 0; i < 300; i++) {
		enum incise_tool was = th.tick.tool;

		one_tick(&th);
		if (th.tick.phase == INCISE_PHASE_FREE)
			incise_plan_set_tool(th.plan, INCISE_TOOL_TUBE);
		if (th.tick.tool != was) {
			changed++;
			/* The force is still there when it happens: the case is met. */
			assert_true(fabs(th.tick.command_N[1]) > 0.1);
		}
		since += changed;
		force_N = hypot(th.tick.command_N[1], th.tick.command_N[2]);
		/* Not above 4 N it is gone in 10 ticks of 0.4 N, and its debt in one more. */
		if (since > 15)
			assert_true(force_N == 0);
	}
	assert_int_equal(changed, 1);
	end(&th);
}

/* The membrane of the scene: over the airway at x = 50. */
#define MEMBRANE_MM 8.0
#define PUNCTURE_N 0.8
#define YIELDS_MM 5.0
#define BACK_WALL_MM 14.0

/* Cut 30 mm along x around there, so deep. */
static void cut_at(struct theatre *th, double x, double depth_mm)
{
	start_at(th, 15);
	go(th, x - 15, 0, 5, 1);
	go(th, x - 15, 0, -depth_mm, 0.8);
	go(th, x + 15, 0, -depth_mm, 2);
	go(th, x + 15, 0, 15, 0.6);
}

/* Turned round the handle goes 10 mm in, across the cut, and comes out. */
static void enlarge_at(struct theatre *th, double x)
{
	turn_round(th);
	turn_to(th, M_PI / 2);
	go(th, x, 0, -10, 1.5);
	go(th, x, 0, 15, 1);
}

/* The tube, with its end above the place. */
static void take_tube(struct theatre *th, double x)
{
	assert_int_equal(incise_plan_set_tool(th->plan, INCISE_TOOL_TUBE), 0);
	if (th->to.by_handle) {
		th->to.by_handle = false;
		th->to.end[2] += HANDLE_MM;
	}
	go(th, x, 0, 15, 1.5);
	assert_int_equal(th->tick.tool, INCISE_TOOL_TUBE);
	assert_free(th);
}

/* Held up so by the tissue in front of the membrane, and by the membrane behind it. */
static double tube_N(double share, double cut_mm, double depth_mm, double membrane_N)
{
	return KY * (share * cut_mm + depth_mm - cut_mm) + membrane_N;
}

/*
 * A tube 12 mm below the skin of a neck, whose stiffness is 0.28 N/mm: the wider the cut, the
 * easier; the hardest where there is none. Beside the airway the tissue below the cut holds up like
 * skin.
 */
TEST(test_tube_where_and_after_what)
{
	const double tight = ALIGNED + (1 - ALIGNED) * (TUBE_MM - STRETCH_MM) / TUBE_MM;
	const double on_N = PUNCTURE_N / YIELDS_MM * (12 - MEMBRANE_MM);
	const struct {
		const char *after;
		double x, cut_mm, want_N;
		bool enlarged, hits;
	} cases[] = {
		{"cut and enlarged", 50, 6, tube_N(ALIGNED, 6, MEMBRANE_MM, on_N), true,
		 true},
		{"cut and enlarged 60 mm off the membrane", 110, 6,
		 tube_N(ALIGNED, 6, 12, 0), true, false},
		{"cut", 50, 6, tube_N(tight, 6, MEMBRANE_MM, on_N), false, true},
		{"scratch", 50, 0.02, tube_N(1, 0, 12, 0), false, false},
	};
	double before_N = 0;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		cut_at(&th, cases[i].x, cases[i].cut_mm);
		if (cases[i].enlarged)
			enlarge_at(&th, cases[i].x);
		take_tube(&th, cases[i].x);
		go(&th, cases[i].x, 0, -12, 1.5);
		print_message("tube 12 mm deep after %s: %.3f N\n", cases[i].after,
			      th.tick.command_N[2]);
		assert_force(&th, (double[]){0, 0, cases[i].want_N});
		assert_int_equal(!!(th.tick.flags & INCISE_TICK_MEMBRANE), cases[i].hits);
		/* More than is felt as different: 10 % (Weber's share of forces). */
		assert_true(th.tick.command_N[2] > 1.1 * before_N);
		before_N = th.tick.command_N[2];
		end(&th);
	}
}

/* Through the membrane, which yields at 0.8 N and stays open; in the airway; on its back wall. */
TEST(test_through_the_membrane)
{
	const double skin_N = tube_N(ALIGNED, 6, MEMBRANE_MM, 0);

	cut_at(&th, 50, 6);
	enlarge_at(&th, 50);
	take_tube(&th, 50);
	go(&th, 50, 0, -12.9, 1.5);
	assert_true(th.tick.flags & INCISE_TICK_MEMBRANE);
	assert_force(&th, (double[]){0, 0, skin_N + PUNCTURE_N / YIELDS_MM * 4.9});
	go(&th, 50, 0, -13.5, 0.3);
	assert_true(th.tick.flags & INCISE_TICK_LUMEN);
	assert_false(th.tick.flags & INCISE_TICK_MEMBRANE);
	assert_force(&th, (double[]){0, 0, skin_N});
	go(&th, 50, 0, -21, 1);
	assert_force(&th, (double[]){0, 0, skin_N});
	assert_false(th.tick.flags & INCISE_TICK_BACK_WALL);
	go(&th, 50, 0, -(MEMBRANE_MM + BACK_WALL_MM + 2), 0.5);
	assert_true(th.tick.flags & INCISE_TICK_BACK_WALL);
	assert_force(&th, (double[]){0, 0, skin_N + PUNCTURE_N / YIELDS_MM * 2});
	go(&th, 50, 0, 15, 2);
	assert_free(&th);
	/* It stays open. */
	go(&th, 50, 0, -11, 1.5);
	assert_true(th.tick.flags & INCISE_TICK_LUMEN);
	assert_force(&th, (double[]){0, 0, skin_N});
	end(&th);
}

/* A plan that replaces another one has its cuts, and its open membrane, in either arithmetic. */
TEST(test_another_plan)
{
	static const char *const arithmetics[] = {"fixed", "double", "double", "fixed"};

	cut_at(&th, 50, 6);
	enlarge_at(&th, 50);
	take_tube(&th, 50);
	go(&th, 50, 0, -14, 1.5);
	go(&th, 50, 0, 15, 1.5);
	for (size_t i = 0; i < sizeof(arithmetics) / sizeof(*arithmetics); i++) {
		struct incise_scene *scene = incise_scene_load(NECK, NULL, NULL);
		struct incise_plan *next;

		assert_int_equal(incise_scene_set_arithmetic(scene, arithmetics[i], NULL),
				 0);
		scene->unchecked = true;
		next = incise_plan_new(scene, NULL, NULL);
		assert_non_null(next);
		incise_plan_take_over(next, th.plan);
		incise_plan_free(th.plan);
		incise_scene_free(th.scene);
		th.plan = next;
		th.scene = scene;
		assert_int_equal(incise_plan_set_tool(th.plan, INCISE_TOOL_TUBE), 0);
		/* The first pose, and the start's ramp. */
		go(&th, 50, 0, 15, 0.3);
		go(&th, 50, 0, -12, 1.5);
		assert_true(th.tick.flags & INCISE_TICK_LUMEN);
		assert_force(&th, (double[]){0, 0, tube_N(ALIGNED, 6, MEMBRANE_MM, 0)});
		go(&th, 50, 0, 15, 1.5);
	}
	end(&th);
}

/* Say where to go from now on. */
static void set_out(struct theatre *th, const struct held *to, double time_s)
{
	th->from = th->to;
	th->to = *to;
	th->begin_s = (double)th->t_ns * 1e-9;
	th->time_s = time_s;
}

/*
 * The handle is leant over in the cut, its end at rest: at most 0.94 rad/s, with which the
 * tip 120 mm above goes at 113 mm/s. What is felt is the end's.
 */
TEST(test_leaning_the_handle)
{
	double off_mm = 0, force_N = 0;

	start_at(&th, 15);
	turn_round(&th);
	go(&th, 20, 0, -3, 1);
	to = th.to;
	to.about_x = M_PI - 0.3;
	set_out(&th, &to, 0.5);
	for (int i = 0; i < 600; i++) {
		one_tick(&th);
		off_mm = fmax(off_mm, fabs(th.tick.tool_mm[1]));
		force_N = fmax(force_N, fabs(th.tick.command_N[1]));
	}
	print_message("leaning the handle: its end %.3f mm off, %.3f N across\n", off_mm,
		      force_N);
	/*
	 * The filter's own miss of a way that starts with 5900 mm/s³ at the tip would be
	 * 0.1 mm; of an end at rest it has none but the Kxz and Kd of 0.01 mm.
	 */
	assert_true(off_mm < 0.01);
	assert_true(force_N < KXZ * 0.01 + AT_REST_N);
	end(&th);
}

/* Snavg is the average over 8 ticks of this contact, and of no other. */
TEST(test_averaged_normal)
{
	static const double ways[][2] = {{-30, -12}, {-20, 8}, {30, -14}, {30, 10}};
	double ring[8][3];
	int n = 0, most = 0;

	start_at(&th, 10);
	for (size_t w = 0; w < sizeof(ways) / sizeof(*ways); w++) {
		to = th.to;
		to.end[1] = ways[w][0];
		to.end[2] = ways[w][1];
		set_out(&th, &to, 0.5);
		for (int i = 0; i < 700; i++) {
			double sum[3] = {0}, length;

			one_tick(&th);
			if (th.tick.phase == INCISE_PHASE_FREE) {
				n = 0;
				continue;
			}
			neck(th.tick.tool_mm, ring[n % 8]);
			n++;
			for (int k = 0; k < n && k < 8; k++)
				for (int c = 0; c < 3; c++)
					sum[c] += ring[k][c];
			length =
				sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
			for (int c = 0; c < 3; c++)
				assert_true(fabs(th.tick.normal[c] - sum[c] / length) <
					    1e-8);
			most = n > most ? n : most;
		}
	}
	assert_int_equal(th.begins, 2);
	assert_true(most > 300);
	end(&th);
}

static double noise_mm(uint64_t *seed)
{
	return 0.05 * paper_random(seed);
}

struct noisy {
	uint64_t seed;
	double z;
};

static void noisy_hand(void *own, double t_s, struct incise_tracker_sample *pose)
{
	struct noisy *n = own;

	pose->position_mm[0] = 10;
	pose->position_mm[2] = n->z + noise_mm(&n->seed);
}

/* Begins of contact in 10 s of a blade at rest near the skin, in a scene of its own. */
static int count_contacts(double z, const char *leave)
{
	struct noisy noisy = {.seed = 7, .z = 2};
	struct fed_folder folder;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_tick tick;
	char text[200];
	int begins = 0;
	bool was = false;

	fed_folder_make(&folder);
	snprintf(text, sizeof(text), "tissue = { reaction_N_mm = 0.25; %s };", leave);
	scene = fed_scene(&folder, text, NULL);
	assert_non_null(scene);
	plan = incise_plan_new(scene, NULL, NULL);
	assert_non_null(plan);
	for (int i = 1; i <= 11000; i++) {
		noisy.z = i < 500 ? 2 : z;
		fed_tick(plan, (int64_t)i * 1000000, noisy_hand, &noisy, &tick);
		begins += i > 1000 && !was && tick.phase != INCISE_PHASE_FREE;
		was = tick.phase != INCISE_PHASE_FREE;
	}
	/* None that starts is one that lasts, or one that never was. */
	if (!*leave)
		assert_int_equal(was, z < 0.1);
	incise_plan_free(plan);
	incise_scene_free(scene);
	fed_folder_remove(&folder);
	return begins;
}

/*
 * Extrapolation over 4 to 13 ms shows the noise of the poses three times as large: sd
 * 0.055 mm of 0.029, and at most 0.154 of 0.05. Each new contact would be a new cut.
 */
TEST(test_noise_does_not_end_contacts)
{
	int with = count_contacts(0, ""), half = count_contacts(0, "leave_mm = 0.1;");
	int without = count_contacts(0, "leave_mm = 0.0;");

	print_message("10 s of ±0.05 mm around the skin: %d new contacts, %d with a "
		      "leave_mm of 0.1, %d with 0\n",
		      with, half, without);
	assert_int_equal(with, 0);
	/* The noise does cross the skin, and half of the default is not enough. */
	assert_true(without > 50 && half > 10);
	/* Above the skin by more than the noise there is no contact at all. */
	assert_int_equal(count_contacts(0.2, ""), 0);
}
