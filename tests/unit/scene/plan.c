// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The plan at work: against the virtual rig's truth, with devices that lie or fail, and
 * without a rig, fed with poses.
 */
#include "../unit.h"
#include <incise/fixed.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/scene.h"
#include "../../../lib/tissue/tick.h"
#include <time.h>
#include "../message.h"
#include "fed.h"
#include "../../../lib/sim/sim.h"

#define LIMITED (INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED)
#define BOTH (INCISE_RIG_TRACKER | INCISE_RIG_STEPPER)

/* Run the rig's clock on by 1 ms and tick. */
static int tick(struct felt *f, struct incise_tick *result)
{
	struct incise_clock *clock = incise_rig_clock(f->rig);

	incise_clock_wait_until(clock, incise_clock_now(clock) + 1000000);
	return incise_plan_tick(f->plan, incise_clock_now(clock), result);
}

static double size(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Of the test that runs. */
static struct felt f;
static struct incise_tick t;
static struct incise_tracker_ops ops;

TEST(test_needs_a_tracker)
{
	struct incise_rig *none =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_FORCE, NULL);

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_null(incise_plan_new(f.scene, none, &err));
	assert_int_equal(err.code, ENODEV);
	incise_rig_close(none);
	felt_end(&f);
}

/* The line that refuses a model names the scene that asks for it. */
TEST(test_a_refused_model_names_its_scene)
{
	struct incise_model *triangles = paper_model(INCISE_MF_TRI, 1, 0.1);
	struct incise_scene *scene;
	FILE *out;

	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_int_equal(incise_model_save(triangles, f.model_path, NULL), 0);
	out = fopen(f.scene_path, "w");
	fputs("model = \"x.fis\";\n", out);
	fclose(out);
	scene = incise_scene_load(f.scene_path, NULL, NULL);
	assert_non_null(scene);
	assert_error(incise_plan_new(scene, f.rig, &err), ENOTSUP, &err, f.scene_path,
		     "trimf");
	incise_scene_free(scene);
	incise_model_free(triangles);
	felt_end(&f);
}

/* What the tissue of a tick should push with; the front goes on. */
static double front_N(struct incise_double_front *front,
		      const struct incise_plan_stability *s, const struct incise_tick *t,
		      bool began, double side[3], double cutting_N)
{
	double way_mm;

	if (began) {
		v3_rotate(side, t->quaternion, (double[3]){0, 1, 0});
		incise_double_front_enter(front, t->proxy_mm, t->normal, side);
	}
	way_mm = incise_double_front_advance(front, t->proxy_mm, t->normal, side);
	/* 0.1: the default of tissue.friction. */
	return incise_double_front_force(front, s->unloading_N_mm, 0.1, t->depth_mm,
					 way_mm, t->depth_mm > 0 ? cutting_N : 0);
}

