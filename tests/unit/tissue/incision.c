// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The cuts that ticks leave, in both kinds of numbers: what makes one, how they join, and what opens them.
 * Ticks are written out here, of a blade, handle or tube on the plane z = 0. Then integers next to double.
 */
#include "../cases.h"
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/tissue/incision.h"
#include "kinds.h"

#define CUT_FROM_MM 0.5
#define STRETCH_MM 2.0
#define CUTS_MOST 16

static struct incise_incision *in_double;
static struct incise_fixed_incision in_integers;
static struct incise_fixed_incision_setup fixed_setup;

static int make(const struct incise_double_incision_setup *tissue)
{
	in_double = incise_incision_make(tissue, (const double[]){0, 1, 0}, NULL);
	memset(&in_integers, 0, sizeof(in_integers));
	fixed_setup = (struct incise_fixed_incision_setup){
		.cuts_most = tissue->cuts_most,
		.cut_from = q16(tissue->cut_from),
		.stretch = q16(tissue->stretch),
		.handle_width = q16(tissue->handle_width),
		.handle_thickness = q16(tissue->handle_thickness),
		.tube = q16(tissue->tube),
	};
	return !in_double || !incise_fixed_incision_good(&fixed_setup);
}

static int setup(void **state)
{
	return make(&(struct incise_double_incision_setup){.cuts_most = CUTS_MOST,
							   .cut_from = CUT_FROM_MM,
							   .stretch = STRETCH_MM,
							   .handle_width = 10,
							   .handle_thickness = 3,
							   .tube = 7});
}

static int teardown(void **state)
{
	incise_incision_free(in_double);
	return 0;
}

/* --- both kinds ------------------------------------------------------------------------- */

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

static bool put_double(enum incise_tool tool, double x, double y, double depth_mm,
		       double turn)
{
	struct incise_tick tick = tick_at(tool, x, y, depth_mm, turn);

	return incise_incision_tick(in_double, &tick);
}

static bool put_fixed(enum incise_tool tool, double x, double y, double depth_mm,
		      double turn)
{
	const int32_t at[3] = {q16(x), q16(y), 0}, normal[3] = {0, 0, 1 << 30},
		      side[3] = {q30(-sin(turn)), q30(cos(turn)), 0};

	if (tool == INCISE_TOOL_BLADE)
		return incise_fixed_incision_cut(&in_integers, &fixed_setup, at, normal,
						 side, q16(depth_mm));
	incise_fixed_incision_open(&in_integers, &fixed_setup, tool, at, side,
				   q16(depth_mm));
	return true;
}

static void lift_double(void)
{
	struct incise_tick tick = {.phase = INCISE_PHASE_FREE};

	assert_true(incise_incision_tick(in_double, &tick));
}

static void lift_fixed(void)
{
	incise_fixed_incision_leave(&in_integers);
}

static int cuts_double(void)
{
	return incise_incision_cuts(in_double);
}

static int cuts_fixed(void)
{
	return in_integers.n;
}

static void get_double(int i, struct incise_cut *cut)
{
	*cut = *incise_incision_cut(in_double, i);
}

static void get_fixed(int i, struct incise_cut *cut)
{
	const struct incise_fixed_cut *from = &in_integers.cut[i];

	memset(cut, 0, sizeof(*cut));
	from_q16(cut->at_mm, from->at_mm);
	from_q30(cut->along, from->along);
	from_q30(cut->side, from->side);
	from_q30(cut->normal, from->normal);
	cut->from_mm = from->from_mm / ONE;
	cut->to_mm = from->to_mm / ONE;
	cut->incision = from->incision;
	for (int k = 0; k < INCISE_CUT_PLACES; k++) {
		cut->place[k].depth_mm = (float)(from->place[k].depth_mm / ONE);
		cut->place[k].open_mm = (float)(from->place[k].open_mm / ONE);
	}
}

static double length_double(int number)
{
	double length_mm = 0;

	for (int i = 0; i < cuts_double(); i++) {
		const struct incise_cut *cut = incise_incision_cut(in_double, i);

		if (cut->incision == number)
			length_mm += cut->to_mm - cut->from_mm;
	}
	return length_mm;
}

static double length_fixed(int number)
{
	int64_t length = 0;

	for (int i = 0; i < in_integers.n; i++)
		if (in_integers.cut[i].incision == number)
			length += in_integers.cut[i].to_mm - in_integers.cut[i].from_mm;
	return (double)length / ONE;
}

static void find_double(enum incise_tool tool, double x, double y,
			struct incise_opening *opening)
{
	incise_incision_opening(in_double, tool, (double[]){x, y, 0}, opening);
}

static void from_fixed(struct incise_opening *to, const struct incise_fixed_opening *from)
{
	to->in = from->in;
	to->cut = from->cut;
	to->at_mm = from->at_mm / ONE;
	to->depth_mm = from->depth_mm / ONE;
	to->open_mm = from->open_mm / ONE;
	to->length_mm = from->length_mm / ONE;
	from_q30(to->along, from->along);
}

static void find_fixed(enum incise_tool tool, double x, double y,
		       struct incise_opening *opening)
{
	const int32_t at[3] = {q16(x), q16(y), 0};
	struct incise_fixed_opening found;

	incise_fixed_incision_find(&in_integers, &fixed_setup, tool, at, &found);
	from_fixed(opening, &found);
}

static double tightness_double(double open_mm, enum incise_tool tool)
{
	const struct incise_double_incision_setup own = {.stretch = STRETCH_MM,
							 .handle_width = 10,
							 .handle_thickness = 3,
							 .tube = 7};

	return incise_double_incision_tightness(
		&own, &(struct incise_opening){.in = true, .open_mm = open_mm}, tool);
}

