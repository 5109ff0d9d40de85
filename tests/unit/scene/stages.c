// SPDX-License-Identifier: GPL-2.0-or-later
/* Stages, one by one, on a plan made by hand. */
#include "../unit.h"
#include <incise/backend.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"

static const struct incise_tracker_info info = {.rate_hz = 100, .latency_ns = 5000000};

/* A plan in double of no stages, with that tracker's filter and no pose. */
static struct incise_plan made_plan(void)
{
	struct incise_plan plan = {.ops = incise_double_ops};
	struct incise_double_plan *numbers = &plan.doubles.plan;

	incise_predict_init(&plan.predict, &info, 0);
	incise_predict_filter(&plan.predict, &numbers->numbers.filter);
	numbers->numbers.pose_age_ns = 20000000;
	/* None is asked for a surface. */
	incise_double_predict_init(&plan.doubles.state.scalpel);
	plan.doubles.state.held = INCISE_TOOL_BLADE;
	return plan;
}

static incise_double_stage_fn *const predict_only[] = {incise_double_stage_predict, NULL};

/* Stages of a tick at a time. */
static void at(struct incise_plan *plan, int64_t t_ns,
	       incise_double_stage_fn *const stages[])
{
	struct incise_doubles *doubles = &plan->doubles;

	doubles->tick = (struct incise_double_tick){.t_ns = t_ns};
	for (; *stages; stages++)
		(*stages)(&doubles->plan, &doubles->state, &doubles->tick);
}

static int read_rc;

static int told_read(struct incise_tracker *tracker,
		     struct incise_tracker_sample *samples, int n)
{
	if (read_rc < 0)
		return read_rc;
	samples[0] = (struct incise_tracker_sample){
		.t_ns = INT64_MAX,
		.position_mm = {1, 2, 3},
		.quaternion = {1},
	};
	return 1;
}

static const struct incise_tracker_ops ops = {.read = told_read};

TEST(test_poses_of_the_future_are_of_now)
{
	struct incise_tracker tracker = {.ops = &ops};
	struct incise_plan plan = made_plan();
	struct incise_tick tick = {.t_ns = 1000000000};

	plan.poses.tracker = &tracker;
	read_rc = 0;
	assert_int_equal(incise_stage_pose(&plan, &tick), 0);
	assert_int_equal(plan.doubles.state.scalpel.t_ns, tick.t_ns - info.latency_ns);
	at(&plan, tick.t_ns, predict_only);
	assert_int_equal(plan.doubles.tick.flags, 0);
	assert_true(plan.doubles.tick.position[2] == 3 && plan.doubles.tick.tool[2] == 3);
	/* A pose is 5 ms old when it comes, and stale from 20 ms on. */
	at(&plan, tick.t_ns + 15000000, predict_only);
	assert_int_equal(plan.doubles.tick.flags, 0);
	at(&plan, tick.t_ns + 15000001, predict_only);
	assert_int_equal(plan.doubles.tick.flags, INCISE_TICK_STALE);
	read_rc = -ENODEV;
	assert_int_equal(incise_stage_pose(&plan, &tick), -ENODEV);
}

/* Stations of the records of told_stations(), and their flags. */
static char station_flag[2];

static int told_stations(struct incise_tracker *tracker,
			 struct incise_tracker_sample *samples, int n)
{
	for (int i = 0; i < 2; i++)
		samples[i] = (struct incise_tracker_sample){
			.t_ns = 1,
			.quaternion = {1},
			.status = station_flag[i],
			.station = (uint8_t)(i + 1),
		};
	return 2;
}