/* One whole cut of the virtual surgeon, in both evaluators. */
TEST(test_against_truth)
{
	static const char *const evaluators[] = {"double", "fixed"};

	for (int a = 0; a < 2; a++) {
		struct incise_model *model;
		double depth = 0, render = 0, last_N = 0, bound_N;
		int contacts = 0, limited = 0, drawn_back = 0;
		struct incise_plan_stability stability;
		struct incise_double_front front = {0};
		double side[3] = {0};
		bool touched = false;

		felt_start(&f, evaluators[a], BOTH);
		model = incise_model_load(f.model_path, NULL);
		incise_plan_stability(f.plan, &stability);
		bound_N = incise_plan_bound(f.plan, 5);
		for (int i = 0; i < 9500; i++) {
			struct incise_sim_truth truth;
			double x[2], want, cutting, tolerance_N;
			bool began;

			assert_int_equal(tick(&f, &t), 0);
			incise_sim_truth(incise_rig_sim(f.rig), &truth);
			if (i < 100)
				continue;
			assert_false(t.flags & INCISE_TICK_STALE);
			depth += pow(t.depth_mm - truth.depth_mm, 2) / 9400;
			render += pow(t.rendered_N[0] - last_N, 2) / 9400;
			last_N = size(t.command_N);
			limited += !!(t.flags & LIMITED);
			began = t.flags & INCISE_TICK_CONTACT && !touched;
			touched = t.flags & INCISE_TICK_CONTACT;
			if (!touched)
				continue;
			x[0] = t.depth_mm;
			x[1] = t.velocity_mm_s;
			cutting = incise_model_eval(model, x, NULL);
			want = front_N(&front, &stability, &t, began, side, cutting);
			/* Within leave_mm above the surface a contact has no depth, and no force. */
			if (!(t.depth_mm > 0))
				continue;
			contacts++;
			drawn_back += want < cutting / 2;
			/* Along the outward normal. */
			assert_true(t.command_N[0] == 0 && t.command_N[1] == 0);
			/*
			 * 50 µN between the evaluators, or the bound of unloading in integers;
			 * a jump at contact meets the slew. Where no more force is paid for,
			 * 50 µN over 5 mm of a cut change its work by 0.25 µJ, and F²/2K = w
			 * is 9 mN at 0.16 N/mm.
			 */
			tolerance_N = fmax(50e-6, bound_N);
			if (a == 1 && want < cutting)
				tolerance_N = 9e-3;
			if (!(t.flags & LIMITED) &&
			    !(fabs(t.command_N[2] - want) < tolerance_N))
				fail_msg("tick %d in %s: %g N at %g mm, expected %g", i,
					 evaluators[a], t.command_N[2], t.depth_mm, want);
		}
		/* On the way out it lets go. */
		assert_true(drawn_back > 50);
		assert_true(contacts > 6000);
		assert_true(limited < 20);
		/* Tracker noise is 0.02 mm a record; the surgeon brakes and starts. */
		assert_true(sqrt(depth) < 0.06);
		/* At each tracker record the velocity, and so the command, jumps by some 3 mm/s
		 * × 0.01 N·s/mm = 30 mN, which the nut (60 mN a tick) follows a tick later. */
		assert_true(sqrt(render) < 0.03);
		incise_model_free(model);
		felt_end(&f);
	}
}

static int silent_tracker(struct incise_tracker *tracker,
			  struct incise_tracker_sample *samples, int n)
{
	return 0;
}

/* 4 s into the cut the blade is in the tissue. */
static void press(struct felt *f)
{
	struct incise_tick t;

	for (int i = 0; i < 4000; i++)
		assert_int_equal(tick(f, &t), 0);
	assert_true(t.flags & INCISE_TICK_CONTACT);
	assert_true(t.command_N[2] > 0.1);
}

TEST(test_stalled_tracker_fades_out)
{
	int zero_at = 0;

	felt_start(&f, "fixed", BOTH);
	press(&f);
	ops = *f.tracker_ops;
	ops.read = silent_tracker;
	incise_rig_tracker(f.rig)->ops = &ops;
	for (int i = 1; i <= 200; i++) {
		assert_int_equal(tick(&f, &t), 0);
		if (!zero_at && size(t.command_N) == 0)
			zero_at = i;
	}
	assert_true(t.flags & INCISE_TICK_STALE);
	/* pose_age_ms of 50, then the slew takes at most 3 N / (0.3 N a tick). */
	assert_in_range(zero_at, 30, 50 + 10 + 1);
	/* And it comes back when poses do. */
	incise_rig_tracker(f.rig)->ops = f.tracker_ops;
	for (int i = 0; i < 50; i++)
		assert_int_equal(tick(&f, &t), 0);
	assert_true(size(t.command_N) > 0.1);
	felt_end(&f);
}

static int gone_tracker(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	return -ENODEV;
}

static int gone_stepper(struct incise_stepper *stepper,
			struct incise_stepper_status *status)
{
	return -EIO;
}