static double tightness_fixed(double open_mm, enum incise_tool tool)
{
	return incise_fixed_incision_tightness(
		       &fixed_setup,
		       &(struct incise_fixed_opening){.in = true,
						      .open_mm = q16(open_mm)},
		       tool) /
	       ONE;
}

/* rounding: of a place, by sums of 200 steps. bit: of one number. */
static const struct kind {
	double rounding, bit;
	bool (*put)(enum incise_tool tool, double x, double y, double depth_mm,
		    double turn);
	void (*lift)(void);
	int (*cuts)(void);
	void (*get)(int i, struct incise_cut *cut);
	double (*length)(int number);
	void (*find)(enum incise_tool tool, double x, double y,
		     struct incise_opening *opening);
	double (*tightness)(double open_mm, enum incise_tool tool);
} kinds[] = {{1e-12, 0, put_double, lift_double, cuts_double, get_double, length_double,
	      find_double, tightness_double},
	     {2 / ONE, 1 / ONE, put_fixed, lift_fixed, cuts_fixed, get_fixed,
	      length_fixed, find_fixed, tightness_fixed}},
  *kind;

/* A straight cut in steps of 0.1 mm, the blade's edge along it. Returns whether it was made. */
static bool cut(double x, double y, double to_x, double to_y, double depth_mm)
{
	double way = hypot(to_x - x, to_y - y), turn = atan2(to_y - y, to_x - x);
	int steps = (int)ceil(way / 0.1);
	bool made = true;

	for (int i = 0; i <= steps; i++)
		made &= kind->put(INCISE_TOOL_BLADE, x + (to_x - x) * i / steps,
				  y + (to_y - y) * i / steps, depth_mm, turn);
	kind->lift();
	return made;
}

static const struct incise_cut *cut_of(int i)
{
	static struct incise_cut cut;

	kind->get(i, &cut);
	return &cut;
}

static double depth_at(int i, double along_mm)
{
	return cut_of(i)->place[incise_cut_place(along_mm)].depth_mm;
}

static struct incise_opening opening(enum incise_tool tool, double x, double y)
{
	struct incise_opening o;

	memset(&o, 0, sizeof(o));
	kind->find(tool, x, y, &o);
	return o;
}

/* A blade that is not deeper than the threshold leaves nothing; one that is leaves a line. */
TEST_KINDS(test_a_scratch_is_no_cut, setup, teardown)
{
	const struct incise_cut *c;

	assert_true(cut(0, 0, 20, 0, CUT_FROM_MM));
	assert_int_equal(kind->cuts(), 0);
	assert_true(cut(5, 0, 25, 0, 3));
	assert_int_equal(kind->cuts(), 1);
	c = cut_of(0);
	/* of sums of 200 steps */
	assert_true(fabs(c->to_mm - c->from_mm - 20) <= kind->rounding);
	assert_true(c->at_mm[0] == 5 && fabs(c->along[0]) == 1 && c->normal[2] == 1);
	for (double s = 0; s <= 20; s += 0.25)
		assert_true(depth_at(0, s * c->along[0]) == 3);
	assert_true(depth_at(0, -c->along[0]) == 0);
	assert_null(incise_incision_cut(in_double, -1));
	assert_null(incise_incision_cut(in_double, 1));
}

/* Again along the same line: deeper, and longer at both ends; never shallower. */
TEST_KINDS(test_lengthened_and_deepened, setup, teardown)
{
	const struct incise_cut *c;

	assert_true(cut(0, 0, 10, 0, 3));
	assert_true(cut(10.5, 0.5, -5, 0.5, 2));
	assert_true(cut(4, 0, 6, 0, 5));
	assert_int_equal(kind->cuts(), 1);
	c = cut_of(0);
	assert_true(fabs(c->from_mm + 5) <= kind->rounding &&
		    fabs(c->to_mm - 10.5) <= kind->rounding);
	assert_true(depth_at(0, 5 * c->along[0]) == 5);
	assert_true(depth_at(0, 2 * c->along[0]) == 3);
	assert_true(depth_at(0, -3 * c->along[0]) == 2);
}

/* The blade starts beyond the end, and goes on along the line when it comes to it. */
TEST_KINDS(test_no_line_twice, setup, teardown)
{
	assert_true(cut(0, 0, 20, 0, 3));
	assert_true(cut(25, 0.5, 3, 0.5, 4));
	assert_int_equal(kind->cuts(), 2);
	assert_int_equal(cut_of(1)->incision, 0);
	/* The parts overlap by the reach at the end, and a place. */
	assert_true(fabs(kind->length(0) - 25) <=
		    INCISE_CUT_BESIDE_MM + INCISE_CUT_SPACING_MM);
	assert_true(depth_at(0, 5) == 4 && depth_at(0, 1) == 3);
}

/* Cuts that cross or touch are one incision, whichever was first; others stay apart. */
TEST_KINDS(test_joined_where_they_meet, setup, teardown)
{
	assert_true(cut(0, 0, 0, 20, 3));
	assert_true(cut(30, 0, 30, 20, 3));
	assert_int_equal(cut_of(1)->incision, 1);
	assert_true(fabs(kind->length(0) - 20) <= kind->rounding);
	/* Across both. */
	assert_true(cut(-5, 10, 26, 10, 3));
	assert_int_equal(cut_of(2)->incision, 0);
	assert_int_equal(cut_of(1)->incision, 1);
	assert_true(cut(26, 10, 35, 10, 3));
	for (int i = 0; i < kind->cuts(); i++)
		assert_int_equal(cut_of(i)->incision, 0);
	assert_true(fabs(kind->length(0) - 80) <= 4 * kind->rounding);
}