/* A scalpel that is put away unusable for long is no failure while the tube is seen. */
TEST(test_blind_is_every_station)
{
	static const struct incise_tracker_ops both = {.read = told_stations};
	static const struct {
		char flag[2];
		unsigned int flags;
		int rc;
	} cases[] = {{{' ', ' '}, 0, 0},
		     {{'x', ' '}, INCISE_TICK_UNUSABLE, 0},
		     {{' ', 'x'}, 0, 0},
		     {{'x', 'x'}, INCISE_TICK_UNUSABLE, -ENODEV}};
	struct incise_tracker tracker = {.ops = &both};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_plan plan = made_plan();
		struct incise_tick tick = {.t_ns = INCISE_NS_PER_S};

		plan.poses.tracker = &tracker;
		plan.poses.scalpel_station = 1;
		plan.poses.tube_station = 2;
		memcpy(station_flag, cases[i].flag, 2);
		assert_int_equal(incise_stage_pose(&plan, &tick), 0);
		assert_int_equal(tick.flags, cases[i].flags);
		assert_int_equal(plan.poses.flag, cases[i].flag[0]);
		assert_int_equal(plan.poses.counts.poses, 2);
		tick.t_ns += INCISE_PLAN_BLIND_NS;
		assert_int_equal(incise_stage_pose(&plan, &tick), cases[i].rc);
	}
}

/* A quarter turn about x takes the tip's y to z. */
TEST(test_tip_of_the_calibration)
{
	struct incise_tracker_sample sample = {
		.t_ns = 1000000000,
		.position_mm = {1, 2, 3},
		.quaternion = {M_SQRT1_2, M_SQRT1_2},
	};
	struct incise_plan plan = made_plan();
	struct incise_tick tick = {.t_ns = 1000000000};
	const double tip_mm[3] = {10, 20, 0}, huge[3] = {1e7}, none[3] = {NAN};
	const double *got = plan.doubles.tick.position;

	plan.poses.fed = &sample;
	plan.poses.n_fed = 1;
	assert_int_equal(incise_plan_set_tip(&plan, huge), -EINVAL);
	assert_int_equal(incise_plan_set_tip(&plan, none), -EINVAL);
	assert_int_equal(incise_plan_set_tip(&plan, tip_mm), 0);
	incise_stage_fed(&plan, &tick);
	at(&plan, tick.t_ns, predict_only);
	/* rounding of the quarter turn */
	assert_true(fabs(got[0] - 11) < 1e-12);
	assert_true(fabs(got[1] - 2) < 1e-12);
	assert_true(fabs(got[2] - 23) < 1e-12);
}

/* Its other parts are none either. */
TEST(test_quaternion_with_a_part_that_is_none)
{
	static const double none[][4] = {
		{1, NAN}, {1, 0, 0, INFINITY}, {0, 1, -INFINITY}, {NAN, 0, 1}, {0}};
	struct incise_tracker_sample sample = {.quaternion = {M_SQRT1_2, M_SQRT1_2}};
	struct incise_plan plan = made_plan();
	const struct incise_double_tick *got = &plan.doubles.tick;

	plan.poses.fed = &sample;
	assert_int_equal(incise_plan_set_tip(&plan, (double[]){10, 20, 0}), 0);
	for (int i = -1; i < (int)(sizeof(none) / sizeof(*none)); i++) {
		struct incise_tick tick = {.t_ns = 1100000000 + i * 10000000};

		plan.poses.n_fed = 1;
		sample.t_ns = tick.t_ns;
		if (i >= 0)
			memcpy(sample.quaternion, none[i], sizeof(sample.quaternion));
		incise_stage_fed(&plan, &tick);
		at(&plan, tick.t_ns, predict_only);
		assert_int_equal(got->age_ns, info.latency_ns);
		assert_true(fabs(got->attitude[1] - M_SQRT1_2) < 1e-12);
		assert_true(fabs(got->position[2] - 20) < 1e-12);
	}
}

static struct incise_surface *ground(void)
{
	static const double point[3] = {0}, up[3] = {0, 0, 1};

	return incise_surface_new_plane(point, up, NULL);
}

/* The tool at a place, in contact or not. */
static const struct incise_double_tick *touch(struct incise_plan *plan, double x,
					      double z)
{
	struct incise_doubles *doubles = &plan->doubles;

	doubles->plan.proxy = &plan->proxy;
	doubles->tick = (struct incise_double_tick){.tool = {x, 0, z}};
	incise_double_stage_contact(&doubles->plan, &doubles->state, &doubles->tick);
	return &doubles->tick;
}

