// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The canvas: composing dirty tiles gives the same bits as composing everything; its levels are
 * means in linear light.
 */
#include "../unit.h"
#include <limits.h>
#include "../../../lib/view/canvas.h"

#define SIDE 256
#define UPLOADS 64

static uint8_t *any_base(int side)
{
	uint8_t *base = malloc((size_t)side * side * 4);

	assert_non_null(base);
	for (int i = 0; i < side * side * 4; i++)
		base[i] = (uint8_t)rand();
	return base;
}

static struct incise_canvas *canvas_of(int side, const uint8_t *base, int layers)
{
	struct incise_canvas *canvas = incise_canvas_new(side, base, NULL);

	assert_non_null(canvas);
	for (int i = 0; i < layers; i++)
		assert_int_equal(incise_canvas_add_layer(canvas), i);
	return canvas;
}

static void compose_all(struct incise_canvas *canvas, int capacity)
{
	struct incise_upload uploads[UPLOADS];
	int n, calls = 0;

	while ((n = incise_canvas_compose(canvas, uploads, capacity, 0)) > 0)
		assert_true(n <= capacity && ++calls < 10000);
	assert_int_equal(n, 0);
}

/* Arbitrary premultiplied texels. */
static void scribble(struct incise_canvas *canvas, int layer, struct incise_rect rect)
{
	uint8_t *rgba = incise_canvas_layer(canvas, layer);
	int side = incise_canvas_size(canvas);

	for (int y = rect.y; y < rect.y + rect.h; y++)
		for (int x = rect.x; x < rect.x + rect.w; x++) {
			uint8_t *to = rgba + ((size_t)y * side + x) * 4;

			if (x < 0 || y < 0 || x >= side || y >= side)
				continue;
			to[3] = (uint8_t)rand();
			for (int c = 0; c < 3; c++)
				to[c] = (uint8_t)(rand() % (to[3] + 1));
		}
	incise_canvas_dirty(canvas, rect);
}

static void assert_same(const struct incise_canvas *a, const struct incise_canvas *b)
{
	for (int level = 0; level < incise_canvas_levels(a); level++) {
		int stride, side = incise_canvas_size(a) >> level;
		const uint8_t *pixels = incise_canvas_pixels(a, level, &stride);

		assert_int_equal(stride, side * 4);
		assert_memory_equal(pixels, incise_canvas_pixels(b, level, NULL),
				    (size_t)stride * side);
	}
}

/* A canvas that composes after each change, compared with one that composes at the end. */
TEST(test_as_anew)
{
	const int capacities[] = {CANVAS_UPLOADS_MIN, UPLOADS};

	for (int k = 0; k < 2; k++) {
		uint8_t *base = any_base(SIDE);
		struct incise_canvas *went = canvas_of(SIDE, base, 2), *anew;

		for (int i = 0; i < 60; i++) {
			struct incise_rect rect = {rand() % 320 - 40, rand() % 320 - 40,
						   rand() % 60, rand() % 60};

			scribble(went, rand() % 2, rect);
			if (rand() % 2)
				compose_all(went, capacities[k]);
		}
		compose_all(went, capacities[k]);
		anew = canvas_of(SIDE, base, 2);
		for (int i = 0; i < 2; i++)
			memcpy(incise_canvas_layer(anew, i), incise_canvas_layer(went, i),
			       SIDE * SIDE * 4);
		compose_all(anew, UPLOADS);
		assert_same(went, anew);
		incise_canvas_free(went);
		incise_canvas_free(anew);
		free(base);
	}
}

