// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The wound: without gaps at any speed and tick rate, opened by an instrument, closed after it,
 * independent of the times of painting; invalid ticks cut nothing.
 */
#include "../unit.h"
#include "allocated.h"
#include "ground.h"
#include "../../../lib/tissue/incision.h"
#include "../../../lib/view/wound.h"

#define SIDE 512
#define PI_2 (2 * M_PI)
#define STRETCH_MM 2.0

static const struct incise_scene_scalpel tools = {{0, 0, 1}, {0, 1, 0}, 120, 10, 3, 7};

/* A curved way, mm from the middle: 40 mm long or so, at u = 0 … 1. */
static void way(double u, double *x, double *y)
{
	*x = -18 + 36 * u;
	*y = 6 * sin(PI_2 * u * 0.8);
}

static double lift(struct wound *wound, double t_s)
{
	struct incise_tick tick = tick_free(t_s);
	struct wound_stroke stroke;

	return wound_tick(wound, &tick, &stroke) ? stroke.length_mm : 0;
}

/* Cut along the way in so many seconds at a rate; returns the sum of the strokes. */
static double cut(struct wound *wound, const struct field *field, double s,
		  double rate_hz, double depth_mm)
{
	int n = (int)(s * rate_hz);
	double sum = 0, x, y;

	for (int i = 0; i <= n; i++) {
		struct wound_stroke stroke;
		struct incise_tick tick;

		way((double)i / n, &x, &y);
		tick = tick_at(field, i / rate_hz, INCISE_TOOL_BLADE, x, y, depth_mm);
		if (wound_tick(wound, &tick, &stroke))
			sum += stroke.length_mm;
	}
	return sum + lift(wound, (n + 1) / rate_hz);
}

static double inside(const struct wound *wound, const struct field *field, double x,
		     double y)
{
	return wound_inside_mm(wound, (int)floor(SIDE / 2.0 + x / field->mm),
			       (int)floor(SIDE / 2.0 + y / field->mm));
}

/* Every texel under the way is well inside of the lips, from the first to the last. */
TEST(test_no_gap)
{
	static const struct {
		double s, rate_hz;
	} cases[] = {{2, 1000}, {2, 120},   {0.1, 1000}, {0.02, 1000},
		     {1, 10},	{0.2, 120}, {2, 5000},	 {0.012, 5000}};
	struct field field;

	field_new(&field, SIDE, 0);
	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct wound *wound = wound_new(field.map, &tools, NULL, NULL);
		double rate = cases[c].rate_hz, off = 0, x, y;
		int n = (int)(cases[c].s * rate);
		double sum;

		assert_non_null(wound);
		sum = cut(wound, &field, cases[c].s, rate, 3);
		/* Strokes are the way, to the last piece; ground_length_mm() is in floats. */
		/* Strokes are all of the way; from point to point, 0.25 mm, it is shorter by
		 * a curve's 1e-4 of it. */
		assert_true(fabs(sum - wound_cut_mm(wound)) < 0.01);
		for (int i = 1; i < 2000; i++) {
			/* On the chords between ticks, which the blade swept. */
			double u = i / 2000.0 * n, x1, y1;

			way(floor(u) / n, &x, &y);
			way((floor(u) + 1) / n, &x1, &y1);
			x += (u - floor(u)) * (x1 - x);
			y += (u - floor(u)) * (y1 - y);
			off = inside(wound, &field, x, y);
			/*
			 * 0.59 mm of half-width at 3 mm, an eighth of it at the very ends, which
			 * taper over 3 mm of some 40.
			 * A texel's middle is up to 0.7 texels away; a line between points
			 * 0.25 mm apart is by less than 0.01 mm another than the way.
			 */
			if (i > 160 && i < 1840)
				assert_true(off > 0.59 - 0.71 * field.mm - 0.02);
			else
				assert_true(off > 0.07 - 0.71 * field.mm - 0.02);
		}
		/* There is no wound elsewhere. */
		assert_true(inside(wound, &field, -24, 0) < 0);
		assert_true(inside(wound, &field, 0, -9) < 0);
		wound_free(wound);
	}
	field_free(&field);
}