TEST(test_fault_is_zero_force_for_good)
{
	for (int which = 0; which < 2; which++) {
		struct incise_tracker_ops tracker;
		struct incise_stepper_ops stepper;
		int want = which ? -EIO : -ENODEV;

		felt_start(&f, "fixed", BOTH);
		press(&f);
		tracker = *f.tracker_ops;
		tracker.read = gone_tracker;
		stepper = *f.stepper_ops;
		stepper.status = gone_stepper;
		if (which)
			incise_rig_stepper(f.rig)->ops = &stepper;
		else
			incise_rig_tracker(f.rig)->ops = &tracker;
		assert_int_equal(tick(&f, &t), want);
		assert_true(size(t.command_N) == 0);
		assert_true(t.flags & INCISE_TICK_FAULT);
		/* The device's return does not bring the force back. */
		incise_rig_tracker(f.rig)->ops = f.tracker_ops;
		incise_rig_stepper(f.rig)->ops = f.stepper_ops;
		for (int i = 0; i < 500; i++) {
			struct incise_stepper_status status;

			assert_int_equal(tick(&f, &t), want);
			assert_true(size(t.command_N) == 0);
			assert_int_equal(incise_stepper_status(incise_rig_stepper(f.rig),
							       &status),
					 0);
			/* The nut stood at 1.1 mm or less for 0.75 N: home in 37 ms at
			 * 30 mm/s, then the handle follows within some b/k = 10 ms. */
			if (i >= 90)
				assert_true(fabs(status.force_N) < 0.02);
			/* Meanwhile the handle lags behind: 30 mm/s × 0.01 N·s/mm. */
			assert_true(status.force_N > -0.3);
		}
		felt_end(&f);
	}
}

/* The scene with all of paper 2, without a rig. */
struct fed {
	struct incise_scene *scene;
	struct incise_plan *plan;
};

static struct fed fed_start(const char *path, bool fixed)
{
	struct fed fed = {.scene = incise_scene_load(path, NULL, &err)};

	succeeds(fed.scene);
	incise_scene_set_arithmetic(fed.scene, fixed ? "fixed" : "double", NULL);
	fed.plan = incise_plan_new(fed.scene, NULL, &err);
	succeeds(fed.plan);
	return fed;
}

static void fed_end(struct fed *fed)
{
	incise_plan_free(fed->plan);
	incise_scene_free(fed->scene);
}

TEST(test_feed)
{
	struct fed fed = fed_start("scenes/neck.scene", true);
	struct incise_tracker_sample poses[40];

	for (int i = 0; i < 40; i++)
		poses[i] = (struct incise_tracker_sample){
			.t_ns = (i + 1) * INT64_C(1000000),
			.position_mm = {1 + i, 2, 3},
			.quaternion = {1},
		};
	assert_int_equal(incise_plan_feed(fed.plan, poses, -1), -EINVAL);
	assert_int_equal(incise_plan_feed(fed.plan, NULL, 0), 0);
	/* Before the first there is none. */
	assert_int_equal(incise_plan_tick(fed.plan, 1000000, &t), 0);
	assert_true(t.flags & INCISE_TICK_STALE);
	/* 32 until the next tick. */
	assert_int_equal(incise_plan_feed(fed.plan, poses, 2), 2);
	assert_int_equal(incise_plan_feed(fed.plan, poses + 2, 38), 30);
	assert_int_equal(incise_plan_feed(fed.plan, poses, 1), 0);
	assert_int_equal(incise_plan_tick(fed.plan, 40000000, &t), 0);
	assert_false(t.flags & INCISE_TICK_STALE);
	/* The first of them were 1 mm apart: the last taken is the 32nd. */
	assert_true(t.position_mm[0] > 25 && t.position_mm[0] < 60);
	assert_true(fabs(t.position_mm[1] - 2) < 1e-9);
	/* Taken once, and there is capacity again. */
	assert_int_equal(incise_plan_feed(fed.plan, poses, 40), 32);
	fed_end(&fed);

	/* One with a rig takes its poses from there. */
	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_int_equal(incise_plan_feed(f.plan, poses, 1), -EINVAL);
	assert_int_equal(incise_plan_feed(f.plan, NULL, 0), -EINVAL);
	felt_end(&f);
}

