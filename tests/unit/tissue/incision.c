// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The cuts that ticks leave: what makes one, how they join, and what opens them. Ticks are
 * written out here, of a blade, handle or tube on the plane z = 0.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/tissue/incision.h"

#define CUT_FROM_MM 0.5
#define STRETCH_MM 2.0
#define CUTS_MOST 16

static struct incise_incision *incision;

static int setup(void **state)
{
	static const struct incise_incision_setup tissue = {
		.cut_from_mm = CUT_FROM_MM,
		.stretch_mm = STRETCH_MM,
		.cuts_most = CUTS_MOST,
		.side = {0, 1, 0},
		.handle_width_mm = 10,
		.handle_thickness_mm = 3,
		.tube_mm = 7,
	};

	incision = incise_incision_make(&tissue, NULL);
	return !incision;
}

static int teardown(void **state)
{
	incise_incision_free(incision);
	return 0;
}

/* At @x, @y, so deep; the tool is turned about z by @turn, at 0 the blade's edge is along x. */
static struct incise_tick tick_at(enum incise_tool tool, double x, double y,
				  double depth_mm, double turn)
{
	return (struct incise_tick){
		.phase = tool == INCISE_TOOL_BLADE ? INCISE_PHASE_CUTTING
						   : INCISE_PHASE_INSERTION,
		.tool = tool,
		.quaternion = {cos(turn / 2), 0, 0, sin(turn / 2)},
		.tool_mm = {x, y, -depth_mm},
		.proxy_mm = {x, y, 0},
		.normal = {0, 0, 1},
		.depth_mm = depth_mm,
	};
}

static bool put(enum incise_tool tool, double x, double y, double depth_mm, double turn)
{
	struct incise_tick tick = tick_at(tool, x, y, depth_mm, turn);

	return incise_incision_tick(incision, &tick);
}

static void lift(void)
{
	struct incise_tick tick = {.phase = INCISE_PHASE_FREE};

	assert_true(incise_incision_tick(incision, &tick));
}

/* A straight cut in steps of 0.1 mm, the blade's edge along it. Returns whether it was made. */
static bool cut(double x, double y, double to_x, double to_y, double depth_mm)
{
	double way = hypot(to_x - x, to_y - y), turn = atan2(to_y - y, to_x - x);
	int steps = (int)ceil(way / 0.1);
	bool made = true;

	for (int i = 0; i <= steps; i++)
		made &= put(INCISE_TOOL_BLADE, x + (to_x - x) * i / steps,
			    y + (to_y - y) * i / steps, depth_mm, turn);
	lift();
	return made;
}

static double depth_at(int i, double along_mm)
{
	const struct incise_cut *c = incise_incision_cut(incision, i);

	return c->place[incise_cut_place(along_mm)].depth_mm;
}

static struct incise_opening opening(enum incise_tool tool, double x, double y)
{
	struct incise_opening o;

	incise_incision_opening(incision, tool, (double[]){x, y, 0}, &o);
	return o;
}

/* A blade that is not deeper than the threshold leaves nothing; one that is leaves a line. */
TEST(test_a_scratch_is_no_cut, setup, teardown)
{
	const struct incise_cut *c;

	assert_true(cut(0, 0, 20, 0, CUT_FROM_MM));
	assert_int_equal(incise_incision_cuts(incision), 0);
	assert_null(incise_incision_cut(incision, 0));
	assert_true(cut(5, 0, 25, 0, 3));
	assert_int_equal(incise_incision_cuts(incision), 1);
	c = incise_incision_cut(incision, 0);
	/* of sums of 200 steps */
	assert_true(fabs(c->to_mm - c->from_mm - 20) < 1e-12);
	assert_true(c->at_mm[0] == 5 && fabs(c->along[0]) == 1 && c->normal[2] == 1);
	for (double s = 0; s <= 20; s += 0.25)
		assert_true(depth_at(0, s * c->along[0]) == 3);
	assert_true(depth_at(0, -c->along[0]) == 0);
	assert_null(incise_incision_cut(incision, -1));
}

