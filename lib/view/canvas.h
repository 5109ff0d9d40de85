/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The texture as drawn: skin below, layers of wound and blood over it, and the same at half the
 * size, a quarter … for distant views. Only dirty tiles are updated.
 *
 *     base (opaque) ◀─ layer 0 ◀─ layer 1    premultiplied RGBA, "over", sRGB values
 *            └────────────┴───────┴──▶ level 0 ─▶ level 1 ─▶ … ─▶ 1 × 1
 *                                      tiles of 32 × 32 texels
 *
 * Layers are blended in sRGB values, as browsers do. A level is the mean of 2 × 2 texels of the one
 * before in linear light, as graphics cards filter sRGB textures: otherwise fine dark lines such as
 * cuts would be too dark from a distance.
 *
 * The result is identical to composing everything again. One thread at a time.
 */
#ifndef INCISE_VIEW_CANVAS_H
#define INCISE_VIEW_CANVAS_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>

#define CANVAS_TILE 32
#define CANVAS_LAYERS_MAX 4

/* Texels; x right, y down. */
struct incise_rect {
	int x, y, w, h;
};

/* The tiles of a square texture that are to be painted. */
struct canvas_tiles {
	int side, n_dirty; /* tiles */
	uint8_t *dirty;	   /* side², row by row */
};

/* All clean. size: texels. False: no memory. tiles->dirty is to be freed. */
bool canvas_tiles_init(struct canvas_tiles *tiles, int size);

static inline void canvas_tiles_mark(struct canvas_tiles *tiles, int number)
{
	tiles->n_dirty += !tiles->dirty[number];
	tiles->dirty[number] = 1;
}

/* Mark the tiles from one texel to another, inclusive; places outside are clipped. */
void canvas_tiles_mark_texels(struct canvas_tiles *tiles, int left, int top, int right,
			      int bottom);

/* The next dirty tile from @number on, marked clean; -1: no dirty tile. */
int canvas_tiles_next(struct canvas_tiles *tiles, int number);

static inline struct incise_rect canvas_tile_rect(const struct canvas_tiles *tiles,
						  int number)
{
	return (struct incise_rect){number % tiles->side * CANVAS_TILE,
				    number / tiles->side * CANVAS_TILE, CANVAS_TILE,
				    CANVAS_TILE};
}

/*
 * Narrow the texels of a row, @left up to before @right, to those i where
 * low <= from + step * i <= high.
 */
void canvas_clip_row(float from, float step, float low, float high, int *left,
		     int *right);

/* A rectangle of a level that has changed; in texels of that level. */
struct incise_upload {
	int level;
	struct incise_rect rect;
};

struct incise_canvas;

/*
 * All of it is dirty at first.
 *
 * size       a power of 2, CANVAS_TILE … 16384
 * base_rgba  size² texels, kept by the caller as long as the canvas; its alpha is not read
 * Returns NULL with errno EINVAL, ENOMEM.
 */
struct incise_canvas *incise_canvas_new(int size, const uint8_t *base_rgba,
					struct incise_error *err);

/*
 * Put a clear layer on top. Returns its index, or -ENOSPC, -ENOMEM. Only written parts of it take
 * memory.
 */
int incise_canvas_add_layer(struct incise_canvas *canvas);

/*
 * size² texels, premultiplied: no colour is above its alpha. Call incise_canvas_dirty() after
 * writing.
 */
uint8_t *incise_canvas_layer(struct incise_canvas *canvas, int layer);

/* A rectangle changed; it is extended to whole tiles and clipped to the canvas. */
void incise_canvas_dirty(struct incise_canvas *canvas, struct incise_rect rect);

/*
 * Compose the dirty tiles at all levels, and return the rectangles that changed.
 *
 * uploads, n   capacity, at least CANVAS_UPLOADS_MIN; if that is too small the rest stays dirty:
 *              call again until it returns 0
 * texels_most  no further rectangle is begun from so many texels on; 0: all. The next call goes on
 *              behind the last one, so that no tile waits longer than once round
 * Returns their number; -EINVAL.
 */
#define CANVAS_UPLOADS_MIN 32
int incise_canvas_compose(struct incise_canvas *canvas, struct incise_upload *uploads,
			  int n, int texels_most);

int incise_canvas_size(const struct incise_canvas *canvas);
int incise_canvas_levels(const struct incise_canvas *canvas);

/* A level's RGBA, alpha 255, as of the last incise_canvas_compose(). stride: bytes, or NULL. */
const uint8_t *incise_canvas_pixels(const struct incise_canvas *canvas, int level,
				    int *stride);

void incise_canvas_free(struct incise_canvas *canvas);

#endif