/* A whole stroke in one call is the same, to the bit, as feeding and ticking one by one. */
TEST(test_run_is_feed_and_tick)
{
	enum { POSES = 240, TICKS = 2000 };
	struct fed fed = fed_start("scenes/neck.scene", true);
	struct fed run = fed_start("scenes/neck.scene", true);
	struct incise_tracker_sample poses[POSES];
	struct incise_tick *ticks = calloc(TICKS, sizeof(*ticks)), one = {0};
	int in_contact = 0;
	size_t next = 0;

	for (int i = 0; i < POSES; i++)
		poses[i] = (struct incise_tracker_sample){
			.t_ns = 1000000000 + i * (int64_t)FED_PERIOD_NS,
			.position_mm = {60, 0, 4 - 8 * sin(i * 0.02)},
			.quaternion = {1},
		};
	assert_int_equal(incise_plan_run(run.plan, poses, POSES, 1000000000, 1000000,
					 ticks, TICKS),
			 TICKS);
	for (int k = 0; k < TICKS; k++) {
		int64_t t_ns = 1000000000 + k * INT64_C(1000000);

		for (; next < POSES && poses[next].t_ns <= t_ns; next++)
			incise_plan_feed(fed.plan, &poses[next], 1);
		memset(&one, 0, sizeof(one));
		incise_plan_tick(fed.plan, t_ns, &one);
		assert_memory_equal(&one, &ticks[k], sizeof(one));
		in_contact += (one.flags & INCISE_TICK_CONTACT) != 0;
	}
	assert_true(in_contact > 100 && in_contact < TICKS);
	/* a tick of more than 32 poses has the newest of them */
	assert_int_equal(incise_plan_run(run.plan, poses, POSES, 3000000000, 1000000,
					 ticks, 1),
			 1);
	assert_true(fabs(ticks[0].position_mm[2] - poses[POSES - 1].position_mm[2]) < 1);
	assert_int_equal(incise_plan_run(run.plan, poses, 2, 4000000000, 0, ticks, 1),
			 -EINVAL);
	poses[1].t_ns = 0;
	assert_int_equal(incise_plan_run(run.plan, poses, 2, 4000000000, 1, ticks, 1),
			 -EINVAL);
	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	assert_int_equal(incise_plan_run(f.plan, NULL, 0, 0, 1, ticks, 1), -EINVAL);
	felt_end(&f);
	free(ticks);
	fed_end(&run);
	fed_end(&fed);
}

/* The scalpel's attitude is reported with each tick, whichever end of it is held. */
TEST(test_attitude)
{
	static const double turned[4] = {0.6, 0, 0.8, 0};
	static const enum incise_tool tools[] = {INCISE_TOOL_BLADE, INCISE_TOOL_HANDLE};

	for (int k = 0; k < 2; k++) {
		struct fed fed = fed_start("scenes/neck.scene", true);
		struct incise_tracker_sample pose = {.position_mm = {0, 0, 300}};

		memcpy(pose.quaternion, turned, sizeof(turned));
		assert_int_equal(incise_plan_set_tool(fed.plan, tools[k]), 0);
		/* Before the first pose it is none: 1 0 0 0. */
		assert_int_equal(incise_plan_tick(fed.plan, 1000000, &t), 0);
		assert_true(t.quaternion[0] == 1 && t.quaternion[2] == 0);
		for (int i = 1; i < 100; i++) {
			pose.t_ns = i * INT64_C(8333333);
			assert_int_equal(incise_plan_feed(fed.plan, &pose, 1), 1);
			assert_int_equal(incise_plan_tick(fed.plan, pose.t_ns + 1, &t),
					 0);
		}
		assert_int_equal(t.tool, tools[k]);
		for (int i = 0; i < 4; i++)
			assert_true(fabs(t.quaternion[i] - turned[i]) < 1e-9);
		fed_end(&fed);
	}
}

TEST(test_set_tool)
{
	struct fed neck = fed_start("scenes/neck.scene", true);
	struct fed wall = fed_start("scenes/wall.scene", true);
	struct incise_tracker_sample pose = {.position_mm = {10, 0, 200},
					     .quaternion = {1}};
	static const enum incise_tool tools[] = {INCISE_TOOL_TUBE, INCISE_TOOL_BLADE,
						 INCISE_TOOL_HANDLE, INCISE_TOOL_AUTO};

	for (int i = 0; i < 4; i++) {
		pose.t_ns = (i + 1) * INT64_C(10000000);
		assert_int_equal(incise_plan_set_tool(neck.plan, tools[i]), 0);
		incise_plan_feed(neck.plan, &pose, 1);
		assert_int_equal(incise_plan_tick(neck.plan, pose.t_ns, &t), 0);
		/* Upright the scalpel by itself is its blade. */
		assert_int_equal(t.tool, tools[i] == INCISE_TOOL_AUTO ? INCISE_TOOL_BLADE
								      : tools[i]);
		/* Nothing is inserted into the wall. */
		assert_int_equal(incise_plan_set_tool(wall.plan, tools[i]), 0);
		incise_plan_feed(wall.plan, &pose, 1);
		assert_int_equal(incise_plan_tick(wall.plan, pose.t_ns, &t), 0);
		assert_int_equal(t.tool, INCISE_TOOL_BLADE);
	}
	assert_int_equal(incise_plan_set_tool(neck.plan, (enum incise_tool)4), -EINVAL);
	assert_int_equal(incise_plan_set_tool(neck.plan, (enum incise_tool) - 1),
			 -EINVAL);
	fed_end(&neck);
	fed_end(&wall);
}