/* Again along the same line: deeper, and longer at both ends; never shallower. */
TEST(test_lengthened_and_deepened, setup, teardown)
{
	const struct incise_cut *c;

	assert_true(cut(0, 0, 10, 0, 3));
	assert_true(cut(10.5, 0.5, -5, 0.5, 2));
	assert_true(cut(4, 0, 6, 0, 5));
	assert_int_equal(incise_incision_cuts(incision), 1);
	c = incise_incision_cut(incision, 0);
	assert_true(fabs(c->from_mm + 5) < 1e-12 && fabs(c->to_mm - 10.5) < 1e-12);
	assert_true(depth_at(0, 5 * c->along[0]) == 5);
	assert_true(depth_at(0, 2 * c->along[0]) == 3);
	assert_true(depth_at(0, -3 * c->along[0]) == 2);
}

/* The blade starts beyond the end, and goes on along the line when it comes to it. */
TEST(test_no_line_twice, setup, teardown)
{
	assert_true(cut(0, 0, 20, 0, 3));
	assert_true(cut(25, 0.5, 3, 0.5, 4));
	assert_int_equal(incise_incision_cuts(incision), 2);
	assert_int_equal(incise_incision_cut(incision, 1)->incision, 0);
	/* The parts overlap by the reach at the end, and a place. */
	assert_true(fabs(incise_incision_length_mm(incision, 0) - 25) <=
		    INCISE_CUT_BESIDE_MM + INCISE_CUT_SPACING_MM);
	assert_true(depth_at(0, 5) == 4 && depth_at(0, 1) == 3);
}

/* Cuts that cross or touch are one incision, whichever was first; others stay apart. */
TEST(test_joined_where_they_meet, setup, teardown)
{
	assert_true(cut(0, 0, 0, 20, 3));
	assert_true(cut(30, 0, 30, 20, 3));
	assert_int_equal(incise_incision_cut(incision, 1)->incision, 1);
	assert_true(fabs(incise_incision_length_mm(incision, 0) - 20) < 1e-12);
	/* Across both. */
	assert_true(cut(-5, 10, 26, 10, 3));
	assert_int_equal(incise_incision_cut(incision, 2)->incision, 0);
	assert_int_equal(incise_incision_cut(incision, 1)->incision, 1);
	assert_true(cut(26, 10, 35, 10, 3));
	for (int i = 0; i < incise_incision_cuts(incision); i++)
		assert_int_equal(incise_incision_cut(incision, i)->incision, 0);
	assert_true(fabs(incise_incision_length_mm(incision, 0) - 80) < 1e-9);
}

/* A fast blade crosses between two ticks. */
TEST(test_crossed_between_two_ticks, setup, teardown)
{
	assert_true(cut(0, 0, 20, 0, 3));
	assert_true(put(INCISE_TOOL_BLADE, 10, -4, 3, M_PI_2));
	assert_true(put(INCISE_TOOL_BLADE, 10, 4, 3, M_PI_2));
	assert_int_equal(incise_incision_cuts(incision), 2);
	assert_int_equal(incise_incision_cut(incision, 1)->incision, 0);
	/* So far is no motion of a blade. */
	assert_true(put(INCISE_TOOL_BLADE, 10, 30, 3, M_PI_2));
	assert_int_equal(incise_incision_cuts(incision), 3);
	assert_int_equal(incise_incision_cut(incision, 2)->incision, 2);
}

/* Radius of an arc, and its end: a third of a circle. */
#define ARC_MM 20.0
#define ARC (2 * M_PI / 3)

/*
 * A slow blade on an arc, with a tracker's noise: in a tick it goes 5 um and is 20 um off. Each cut
 * leaves the arc by 1 mm after √(2 · 20 · 1) = 6.3 mm at the earliest where it lies along it; a
 * direction that is 10° off halves that. Its pieces follow the arc: of 3.2 mm 14 at most, each within
 * 30°, and together as long but for a place at each end.
 */