/* A fast blade crosses between two ticks. */
TEST_KINDS(test_crossed_between_two_ticks, setup, teardown)
{
	assert_true(cut(0, 0, 20, 0, 3));
	assert_true(kind->put(INCISE_TOOL_BLADE, 10, -4, 3, M_PI_2));
	assert_true(kind->put(INCISE_TOOL_BLADE, 10, 4, 3, M_PI_2));
	assert_int_equal(kind->cuts(), 2);
	assert_int_equal(cut_of(1)->incision, 0);
	/* So far is no motion of a blade. */
	assert_true(kind->put(INCISE_TOOL_BLADE, 10, 30, 3, M_PI_2));
	assert_int_equal(kind->cuts(), 3);
	assert_int_equal(cut_of(2)->incision, 2);
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
TEST_KINDS(test_along_an_arc_with_noise, setup, teardown)
{
	uint64_t key = incise_random_key(1, INCISE_RANDOM_TRACKER), n = 0;
	double length_mm = ARC * ARC_MM;

	for (double way_mm = 0; way_mm <= length_mm; way_mm += 0.005) {
		double turn = way_mm / ARC_MM;
		double x = ARC_MM * sin(turn) + 0.02 * incise_random_normal(key, n++);
		double y =
			ARC_MM * (1 - cos(turn)) + 0.02 * incise_random_normal(key, n++);

		assert_true(kind->put(INCISE_TOOL_BLADE, x, y, 3, turn));
	}
	assert_in_range(kind->cuts(), 6, 14);
	for (int i = 0; i < kind->cuts(); i++) {
		const struct incise_cut *c = cut_of(i);
		double turn = atan2(c->at_mm[0], ARC_MM - c->at_mm[1]);

		assert_int_equal(c->incision, 0);
		assert_true(fabs(c->along[0] * cos(turn) + c->along[1] * sin(turn)) >
			    cos(M_PI / 6));
	}
	assert_true(fabs(kind->length(0) - length_mm) <
		    kind->cuts() * INCISE_CUT_SPACING_MM);
}

/* A way round a corner goes on as another cut, of the same incision. */
TEST_KINDS(test_round_a_corner, setup, teardown)
{
	for (int i = 0; i <= 100; i++)
		assert_true(kind->put(INCISE_TOOL_BLADE, 0.1 * i, 0, 3, 0));
	for (int i = 1; i <= 100; i++)
		assert_true(kind->put(INCISE_TOOL_BLADE, 10, 0.1 * i, 2, 0));
	assert_int_equal(kind->cuts(), 2);
	assert_int_equal(cut_of(1)->incision, 0);
	/* The way was 20 mm; up to 1 mm beside the line it still was on the first. */
	assert_true(fabs(kind->length(0) - 20) <
		    INCISE_CUT_BESIDE_MM + 0.1 + 4 * kind->rounding);
	/* Longer than a cut's places, it goes on too. */
	assert_true(cut(40, -50, 40, 50, 3));
	assert_true(kind->cuts() > 3);
	assert_true(fabs(kind->length(2) - 100) < 1);
}

/* More cuts than there is capacity for are not made, and change nothing. */
TEST_KINDS(test_no_more_than_the_bound, setup, teardown)
{
	struct incise_cut before[CUTS_MOST];

	for (int i = 0; i < CUTS_MOST; i++)
		assert_true(cut(0, 10 * i, 20, 10 * i, 3));
	for (int i = 0; i < CUTS_MOST; i++)
		before[i] = *cut_of(i);
	assert_false(cut(0, 200, 20, 200, 3));
	assert_int_equal(kind->cuts(), CUTS_MOST);
	for (int i = 0; i < CUTS_MOST; i++)
		assert_memory_equal(&before[i], cut_of(i), sizeof(before[i]));
	/* Those that are there can still be deepened, and lengthened. */
	assert_true(cut(0, 70, 25, 70, 4));
	assert_true(kind->length(7) > 24.9);
	assert_true(depth_at(7, 0) == 4);
}

/* As wide as it is deep, up to its extent across; less what stretches. It never closes. */
TEST_KINDS(test_opened_by_handle_and_tube, setup, teardown)
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
		kind->put(cases[i].tool, 0, 0, cases[i].depth_mm, cases[i].turn);
		kind->lift();
		/* of a float, and of a quarter turn's cosine */
		assert_true(fabs(opening(cases[i].tool, 0, 0).open_mm -
				 cases[i].open_mm) < 1e-6 + 2 * kind->bit);
	}
	assert_true(opening(INCISE_TOOL_TUBE, 0, 0).depth_mm == 5);
	/* Less away from where it was opened, and nothing beyond its ends. */
	assert_true(opening(INCISE_TOOL_TUBE, 10, 0).open_mm <
		    opening(INCISE_TOOL_TUBE, 5, 0).open_mm);
	assert_true(cut_of(0)->place[0].open_mm == 0);
}

/* Tightness of a handle is 1 in a cut that is not opened, and 0 in one that is wide enough. */
TEST_KINDS(test_tightness, setup, teardown)
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

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_true(fabs(kind->tightness(cases[i].open_mm, cases[i].tool) -
				 cases[i].want) <= kind->bit);
}

