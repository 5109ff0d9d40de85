// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Changes of the tool: by word at any time, and by a tube with a station of its own; poses of two
 * stations that share a tracker's rate. The plans are fed, and each tick keeps the slew.
 *
 *     z ▲    scalpel, station 1      tube, station 2
 *       │          │ tip                  ○ end
 *     0 ┼──────────┴──────────────────────┴───── plane, or the highest line of a capsule
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "fed.h"

#define SLEW_N 0.4	 /* in a tick */
#define ROUNDING_N 1e-14 /* of some sums of 4 N */
#define MS INT64_C(1000000)
#define NEARER_MM 5 /* the hysteresis */

enum { SCALPEL = 1, TUBE, OTHER };

static const struct incise_tracker_info two = {
	.rate_hz = 120,
	.latency_ns = FED_LATENCY_NS,
	.stations = 2,
	.scalpel_station = SCALPEL,
	.tube_station = TUBE,
};

#define TISSUE                                                                                              \
	"tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.05; insertion_N_mm = 0.2; spread_N_mm = 0.2; };\n" \
	"limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n"

/* Two stations of 60 Hz hold less than one of 120 Hz: softer than the neck that is shipped. */
static const char plane[] = TISSUE;
static const char capsule[] =
	TISSUE "surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0]; "
	       "to_mm = [60.0, 0.0, -55.0]; radius_mm = 55.0; };\n";

/* Two hands, and what they hold. */
static struct room {
	struct fed_folder folder;
	struct incise_scene *scene;
	struct incise_plan *plan;
	int64_t t_ns, record;
	double scalpel_mm[3], tube_mm[3], turn;
	bool scalpel_silent, tube_silent;
	struct incise_tick tick;
} room;