TEST(test_along_an_arc_with_noise, setup, teardown)
{
	uint64_t key = incise_random_key(1, INCISE_RANDOM_TRACKER), n = 0;
	double length_mm = ARC * ARC_MM;

	for (double way_mm = 0; way_mm <= length_mm; way_mm += 0.005) {
		double turn = way_mm / ARC_MM;
		double x = ARC_MM * sin(turn) + 0.02 * incise_random_normal(key, n++);
		double y =
			ARC_MM * (1 - cos(turn)) + 0.02 * incise_random_normal(key, n++);

		assert_true(put(INCISE_TOOL_BLADE, x, y, 3, turn));
	}
	assert_in_range(incise_incision_cuts(incision), 6, 14);
	for (int i = 0; i < incise_incision_cuts(incision); i++) {
		const struct incise_cut *c = incise_incision_cut(incision, i);
		double turn = atan2(c->at_mm[0], ARC_MM - c->at_mm[1]);

		assert_int_equal(c->incision, 0);
		assert_true(fabs(c->along[0] * cos(turn) + c->along[1] * sin(turn)) >
			    cos(M_PI / 6));
	}
	assert_true(fabs(incise_incision_length_mm(incision, 0) - length_mm) <
		    incise_incision_cuts(incision) * INCISE_CUT_SPACING_MM);
}

/* A way round a corner goes on as another cut, of the same incision. */
TEST(test_round_a_corner, setup, teardown)
{
	for (int i = 0; i <= 100; i++)
		assert_true(put(INCISE_TOOL_BLADE, 0.1 * i, 0, 3, 0));
	for (int i = 1; i <= 100; i++)
		assert_true(put(INCISE_TOOL_BLADE, 10, 0.1 * i, 2, 0));
	assert_int_equal(incise_incision_cuts(incision), 2);
	assert_int_equal(incise_incision_cut(incision, 1)->incision, 0);
	/* The way was 20 mm; up to 1 mm beside the line it still was on the first. */
	assert_true(fabs(incise_incision_length_mm(incision, 0) - 20) <
		    INCISE_CUT_BESIDE_MM + 0.1 + 1e-9);
	/* Longer than a cut's places, it goes on too. */
	assert_true(cut(40, -50, 40, 50, 3));
	assert_true(incise_incision_cuts(incision) > 3);
	assert_true(fabs(incise_incision_length_mm(incision, 2) - 100) < 1);
}

/* More cuts than there is capacity for are not made, and change nothing. */
TEST(test_no_more_than_the_bound, setup, teardown)
{
	struct incise_cut before[CUTS_MOST];

	for (int i = 0; i < CUTS_MOST; i++)
		assert_true(cut(0, 10 * i, 20, 10 * i, 3));
	for (int i = 0; i < CUTS_MOST; i++)
		before[i] = *incise_incision_cut(incision, i);
	assert_false(cut(0, 200, 20, 200, 3));
	assert_int_equal(incise_incision_cuts(incision), CUTS_MOST);
	for (int i = 0; i < CUTS_MOST; i++)
		assert_memory_equal(&before[i], incise_incision_cut(incision, i),
				    sizeof(before[i]));
	/* Those that are there can still be deepened, and lengthened. */
	assert_true(cut(0, 70, 25, 70, 4));
	assert_true(incise_incision_length_mm(incision, 7) > 24.9);
	assert_true(depth_at(7, 0) == 4);
}