/* A plan over the plane z = 0, the blade 1 mm above it; a quarter turn about z from its side y. */
static struct incise_plan plan_over(struct incise_surface *surface)
{
	struct incise_plan plan = made_plan();

	plan.doubles.plan.numbers.side[1] = 1;
	plan.doubles.state.attitude[0] = plan.doubles.state.attitude[3] = M_SQRT1_2;
	plan.doubles.state.force[0] = 1;
	incise_proxy_init(&plan.proxy, surface, 0.5);
	assert_int_equal(touch(&plan, 0, 1)->phase, INCISE_PHASE_FREE);
	return plan;
}

TEST(test_a_cut_from_its_begin_to_its_end)
{
	static const struct {
		double z_mm, depth_mm;
		bool contact;
	} way[] = {{-1, 1, true},  {-3, 3, true},      {0, 0, true},
		   {0.5, 0, true}, {0.5001, 0, false}, {0.25, 0, false}};
	struct incise_surface *surface = ground();
	struct incise_plan plan = plan_over(surface);
	struct incise_double_state *now = &plan.doubles.state;

	for (size_t i = 0; i < sizeof(way) / sizeof(*way); i++) {
		const struct incise_double_tick *tick;

		now->force[0] = 5;
		tick = touch(&plan, 2.0 * (double)i, way[i].z_mm);
		/* Each tick's force starts with none. */
		assert_true(v3_length(now->force) == 0);
		assert_int_equal(tick->phase == INCISE_PHASE_CUTTING, way[i].contact);
		assert_int_equal(!!(tick->flags & INCISE_TICK_CONTACT), way[i].contact);
		assert_true(tick->depth == way[i].depth_mm);
	}
	/* It came in at 0, half way down from 1 to -1. */
	assert_true(v3_length(now->p0) < 1e-15);
	assert_true(fabs(now->side[0] + 1) < 1e-15);
	incise_surface_free(surface);
}

TEST(test_an_instrument_has_no_edge)
{
	struct incise_surface *surface = ground();
	struct incise_plan plan = plan_over(surface);

	plan.doubles.state.held = INCISE_TOOL_TUBE;
	assert_int_equal(touch(&plan, 0, -1)->phase, INCISE_PHASE_INSERTION);
	assert_true(v3_length(plan.doubles.state.side) == 0);
	incise_surface_free(surface);
}

/* Another tool in the hand, also while no poses come: its end is where it is said to be. */
TEST(test_the_end_of_what_is_held)
{
	static incise_double_stage_fn *const stages[] = {incise_double_stage_predict,
							 incise_double_stage_tool, NULL};
	struct incise_surface *surface = ground();
	struct incise_tracker_sample pose = {.t_ns = 1000000000,
					     .position_mm = {0, 0, 50},
					     .quaternion = {0, 1, 0, 0}};
	struct incise_double_ends ends;
	struct incise_plan plan = made_plan();
	struct incise_double_numbers *numbers = &plan.doubles.plan.numbers;
	const struct incise_double_tick *tick = &plan.doubles.tick;

	numbers->inserts = true;
	numbers->up[2] = numbers->axis[2] = numbers->side[1] = 1;
	numbers->handle = 40;
	plan.poses.fed = &pose;
	plan.poses.n_fed = 1;
	incise_proxy_init(&plan.proxy, surface, 0.5);
	plan.doubles.plan.proxy = &plan.proxy;
	incise_double_predict_init(&ends.handle);
	plan.doubles.state.ends = &ends;
	for (int late = 0; late < 2; late++) {
		struct incise_tick now = {.t_ns = 1000000000 + late * 100000000};

		incise_stage_fed(&plan, &now);
		at(&plan, now.t_ns, stages);
		assert_int_equal(!!(tick->flags & INCISE_TICK_STALE), late);
		/* Upside down: the handle is 40 mm below the tip. */
		assert_int_equal(tick->held, INCISE_TOOL_HANDLE);
		assert_true(tick->position[2] == 50);
		assert_true(fabs(tick->tool[2] - 10) < 1e-13);
	}
	incise_surface_free(surface);
}
