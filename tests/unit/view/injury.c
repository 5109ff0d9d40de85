// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The injury: a function of the ticks alone, whenever it is painted; only the parts that the scene
 * requests; and invalid ticks do no harm.
 */
#include "../unit.h"
#include "allocated.h"
#include "ground.h"

#define SIDE 128
#define TEXELS (SIDE * SIDE * 4)

static const struct incise_scene_scalpel tools = {{0, 0, 1}, {0, 1, 0}, 120, 10, 3, 7};

struct scene {
	struct incise_canvas *canvas;
	struct incise_injury *injury;
	uint8_t *base;
	size_t memory; /* of the injury and its layers */
};

static void scene_new(struct scene *s, const struct field *field)
{
	s->base = malloc(TEXELS);
	memset(s->base, 200, TEXELS);
	s->canvas = incise_canvas_new(SIDE, s->base, NULL);
	assert_non_null(s->canvas);
	s->memory = allocated;
	s->injury = incise_injury_new(&field->picture, &tools, NULL, field->map,
				      s->canvas, NULL);
	s->memory = allocated - s->memory;
	assert_non_null(s->injury);
}

static void scene_free(struct scene *s)
{
	incise_injury_free(s->injury);
	incise_canvas_free(s->canvas);
	free(s->base);
}

static void paint(struct scene *s)
{
	struct incise_upload uploads[64];

	incise_injury_paint(s->injury);
	while (incise_canvas_compose(s->canvas, uploads, 64, 0) > 0)
		;
}

/* Cut, let it bleed, put the handle in, take it out: tick @i of a rate. */
static struct incise_tick procedure(const struct field *field, int i, double rate_hz)
{
	double t = i / rate_hz;

	if (t < 1)
		return tick_at(field, t, INCISE_TOOL_BLADE, -15 + 30 * t, 3 * t, 3);
	if (t > 2 && t < 2.6)
		return tick_at(field, t, INCISE_TOOL_HANDLE, 1, 1.5, 5);
	return tick_free(t);
}

static void assert_same(const struct scene *a, const struct scene *b)
{
	struct incise_view_report ra = {0}, rb = {0};

	for (int level = 0; level < incise_canvas_levels(a->canvas); level++)
		assert_memory_equal(incise_canvas_pixels(a->canvas, level, NULL),
				    incise_canvas_pixels(b->canvas, level, NULL),
				    (size_t)(SIDE >> level) * (SIDE >> level) * 4);
	incise_injury_report(a->injury, &ra);
	incise_injury_report(b->injury, &rb);
	assert_memory_equal(&ra, &rb, sizeof(ra));
}

/* Frames at each tick, at 60 Hz, at random, or one at the end: the same to the bit. */
TEST(test_frames_do_not_matter)
{
	static const int every[] = {3, 17, 0, 100000};
	struct scene s[4];
	struct field field;

	field_new(&field, SIDE, 40);
	for (int k = 0; k < 4; k++) {
		scene_new(&s[k], &field);
		for (int i = 0; i < 3000; i++) {
			struct incise_tick tick = procedure(&field, i, 1000);

			incise_injury_tick(s[k].injury, &tick);
			if (every[k] ? i % every[k] == 0 : rand() % 40 == 0)
				paint(&s[k]);
		}
		paint(&s[k]);
	}
	for (int k = 1; k < 4; k++)
		assert_same(&s[0], &s[k]);
	for (int k = 0; k < 4; k++)
		scene_free(&s[k]);
	field_free(&field);
}

/* Repeated ticks of one time, as from a reader that reads twice, change nothing. */
TEST(test_ticks_twice)
{
	struct scene s[2];
	struct field field;

	field_new(&field, SIDE, 40);
	for (int k = 0; k < 2; k++) {
		scene_new(&s[k], &field);
		for (int i = 0; i < 1500; i++) {
			struct incise_tick tick = procedure(&field, i, 500);

			for (int n = 0; n <= k; n++)
				incise_injury_tick(s[k].injury, &tick);
		}
		paint(&s[k]);
	}
	assert_same(&s[0], &s[1]);
	for (int k = 0; k < 2; k++)
		scene_free(&s[k]);
	field_free(&field);
}