TEST(test_getters)
{
	struct fed fixed = fed_start("scenes/neck.scene", true);
	struct fed exact = fed_start("scenes/neck.scene", false);
	struct incise_plan_stability s;
	struct incise_touch top;
	const char *name, *why = "none";
	bool actuate = false;

	/* The highest line of the neck, in the middle of its length. */
	incise_plan_top(fixed.plan, &top);
	assert_true(fabs(top.point_mm[0] - 50) < 1e-9 && fabs(top.point_mm[1]) < 1e-9);
	assert_true(fabs(top.point_mm[2]) < 1e-9 && fabs(top.normal[2] - 1) < 1e-12);

	/* At least half an LSB of the stiffness of reaction and plane each; that of ticks is in its own test. */
	assert_true(incise_plan_bound(fixed.plan, 20) > 2 * 20 * 0x1p-17);
	assert_true(incise_plan_bound(fixed.plan, 20) < 0.01);
	assert_true(incise_plan_bound(fixed.plan, 40) >
		    incise_plan_bound(fixed.plan, 20));
	assert_true(incise_plan_bound(exact.plan, 20) == 0);

	incise_plan_stability(fixed.plan, &s);
	assert_true(s.stiffness_N_mm == 0.8 / 5 + 0.17 && s.certified);
	assert_true(s.damping_N_s_mm == 0.0005 && s.speed_slope_N_s_mm == 0);
	assert_true(s.weakest.margin >= 1 && !s.own_delay);
	/* 4.2 ms and a period of 8.33. */
	assert_int_equal(s.device.delay_ticks, 13);

	assert_null(incise_plan_left_out(fixed.plan, 99, &why));
	assert_string_equal(why, "none");
	for (int i = 0; !actuate && (name = incise_plan_left_out(fixed.plan, i, NULL));
	     i++)
		actuate = !strcmp(name, "actuate");
	assert_true(actuate);

	/* Its own size at the least, and the model's and the tables' on top. */
	assert_true(incise_plan_memory(exact.plan) > 1000);
	felt_start(&f, "fixed", BOTH);
	assert_true(incise_plan_memory(f.plan) > incise_plan_memory(exact.plan) + 1000);
	/* The model's own bound, and of unloading, which grows with the reach. */
	assert_true(incise_plan_bound(f.plan, 1) > 0);
	assert_true(incise_plan_bound(f.plan, 1) < incise_plan_bound(f.plan, 99));
	felt_end(&f);
	fed_end(&fixed);
	fed_end(&exact);
}

/* A faster tracker holds more; what is no tracker is refused. */
TEST(test_fed_tracker)
{
	static const struct incise_tracker_info fast = {
		.name = "fast", .rate_hz = 240, .latency_ns = 2000000};
	static const struct incise_tracker_info none[] = {
		{.rate_hz = 0},
		{.rate_hz = -1},
		{.rate_hz = NAN},
		{.rate_hz = INFINITY},
		{.rate_hz = 120, .latency_ns = -1},
	};
	static const struct incise_tracker_info late = {
		.name = "late", .rate_hz = 100, .latency_ns = 50000000};
	struct fed usual = fed_start("scenes/neck.scene", true);
	struct incise_plan_stability by_usual, by_fast, by_slow;
	struct incise_plan *plan, *slow;
	struct incise_scene *often;
	struct fed_folder folder;

	fed_folder_make(&folder);
	often = fed_scene(&folder,
			  "rate_hz = 20000; tissue = { reaction_N_mm = 0.01; };"
			  "limits = { pose_age_ms = 100; };",
			  &err);
	assert_non_null(often);
	slow = incise_plan_new_fed(often, &late, &err);
	plan = incise_plan_new_fed(usual.scene, &fast, &err);
	assert_non_null(plan);
	incise_plan_stability(usual.plan, &by_usual);
	incise_plan_stability(plan, &by_fast);
	assert_int_equal(by_fast.device.delay_ticks, 7);
	assert_true(by_fast.weakest.margin > 1.5 * by_usual.weakest.margin);
	incise_plan_free(plan);
	/* 50 ms and a period of 10, in ticks of 50 us: more than an exact limit takes. */
	assert_non_null(slow);
	incise_plan_stability(slow, &by_slow);
	assert_int_equal(by_slow.device.delay_ticks, 1200);
	assert_true(by_slow.device.period_s == 1 / 20000.0);
	incise_plan_free(slow);
	incise_scene_free(often);
	fed_folder_remove(&folder);
	for (size_t i = 0; i < sizeof(none) / sizeof(*none); i++) {
		assert_null(incise_plan_new_fed(usual.scene, &none[i], &err));
		assert_int_equal(errno, EINVAL);
		assert_int_equal(err.code, EINVAL);
	}
	fed_end(&usual);
}