/* Two stretched lips go round a tube of 7 mm from 7π/2 - 2 = 8.996 mm on, a handle from 11. */
TEST_KINDS(test_too_short_for_the_tool, setup, teardown)
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
TEST_KINDS(test_the_deeper_of_two, setup, teardown)
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
TEST_KINDS(test_elsewhere_changes_nothing, setup, teardown)
{
	struct incise_opening before, after;

	assert_true(cut(-15, 0, 15, 0, 5));
	kind->put(INCISE_TOOL_HANDLE, 0, 0, 8, 1);
	kind->lift();
	before = opening(INCISE_TOOL_TUBE, 1, 0.5);
	kind->put(INCISE_TOOL_BLADE, 40, 40, 0.05, 0);
	kind->lift();
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
			assert_true(incise_incision_tick(in_double, &tick));
			tick.phase = INCISE_PHASE_INSERTION;
			tick.tool = INCISE_TOOL_TUBE;
			assert_true(incise_incision_tick(in_double, &tick));
		}
	assert_int_equal(incise_incision_cuts(in_double), 0);
	assert_int_equal(incise_cut_place(NAN), 0);
	assert_int_equal(incise_cut_place(-1e300), 0);
	assert_int_equal(incise_cut_place(1e300), INCISE_CUT_PLACES - 1);
}

static void any_stroke(void)
{
	double x = 30.0 * rand() / RAND_MAX, y = 15.0 * rand() / RAND_MAX;
	double depth_mm = 12.0 * rand() / RAND_MAX, turn = 7.0 * rand() / RAND_MAX;

	if (rand() % 9 == 0)
		kind->lift();
	else
		kind->put(INCISE_TOOL_BLADE + rand() % 3, x, y, depth_mm, turn);
}

/*
 * Random strokes of every tool: depth and opening never fall, a cut's ends only go apart, between which
 * it is nowhere uncut, and the same ticks give the same incision to the bit.
 */
TEST_KINDS(test_grows_only, setup, teardown)
{
	struct incise_cut was[CUTS_MOST] = {0};

	srand(3);
	for (int i = 0; i < 20000; i++) {
		any_stroke();
		for (int k = 0; k < kind->cuts(); k++) {
			const struct incise_cut *c = cut_of(k);

			assert_true(c->from_mm <= was[k].from_mm &&
				    c->to_mm >= was[k].to_mm);
			for (int p = 0; p < INCISE_CUT_PLACES; p++)
				assert_true(c->place[p].depth_mm >=
						    was[k].place[p].depth_mm &&
					    c->place[p].open_mm >=
						    was[k].place[p].open_mm);
			for (int p = incise_cut_place(c->from_mm);
			     p <= incise_cut_place(c->to_mm); p++)
				assert_true(c->place[p].depth_mm > 0);
			was[k] = *c;
		}
	}
	assert_int_equal(kind->cuts(), CUTS_MOST);
	teardown(NULL);
	assert_int_equal(setup(NULL), 0);
	srand(3);
	for (int i = 0; i < 20000; i++)
		any_stroke();
	assert_int_equal(kind->cuts(), CUTS_MOST);
	for (int k = 0; k < CUTS_MOST; k++)
		assert_memory_equal(cut_of(k), &was[k], sizeof(was[k]));
}

/* --- integers next to double ------------------------------------------------------------ */

static uint64_t drawn;

static double any(double least, double most)
{
	static uint64_t key;

	key = key ? key : incise_random_key(6, 99);
	return least + (most - least) * incise_random_uniform(key, drawn++);
}

static double any_q16(double least, double most)
{
	return q16(any(least, most)) / ONE;
}

/* Of cuts that go along a way as short as 0.05 mm, 32 mm away; and of depths between two ticks. */
#define ENDS_MM (32 / ONE / 0.05)
#define DEPTH_MM 1e-3

static bool is_same(const struct incise_cut *got, const struct incise_cut *want)
{
	if (got->incision != want->incision ||
	    fabs(got->from_mm - want->from_mm) > ENDS_MM ||
	    fabs(got->to_mm - want->to_mm) > ENDS_MM)
		return false;
	for (int k = 0; k < INCISE_CUT_PLACES; k++)
		if (fabs((double)got->place[k].depth_mm -
			 (double)want->place[k].depth_mm) > DEPTH_MM ||
		    fabs((double)got->place[k].open_mm - (double)want->place[k].open_mm) >
			    DEPTH_MM)
			return false;
	return true;
}

/* A blade that goes to and fro over a skin, turns and leaves it; handle or tube opens its cuts. */
struct stroke {
	double x, y, angle, depth;
};

static void move(struct stroke *s)
{
	double way = any(0, 0.4);

	s->angle += any(-0.05, 0.05);
	if (any(0, 60) < 1)
		s->angle += any(-2, 2);
	s->x += way * cos(s->angle);
	s->y += way * sin(s->angle);
	s->depth = fmin(fmax(s->depth + any(-0.3, 0.3), -1), 12);
}

/* One tick of both. @return whether an opening was met; @full: no cut was left */
static bool compare_tick(const struct stroke *s, enum incise_tool tool,
			 const struct incise_double_incision_setup *tissue, int *full)
{
	double x = q16(s->x) / ONE, y = q16(s->y) / ONE, depth = q16(s->depth) / ONE;
	const struct incise_opening *want = &incise_incision_of(in_double)->met;
	const struct incise_fixed_opening *got = &in_integers.met;
	bool left;

	if (s->depth < 0) {
		lift_double();
		lift_fixed();
	} else {
		left = put_fixed(tool, x, y, depth, s->angle);
		assert_int_equal(put_double(tool, x, y, depth, s->angle), left);
		*full += !left;
	}
	assert_int_equal(got->in, want->in);
	if (!want->in)
		return false;
	assert_int_equal(got->cut, want->cut);
	assert_true(fabs(got->depth_mm / ONE - want->depth_mm) <= 1e-3);
	assert_true(fabs(incise_fixed_incision_tightness(&fixed_setup, got, tool) / ONE -
			 incise_double_incision_tightness(tissue, want, tool)) <= 1e-3);
	return true;
}

