// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The texture as drawn: its layers blended, its levels, and its dirty tiles; see canvas.h.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include "canvas.h"

#define LEVELS_MAX 15
/* From this level on a tile is at most one texel: these levels are updated once per call. */
#define LEVEL_SMALL 5
/* The sum of four 16-bit linear values, to 14 bits: finer than a step of 8-bit sRGB. */
#define SUM_SHIFT 4
#define SUM_STEPS (1 << 14)

struct incise_canvas {
	int size, levels;
	const uint8_t *base;
	int n_layers;
	uint8_t *layer[CANVAS_LAYERS_MAX];
	uint8_t *level[LEVELS_MAX];
	struct canvas_tiles tiles;
	int next;		 /* tile, from which the next call looks for dirty ones */
	uint16_t linear[256];	 /* of an sRGB value, 65535 is white */
	uint8_t srgb[SUM_STEPS]; /* of the sum of four of them >> SUM_SHIFT */
};

bool canvas_tiles_init(struct canvas_tiles *tiles, int size)
{
	*tiles = (struct canvas_tiles){.side = size / CANVAS_TILE};
	tiles->dirty = calloc((size_t)tiles->side * tiles->side, 1);
	return tiles->dirty;
}

void canvas_tiles_mark_texels(struct canvas_tiles *tiles, int left, int top, int right,
			      int bottom)
{
	int last = tiles->side * CANVAS_TILE - 1;

	left = (left < 0 ? 0 : left) / CANVAS_TILE;
	top = (top < 0 ? 0 : top) / CANVAS_TILE;
	right = right < 0 ? -1 : (right > last ? last : right) / CANVAS_TILE;
	bottom = bottom < 0 ? -1 : (bottom > last ? last : bottom) / CANVAS_TILE;
	for (int y = top; y <= bottom; y++)
		for (int x = left; x <= right; x++)
			canvas_tiles_mark(tiles, y * tiles->side + x);
}

int canvas_tiles_next(struct canvas_tiles *tiles, int number)
{
	if (!tiles->n_dirty)
		return -1;
	while (!tiles->dirty[number])
		number++;
	tiles->dirty[number] = 0;
	tiles->n_dirty--;
	return number;
}

void canvas_clip_row(float from, float step, float low, float high, int *left, int *right)
{
	float a, b;

	if (fabsf(step) < 1e-9f) {
		if (from < low || from > high)
			*right = *left;
		return;
	}
	a = ((step > 0 ? low : high) - from) / step;
	b = ((step > 0 ? high : low) - from) / step;
	if (a > (float)*left)
		*left = a < (float)*right ? (int)ceilf(a) : *right;
	if (b < (float)*right - 1)
		*right = b >= (float)*left ? (int)floorf(b) + 1 : *left;
}

static void make_tables(struct incise_canvas *canvas)
{
	for (int i = 0; i < 256; i++) {
		double v = i / 255.0;

		v = v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
		canvas->linear[i] = (uint16_t)(v * 65535 + 0.5);
	}
	for (int i = 0; i < SUM_STEPS; i++) {
		double v = (i + 0.5) / SUM_STEPS;

		v = v <= 0.0031308 ? v * 12.92 : 1.055 * pow(v, 1 / 2.4) - 0.055;
		canvas->srgb[i] = (uint8_t)(v * 255 + 0.5);
	}
}

struct incise_canvas *incise_canvas_new(int size, const uint8_t *base_rgba,
					struct incise_error *err)
{
	struct incise_canvas *canvas;
	bool there;

	if (size < CANVAS_TILE || size > 16384 || (size & (size - 1)) || !base_rgba)
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"canvas: a side of %d texels: expected a power of 2, "
			"32 … 16384",
			size);
	canvas = calloc(1, sizeof(*canvas));
	if (!canvas)
		goto no_memory;
	canvas->size = size;
	canvas->base = base_rgba;
	there = canvas_tiles_init(&canvas->tiles, size);
	for (int side = size; side; side >>= 1) {
		uint8_t *level = malloc((size_t)side * side * 4);

		canvas->level[canvas->levels++] = level;
		there = there && level;
	}
	if (!there)
		goto no_memory;
	make_tables(canvas);
	canvas_tiles_mark_texels(&canvas->tiles, 0, 0, size - 1, size - 1);
	return canvas;

no_memory:
	incise_canvas_free(canvas);
	return INCISE_ERROR_NULL(err, ENOMEM, "canvas: no memory for %d × %d texels",
				 size, size);
}

void incise_canvas_free(struct incise_canvas *canvas)
{
	if (!canvas)
		return;
	for (int i = 0; i < canvas->n_layers; i++)
		free(canvas->layer[i]);
	for (int i = 0; i < canvas->levels; i++)
		free(canvas->level[i]);
	free(canvas->tiles.dirty);
	free(canvas);
}