/* A copy that follows the uploads, as in a graphics card, equals the canvas. */
TEST(test_uploads_tell_all)
{
	uint8_t *base = any_base(SIDE), *copy[9];
	struct incise_canvas *canvas = canvas_of(SIDE, base, 1);
	struct incise_upload uploads[UPLOADS];
	int n;

	assert_int_equal(incise_canvas_levels(canvas), 9);
	for (int level = 0; level < 9; level++)
		copy[level] = calloc((size_t)(SIDE >> level) * (SIDE >> level), 4);
	for (int i = 0; i < 40; i++) {
		scribble(canvas, 0,
			 (struct incise_rect){rand() % SIDE, rand() % SIDE, rand() % 50,
					      rand() % 50});
		while ((n = incise_canvas_compose(canvas, uploads, UPLOADS, 0)) > 0)
			for (int k = 0; k < n; k++) {
				const struct incise_rect *r = &uploads[k].rect;
				int stride;
				const uint8_t *from = incise_canvas_pixels(
					canvas, uploads[k].level, &stride);

				assert_true(r->x >= 0 && r->y >= 0 && r->w > 0 &&
					    r->h > 0);
				assert_true(r->x + r->w <= stride / 4 &&
					    r->y + r->h <= stride / 4);
				for (int y = r->y; y < r->y + r->h; y++)
					memcpy(copy[uploads[k].level] + y * stride +
						       r->x * 4,
					       from + y * stride + r->x * 4, r->w * 4);
			}
		for (int level = 0; level < 9; level++)
			assert_memory_equal(
				copy[level], incise_canvas_pixels(canvas, level, NULL),
				(size_t)(SIDE >> level) * (SIDE >> level) * 4);
	}
	for (int level = 0; level < 9; level++)
		free(copy[level]);
	incise_canvas_free(canvas);
	free(base);
}

/* A small change gives small rectangles: a tile, and its parts of the other levels. */
TEST(test_small_stays_small)
{
	uint8_t *base = any_base(SIDE);
	struct incise_canvas *canvas = canvas_of(SIDE, base, 1);
	struct incise_upload uploads[UPLOADS];
	int n, texels = 0;

	compose_all(canvas, UPLOADS);
	scribble(canvas, 0, (struct incise_rect){70, 70, 5, 5});
	n = incise_canvas_compose(canvas, uploads, UPLOADS, 0);
	assert_int_equal(n, 9);
	for (int i = 0; i < n; i++)
		texels += uploads[i].rect.w * uploads[i].rect.h;
	/* 32² and a third of it, and some levels of one texel. */
	assert_true(texels <= 1024 + 342 + 5);
	assert_int_equal(incise_canvas_compose(canvas, uploads, UPLOADS, 0), 0);
	incise_canvas_free(canvas);
	free(base);
}

/* Compared with the formula of "over" in doubles. */
TEST(test_over)
{
	uint8_t *base = any_base(32);
	struct incise_canvas *canvas = canvas_of(32, base, 2);
	const uint8_t *out;

	for (int i = 0; i < 2; i++)
		scribble(canvas, i, (struct incise_rect){0, 0, 32, 32});
	compose_all(canvas, UPLOADS);
	out = incise_canvas_pixels(canvas, 0, NULL);
	for (int i = 0; i < 32 * 32; i++) {
		assert_int_equal(out[4 * i + 3], 255);
		for (int c = 0; c < 3; c++) {
			double v = base[4 * i + c];

			for (int k = 0; k < 2; k++) {
				const uint8_t *over =
					incise_canvas_layer(canvas, k) + 4 * i;

				v = over[c] + v * (255 - over[3]) / 255;
			}
			/* Each of two layers is rounded to a half. */
			assert_true(fabs(out[4 * i + c] - v) <= 1.0);
		}
	}
	incise_canvas_free(canvas);
	free(base);
}

/* One colour is the same at all levels; black and white side by side are 188, not 128. */
TEST(test_levels)
{
	for (int value = 0; value < 256; value += 5) {
		uint8_t base[32 * 32 * 4];
		struct incise_canvas *canvas;

		memset(base, value, sizeof(base));
		canvas = canvas_of(32, base, 0);
		compose_all(canvas, UPLOADS);
		for (int level = 0; level < incise_canvas_levels(canvas); level++)
			for (int c = 0; c < 4; c++)
				assert_int_equal(incise_canvas_pixels(canvas, level,
								      NULL)[c],
						 c == 3 ? 255 : value);
		incise_canvas_free(canvas);
	}
	{
		uint8_t base[32 * 32 * 4];
		struct incise_canvas *canvas;

		for (int i = 0; i < 32 * 32; i++)
			memset(base + 4 * i, i % 2 ? 255 : 0, 4);
		canvas = canvas_of(32, base, 0);
		compose_all(canvas, UPLOADS);
		/* sRGB of half of the light: 1.055 · 0.5^(1/2.4) - 0.055 = 0.7354. */
		assert_int_equal(incise_canvas_pixels(canvas, 1, NULL)[0], 188);
		incise_canvas_free(canvas);
	}
}

