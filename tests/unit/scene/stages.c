// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/scene/stages.c, stage by stage, on a plan made by hand. */
#include "../unit.h"
#include <incise/backend.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"

static const struct incise_tracker_info info = {.rate_hz = 100, .latency_ns = 5000000};

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
	struct incise_plan plan = {.tracker = &tracker, .pose_age_ns = 20000000};
	struct incise_tick tick = {.t_ns = 1000000000};

	incise_predict_init(&plan.predict, &info, 0);
	read_rc = 0;
	assert_int_equal(incise_stage_pose(&plan, &tick), 0);
	assert_int_equal(plan.predict.t_ns, tick.t_ns - info.latency_ns);
	assert_int_equal(incise_stage_predict(&plan, &tick), 0);
	assert_int_equal(tick.flags, 0);
	assert_true(tick.position_mm[2] == 3 && tick.tool_mm[2] == 3);
	/* A pose is 5 ms old when it comes, and stale from 20 ms on. */
	tick.t_ns += 15000000;
	incise_stage_predict(&plan, &tick);
	assert_int_equal(tick.flags, 0);
	tick.t_ns += 1;
	incise_stage_predict(&plan, &tick);
	assert_int_equal(tick.flags, INCISE_TICK_STALE);
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
		struct incise_plan plan = {
			.tracker = &tracker, .scalpel_station = 1, .tube_station = 2};
		struct incise_tick tick = {.t_ns = INCISE_NS_PER_S};

		incise_predict_init(&plan.predict, &info, 0);
		memcpy(station_flag, cases[i].flag, 2);
		assert_int_equal(incise_stage_pose(&plan, &tick), 0);
		assert_int_equal(tick.flags, cases[i].flags);
		assert_int_equal(plan.pose_flag, cases[i].flag[0]);
		assert_int_equal(plan.poses.poses, 2);
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
	struct incise_plan plan = {.pose_age_ns = 20000000, .fed = &sample, .n_fed = 1};
	struct incise_tick tick = {.t_ns = 1000000000};
	const double tip_mm[3] = {10, 20, 0}, huge[3] = {1e7}, none[3] = {NAN};

	assert_int_equal(incise_plan_set_tip(&plan, huge), -EINVAL);
	assert_int_equal(incise_plan_set_tip(&plan, none), -EINVAL);
	assert_int_equal(incise_plan_set_tip(&plan, tip_mm), 0);
	incise_predict_init(&plan.predict, &info, 0);
	incise_stage_fed(&plan, &tick);
	incise_stage_predict(&plan, &tick);
	/* rounding of the quarter turn */
	assert_true(fabs(tick.position_mm[0] - 11) < 1e-12);
	assert_true(fabs(tick.position_mm[1] - 2) < 1e-12);
	assert_true(fabs(tick.position_mm[2] - 23) < 1e-12);
}

/* A plan over the plane z = 0, the blade 1 mm above it. */
static struct incise_plan plan_over(struct incise_surface *surface)
{
	struct incise_plan plan = {
		.surface = surface,
		.attitude = {M_SQRT1_2, 0, 0, M_SQRT1_2},
		.instrument = {.side = {0, 1, 0}, .held = INCISE_TOOL_BLADE},
		.force_N = {1, 1, 1},
	};
	struct incise_tick tick = {.tool_mm = {0, 0, 1}};

	incise_proxy_init(&plan.proxy, surface, 0.5);
	incise_stage_contact(&plan, &tick);
	assert_int_equal(tick.phase, INCISE_PHASE_FREE);
	return plan;
}

static struct incise_surface *ground(void)
{
	static const double point[3] = {0}, up[3] = {0, 0, 1};

	return incise_surface_new_plane(point, up, NULL);
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

	for (size_t i = 0; i < sizeof(way) / sizeof(*way); i++) {
		struct incise_tick tick = {.tool_mm = {2.0 * i, 0, way[i].z_mm}};

		plan.force_N[0] = 5;
		assert_int_equal(incise_stage_contact(&plan, &tick), 0);
		/* Each tick's force starts with none. */
		assert_true(v3_length(plan.force_N) == 0);
		assert_int_equal(tick.phase == INCISE_PHASE_CUTTING, way[i].contact);
		assert_int_equal(!!(tick.flags & INCISE_TICK_CONTACT), way[i].contact);
		assert_true(tick.depth_mm == way[i].depth_mm);
	}
	/* It came in at 0, half way down from 1 to -1. */
	assert_true(v3_length(plan.p0_mm) < 1e-15);
	/* A quarter turn about z: the blade's side lies along -x. */
	assert_true(fabs(plan.side[0] + 1) < 1e-15);
	incise_surface_free(surface);
}

