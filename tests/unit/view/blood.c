// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Blood: its volume balances in whole units, drops run downhill only, memory is bounded, and a seed
 * determines the result.
 */
#include "../unit.h"
#include "allocated.h"
#include "ground.h"
#include "../../../lib/view/blood.h"
#include "../../../lib/view/blood_film.h"

#define SIDE 256
#define COARSE 64 /* where what is counted does not hang on how fine it is */
#define DROPS 128

/* A straight stroke, mm from the middle, in pieces as the wound gives them. */
static void stroke(struct blood *blood, const struct field *field, double x0, double y0,
		   double x1, double y1, double depth_mm)
{
	double half = field->map->size / 2.0, length = hypot(x1 - x0, y1 - y0);
	int n = (int)(length / 0.25) + 1;

	for (int i = 0; i < n; i++) {
		double a = (double)i / n, b = (i + 1.0) / n;
		struct wound_stroke piece = {
			.from_px = {half + (x0 + a * (x1 - x0)) / field->mm,
				    half + (y0 + a * (y1 - y0)) / field->mm},
			.to_px = {half + (x0 + b * (x1 - x0)) / field->mm,
				  half + (y0 + b * (y1 - y0)) / field->mm},
			.length_mm = length / n,
			.fresh_mm = depth_mm,
			.begins = !i,
		};

		blood_stroke(blood, &piece);
	}
}

static void assert_balance(const struct blood *blood)
{
	struct blood_volumes v;

	blood_volumes(blood, &v);
	/* Whole units are equal exactly. */
	assert_true(v.emitted == v.drops + v.films + v.off);
	assert_true(v.drops >= 0 && v.films >= 0 && v.off >= 0);
}

/* Of the test that runs. */
static struct field field;
static struct blood *blood;

/* Two minutes on ground of some tilts, with cuts now and then. */
TEST(test_balance)
{
	static const double tilts[] = {0, 40, -1};

	for (int k = 0; k < 3; k++) {
		struct blood_volumes v;

		field_new(&field, COARSE, tilts[k]);
		blood = blood_new(field.map, &field.picture, NULL);
		assert_non_null(blood);
		for (int i = 0; i < 12000; i++) {
			if (i % 3000 == 0)
				stroke(blood, &field, -20 + i % 7, -10 + i % 5, 15, 8, 3);
			if (i % 4000 < 100)
				blood_reopen(blood, (double[]){SIDE / 2.0, SIDE / 2.0},
					     4);
			blood_step(blood);
			if (i % 50 == 0)
				assert_balance(blood);
		}
		assert_balance(blood);
		blood_volumes(blood, &v);
		assert_true(v.emitted > 0);
		blood_free(blood);
		field_free(&field);
	}
}

/*
 * A fresh cut emits k L D tau in total, 99 % of it in five tau. On level ground: a source emits
 * every 80 ms at the rate of their start, so half of 80 ms / 18 s too much.
 */
TEST(test_emits_what_it_should)
{
	struct blood_volumes v;
	double all;

	field_new(&field, COARSE, 0);
	blood = blood_new(field.map, &field.picture, NULL);
	stroke(blood, &field, -10, 0, 10, 0, 2);
	for (int i = 0; i < 100; i++)
		blood_step(blood);
	blood_volumes(blood, &v);
	all = field.picture.blood_ul_s_mm2 * 20 * 2 * BLOOD_CLOT_S;
	/* The first second, of which a source may have missed 80 ms. */
	assert_true(fabs(v.emitted * BLOOD_UNIT_UL / all - (1 - exp(-1 / BLOOD_CLOT_S))) <
		    0.1 / BLOOD_CLOT_S);
	for (int i = 0; i < 9000; i++)
		blood_step(blood);
	blood_volumes(blood, &v);
	assert_true(fabs(v.emitted * BLOOD_UNIT_UL / all - 0.993) < 0.005);
	assert_true(v.off == 0);
	blood_free(blood);
	field_free(&field);
}

/* Height of a place as drawn, against gravity, mm. */
static double height_mm(const struct field *field, const double px[2])
{
	double point[3], normal[3], relief = uv_map_relief_mm(field->map, px);
	double high = 0;

	/* It has just run off the texture. */
	if (!uv_map_point(field->map, px, point, normal))
		return -INFINITY;
	for (int i = 0; i < 3; i++)
		high -= (point[i] + relief * normal[i]) * field->picture.gravity[i];
	return high;
}