/* Deeper is wider, and a second cut over the first is the union of both. */
TEST(test_union)
{
	struct field field;
	struct wound *wound, *both;

	field_new(&field, SIDE, 0);
	wound = wound_new(field.map, &tools, NULL, NULL);
	both = wound_new(field.map, &tools, NULL, NULL);
	cut(wound, &field, 1, 1000, 4);
	cut(both, &field, 1, 1000, 4);
	cut(both, &field, 1, 1000, 1);
	for (int y = 0; y < SIDE; y++)
		for (int x = 0; x < SIDE; x++)
			assert_true(wound_inside_mm(wound, x, y) ==
				    wound_inside_mm(both, x, y));
	wound_free(wound);
	wound_free(both);
	field_free(&field);
}

struct painted {
	struct incise_incision *incision;
	struct wound *wound;
	struct incise_canvas *canvas;
	uint8_t *base;
};

static void painted_new(struct painted *p, const struct field *field)
{
	const struct incise_double_incision_setup setup = {.cuts_most = 8,
							   .cut_from = 0.5,
							   .stretch = STRETCH_MM,
							   .handle_width = 10,
							   .handle_thickness = 3,
							   .tube = 7};

	p->incision = incise_incision_make(&setup, (const double[]){0, 1, 0}, NULL);
	assert_non_null(p->incision);
	p->base = calloc(SIDE * SIDE, 4);
	p->canvas = incise_canvas_new(SIDE, p->base, NULL);
	assert_non_null(p->canvas);
	assert_int_equal(incise_canvas_add_layer(p->canvas), 0);
	assert_int_equal(incise_canvas_add_layer(p->canvas), 1);
	p->wound = wound_new(field->map, &tools, p->incision, NULL);
	assert_non_null(p->wound);
}

static void painted_free(struct painted *p)
{
	wound_free(p->wound);
	incise_incision_free(p->incision);
	incise_canvas_free(p->canvas);
	free(p->base);
}

/* Width of the flesh across the cut at right_mm, mm. */
static double open_mm(const struct painted *p, const struct field *field, double right_mm)
{
	const uint8_t *layer = incise_canvas_layer(p->canvas, 1);
	int x = (int)(SIDE / 2.0 + right_mm / field->mm), n = 0;

	for (int y = 0; y < SIDE; y++)
		n += layer[(y * SIDE + x) * 4 + 3] > 127;
	return n * field->mm;
}

/* Some time with an instrument at a place, or none; painted sometimes, or not. */
static void hold(struct painted *p, const struct field *field, double *t_s, double s,
		 enum incise_tool tool, double turn_rad, bool in, bool paint)
{
	for (double end = *t_s + s; *t_s < end; *t_s += 0.01) {
		struct incise_tick tick =
			in ? tick_at(field, *t_s, tool, 0, 0, 12) : tick_free(*t_s);
		struct wound_stroke stroke;

		tick.quaternion[0] = cos(turn_rad / 2);
		tick.quaternion[3] = sin(turn_rad / 2);
		wound_tick(p->wound, &tick, &stroke);
		wound_step(p->wound);
		if (paint)
			wound_paint(p->wound, p->canvas, 0, 1);
	}
	wound_paint(p->wound, p->canvas, 0, 1);
}

static void straight(struct painted *p, const struct field *field, double *t_s)
{
	for (int i = 0; i <= 1000; i++, *t_s += 0.001) {
		struct incise_tick tick =
			tick_at(field, *t_s, INCISE_TOOL_BLADE, -15 + i * 0.03, 0, 3);
		struct wound_stroke stroke;

		wound_tick(p->wound, &tick, &stroke);
	}
	lift(p->wound, *t_s);
	wound_paint(p->wound, p->canvas, 0, 1);
}

/*
 * The cut opens to the tool's extent across it at its place, less next to it; out of it, it closes
 * by what is elastic, and the rest stays.
 */