/* The blood of a cut depends on its length and depth, not on the tick rate. */
TEST(test_rates)
{
	static const double rates[] = {1000, 5000, 100, 20};
	double ul[4];
	struct field field;

	field_new(&field, SIDE, 40);
	for (int k = 0; k < 4; k++) {
		struct incise_view_report report = {0};
		struct scene s;

		scene_new(&s, &field);
		for (int i = 0; i < 3 * rates[k]; i++) {
			struct incise_tick tick = procedure(&field, i, rates[k]);

			incise_injury_tick(s.injury, &tick);
		}
		incise_injury_report(s.injury, &report);
		ul[k] = report.blood_ul_emitted;
		/* 30 mm and 3 mm to the side; the last tick in it is a period before 1 s. */
		assert_true(fabs(report.cut_mm - 30.15 * (1 - 1 / rates[k])) < 0.01);
		assert_true(fabs(report.blood_ul_emitted - report.blood_ul_drops -
				 report.blood_ul_trails - report.blood_ul_off) < 1e-9);
		scene_free(&s);
	}
	/* Where it bleeds first, and how much of 50 ms at 20 Hz is cut: within some percent. */
	for (int k = 1; k < 4; k++)
		assert_true(fabs(ul[k] / ul[0] - 1) < 0.08);
	field_free(&field);
}

/* There are only the parts that the scene requests. */
TEST(test_only_what_is_asked_for)
{
	static const struct {
		bool wound, bleeding;
		int layers;
	} cases[] = {
		{false, false, 0}, {false, true, 0}, {true, false, 2}, {true, true, 3}};
	size_t memory[4];
	struct field field;

	field_new(&field, SIDE, 40);
	for (int k = 0; k < 4; k++) {
		struct incise_view_report report = {0};
		struct scene s;

		field.picture.wound = cases[k].wound;
		field.picture.bleeding = cases[k].bleeding;
		scene_new(&s, &field);
		for (int i = 0; i < 1500; i++) {
			struct incise_tick tick = procedure(&field, i, 1000);

			incise_injury_tick(s.injury, &tick);
		}
		paint(&s);
		incise_injury_report(s.injury, &report);
		assert_true((report.cut_mm > 0) == cases[k].wound);
		assert_true((report.blood_ul_emitted > 0) == (cases[k].layers == 3));
		memory[k] = s.memory;
		for (int layer = 0; layer < CANVAS_LAYERS_MAX; layer++)
			assert_true(!incise_canvas_layer(s.canvas, layer) ==
				    (layer >= cases[k].layers));
		if (!cases[k].wound)
			for (int i = 0; i < SIDE * SIDE; i++)
				assert_int_equal(incise_canvas_pixels(s.canvas, 0,
								      NULL)[4 * i],
						 200);
		scene_free(&s);
	}
	assert_true(memory[0] < 200 && memory[1] == memory[0]);
	/* Fields of 8 bytes a texel, films of 5 more; layers of 4 each. */
	assert_true(memory[2] > (8 + 2 * 4) * SIDE * SIDE &&
		    memory[3] > memory[2] + (5 + 4) * SIDE * SIDE);
	field_free(&field);
}