int incise_canvas_add_layer(struct incise_canvas *canvas)
{
	uint8_t *layer;

	if (canvas->n_layers == CANVAS_LAYERS_MAX)
		return -ENOSPC;
	/* From calloc: unwritten pages take no memory. */
	layer = calloc((size_t)canvas->size * canvas->size, 4);
	if (!layer)
		return -ENOMEM;
	canvas->layer[canvas->n_layers] = layer;
	return canvas->n_layers++;
}

uint8_t *incise_canvas_layer(struct incise_canvas *canvas, int layer)
{
	return layer >= 0 && layer < canvas->n_layers ? canvas->layer[layer] : NULL;
}

void incise_canvas_dirty(struct incise_canvas *canvas, struct incise_rect rect)
{
	int64_t right = (int64_t)rect.x + rect.w - 1;
	int64_t bottom = (int64_t)rect.y + rect.h - 1;

	if (rect.w > 0 && rect.h > 0)
		canvas_tiles_mark_texels(
			&canvas->tiles, rect.x, rect.y,
			(int)(right < canvas->size ? right : canvas->size),
			(int)(bottom < canvas->size ? bottom : canvas->size));
}

/* round(a b / 255), exact for 8-bit values. */
static inline unsigned int times(unsigned int a, unsigned int b)
{
	unsigned int v = a * b + 128;

	return (v + (v >> 8)) >> 8;
}

/* Over opaque texels; texels of 4 bytes are mostly clear, or mostly opaque. */
static void blend(uint8_t *to, const uint8_t *over, int n)
{
	for (int i = 0; i < n; i++, to += 4, over += 4) {
		unsigned int clear = 255 - over[3];

		if (clear == 255)
			continue;
		if (!clear) {
			memcpy(to, over, 4);
			continue;
		}
		for (int c = 0; c < 3; c++) {
			unsigned int v = over[c] + times(to[c], clear);

			to[c] = v > 255 ? 255 : (uint8_t)v;
		}
	}
}

/* Whether a row of a layer is clear: from calloc(), or not painted. */
static bool is_clear(const uint8_t *row, int n)
{
	uint64_t any = 0, eight;

	/* Two texels each: rectangles consist of tiles. */
	for (int i = 0; i < n; i += 2) {
		memcpy(&eight, row + 4 * i, sizeof(eight));
		any |= eight;
	}
	return !any;
}

/* Whole tiles, eight texels at a time. */
static void copy_opaque(uint8_t *to, const uint8_t *from, int n)
{
	static const uint8_t opaque[32] = {
		[3] = 255,  [7] = 255,	[11] = 255, [15] = 255,
		[19] = 255, [23] = 255, [27] = 255, [31] = 255};

	for (int i = 0; i < 4 * n; i += 32) {
		uint8_t eight[32];

		memcpy(eight, from + i, sizeof(eight));
		for (int k = 0; k < 32; k++)
			eight[k] |= opaque[k];
		memcpy(to + i, eight, sizeof(eight));
	}
}

static void compose_rect(struct incise_canvas *canvas, const struct incise_rect *rect)
{
	for (int y = rect->y; y < rect->y + rect->h; y++) {
		size_t at = ((size_t)y * canvas->size + rect->x) * 4;
		uint8_t *to = canvas->level[0] + at;

		copy_opaque(to, canvas->base + at, rect->w);
		for (int i = 0; i < canvas->n_layers; i++)
			if (!is_clear(canvas->layer[i] + at, rect->w))
				blend(to, canvas->layer[i] + at, rect->w);
	}
}

static void shrink_rect(struct incise_canvas *canvas, int level,
			const struct incise_rect *rect)
{
	int side = canvas->size >> level, from_stride = side * 2 * 4;
	const uint16_t *linear = canvas->linear;

	for (int y = rect->y; y < rect->y + rect->h; y++) {
		const uint8_t *a = canvas->level[level - 1] +
				   ((size_t)2 * y * side * 2 + 2 * rect->x) * 4;
		uint8_t *to = canvas->level[level] + ((size_t)y * side + rect->x) * 4;

		for (int x = 0; x < rect->w; x++, a += 8, to += 4) {
			const uint8_t *b = a + from_stride;

			for (int c = 0; c < 3; c++)
				to[c] = canvas->srgb[((unsigned int)linear[a[c]] +
						      linear[a[c + 4]] + linear[b[c]] +
						      linear[b[c + 4]]) >>
						     SUM_SHIFT];
			to[3] = 255;
		}
	}
}