/* A scene is checked on the haptic device that gives the poses, not on its own; and asks no more than it has. */
TEST(test_fed_haptic)
{
	struct incise_haptic_info device = {.name = "omega",
					    .peak_N = 12,
					    .mass_kg = 0.3,
					    .damping_N_s_mm = 0.02,
					    .force_latency_ns = 1500000};
	struct incise_tracker_info poses = {.name = "omega",
					    .rate_hz = 1000,
					    .latency_ns = 500000,
					    .haptic = &device};
	struct fed usual = fed_start("scenes/neck.scene", true);
	struct incise_plan_stability s;
	struct incise_plan *plan;

	usual.scene->device.delay_ticks = 3;
	plan = incise_plan_new_fed(usual.scene, &poses, &err);
	succeeds(plan);
	incise_plan_stability(plan, &s);
	assert_true(s.device.mass_kg == 0.3 && s.device.damping_N_s_mm == 0.02);
	assert_int_equal(s.device.delay_ticks, 2);
	assert_int_equal(s.late_ticks, 2);
	assert_false(s.own_delay);
	incise_plan_free(plan);
	usual.scene->tissue.gain = 1e4;
	assert_null(incise_plan_new_fed(usual.scene, &poses, &err));
	assert_non_null(strstr(err.text, "on a device of 0.3 kg and 0.02 N s/mm"));
	device.force_latency_ns = 20000000;
	assert_error(incise_plan_new_fed(usual.scene, &poses, &err), EDOM, &err,
		     "its force is 20 ticks late");
	device.peak_N = 1;
	assert_error(incise_plan_new_fed(usual.scene, &poses, &err), EDOM, &err,
		     "but omega gives at most 1 N");
	device.mass_kg = 0;
	assert_error(incise_plan_new_fed(usual.scene, &poses, &err), EDOM, &err,
		     "the mass of omega is not known; set haptic_setup.mass_kg");
	fed_end(&usual);
}

/* Without a surface in the scene the tissue is where it is said to be. */
TEST(test_fed_plane)
{
	static const struct incise_tracker_info tracker = {
		.name = "t", .rate_hz = 120, .stations = 1};
	const double point[3] = {10, -4, 7}, normal[3] = {0, 3, 4}, nowhere[3] = {0};
	const double off[3] = {NAN, 0, 0};
	struct incise_tracker_sample pose = {.quaternion = {1}, .status = ' '};
	struct fed_folder folder;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_tick tick;

	fed_folder_make(&folder);
	scene = fed_scene(&folder, "tissue = { reaction_N_mm = 0.1; };", &err);
	assert_non_null(scene);
	plan = incise_plan_new_fed_on(scene, &tracker, point, normal, &err);
	assert_non_null(plan);
	/* 2 mm along (0, 0.6, 0.8) below the point, and aside; there from the first pose on */
	for (int i = 0; i < 3; i++)
		pose.position_mm[i] = point[i] - 2 * normal[i] / 5;
	pose.position_mm[0] += 5;
	for (int k = 1; k <= 400; k++) {
		pose.t_ns = k * 1000000LL;
		/* from above, so that the force starts small */
		pose.position_mm[2] += k == 1 ? 4 : k <= 201 ? -0.02 : 0;
		assert_int_equal(incise_plan_feed(plan, &pose, 1), 1);
		assert_int_equal(incise_plan_tick(plan, pose.t_ns, &tick), 0);
	}
	/* what is left of a smoothed way of 4 mm after 0.2 s at rest */
	assert_true(fabs(tick.depth_mm - 2) < 1e-3);
	/* a direction in integers has 30 bits */
	assert_true(fabs(tick.normal[1] - 0.6) < 1e-8 &&
		    fabs(tick.normal[2] - 0.8) < 1e-8);
	assert_true(fabs(tick.command_N[1] - 0.2 * 0.6) < 1e-3);
	assert_true(fabs(tick.command_N[2] - 0.2 * 0.8) < 1e-3);
	incise_plan_free(plan);
	assert_null(incise_plan_new_fed_on(scene, &tracker, point, nowhere, &err));
	assert_int_equal(errno, EINVAL);
	assert_null(incise_plan_new_fed_on(scene, &tracker, off, normal, &err));
	assert_int_equal(err.code, EINVAL);
	incise_scene_free(scene);
	fed_folder_remove(&folder);
}