/* The same cuts, joined in the same way; the same openings, as tight. */
TEST(test_same_cuts)
{
	int most = 0, met = 0, full = 0, apart = 0, all = 0;

	drawn = 0;
	for (int run = 0; run < 200; run++) {
		struct incise_double_incision_setup tissue = {
			.cuts_most = 1 + (int32_t)any(0, INCISE_FIXED_CUTS_MAX - 1),
			.cut_from = any_q16(0, 2),
			.stretch = any_q16(0, 3),
			.handle_width = any_q16(6, 14),
			.handle_thickness = any_q16(1, 5),
			.tube = any_q16(4, 9),
		};
		struct stroke stroke = {.depth = 3};

		assert_int_equal(make(&tissue), 0);
		for (int t = 0; t < 400; t++) {
			enum incise_tool other =
				run & 1 ? INCISE_TOOL_TUBE : INCISE_TOOL_HANDLE;

			move(&stroke);
			met += compare_tick(&stroke,
					    t / 100 % 3 == 2 ? other : INCISE_TOOL_BLADE,
					    &tissue, &full);
		}
		assert_int_equal(cuts_fixed(), cuts_double());
		for (int i = 0; i < cuts_double(); i++) {
			struct incise_cut got;

			get_fixed(i, &got);
			apart += !is_same(&got, incise_incision_cut(in_double, i));
		}
		all += cuts_fixed();
		most = cuts_fixed() > most ? cuts_fixed() : most;
		teardown(NULL);
	}
	assert_true(most > 3);
	assert_true(met > 100);
	assert_true(full > 100);
	/*
	 * Where a tick lies on the edge of a place, or 1 mm beside a cut, rounding decides whether that is
	 * deepened, or left a tick later: of 400 ticks with edges 0.5 mm apart, an LSB each.
	 */
	if (apart * 100 > all)
		fail_msg("%d of %d cuts are apart", apart, all);
}

/* --- a blade in a cut that is there -------------------------------------------------------------- */

#define KN 0.14
#define SLIDES 0.1 /* friction */
#define CONTACTS 400
#define BLADE_TICKS 300

/* Stages incision and reaction of a blade on the plane z = 0: the force along it. */
#define BLADE(kind, num_of, dir_of, back, cuts)                                     \
	static double force_##kind(bool began, double x, double depth, double turn) \
	{                                                                           \
		static struct incise_##kind##_plan plan;                            \
		static struct incise_##kind##_state state;                          \
		struct incise_##kind##_tick tick = {.phase = INCISE_PHASE_CUTTING}; \
                                                                                    \
		plan.numbers.inserts = true;                                        \
		plan.numbers.incision = *setup_##kind();                            \
		plan.numbers.reaction = num_of(KN);                                 \
		plan.numbers.friction = num_of(SLIDES);                             \
		state.held = INCISE_TOOL_BLADE;                                     \
		state.proxy.began = began;                                          \
		state.depth = num_of(depth);                                        \
		state.normal[2] = dir_of(1);                                        \
		state.flat[0] = dir_of(-sin(turn));                                 \
		state.flat[1] = dir_of(cos(turn));                                  \
		state.force[2] = 0;                                                 \
		tick.proxy[0] = num_of(x);                                          \
		cuts(&state);                                                       \
		incise_##kind##_stage_incision(&plan, &state, &tick);               \
		incise_##kind##_stage_reaction(&plan, &state, &tick);               \
		cuts##_back(&state);                                                \
		return state.force[2] back;                                         \
	}

static const struct incise_double_incision_setup *setup_double(void)
{
	static const struct incise_double_incision_setup tissue = {.cuts_most = CUTS_MOST,
								   .cut_from =
									   CUT_FROM_MM,
								   .stretch = STRETCH_MM,
								   .handle_width = 10,
								   .handle_thickness = 3,
								   .tube = 7};

	return &tissue;
}

static const struct incise_fixed_incision_setup *setup_fixed(void)
{
	return &fixed_setup;
}

#define AS_IS(x) (x)
#define point(state) ((state)->incision = incise_incision_of(in_double))
#define point_back(state) ((void)(state))
#define copy(state) ((state)->incision = in_integers)
#define copy_back(state) (in_integers = (state)->incision)

/* clang-format off */
BLADE(double, AS_IS, AS_IS, , point)
BLADE(fixed, q16, q30, / ONE, copy)
/* clang-format on */

static double force(bool began, double x, double depth, double turn)
{
	return (kind == kinds ? force_double : force_fixed)(began, x, depth, turn);
}

/* Numbers of 16 bits, and their products. */
#define SAME_N (kind == kinds ? 1e-12 : 4 / ONE)

static double force_in(double cut_mm, double depth_mm)
{
	double open_mm = fmin(cut_mm, depth_mm);

	return KN * (SLIDES * open_mm + depth_mm - open_mm);
}