TEST(test_opens_and_closes)
{
	/* Of a handle 10 mm wide and 3 thick: flat side along the cut, then a quarter turned. */
	static const struct {
		enum incise_tool tool;
		double turn_rad, wide_mm;
	} cases[] = {{INCISE_TOOL_HANDLE, 0, 3},
		     {INCISE_TOOL_HANDLE, M_PI_2, 10},
		     {INCISE_TOOL_TUBE, 0, 7}};
	/* Lips are drawn with a rough edge, on both sides. */
	const double edge_mm = 0.2;
	struct field field;

	field_new(&field, SIDE, 0);
	for (int c = 0; c < 3; c++) {
		double t = 0, rest, shut, wide = cases[c].wide_mm, close;
		struct painted p;

		painted_new(&p, &field);
		straight(&p, &field, &t);
		rest = open_mm(&p, &field, 0);
		/* Twice 0.59 mm, by whole texels on both sides, and soft edges. */
		assert_true(fabs(rest - 1.18) < 2 * field.mm + edge_mm);
		hold(&p, &field, &t, 0.5, cases[c].tool, cases[c].turn_rad, true, false);
		close = 2 * field.mm + edge_mm;
		assert_true(fabs(open_mm(&p, &field, 0) - wide) < close);
		assert_true(open_mm(&p, &field, 7) < open_mm(&p, &field, 0) - edge_mm);
		assert_true(open_mm(&p, &field, 3) > rest);
		assert_true(open_mm(&p, &field, 14.5) < rest + close);
		hold(&p, &field, &t, 0.1, cases[c].tool, 0, false, false);
		assert_true(open_mm(&p, &field, 0) > fmax(wide - STRETCH_MM, rest));
		hold(&p, &field, &t, 2.0, cases[c].tool, 0, false, false);
		shut = open_mm(&p, &field, 0);
		assert_true(fabs(shut - fmax(wide - STRETCH_MM, rest)) < close);
		hold(&p, &field, &t, 1.0, cases[c].tool, 0, false, false);
		assert_true(open_mm(&p, &field, 0) == shut);
		painted_free(&p);
	}
	field_free(&field);
}

/* Painted at each tick or at the end only: the same to the bit. */
TEST(test_painting_changes_nothing)
{
	struct field field;
	struct painted p[2];

	field_new(&field, SIDE, 0);
	for (int i = 0; i < 2; i++) {
		double t = 0;

		painted_new(&p[i], &field);
		for (int k = 0; k < 300; k++, t += 0.001) {
			struct incise_tick tick =
				tick_at(&field, t, INCISE_TOOL_BLADE, -10 + k * 0.06,
					k % 7 * 0.05, 2 + sin(k * 0.1));
			struct wound_stroke stroke;

			wound_tick(p[i].wound, &tick, &stroke);
			if (i && k % 3 == 0)
				wound_paint(p[i].wound, p[i].canvas, 0, 1);
		}
		/* Also while the blade is in the tissue. */
		wound_paint(p[i].wound, p[i].canvas, 0, 1);
	}
	for (int stage = 0; stage < 3; stage++) {
		assert_memory_equal(incise_canvas_layer(p[0].canvas, 0),
				    incise_canvas_layer(p[1].canvas, 0), SIDE * SIDE * 4);
		assert_memory_equal(incise_canvas_layer(p[0].canvas, 1),
				    incise_canvas_layer(p[1].canvas, 1), SIDE * SIDE * 4);
		for (int i = 0; i < 2 && stage < 2; i++) {
			double t = 1 + stage;

			hold(&p[i], &field, &t, 0.3, INCISE_TOOL_TUBE, 0, !stage, i);
		}
	}
	painted_free(&p[0]);
	painted_free(&p[1]);
	field_free(&field);
}