/* Down into the neck and along it, blade first, and out. */
static void dive(void *own, double t, struct incise_tracker_sample *pose)
{
	pose->position_mm[0] = 10 + 20 * t;
	pose->position_mm[1] = sin(7 * t);
	pose->position_mm[2] = 4 - 8 * sin(2 * t);
}

static int64_t now_ns(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

TEST(test_timed_tick_is_the_same)
{
	struct fed a = fed_start("scenes/neck.scene", true);
	struct fed b = fed_start("scenes/neck.scene", true);
	int contacts = 0, n = 0;

	while (incise_plan_stage(a.plan, n))
		n++;
	for (int i = 1; i < 2000; i++) {
		int64_t t_ns = i * INT64_C(1000000), ns[INCISE_PLAN_STAGES_MAX], sum = 0;
		struct incise_tick x, y;
		struct incise_tracker_sample pose = {.t_ns = t_ns, .quaternion = {1}};
		int64_t before;

		dive(NULL, i * 1e-3, &pose);
		if (i % 8 == 0) {
			incise_plan_feed(a.plan, &pose, 1);
			incise_plan_feed(b.plan, &pose, 1);
		}
		memset(ns, 0xff, sizeof(ns));
		assert_int_equal(incise_plan_tick(a.plan, t_ns, &x), 0);
		before = now_ns();
		assert_int_equal(incise_plan_tick_timed(b.plan, t_ns, &y, ns), 0);
		for (int k = 0; k < INCISE_PLAN_STAGES_MAX; k++) {
			assert_true(k < n ? ns[k] >= 0 : ns[k] == 0);
			sum += ns[k];
		}
		/* By the same clock: parts of what the whole took. */
		assert_true(sum <= now_ns() - before);
		assert_memory_equal(x.command_N, y.command_N, sizeof(x.command_N));
		assert_memory_equal(x.tool_mm, y.tool_mm, sizeof(x.tool_mm));
		assert_memory_equal(x.proxy_mm, y.proxy_mm, sizeof(x.proxy_mm));
		assert_memory_equal(x.normal, y.normal, sizeof(x.normal));
		assert_memory_equal(&x.depth_mm, &y.depth_mm, sizeof(x.depth_mm));
		assert_int_equal(x.flags, y.flags);
		assert_int_equal(x.phase, y.phase);
		contacts += x.flags & INCISE_TICK_CONTACT;
	}
	assert_true(contacts > 500);
	fed_end(&a);
	fed_end(&b);
}

/* Stages that a fault keeps from running take no time. */
TEST(test_timed_fault)
{
	int64_t ns[INCISE_PLAN_STAGES_MAX];

	felt_start(&f, "fixed", BOTH);
	press(&f);
	ops = *f.tracker_ops;
	ops.read = gone_tracker;
	incise_rig_tracker(f.rig)->ops = &ops;
	for (int i = 0; i < 2; i++) {
		memset(ns, 0xff, sizeof(ns));
		assert_int_equal(incise_plan_tick_timed(f.plan, t.t_ns + i, &t, ns),
				 -ENODEV);
		/* The first failed; after that none is begun. */
		for (int k = i ? 0 : 1; k < INCISE_PLAN_STAGES_MAX; k++)
			assert_true(ns[k] == 0);
	}
	felt_end(&f);
}