/* Friction down to the floor of a cut that was there, skin below; its own cutting counts from the next contact on. */
TEST_KINDS(test_back_in_a_cut, setup, teardown)
{
	bool began = true;

	for (double d = 0; d <= 8; d += 0.25, began = false)
		assert_true(fabs(force(began, 0, d, 0) - KN * d) < SAME_N);
	for (double d = 8; d >= 0; d -= 0.25)
		assert_true(fabs(force(false, 0, d, 0) - KN * d) < SAME_N);
	kind->lift();
	/* In the next, and beside it; on the way out the same. */
	for (int i = 0; i <= 96; i++) {
		double d = 0.25 * fmin(i, 96 - i);

		assert_true(fabs(force(i == 0, 0.5 * (i > 48), d, 0) - force_in(8, d)) <
			    SAME_N);
	}
	kind->lift();
	/* As deep as it was cut then. Turned by more than 30° it is new tissue, so is skin beyond its end. */
	assert_true(fabs(force(true, 0, 11, 0.4) - force_in(12, 11)) < SAME_N);
	kind->lift();
	assert_true(fabs(force(true, 0, 0.4, 0.6) - KN * 0.4) < SAME_N);
	kind->lift();
	assert_true(fabs(force(true, 2, 0.4, 0) - KN * 0.4) < SAME_N);
}

/*
 * Any way of the blade along a line that was cut to several depths, deeper and out again, by a place or a depth in each
 * tick: it is continuous in depth, never pulls, and returns no more work than it took.
 */
TEST_KINDS(test_a_blade_in_cuts_returns_no_work, setup, teardown)
{
	double most = 0, least = INFINITY, before, now, step = 1.0 / 16;

	drawn = cases_seed(1) << 32;
	for (int c = 0; c < cases_of(CONTACTS, 40); c++) {
		double x = any(-20, 20), d = 0, work = 0, put = 0;

		before = force(true, x, 0, 0);
		assert_true(before == 0);
		for (int i = 0; i < BLADE_TICKS || d > 0; i++) {
			bool aside = i < BLADE_TICKS && any(0, 3) < 1;
			double way =
				any(0, 1) < (i % 150 < 80 ? 0.85 : 0.2) ? step : -step;

			way = d + way < 0 ? -d : d + way > 12 ? 0 : way;
			way = i < BLADE_TICKS ? way : -fmin(d, step);
			if (aside)
				x += any(-0.4, 0.4);
			else
				d += way;
			now = force(false, x, d, 0);
			assert_true(now >= 0 && now <= KN * d + SAME_N);
			/* Sideways it may fall, as tissue is cut there; it never rises. */
			assert_true(aside ? now <= before + SAME_N
					  : fabs(now - before) <= KN * step + SAME_N);
			if (!aside)
				work += (now + before) / 2 * way;
			put += aside ? 0 : fmax(way, 0) * now;
			before = now;
		}
		kind->lift();
		/* Floors of cuts lie between two depths here: the trapezoid's error there. */
		assert_true(work >= -(SAME_N * BLADE_TICKS + KN * step * step * 20));
		most = fmax(most, work);
		least = fmin(least, work / put);
	}
	assert_true(most > 0.1);
	assert_true(least < 0.05);
}

/* --- which opening a tool is in, against an oracle ---------------------------------------------- */

/*
 * The review's case: a scratch of 30 mm, and a stab of no length beside it, 15 mm deep, with the blade across. The
 * tube is stopped as without the stab, wherever it is; the handle along a deep cut meets that cut's direction.
 */
TEST_KINDS(test_a_stab_lends_nothing, setup, teardown)
{
	struct incise_opening without[41], now;

	assert_true(cut(-15, 0, 15, 0, 1.2));
	assert_true(cut(-15, 20, 15, 20, 12));
	for (int i = 0; i <= 40; i++)
		without[i] = opening(INCISE_TOOL_TUBE, 0.5 * i - 10, 0);
	assert_true(kind->put(INCISE_TOOL_BLADE, 0, 0, 15, M_PI_2));
	kind->lift();
	/* And along it, which deepens the scratch itself. */
	assert_true(kind->put(INCISE_TOOL_BLADE, 5, 0, 15, 0));
	kind->lift();
	assert_true(kind->put(INCISE_TOOL_BLADE, 0, 20, 15, M_PI_2));
	kind->lift();
	assert_int_equal(kind->cuts(), 4);
	for (int i = 0; i <= 40; i++) {
		now = opening(INCISE_TOOL_TUBE, 0.5 * i - 10, 0);
		assert_true(now.in && now.depth_mm == without[i].depth_mm);
		assert_int_equal(now.cut, without[i].cut);
	}
	for (int i = -8; i <= 8; i++) {
		now = opening(INCISE_TOOL_HANDLE, 0.5 * i, 20);
		assert_true(now.in && now.depth_mm == 12);
		assert_true(fabs(now.along[0]) == 1 && now.along[1] == 0);
		/* of the ends, by sums of steps */
		assert_true(fabs(now.length_mm - 30) <= 2 * kind->rounding);
	}
}

/* A cut that goes on round a curve lends its length, one round a corner none. */
TEST_KINDS(test_goes_on_along_its_line, setup, teardown)
{
	static const struct {
		double turn_deg;
		bool in;
	} cases[] = {{0, true}, {15, true}, {35, true}, {65, false}, {90, false}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double x = 40.0 * (double)i, turn = cases[i].turn_deg * M_PI / 180;

		/* 7 mm each: a handle needs 11. */
		for (int k = 0; k <= 140; k++) {
			double to = 0.1 * k - 7, on = fmax(to, 0);

			assert_true(kind->put(INCISE_TOOL_BLADE,
					      x + fmin(to, 0) + on * cos(turn),
					      on * sin(turn), 5, 0));
		}
		kind->lift();
		assert_int_equal(opening(INCISE_TOOL_HANDLE, x - 4, 0).in, cases[i].in);
		assert_int_equal(
			opening(INCISE_TOOL_HANDLE, x + 5 * cos(turn), 5 * sin(turn)).in,
			cases[i].in);
	}
}

/* A way of the blade: one leg, or two with a little turn between them. */
struct way {
	double x, y, angle, length[2], turn;
	int passes;
	struct {
		double from, to, depth;
	} pass[3]; /* along the first leg, after the first pass along all */
};