/* No drop rises in any step, and some run far. With and without a larynx. */
TEST(test_downhill)
{
	for (int k = 0; k < 3; k++) {
		double was[DROPS] = {0}, first[DROPS] = {0}, farthest = 0;
		bool there[DROPS] = {false};
		struct incise_scene_picture picture;

		field_new(&field, SIDE, k ? -1 : 40);
		picture = field.picture;
		if (k == 2) {
			field_free(&field);
			picture.larynx = true;
			field.surface =
				incise_surface_new_capsule((double[]){-60, 0, -55},
							   (double[]){160, 0, -55}, 55,
							   NULL);
			field.map = uv_map_new(field.surface, &picture, NULL);
		}
		blood = blood_new(field.map, &picture, NULL);
		stroke(blood, &field, -20, 12, 20, 14, 4);
		for (int i = 0; i < 1200; i++) {
			blood_step(blood);
			for (int n = 0; n < DROPS; n++) {
				double px[2], ul, high;

				if (!blood_drop(blood, n, px, &ul)) {
					there[n] = false;
					continue;
				}
				high = height_mm(&field, px);
				if (!there[n])
					first[n] = high;
				/*
				 * A step is 1.5 mm at most; over that a curve of 10 mm
				 * radius, the larynx's, bends by 0.1 mm; the relief's
				 * slope is taken over two texels either way.
				 */
				else
					assert_true(high <= was[n] + 0.02);
				if (isfinite(high))
					farthest = fmax(farthest, first[n] - high);
				was[n] = high;
				there[n] = true;
			}
		}
		assert_true(farthest > 10);
		blood_free(blood);
		field_free(&field);
	}
}

/* On level ground nothing runs. */
TEST(test_level_stays)
{
	double px[2], ul;

	field_new(&field, SIDE, 0);
	blood = blood_new(field.map, &field.picture, NULL);
	stroke(blood, &field, -5, 0, 5, 0, 3);
	for (int i = 0; i < 2000; i++)
		blood_step(blood);
	for (int n = 0; n < DROPS; n++)
		if (blood_drop(blood, n, px, &ul)) {
			assert_true(fabs(px[1] - SIDE / 2.0) * field.mm < 0.5);
			assert_true(fabs(px[0] - SIDE / 2.0) * field.mm < 6);
		}
	blood_free(blood);
	field_free(&field);
}

/* A drop below the critical volume hangs; a steeper slope releases smaller ones. */
TEST(test_pinned_below_a_volume)
{
	double let_go_ul[2] = {0};

	for (int k = 0; k < 2; k++) {
		double begin[2] = {0}, px[2], ul;
		bool there = false;

		field_new(&field, SIDE, k ? 80 : 15);
		field.picture.blood_ul_s_mm2 = 0.3;
		blood = blood_new(field.map, &field.picture, NULL);
		stroke(blood, &field, 0, -30, 0.3, -30, 2);
		for (int i = 0; i < 6000 && !(let_go_ul[k] > 0); i++) {
			if (i % 500 == 0)
				blood_reopen(blood,
					     (double[]){SIDE / 2.0,
							SIDE / 2.0 - 30 / field.mm},
					     9);
			blood_step(blood);
			if (!blood_drop(blood, 0, px, &ul))
				continue;
			if (!there)
				begin[1] = px[1];
			there = true;
			/* A hanging drop sags by half of its radius, 1.5 mm or less. */
			if (fabs(px[1] - begin[1]) * field.mm > 4)
				let_go_ul[k] = ul;
		}
		blood_free(blood);
		field_free(&field);
	}
	/*
	 * rho g V s = gamma dcos 2 r c with V = 0.786 r³: 3.29 µl at 15°, 0.444 µl at 80°, each
	 * times c^1.5. Its c, 0.45 … 1.9, is the same on both, as is the seed. It has been fed,
	 * and has left some behind, on the 4 mm since.
	 */
	assert_true(fabs(let_go_ul[0] / let_go_ul[1] / (3.29 / 0.444) - 1) < 0.5);
	assert_true(let_go_ul[0] > 3.29 * 0.75 * pow(0.45, 1.5));
	assert_true(let_go_ul[0] < 3.29 * 1.25 * pow(1.9, 1.5));
}