/* As wide as it is deep, up to its extent across; less what stretches. It never closes. */
TEST(test_opened_by_handle_and_tube, setup, teardown)
{
	static const struct {
		enum incise_tool tool;
		double turn, depth_mm, open_mm;
	} cases[] = {
		{INCISE_TOOL_HANDLE, 0, 3, 1}, /* 3 mm thick, along */
		{INCISE_TOOL_HANDLE, 0, 9, 1},
		{INCISE_TOOL_HANDLE, M_PI_2, 4, 2}, /* 10 mm wide, across */
		{INCISE_TOOL_HANDLE, M_PI_2, 2, 2},
		{INCISE_TOOL_TUBE, 0, 12, 5}, /* 7 mm */
		{INCISE_TOOL_HANDLE, M_PI_2, 10, 8},
		{INCISE_TOOL_TUBE, 0, 12, 8},
	};

	assert_true(cut(-15, 0, 15, 0, 5));
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		put(cases[i].tool, 0, 0, cases[i].depth_mm, cases[i].turn);
		lift();
		/* of a float, and of a quarter turn's cosine */
		assert_true(fabs(opening(cases[i].tool, 0, 0).open_mm -
				 cases[i].open_mm) < 1e-6);
	}
	assert_true(opening(INCISE_TOOL_TUBE, 0, 0).depth_mm == 5);
	/* Less away from where it was opened, and nothing beyond its ends. */
	assert_true(opening(INCISE_TOOL_TUBE, 10, 0).open_mm <
		    opening(INCISE_TOOL_TUBE, 5, 0).open_mm);
	assert_true(incise_incision_cut(incision, 0)->place[0].open_mm == 0);
}

/* Tightness of a handle is 1 in a cut that is not opened, and 0 in one that is wide enough. */
TEST(test_tightness, setup, teardown)
{
	static const struct {
		enum incise_tool tool;
		double open_mm, want;
	} cases[] = {
		{INCISE_TOOL_HANDLE, 0, 1},	{INCISE_TOOL_HANDLE, 4, 0.5},
		{INCISE_TOOL_HANDLE, 8, 0},	{INCISE_TOOL_HANDLE, 99, 0},
		{INCISE_TOOL_TUBE, 0, 5.0 / 7}, {INCISE_TOOL_TUBE, 3, 2.0 / 7},
		{INCISE_TOOL_TUBE, 5, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_opening o = {.in = true, .open_mm = cases[i].open_mm};

		assert_true(incise_incision_tightness(incision, &o, cases[i].tool) ==
			    cases[i].want);
	}
}

/* Two stretched lips go round a tube of 7 mm from 7π/2 - 2 = 8.996 mm on, a handle from 11. */
TEST(test_too_short_for_the_tool, setup, teardown)
{
	static const struct {
		double length_mm;
		bool tube, handle;
	} cases[] = {{8.9, false, false},
		     {9.1, true, false},
		     {10.9, true, false},
		     {11.1, true, true}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double y = 20.0 * (double)i;

		assert_true(cut(0, y, cases[i].length_mm, y, 5));
		assert_int_equal(opening(INCISE_TOOL_TUBE, 4, y).in, cases[i].tube);
		assert_int_equal(opening(INCISE_TOOL_HANDLE, 4, y).in, cases[i].handle);
	}
	/* Within half of the tool's width, to the side and beyond the end. */
	assert_true(opening(INCISE_TOOL_TUBE, 4, 63.4).in);
	assert_false(opening(INCISE_TOOL_TUBE, 4, 63.6).in);
	assert_true(opening(INCISE_TOOL_HANDLE, 16, 60).in);
	assert_false(opening(INCISE_TOOL_HANDLE, 16.2, 60).in);
}

/* Where cuts cross a tool goes into the deeper one, wherever it is within a line's width. */
TEST(test_the_deeper_of_two, setup, teardown)
{
	assert_true(cut(-15, 0, 15, 0, 4));
	assert_true(cut(0, -15, 0, 15, 9));
	for (int i = -9; i <= 9; i++) {
		assert_int_equal(opening(INCISE_TOOL_HANDLE, 0.1 * i, 0).cut, 1);
		assert_int_equal(opening(INCISE_TOOL_HANDLE, 0, 0.1 * i).cut, 1);
	}
	/* Farther along the first one it is that. */
	assert_int_equal(opening(INCISE_TOOL_HANDLE, 4, 0).cut, 0);
	assert_true(opening(INCISE_TOOL_HANDLE, 4, 0).depth_mm == 4);
}

/* A touch, or a whole cut elsewhere, leaves an opening as it was, to the bit. */
TEST(test_elsewhere_changes_nothing, setup, teardown)
{
	struct incise_opening before, after;

	assert_true(cut(-15, 0, 15, 0, 5));
	put(INCISE_TOOL_HANDLE, 0, 0, 8, 1);
	lift();
	before = opening(INCISE_TOOL_TUBE, 1, 0.5);
	put(INCISE_TOOL_BLADE, 40, 40, 0.05, 0);
	lift();
	assert_true(cut(40, 40, 60, 40, 4));
	after = opening(INCISE_TOOL_TUBE, 1, 0.5);
	assert_memory_equal(&before, &after, sizeof(before));
}

/* Numbers that no hand makes cut nothing. */
TEST(test_impossible_ticks, setup, teardown)
{
	static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e7};

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++)
		for (int field = 0; field < 4; field++) {
			struct incise_tick tick = tick_at(INCISE_TOOL_BLADE, 0, 0, 3, 0);
			double *fields[] = {&tick.proxy_mm[0], &tick.normal[2],
					    &tick.quaternion[0], &tick.depth_mm};

			*fields[field] = bad[i];
			assert_true(incise_incision_tick(incision, &tick));
			tick.phase = INCISE_PHASE_INSERTION;
			tick.tool = INCISE_TOOL_TUBE;
			assert_true(incise_incision_tick(incision, &tick));
		}
	assert_int_equal(incise_incision_cuts(incision), 0);
	assert_int_equal(incise_cut_place(NAN), 0);
	assert_int_equal(incise_cut_place(-1e300), 0);
	assert_int_equal(incise_cut_place(1e300), INCISE_CUT_PLACES - 1);
}