#define WAYS 6

static void place_on(const struct way *way, double s, double beside, double at[2])
{
	double on = fmax(s - way->length[0], 0), angle = way->angle;

	s = fmin(s, way->length[0]);
	at[0] = way->x + s * cos(angle) + on * cos(angle + way->turn);
	at[1] = way->y + s * sin(angle) + on * sin(angle + way->turn);
	angle += on > 0 ? way->turn : 0;
	at[0] -= beside * sin(angle);
	at[1] += beside * cos(angle);
}

static double whole(const struct way *way)
{
	return way->length[0] + way->length[1];
}

/* How deep the blade was there. */
static double deep_on(const struct way *way, double s)
{
	double deep = 0;

	for (int i = 0; i < way->passes; i++)
		if (s >= way->pass[i].from && s <= way->pass[i].to)
			deep = fmax(deep, way->pass[i].depth);
	return deep;
}

/* What a surgeon would say, in steps of 0.05 mm along the ways: with this way the tool needs another length. */
struct oracle {
	double need, beside, shift, reach;
	int way;
	double need_of_way;
};

#define STEP_MM 0.05

/* The deepest level at which a stretch of a way round @s is as long as the tool needs. */
static double level_at(const struct way *way, double s, double need)
{
	double deepest = 0;

	for (int i = 0; i < way->passes; i++) {
		double level = way->pass[i].depth, low = s, high = s;

		if (deep_on(way, s) < level)
			continue;
		while (low >= 0 && deep_on(way, low) >= level)
			low -= STEP_MM;
		while (high <= whole(way) && deep_on(way, high) >= level)
			high += STEP_MM;
		if (high - low >= need)
			deepest = fmax(deepest, level);
	}
	return deepest;
}

/* Of one leg: how far away the tool is, and how deep it lets it in. @return whether it does */
static bool ask_leg(const struct oracle *o, const struct way *ways, int which, int leg,
		    const double at[2], double *away, double *depth)
{
	const struct way *way = &ways[which];
	double angle = way->angle + (leg ? way->turn : 0), corner[2], s;
	double begin = leg ? way->length[0] : 0;
	double end = leg ? whole(way) : way->length[0];

	if (leg && way->turn == 0)
		return false;
	place_on(way, begin, 0, corner);
	s = begin + (at[0] - corner[0]) * cos(angle) + (at[1] - corner[1]) * sin(angle);
	*away = fabs((at[1] - corner[1]) * cos(angle) - (at[0] - corner[0]) * sin(angle));
	/* The next cut begins where the blade is 1 mm away from the line of the first, which goes so far. */
	if (leg)
		begin += INCISE_CUT_BESIDE_MM / fabs(sin(way->turn));
	else if (way->turn != 0)
		end += INCISE_CUT_BESIDE_MM / fabs(tan(way->turn));
	*away = fmax(*away, fmax(begin - s, s - end));
	s = fmin(fmax(fmin(fmax(s, begin), end) + o->shift, begin), end);
	*depth = level_at(way, s, which == o->way ? o->need_of_way : o->need);
	return *away <= o->reach && *depth > 0;
}

static double ask(const struct oracle *o, const struct way *ways, int n,
		  const double at[2], int *which)
{
	double nearest = INFINITY, deepest = 0, away, depth;

	*which = -1;
	for (int i = 0; i < 2 * n; i++)
		if (ask_leg(o, ways, i / 2, i % 2, at, &away, &depth))
			nearest = fmin(nearest, away);
	for (int i = 0; i < 2 * n; i++)
		if (ask_leg(o, ways, i / 2, i % 2, at, &away, &depth) &&
		    away <= nearest + o->beside && depth > deepest) {
			deepest = depth;
			*which = i / 2;
		}
	return deepest;
}

/* Whether two ways are apart, or cross at 58° or more. */
static bool is_clear(const struct way *a, const struct way *b)
{
	for (double s = 0; s <= whole(a); s += 0.5)
		for (double t = 0; t <= whole(b); t += 0.5) {
			double p[2], q[2], between;

			place_on(a, s, 0, p);
			place_on(b, t, 0, q);
			if (hypot(p[0] - q[0], p[1] - q[1]) > 3)
				continue;
			between = a->angle + (s > a->length[0] ? a->turn : 0) - b->angle -
				  (t > b->length[0] ? b->turn : 0);
			if (fabs(cos(between)) > cos(58 * M_PI / 180))
				return false;
		}
	return true;
}

static void draw_way(struct way *way, double angle, const struct way *last)
{
	double at[2] = {any(-15, 15), any(-15, 15)};

	/* Round the corner. */
	if (last && any(0, 4) < 1)
		place_on(last, whole(last), 0, at);
	*way = (struct way){.x = at[0],
			    .y = at[1],
			    .angle = angle + (any(0, 2) < 1 ? M_PI_2 : 0) +
				     any(-0.17, 0.17),
			    .length = {any(0, 5) < 1 ? 0 : any(1, 26)},
			    .passes = 1};
	if (any(0, 2) < 1 && way->length[0] > 4) {
		way->length[1] = any(4, 14);
		way->turn = any(15, 35) * M_PI / 180 * (any(0, 2) < 1 ? 1 : -1);
	}
	way->pass[0].to = whole(way);
	way->pass[0].depth = any(0.6, 15);
	for (; way->length[0] > 4 && way->passes < 3 && any(0, 2) < 1; way->passes++) {
		double from = any(0, way->length[0]), to = any(0, way->length[0]);

		way->pass[way->passes].from = fmin(from, to);
		way->pass[way->passes].to =
			any(0, 3) < 1 ? fmin(from, to) : fmax(from, to);
		way->pass[way->passes].depth = any(0.6, 15);
	}
}