TEST(test_refused)
{
	static const int sides[] = {0, -1, 16, 33, 96, 32768, INT_MIN};
	uint8_t base[32 * 32 * 4] = {0};
	struct incise_upload uploads[CANVAS_UPLOADS_MIN];
	struct incise_canvas *canvas;

	for (size_t i = 0; i < sizeof(sides) / sizeof(*sides); i++) {
		struct incise_error err;

		assert_null(incise_canvas_new(sides[i], base, &err));
		assert_int_equal(err.code, EINVAL);
	}
	canvas = canvas_of(32, base, CANVAS_LAYERS_MAX);
	assert_int_equal(incise_canvas_add_layer(canvas), -ENOSPC);
	assert_null(incise_canvas_layer(canvas, CANVAS_LAYERS_MAX));
	assert_null(incise_canvas_layer(canvas, -1));
	assert_null(incise_canvas_pixels(canvas, 6, NULL));
	assert_int_equal(incise_canvas_compose(canvas, uploads, CANVAS_UPLOADS_MIN - 1,
					       0),
			 -EINVAL);
	compose_all(canvas, UPLOADS);
	incise_canvas_dirty(canvas, (struct incise_rect){INT_MAX, INT_MAX, INT_MAX, 1});
	incise_canvas_dirty(canvas, (struct incise_rect){-5, -5, 5, 5});
	incise_canvas_dirty(canvas, (struct incise_rect){0, 0, 0, 9});
	incise_canvas_dirty(canvas, (struct incise_rect){0, 0, INT_MIN, INT_MIN});
	assert_int_equal(incise_canvas_compose(canvas, uploads, CANVAS_UPLOADS_MIN, 0),
			 0);
	incise_canvas_dirty(canvas,
			    (struct incise_rect){INT_MIN, INT_MIN, INT_MAX, INT_MAX});
	assert_int_equal(incise_canvas_compose(canvas, uploads, CANVAS_UPLOADS_MIN, 0),
			 0);
	incise_canvas_dirty(canvas, (struct incise_rect){-9, -9, INT_MAX, INT_MAX});
	assert_true(incise_canvas_compose(canvas, uploads, CANVAS_UPLOADS_MIN, 0) > 0);
	incise_canvas_free(canvas);
	incise_canvas_free(NULL);
}

/*
 * With few texels a call all tiles come in turn: none waits longer than once round, however often the
 * first ones change again. In the end it is as if composed at once.
 */
TEST(test_few_texels_a_call)
{
	const int tiles = SIDE / CANVAS_TILE, few = 4 * CANVAS_TILE * CANVAS_TILE;
	const int rounds = tiles * tiles / 4;
	uint8_t *base = any_base(SIDE);
	struct incise_canvas *canvas = canvas_of(SIDE, base, 1),
			     *whole = canvas_of(SIDE, base, 1);
	struct incise_upload uploads[UPLOADS];
	const struct incise_rect all = {0, 0, SIDE, SIDE}, first = {0, 0, SIDE, 40};

	compose_all(canvas, UPLOADS);
	scribble(canvas, 0, all);
	memcpy(incise_canvas_layer(whole, 0), incise_canvas_layer(canvas, 0),
	       (size_t)SIDE * SIDE * 4);
	compose_all(whole, UPLOADS);
	incise_canvas_dirty(canvas, all);
	for (int i = 0; i < rounds; i++) {
		int texels = 0, n = incise_canvas_compose(canvas, uploads, UPLOADS, few);

		for (int k = 0; k < n; k++)
			if (!uploads[k].level)
				texels += uploads[k].rect.w * uploads[k].rect.h;
		/* The last rectangle may be a row of tiles too much. */
		assert_true(texels <= few + SIDE * CANVAS_TILE);
		incise_canvas_dirty(canvas, first);
	}
	assert_memory_equal(incise_canvas_pixels(canvas, 0, NULL),
			    incise_canvas_pixels(whole, 0, NULL),
			    (size_t)SIDE * SIDE * 4);
	incise_canvas_free(canvas);
	incise_canvas_free(whole);
	free(base);
}