/*
 * Random strokes of every tool: depth and opening never fall, a cut's ends only go apart, and the
 * same ticks give the same incision to the bit.
 */
TEST(test_grows_only, setup, teardown)
{
	struct incise_incision *first = incision;
	struct incise_cut was[CUTS_MOST] = {0};

	srand(3);
	setup(NULL);
	for (int i = 0; i < 20000; i++) {
		double x = 30.0 * rand() / RAND_MAX, y = 15.0 * rand() / RAND_MAX;
		double depth_mm = 12.0 * rand() / RAND_MAX,
		       turn = 7.0 * rand() / RAND_MAX;
		struct incise_tick tick =
			tick_at(INCISE_TOOL_BLADE + rand() % 3, x, y, depth_mm, turn);

		if (rand() % 9 == 0)
			tick.phase = INCISE_PHASE_FREE;
		incise_incision_tick(first, &tick);
		incise_incision_tick(incision, &tick);
		for (int k = 0; k < incise_incision_cuts(incision); k++) {
			const struct incise_cut *c = incise_incision_cut(incision, k);

			assert_true(c->from_mm <= was[k].from_mm &&
				    c->to_mm >= was[k].to_mm);
			for (int p = 0; p < INCISE_CUT_PLACES; p++)
				assert_true(c->place[p].depth_mm >=
						    was[k].place[p].depth_mm &&
					    c->place[p].open_mm >=
						    was[k].place[p].open_mm);
			was[k] = *c;
		}
	}
	assert_int_equal(incise_incision_cuts(incision), CUTS_MOST);
	for (int k = 0; k < CUTS_MOST; k++)
		assert_memory_equal(incise_incision_cut(first, k),
				    incise_incision_cut(incision, k),
				    sizeof(struct incise_cut));
	incise_incision_free(first);
}