/* A procedure of up to WAYS ways that are to be cut. */
static int draw_procedure(struct way *ways)
{
	int n = 1 + (int)any(0, WAYS), have = 0;
	double angle = any(0, 2 * M_PI);

	for (int tries = 0; have < n && tries < 50; tries++) {
		bool clear = true;

		draw_way(&ways[have], angle, have ? &ways[have - 1] : NULL);
		for (int i = 0; i < have; i++)
			clear = clear && is_clear(&ways[i], &ways[have]);
		have += clear;
	}
	return have;
}

static void cut_way(const struct way *way)
{
	for (int i = 0; i < way->passes; i++) {
		double gone = way->pass[i].to - way->pass[i].from, at[2];
		int steps = (int)ceil(gone / 0.1);

		for (int k = 0; k <= steps; k++) {
			place_on(way, way->pass[i].from + (steps ? gone * k / steps : 0),
				 0, at);
			assert_true(kind->put(INCISE_TOOL_BLADE, at[0], at[1],
					      way->pass[i].depth, way->angle));
		}
		kind->lift();
	}
}

/*
 * Whether a depth is one that the oracle says within tolerances: a stretch is longer than it was cut by a place at each end
 * at most, so that a gap may close, and is seen by a place off; ends and lines are off by less than 0.2 mm, as a blade's steps are.
 */
static bool could_say(const struct oracle *o, const struct way *ways, int n,
		      const double at[2], double depth)
{
	static const double off[] = {0, -1, 1};
	struct way wide[WAYS];
	double place = INCISE_CUT_SPACING_MM + STEP_MM, least = INFINITY, most = 0;

	memcpy(wide, ways, (size_t)n * sizeof(*ways));
	for (int i = 0; i < n; i++)
		for (int k = 0; k < wide[i].passes; k++) {
			wide[i].pass[k].from -= place;
			wide[i].pass[k].to += place;
		}
	for (int i = 0; i < 486; i++)
		for (int k = 0; k < n; k++) {
			struct oracle other = {.need = o->need + 2 * place * off[i % 3],
					       .need_of_way = o->need +
							      2 * place * off[i / 3 % 3],
					       .way = k,
					       .beside = o->beside + 0.2 * off[i / 9 % 3],
					       .shift = place * off[i / 27 % 3],
					       .reach = o->reach + 0.2 * off[i / 81 % 3]};
			int which;
			double says = ask(&other, i < 243 ? ways : wide, n, at, &which);

			least = fmin(least, says);
			most = fmax(most, says);
		}
	return depth > least - 1e-4 && depth < most + 1e-4;
}

/* @return whether the opening is what the oracle says, without a tolerance */
static bool compare_opening(const struct way *ways, int n, enum incise_tool tool,
			    const double at[2], int procedure)
{
	bool tube = tool == INCISE_TOOL_TUBE;
	struct oracle o = {.need = (tube ? M_PI_2 * 7 : 10 + 3) - STRETCH_MM,
			   .reach = tube ? 3.5 : 5,
			   .beside = INCISE_CUT_BESIDE_MM,
			   .way = -1};
	struct incise_opening got = opening(tool, at[0], at[1]);
	int which;
	double depth = ask(&o, ways, n, at, &which);
	/* Rounding of a float or of an integer. */
	bool same = fabs(depth - got.depth_mm) < 1e-4;

	if (!same && !could_say(&o, ways, n, at, got.depth_mm))
		fail_msg("procedure %d, tool %d at %.3f, %.3f: %.3f mm deep, not %.3f",
			 procedure, tool, at[0], at[1], got.depth_mm, depth);
	assert_int_equal(got.in, got.depth_mm > 0);
	if (got.in)
		assert_true(got.length_mm >= o.need);
	if (same && got.in && ways[which].turn == 0)
		assert_true(fabs(got.along[0] * cos(ways[which].angle) +
				 got.along[1] * sin(ways[which].angle)) > 0.9999);
	return same;
}

/*
 * Random procedures: up to six ways of the blade, of any place, length, depth and direction, straight, bent or round a
 * corner, deepened in parts, stabs of no length among them, many of which cross. The tools are at places on and beside them.
 */
#define PROCEDURES 1000
#define PLACES_OF_EACH 10

TEST_KINDS(test_openings_as_a_surgeon_expects)
{
	struct incise_double_incision_setup tissue = *setup_double();
	int n = cases_of(PROCEDURES, 100), same = 0, in = 0, all = 0;

	tissue.cuts_most = 32;
	drawn = cases_seed(1) << 32;
	for (int p = 0; p < n; p++) {
		struct way ways[WAYS];
		int have = draw_procedure(ways);

		assert_int_equal(make(&tissue), 0);
		for (int i = 0; i < have; i++)
			cut_way(&ways[i]);
		for (int i = 0; i < PLACES_OF_EACH; i++) {
			const struct way *way = &ways[(int)any(0, have)];
			enum incise_tool tool =
				i % 2 ? INCISE_TOOL_TUBE : INCISE_TOOL_HANDLE;
			double at[2];

			place_on(way, any(-2, whole(way) + 2), any(-4, 4), at);
			same += compare_opening(ways, have, tool, at, p);
			in += opening(tool, at[0], at[1]).in;
			all++;
		}
		teardown(NULL);
	}
	printf("%d places, %d in an opening, %d to the oracle's depth\n", all, in, same);
	assert_true(in > all / 3);
	/* The rest is within its tolerances. */
	assert_true(same > all * 0.98);
}