/* The rectangle of the next level that covers a rectangle of this one. */
static void halve(struct incise_rect *rect)
{
	int right = (rect->x + rect->w + 1) / 2, bottom = (rect->y + rect->h + 1) / 2;

	rect->x /= 2;
	rect->y /= 2;
	rect->w = right - rect->x;
	rect->h = bottom - rect->y;
}

static void enclose(struct incise_rect *all, const struct incise_rect *rect)
{
	int right = all->x + all->w, bottom = all->y + all->h;

	if (!all->w) {
		*all = *rect;
		return;
	}
	if (rect->x + rect->w > right)
		right = rect->x + rect->w;
	if (rect->y + rect->h > bottom)
		bottom = rect->y + rect->h;
	if (rect->x < all->x)
		all->x = rect->x;
	if (rect->y < all->y)
		all->y = rect->y;
	all->w = right - all->x;
	all->h = bottom - all->y;
}

/* Clean part of a row of tiles if all of it is dirty. Returns whether. */
static bool take_canvas_row(struct incise_canvas *canvas, int x, int y, int w)
{
	uint8_t *row = canvas->tiles.dirty + (size_t)y * canvas->tiles.side + x;

	for (int i = 0; i < w; i++)
		if (!row[i])
			return false;
	memset(row, 0, w);
	canvas->tiles.n_dirty -= w;
	return true;
}

/*
 * Take a rectangle of dirty tiles that starts at one: as far to the right as they reach, and as far
 * down as the whole width does, up to so many texels.
 */
static struct incise_rect take_rect(struct incise_canvas *canvas, int x, int y,
				    int texels_most)
{
	const uint8_t *row = canvas->tiles.dirty + (size_t)y * canvas->tiles.side;
	int w = 1, h = 1;

	while (x + w < canvas->tiles.side && row[x + w])
		w++;
	take_canvas_row(canvas, x, y, w);
	while (w * h * CANVAS_TILE * CANVAS_TILE < texels_most &&
	       y + h < canvas->tiles.side && take_canvas_row(canvas, x, y + h, w))
		h++;
	return (struct incise_rect){x * CANVAS_TILE, y * CANVAS_TILE, w * CANVAS_TILE,
				    h * CANVAS_TILE};
}

/* Update a rectangle at all levels below LEVEL_SMALL. Returns the number of uploads. */
static int do_rect(struct incise_canvas *canvas, struct incise_rect rect,
		   struct incise_upload *uploads)
{
	int n = 0;

	compose_rect(canvas, &rect);
	uploads[n++] = (struct incise_upload){0, rect};
	for (int level = 1; level < LEVEL_SMALL && level < canvas->levels; level++) {
		halve(&rect);
		shrink_rect(canvas, level, &rect);
		uploads[n++] = (struct incise_upload){level, rect};
	}
	return n;
}

int incise_canvas_compose(struct incise_canvas *canvas, struct incise_upload *uploads,
			  int n, int texels_most)
{
	int done = 0, texels = 0, tiles = canvas->tiles.side * canvas->tiles.side;
	struct incise_rect all = {0};

	if (n < CANVAS_UPLOADS_MIN)
		return -EINVAL;
	if (texels_most <= 0)
		texels_most = INT_MAX;
	n -= LEVELS_MAX - LEVEL_SMALL; /* kept for the small levels */
	while (canvas->tiles.n_dirty && done + LEVEL_SMALL <= n && texels < texels_most) {
		int at = canvas->next;
		struct incise_rect rect;

		canvas->next = (at + 1) % tiles;
		if (!canvas->tiles.dirty[at])
			continue;
		rect = take_rect(canvas, at % canvas->tiles.side, at / canvas->tiles.side,
				 texels_most - texels);
		/* Behind all of it, though parts may be dirty again by the next call. */
		canvas->next = (at + rect.w / CANVAS_TILE) % tiles;
		texels += rect.w * rect.h;
		enclose(&all, &rect);
		done += do_rect(canvas, rect, uploads + done);
	}
	if (!done)
		return 0;
	for (int level = 1; level < canvas->levels; level++) {
		halve(&all);
		if (level < LEVEL_SMALL)
			continue;
		shrink_rect(canvas, level, &all);
		uploads[done++] = (struct incise_upload){level, all};
	}
	return done;
}

int incise_canvas_size(const struct incise_canvas *canvas)
{
	return canvas->size;
}

int incise_canvas_levels(const struct incise_canvas *canvas)
{
	return canvas->levels;
}

const uint8_t *incise_canvas_pixels(const struct incise_canvas *canvas, int level,
				    int *stride)
{
	if (level < 0 || level >= canvas->levels)
		return NULL;
	if (stride)
		*stride = (canvas->size >> level) * 4;
	return canvas->level[level];
}