/* Up to a second of a gap in the ticks is caught up, the rest skipped. */
TEST(test_gaps)
{
	static const struct {
		int64_t gap_ns;
		uint64_t lost;
	} cases[] = {{500000000, 0},
		     {1000000000, 0},
		     {10000000000, 900},
		     {-5000000000, 0},
		     {INT64_MAX - 2000000000, 922337203485 - 100}};
	struct field field;

	field_new(&field, SIDE, 40);
	for (int k = 0; k < 5; k++) {
		struct incise_view_report before = {0}, after = {0}, later = {0};
		struct incise_tick tick = {0};
		struct scene s;

		scene_new(&s, &field);
		for (int i = 0; i <= 2000; i++) {
			tick = procedure(&field, i, 1000);
			incise_injury_tick(s.injury, &tick);
		}
		incise_injury_report(s.injury, &before);
		tick.t_ns += cases[k].gap_ns;
		incise_injury_tick(s.injury, &tick);
		incise_injury_report(s.injury, &after);
		if (incise_injury_steps_lost(s.injury) != cases[k].lost)
			print_error(
				"%d: %llu\n", k,
				(unsigned long long)incise_injury_steps_lost(s.injury));
		assert_true(incise_injury_steps_lost(s.injury) == cases[k].lost);
		assert_true((after.blood_ul_emitted > before.blood_ul_emitted) ==
			    (cases[k].gap_ns > 0));
		/* Time continues from there. */
		if (cases[k].gap_ns < INT64_MAX / 2)
			tick.t_ns += 200000000;
		incise_injury_tick(s.injury, &tick);
		incise_injury_report(s.injury, &later);
		if (cases[k].gap_ns < INT64_MAX / 2)
			assert_true(later.blood_ul_emitted > after.blood_ul_emitted);
		scene_free(&s);
	}
	field_free(&field);
}

static double any_double(void)
{
	static const double odd[] = {NAN,    INFINITY, -INFINITY,   1e308,
				     -1e308, 1e-320,   -0.0,	    1e9,
				     -1e5,   50,       2147483648.0};

	if (rand() % 3)
		return 60.0 * rand() / RAND_MAX - 30;
	return odd[(size_t)rand() % (sizeof(odd) / sizeof(*odd))];
}

/* Any ticks give premultiplied colours and volumes that balance, in bounded time. */
TEST(test_hostile)
{
	static const double tilts[] = {40, -1};

	for (int k = 0; k < 2; k++) {
		struct incise_view_report report = {0};
		struct incise_tick tick = {0};
		struct field field;
		struct scene s;

		field_new(&field, SIDE, tilts[k]);
		scene_new(&s, &field);
		srand(7);
		for (int i = 0; i < 1000; i++) {
			if (rand() % 4)
				tick = procedure(&field, rand() % 4000, 1000);
			for (int n = rand() % 4; n > 0; n--) {
				double v = any_double();

				switch (rand() % 8) {
				case 0:
					tick.depth_mm = v;
					break;
				case 1:
					tick.proxy_mm[rand() % 3] = v;
					break;
				case 2:
					tick.tool_mm[rand() % 3] = v;
					break;
				case 3:
					tick.flags = (unsigned int)rand();
					break;
				case 4:
					tick.phase = (enum incise_phase)(rand() % 5 - 1);
					break;
				case 5:
					tick.tool = (enum incise_tool)(rand() % 6 - 1);
					break;
				case 6:
					tick.normal[rand() % 3] = v;
					break;
				default:
					if (rand() % 50 == 0)
						tick.t_ns = rand() % 2 ? INT64_MIN
								       : INT64_MAX;
				}
			}
			incise_injury_tick(s.injury, &tick);
			if (i % 50 == 0)
				paint(&s);
		}
		incise_injury_report(s.injury, &report);
		assert_true(isfinite(report.cut_mm) && report.cut_mm >= 0);
		assert_true(fabs(report.blood_ul_emitted - report.blood_ul_drops -
				 report.blood_ul_trails - report.blood_ul_off) <=
			    1e-9 * report.blood_ul_emitted);
		paint(&s);
		for (int layer = 0; layer < 2; layer++) {
			const uint8_t *rgba = incise_canvas_layer(s.canvas, layer);

			for (int i = 0; i < TEXELS; i++)
				assert_true(rgba[i] <= rgba[i | 3]);
		}
		scene_free(&s);
		field_free(&field);
	}
}

TEST(test_refused)
{
	struct incise_canvas *canvas;
	struct field field;
	uint8_t base[32 * 32 * 4] = {0};

	field_new(&field, SIDE, 0);
	canvas = incise_canvas_new(32, base, NULL);
	assert_null(
		incise_injury_new(&field.picture, &tools, NULL, field.map, canvas, &err));
	assert_int_equal(err.code, EINVAL);
	incise_canvas_free(canvas);
	incise_injury_free(NULL);
	field_free(&field);
}