TEST(test_an_instrument_has_no_edge)
{
	struct incise_surface *surface = ground();
	struct incise_plan plan = plan_over(surface);
	struct incise_tick tick = {.tool_mm = {0, 0, -1}};

	plan.instrument.held = INCISE_TOOL_TUBE;
	assert_int_equal(incise_stage_contact(&plan, &tick), 0);
	assert_int_equal(tick.phase, INCISE_PHASE_INSERTION);
	assert_int_equal(tick.tool, INCISE_TOOL_TUBE);
	assert_true(v3_length(plan.side) == 0);
	incise_surface_free(surface);
}

/* Another tool in the hand, also while no poses come: its end is where it is said to be. */
TEST(test_the_end_of_what_is_held)
{
	struct incise_surface *surface = ground();
	struct incise_predict handle;
	struct incise_tracker_sample pose = {.t_ns = 1000000000,
					     .position_mm = {0, 0, 50},
					     .quaternion = {0, 1, 0, 0}};
	struct incise_plan plan = {
		.surface = surface,
		.handle = &handle,
		.inserts = true,
		.fed = &pose,
		.n_fed = 1,
		.up = {0, 0, 1},
		.pose_age_ns = 20000000,
		.instrument = {.axis = {0, 0, 1},
			       .side = {0, 1, 0},
			       .handle_mm = 40,
			       .held = INCISE_TOOL_BLADE},
	};

	incise_predict_init(&plan.predict, &info, 0);
	incise_predict_init(&handle, &info, 0);
	incise_proxy_init(&plan.proxy, surface, 0.5);
	for (int late = 0; late < 2; late++) {
		struct incise_tick tick = {.t_ns = 1000000000 + late * 100000000};

		incise_stage_fed(&plan, &tick);
		incise_stage_predict(&plan, &tick);
		incise_stage_tool(&plan, &tick);
		assert_int_equal(!!(tick.flags & INCISE_TICK_STALE), late);
		/* Upside down: the handle is 40 mm below the tip. */
		assert_int_equal(tick.tool, INCISE_TOOL_HANDLE);
		assert_true(tick.position_mm[2] == 50);
		assert_true(fabs(tick.tool_mm[2] - 10) < 1e-13);
	}
	incise_surface_free(surface);
}

TEST(test_each_limit_is_an_event_of_its_own)
{
	static const struct {
		double asked_N[3];
		unsigned int flags;
	} cases[] = {
		{{0, 0, 0.5}, 0},
		{{0, 0, 1.5}, INCISE_TICK_SLEWED},
		{{0, 0, 9}, INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED},
		{{0, NAN, 0}, INCISE_TICK_NOT_FINITE},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_plan plan = {.limit = {.force_N = 3, .slew_N = 1}};
		struct incise_tick tick = {0};

		memcpy(tick.command_N, cases[i].asked_N, sizeof(tick.command_N));
		assert_int_equal(incise_stage_limit(&plan, &tick), 0);
		assert_int_equal(tick.flags, cases[i].flags);
	}
}

TEST(test_without_poses_the_last_force_fades)
{
	struct incise_plan plan = {
		.force_N = {0, 0, 2},
		.start = {.small_N = 3, .ramp_s = 0.01, .fade_s = 0.01},
	};
	double last = 0;

	/* Ticks of 1 ms: ten up, ten down; the first tick has no time. */
	for (int i = 0; i <= 24; i++) {
		struct incise_tick tick = {
			.t_ns = 1000000000 + i * 1000000,
			.flags = i > 12 ? INCISE_TICK_STALE : 0,
		};
		double want = 2 * (i <= 12 ? fmin(i, 10) : fmax(22 - i, 0)) / 10;

		assert_int_equal(incise_stage_start(&plan, &tick), 0);
		/* Ten sums of 0.1. */
		assert_true(fabs(tick.command_N[2] - want) < 1e-14);
		/* At the tenth the sum may be an ulp below 1. */
		if (i != 10)
			assert_int_equal(!!(tick.flags & INCISE_TICK_STARTING),
					 i < 10 || i > 12);
		last = tick.command_N[2];
	}
	assert_true(last == 0);
}