static double size(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void enter(const char *text, const char *arithmetic,
		  const struct incise_tracker_info *tracker)
{
	room = (struct room){.scalpel_mm = {0, 0, 60}, .tube_mm = {20, 0, 100}};
	fed_folder_make(&room.folder);
	room.scene = fed_scene(&room.folder, text, &err);
	succeeds(room.scene);
	assert_int_equal(incise_scene_set_arithmetic(room.scene, arithmetic, NULL), 0);
	/* No force moves these tools. */
	room.scene->unchecked = true;
	room.plan = incise_plan_new_fed(room.scene, tracker, &err);
	succeeds(room.plan);
}

static void leave(void)
{
	incise_plan_free(room.plan);
	incise_scene_free(room.scene);
	fed_folder_remove(&room.folder);
}

static int enter_plane(void **state)
{
	enter(plane, "double", &two);
	return 0;
}

static int leave_room(void **state)
{
	leave();
	return 0;
}

/* The stations take turns. */
static void feed(int64_t arrival_ns)
{
	struct incise_tracker_sample pose = {.t_ns = arrival_ns, .quaternion = {1}};
	bool tube = room.record++ % 2;

	pose.station = tube ? TUBE : SCALPEL;
	if (tube ? room.tube_silent : room.scalpel_silent)
		return;
	if (!tube)
		fed_attitude(pose.quaternion, room.turn, 0);
	memcpy(pose.position_mm, tube ? room.tube_mm : room.scalpel_mm,
	       sizeof(pose.position_mm));
	assert_int_equal(incise_plan_feed(room.plan, &pose, 1), 1);
}

/* A tick, 1 ms after the last. The force never changes by more than the slew. */
static void step(void)
{
	struct incise_tick was = room.tick;
	int64_t arrival_ns;
	double change_N[3];

	room.t_ns += MS;
	arrival_ns = room.t_ns / FED_PERIOD_NS * FED_PERIOD_NS;
	if (room.t_ns - arrival_ns < MS)
		feed(arrival_ns);
	assert_int_equal(incise_plan_tick(room.plan, room.t_ns, &room.tick), 0);
	for (int i = 0; i < 3; i++)
		change_N[i] = room.tick.command_N[i] - was.command_N[i];
	assert_true(size(change_N) <= SLEW_N + ROUNDING_N);
}

static void steps(int n)
{
	for (int i = 0; i < n; i++)
		step();
}

/* --- stations --------------------------------------------------------------------------- */

/* Two stations that share 120 Hz are as a tracker of 60 Hz with one. */
TEST(test_stations_share_the_rate, enter_plane, leave_room)
{
	struct incise_tracker_info shared = two, one = two;
	struct incise_plan_stability a, b;
	struct incise_scene *scene;

	one.stations = 1;
	one.rate_hz = 60;
	assert_true(incise_tracker_station_hz(&two) == 60);
	assert_true(incise_tracker_station_hz(&one) == 60);
	one.stations = 0;
	assert_true(incise_tracker_station_hz(&one) == 60);
	incise_plan_stability(room.plan, &a);
	incise_plan_free(room.plan);
	room.plan = incise_plan_new_fed(room.scene, &one, NULL);
	incise_plan_stability(room.plan, &b);
	assert_int_equal(a.device.delay_ticks, b.device.delay_ticks);
	assert_true(a.weakest.margin == b.weakest.margin);
	/* 4.2 + 16.7 ms is too old, 4.2 + 8.3 ms is not. */
	scene = fed_scene(&room.folder,
			  "tissue = { reaction_N_mm = 0.1; }; "
			  "limits = { pose_age_ms = 20.0; };\n",
			  NULL);
	assert_non_null(scene);
	assert_null(incise_plan_new_fed(scene, &shared, &err));
	assert_int_equal(err.code, EDOM);
	shared.stations = 1;
	incise_plan_free(room.plan);
	room.plan = incise_plan_new_fed(scene, &shared, NULL);
	assert_non_null(room.plan);
	incise_plan_free(room.plan);
	room.plan = NULL;
	incise_scene_free(scene);
}

/* Poses of a station that is neither scalpel nor tube move nothing, and are not counted. */
TEST(test_other_stations, enter_plane, leave_room)
{
	struct incise_tracker_sample deep = {
		.position_mm = {0, 0, -10}, .quaternion = {1}, .station = OTHER};
	struct incise_pose_counts counts;

	for (int i = 0; i < 500; i++) {
		deep.t_ns = room.t_ns + MS;
		assert_int_equal(incise_plan_feed(room.plan, &deep, 1), 1);
		step();
		assert_false(room.tick.flags & INCISE_TICK_CONTACT);
	}
	assert_true(room.tick.position_mm[2] == 60);
	incise_plan_poses(room.plan, &counts);
	/* Half a second of 120 Hz. */
	assert_in_range(counts.poses, 59, 60);
}

/* Without insertion there is no tube: its poses are not the blade's. */
TEST(test_no_tube_without_insertion)
{
	enter("tissue = { plane_N_mm = 0.17; };\n", "double", &two);
	room.tube_mm[2] = -10;
	steps(500);
	assert_false(room.tick.flags & INCISE_TICK_CONTACT);
	assert_true(room.tick.position_mm[2] == 60);
	assert_int_equal(room.tick.tool, INCISE_TOOL_BLADE);
	leave();
}

/* The tip of the calibration is the scalpel's alone. */
TEST(test_tip_is_the_scalpels, enter_plane, leave_room)
{
	static const double tip_mm[3] = {1, 2, 3};

	assert_int_equal(incise_plan_set_tip(room.plan, tip_mm), 0);
	incise_plan_set_tool(room.plan, INCISE_TOOL_TUBE);
	steps(100);
	for (int i = 0; i < 3; i++) {
		assert_true(room.tick.position_mm[i] == room.scalpel_mm[i] + tip_mm[i]);
		assert_true(room.tick.tool_mm[i] == room.tube_mm[i]);
	}
}

/* --- the tube by its station ------------------------------------------------------------ */

/*
 * Go there along a cosine in 2 s and rest for 1 s: of 200 mm on the way a filter with a memory of
 * 10 poses, 0.17 s, makes less than 1 mm of error, and of that e^-6 are left at the end.
 */
static enum incise_tool held_at(double scalpel_mm, double tube_mm)
{
	double scalpel = room.scalpel_mm[2], tube = room.tube_mm[2];

	for (int i = 1; i <= 2000; i++) {
		double share = (1 - cos(M_PI * i / 2000)) / 2;

		room.scalpel_mm[2] = scalpel + share * (scalpel_mm - scalpel);
		room.tube_mm[2] = tube + share * (tube_mm - tube);
		step();
	}
	steps(1000);
	return room.tick.tool;
}

TEST(test_nearer_tool)
{
	const double more = NEARER_MM + 0.01, less = NEARER_MM - 0.01;

	for (int kind = 0; kind < 2; kind++) {
		enter(kind ? capsule : plane, "double", &two);
		/* Over the same place, where the capsule is as high as the plane. */
		room.tube_mm[0] = 0;
		assert_int_equal(held_at(60, 100), INCISE_TOOL_BLADE);
		assert_int_equal(held_at(60, 60 - less), INCISE_TOOL_BLADE);
		assert_int_equal(held_at(60, 60 - more), INCISE_TOOL_TUBE);
		assert_int_equal(held_at(60, 60 + less), INCISE_TOOL_TUBE);
		assert_int_equal(held_at(60, 60 + more), INCISE_TOOL_BLADE);
		/* The scalpel's other end counts as well. */
		room.turn = M_PI;
		assert_int_equal(held_at(150, 30 - less), INCISE_TOOL_HANDLE);
		assert_int_equal(held_at(150, 30 - more), INCISE_TOOL_TUBE);
		leave();
	}
}

/* A tool that is asked for by name is held wherever the other one is. */
TEST(test_by_name, enter_plane, leave_room)
{
	incise_plan_set_tool(room.plan, INCISE_TOOL_BLADE);
	assert_int_equal(held_at(60, 10), INCISE_TOOL_BLADE);
	incise_plan_set_tool(room.plan, INCISE_TOOL_HANDLE);
	assert_int_equal(held_at(60, 10), INCISE_TOOL_HANDLE);
	incise_plan_set_tool(room.plan, INCISE_TOOL_TUBE);
	assert_int_equal(held_at(10, 60), INCISE_TOOL_TUBE);
	incise_plan_set_tool(room.plan, INCISE_TOOL_AUTO);
	assert_int_equal(held_at(10, 60), INCISE_TOOL_BLADE);
}

/* In the tissue the held one stays, however near the other comes. */
TEST(test_no_change_in_the_tissue, enter_plane, leave_room)
{
	assert_int_equal(held_at(60, 100), INCISE_TOOL_BLADE);
	assert_int_equal(held_at(-3, 100), INCISE_TOOL_BLADE);
	assert_true(room.tick.flags & INCISE_TICK_CONTACT);
	assert_int_equal(held_at(-3, -20), INCISE_TOOL_BLADE);
	/* Out, the tube is there. */
	assert_int_equal(held_at(60, -20), INCISE_TOOL_TUBE);
	assert_int_equal(room.tick.phase, INCISE_PHASE_INSERTION);
	assert_true(size(room.tick.command_N) > 1);
	assert_int_equal(held_at(-40, -20), INCISE_TOOL_TUBE);
}

/* A tube that is taken in hand far off the membrane is not in it because the blade was. */
TEST(test_membrane_is_of_one_tool)
{
	static const char airway[] = TISSUE
		"membrane = { point_mm = [0.0, 0.0, -8.0]; normal = [0.0, 0.0, 1.0]; "
		"radius_mm = 5.0; thickness_mm = 5.0; puncture_N = 0.5; "
		"back_wall_mm = 14.0; };\n";

	for (int blade = 0; blade < 2; blade++) {
		enter(airway, "double", &two);
		room.tube_mm[0] = 60;
		assert_int_equal(held_at(60, 100), INCISE_TOOL_BLADE);
		held_at(blade ? -15 : 60, 100);
		assert_true(!!(room.tick.flags & INCISE_TICK_LUMEN) == blade);
		incise_plan_set_tool(room.plan, INCISE_TOOL_TUBE);
		assert_int_equal(held_at(blade ? -15 : 60, -12), INCISE_TOOL_TUBE);
		assert_false(room.tick.flags &
			     (INCISE_TICK_LUMEN | INCISE_TICK_MEMBRANE));
		assert_true(fabs(room.tick.command_N[2] - 0.2 * 12) < 1e-6);
		leave();
	}
}

/* A silent station takes its own tool away, and not the other's. */
TEST(test_silence, enter_plane, leave_room)
{
	assert_int_equal(held_at(60, 10), INCISE_TOOL_TUBE);
	room.tube_silent = true;
	assert_int_equal(held_at(60, 10), INCISE_TOOL_BLADE);
	assert_false(room.tick.flags & INCISE_TICK_STALE);
	room.tube_silent = false;
	assert_int_equal(held_at(60, 10), INCISE_TOOL_TUBE);
	assert_int_equal(held_at(60, -8), INCISE_TOOL_TUBE);
	assert_true(size(room.tick.command_N) > 1);
	/* The scalpel's silence does not matter to the tube … */
	room.scalpel_silent = true;
	assert_int_equal(held_at(60, -8), INCISE_TOOL_TUBE);
	assert_false(room.tick.flags & INCISE_TICK_STALE);
	assert_true(size(room.tick.command_N) > 1);
	/* … and without either there is no force. */
	room.tube_silent = true;
	held_at(60, -8);
	assert_true(room.tick.flags & INCISE_TICK_STALE);
	assert_true(size(room.tick.command_N) == 0);
	/* A tube by name waits for its station. */
	room.scalpel_silent = false;
	incise_plan_set_tool(room.plan, INCISE_TOOL_TUBE);
	assert_int_equal(held_at(-3, -8), INCISE_TOOL_TUBE);
	assert_true(room.tick.flags & INCISE_TICK_STALE);
	assert_true(size(room.tick.command_N) == 0);
}

/* A blade that goes silent in the tissue, with the tube at hand: the tube. */
TEST(test_silence_in_the_tissue, enter_plane, leave_room)
{
	double cutting_N, back_N;

	held_at(60, 100);
	assert_int_equal(held_at(-5, 100), INCISE_TOOL_BLADE);
	cutting_N = size(room.tick.command_N);
	assert_true(cutting_N > 0.5);
	room.scalpel_silent = true;
	assert_int_equal(held_at(-5, 100), INCISE_TOOL_TUBE);
	assert_false(room.tick.flags & INCISE_TICK_STALE);
	room.scalpel_silent = false;
	assert_int_equal(held_at(-5, 100), INCISE_TOOL_BLADE);
	/* It is back in its cut: a tenth, and a hundredth for where the hand trembles to. */
	back_N = size(room.tick.command_N);
	assert_true(back_N > 0.09 * cutting_N && back_N < 0.2 * cutting_N);
}

/* --- continuity -------------------------------------------------------------------------- */

struct seen {
	int changes, in_tissue, held[INCISE_TOOL_TUBE + 1], loaded[INCISE_TOOL_TUBE + 1];
};

static double draw(uint64_t *random, double least, double most)
{
	return least + (most - least) * (incise_random_symmetric(random) + 1) / 2;
}

/* Sums of sines with phases of their own: in and out of the tissue, turned round now and then. */
static void move(const double phase[8])
{
	double t = (double)room.t_ns * 1e-9;

	room.scalpel_mm[0] = 15 * sin(0.7 * t + phase[0]);
	room.scalpel_mm[1] = 8 * sin(1.1 * t + phase[1]);
	room.scalpel_mm[2] = 4 + 9 * sin(1.9 * t + phase[2]) + 6 * sin(5 * t + phase[3]);
	room.turn = M_PI / 2 * (1 + tanh(4 * sin(0.4 * t + phase[4])));
	/* Turned round, the handle's end is where the tip was. */
	room.scalpel_mm[1] += 120 * sin(room.turn / 2) * sin(room.turn);
	room.scalpel_mm[2] += 60 * (1 - cos(room.turn));
	room.tube_mm[0] = 10 * sin(0.5 * t + phase[5]);
	room.tube_mm[1] = 5 * sin(0.9 * t + phase[6]);
	room.tube_mm[2] = 12 + 22 * sin(0.8 * t + phase[7]);
}

static void watch(const struct incise_tick *was, const struct incise_tick *tick,
		  struct seen *seen)
{
	bool changed = was->tool != tick->tool;

	seen->held[tick->tool]++;
	seen->loaded[tick->tool] += size(tick->command_N) > 0.5;
	if (!changed)
		return;
	seen->changes++;
	if (was->phase == INCISE_PHASE_FREE && !(was->flags & INCISE_TICK_STALE))
		return;
	/* It was in the tissue, or may have been when the poses ended. */
	seen->in_tissue += was->phase != INCISE_PHASE_FREE;
	assert_true(size(was->command_N) == 0);
}

/* Words, silences and places at random; a second run with a tube that has no station. */
static void run_at_random(const char *scene, const char *arithmetic, bool station,
			  uint64_t random, struct seen *seen)
{
	struct incise_tracker_info tracker = two;
	double phase[8];

	if (!station)
		tracker.tube_station = 0;
	enter(scene, arithmetic, &tracker);
	for (int i = 0; i < 8; i++)
		phase[i] = draw(&random, 0, 2 * M_PI);
	for (int i = 0; i < 40000; i++) {
		struct incise_tick was = room.tick;

		if (draw(&random, 0, 300) < 1)
			incise_plan_set_tool(room.plan,
					     (enum incise_tool)draw(&random, 0, 4));
		if (draw(&random, 0, 1500) < 1)
			room.tube_silent = !room.tube_silent;
		if (draw(&random, 0, room.scalpel_silent ? 200 : 3000) < 1)
			room.scalpel_silent = !room.scalpel_silent;
		move(phase);
		step();
		if (i)
			watch(&was, &room.tick, seen);
	}
	leave();
}

TEST(test_continuous)
{
	static const char *const scenes[] = {plane, capsule};
	static const char *const arithmetics[] = {"fixed", "double"};

	for (int i = 0; i < 8; i++) {
		struct seen seen = {0};

		run_at_random(scenes[i & 1], arithmetics[i >> 1 & 1], i & 4,
			      (uint64_t)i + 1, &seen);
		/* It was about something. */
		assert_true(seen.changes > 20 && seen.in_tissue > 5);
		for (int tool = INCISE_TOOL_BLADE; tool <= INCISE_TOOL_TUBE; tool++)
			if (seen.held[tool] < 1000 || seen.loaded[tool] < 100)
				fail_msg(
					"run %d: tool %d for %d ticks, %d of them in tissue",
					i, tool, seen.held[tool], seen.loaded[tool]);
	}
}