struct painted {
	struct blood *blood;
	struct incise_canvas *canvas;
	uint8_t *base;
};

static void painted_new(struct painted *p, const struct field *field, int seed)
{
	struct incise_scene_picture picture = field->picture;

	picture.seed = seed;
	p->base = calloc(SIDE * SIDE, 4);
	p->canvas = incise_canvas_new(SIDE, p->base, NULL);
	assert_int_equal(incise_canvas_add_layer(p->canvas), 0);
	p->blood = blood_new(field->map, &picture, NULL);
	assert_non_null(p->blood);
}

/* The same seed gives identical textures, painted often or once; another seed another one. */
TEST(test_repeats)
{
	static const int seeds[] = {1, 1, 2};
	struct painted p[3];
	const uint8_t *layer[3];

	field_new(&field, SIDE, 50);
	for (int k = 0; k < 3; k++) {
		painted_new(&p[k], &field, seeds[k]);
		stroke(p[k].blood, &field, -20, -20, 20, -18, 3);
		for (int i = 0; i < 1500; i++) {
			blood_step(p[k].blood);
			if (k && i % 7 == 0)
				blood_paint(p[k].blood, p[k].canvas, 0);
		}
		blood_paint(p[k].blood, p[k].canvas, 0);
		layer[k] = incise_canvas_layer(p[k].canvas, 0);
	}
	assert_memory_equal(layer[0], layer[1], SIDE * SIDE * 4);
	assert_true(memcmp(layer[0], layer[2], SIDE * SIDE * 4) != 0);
	/* Premultiplied; with thick blood, thin blood and none. */
	for (int i = 0; i < SIDE * SIDE; i++)
		for (int c = 0; c < 3; c++)
			assert_true(layer[0][4 * i + c] <= layer[0][4 * i + 3]);
	for (int want = 0; want < 3; want++) {
		int n = 0;

		for (int i = 0; i < SIDE * SIDE; i++) {
			int alpha = layer[0][4 * i + 3];

			n += want == 0	 ? !alpha
			     : want == 1 ? alpha > 20 && alpha < 200
					 : alpha > 240;
		}
		assert_true(n > 30);
	}
	for (int k = 0; k < 3; k++) {
		blood_free(p[k].blood);
		incise_canvas_free(p[k].canvas);
		free(p[k].base);
	}
	field_free(&field);
}

/* After a long time nothing moves and nothing is painted. */
TEST(test_dries)
{
	struct incise_upload uploads[256];
	struct painted p;

	field_new(&field, SIDE, 50);
	painted_new(&p, &field, 1);
	stroke(p.blood, &field, -10, -20, 10, -18, 2);
	for (int i = 0; i < 36000; i++)
		blood_step(p.blood);
	blood_paint(p.blood, p.canvas, 0);
	while (incise_canvas_compose(p.canvas, uploads, 256, 0) > 0)
		;
	for (int i = 0; i < 300; i++)
		blood_step(p.blood);
	blood_paint(p.blood, p.canvas, 0);
	assert_int_equal(incise_canvas_compose(p.canvas, uploads, 256, 0), 0);
	assert_balance(p.blood);
	blood_free(p.blood);
	incise_canvas_free(p.canvas);
	free(p.base);
	field_free(&field);
}

/* More than the capacity: strokes anywhere, much blood, thin and thick. */
TEST(test_much)
{
	static const double viscosities[] = {0.5, 1000};

	for (int k = 0; k < 2; k++) {
		size_t memory;

		field_new(&field, COARSE, -1);
		field.picture.blood_ul_s_mm2 = 100;
		field.picture.viscosity_mPa_s = viscosities[k];
		blood = blood_new(field.map, &field.picture, NULL);
		memory = allocated;
		srand(3);
		for (int i = 0; i < 60; i++) {
			stroke(blood, &field, rand() % 180 - 90, rand() % 180 - 90,
			       rand() % 180 - 90, rand() % 180 - 90, rand() % 15);
			blood_step(blood);
			assert_balance(blood);
		}
		assert_true(allocated == memory);
		blood_free(blood);
		field_free(&field);
	}
}