/* Endless cutting: the number of points is bounded, and no cut disappears. */
TEST(test_endless)
{
	struct field field;
	struct wound *wound;
	size_t memory;

	field_new(&field, SIDE, 0);
	wound = wound_new(field.map, &tools, NULL, NULL);
	memory = allocated;
	cut(wound, &field, 1, 1000, 3);
	for (int i = 0; i < 3 * WOUND_POINTS; i++) {
		struct incise_tick tick =
			tick_at(&field, 2 + i * 1e-3, INCISE_TOOL_BLADE,
				20 * cos(i * 0.05), 20 * sin(i * 0.0503), 1);
		struct wound_stroke stroke;

		wound_tick(wound, &tick, &stroke);
	}
	assert_int_equal(wound_points(wound), WOUND_POINTS);
	assert_true(allocated == memory);
	for (int i = 160; i < 1840; i++) {
		double x, y;

		way(i / 2000.0, &x, &y);
		assert_true(inside(wound, &field, x, y) > 0.59 - 0.71 * field.mm - 0.02);
	}
	wound_free(wound);
	field_free(&field);
}

/* No cut: by flags, phases, tools, discontinuities, gaps, and values that are not finite. */
TEST(test_no_cut)
{
	struct field field;
	struct wound *wound;

	field_new(&field, SIDE, 0);
	wound = wound_new(field.map, &tools, NULL, NULL);
	for (int k = 0; k < 15; k++)
		for (int i = 0; i < 4; i++) {
			struct incise_tick tick = tick_at(
				&field, k + i * 0.001, INCISE_TOOL_BLADE, i * 0.5, 0, 3);
			struct wound_stroke stroke;

			switch (k) {
			case 0:
				tick.flags = 0;
				break;
			case 1:
				tick.flags |= INCISE_TICK_STALE;
				break;
			case 2:
				tick.flags |= INCISE_TICK_FAULT;
				break;
			case 3:
				tick.phase = INCISE_PHASE_FREE;
				break;
			case 4:
				tick.tool = INCISE_TOOL_TUBE;
				break;
			case 5:
				tick.depth_mm = NAN;
				break;
			case 6:
				tick.depth_mm = INFINITY;
				break;
			case 7:
				tick.depth_mm = 0.01;
				break;
			case 8:
				tick.depth_mm = -3;
				break;
			case 9:
				tick.proxy_mm[i % 3] = NAN;
				break;
			case 10:
				tick.proxy_mm[0] = INFINITY;
				break;
			case 11:
				tick.proxy_mm[1] = -1e300;
				break;
			case 12:
				tick.proxy_mm[1] = 1e5;
				break;
			case 13:
				tick.phase = (enum incise_phase)99;
				break;
			default:
				tick.tool = (enum incise_tool) - 7;
			}
			assert_false(wound_tick(wound, &tick, &stroke));
			wound_step(wound);
		}
	assert_true(wound_cut_mm(wound) == 0 && wound_stamps(wound) == 0);
	wound_free(wound);
	field_free(&field);
}

/* Pricks too far apart for a hand are not joined. */
TEST(test_jumps)
{
	static const int64_t after_ns[] = {1000000, -1000000, 600000000, INT64_MAX / 2,
					   INT64_MIN};
	struct field field;

	field_new(&field, SIDE, 0);
	for (int i = 0; i < 5; i++) {
		struct wound *wound = wound_new(field.map, &tools, NULL, NULL);
		struct incise_tick tick =
			tick_at(&field, 1, INCISE_TOOL_BLADE, -20, 0, 3);
		struct wound_stroke stroke;

		wound_tick(wound, &tick, &stroke);
		tick = tick_at(&field, 1, INCISE_TOOL_BLADE, 20, 0, 3);
		tick.t_ns =
			after_ns[i] == INT64_MIN ? INT64_MIN : tick.t_ns + after_ns[i];
		wound_tick(wound, &tick, &stroke);
		lift(wound, 2);
		assert_true(wound_cut_mm(wound) == 0);
		assert_true(inside(wound, &field, 0, 0) < 0);
		wound_free(wound);
	}
	field_free(&field);
}
