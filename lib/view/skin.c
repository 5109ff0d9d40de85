// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The texture of intact tissue: the kind's look (skin_neck.c, skin_liver.c) mixes rows of colour and
 * height, and heights become normals.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "skin.h"
#include "skin_look.h"

static const uint8_t plain_rgb[3] = {205, 170, 150};

static void paint_plain(int size, uint8_t *rgba, uint8_t *normal_rgb)
{
	size_t n = (size_t)size * (size_t)size;

	for (size_t i = 0; i < n; i++) {
		for (size_t c = 0; c < 3; c++)
			rgba[4 * i + c] = plain_rgb[c];
		rgba[4 * i + 3] = 255;
		normal_rgb[3 * i] = normal_rgb[3 * i + 1] = 128;
		normal_rgb[3 * i + 2] = 255;
	}
}

static uint8_t byte(float x)
{
	return (uint8_t)(skin_clamp(x, 0, 255) + 0.5F);
}

static void write_colour(int size, float *const colour[3], uint8_t *rgba)
{
	for (int x = 0; x < size; x++) {
		for (int c = 0; c < 3; c++)
			rgba[4 * x + c] = byte(colour[c][x]);
		rgba[4 * x + 3] = 255;
	}
}

/* For the middle one of three rows of heights; at the border the slope is one-sided. */
static void write_normals(const struct skin_work *work, int y, float *const height[3],
			  uint8_t *rgb)
{
	int size = work->size, rows = y > 0 && y < size - 1 ? 2 : 1;
	float down = (float)(1 / (rows * work->y_mm)), right = (float)(1 / work->x_mm);

	for (int x = 0; x < size; x++) {
		int a = x > 0 ? x - 1 : 0, b = x < size - 1 ? x + 1 : x;
		float dx = (height[1][a] - height[1][b]) * right / (float)(b - a);
		float dy = (height[0][x] - height[2][x]) * down;
		float scale = 127 / sqrtf(dx * dx + dy * dy + 1);

		/* Random rounding: otherwise a wet surface shows steps of half a degree. */
		rgb[3 * x] = (uint8_t)(128 + noise_at(0, 2 * x, y) + scale * dx);
		rgb[3 * x + 1] = (uint8_t)(128 + noise_at(0, 2 * x + 1, y) + scale * dy);
		rgb[3 * x + 2] = (uint8_t)(128.5F + scale);
	}
}

static void work_free(struct skin_work *work)
{
	for (int i = 0; i < SKIN_NOISES_MAX; i++)
		noise_free(work->noise[i]);
	for (int i = 0; i < SKIN_CELLS_MAX; i++)
		cells_free(work->cells[i]);
	free(work->row[0]);
}

static int work_init(struct skin_work *work, const struct skin_look *look)
{
	size_t size = (size_t)work->size;

	/* The mixer's rows, three of colour and three of height. */
	work->row[0] = calloc((SKIN_ROWS + 6) * size, sizeof(float));
	if (!work->row[0])
		return -ENOMEM;
	for (size_t i = 1; i < SKIN_ROWS; i++)
		work->row[i] = work->row[0] + i * size;
	for (int i = 0; i < look->n_noises; i++) {
		work->noise[i] = noise_new(work->seed + (uint64_t)i, work->size,
					   look->noise[i].x_mm / work->x_mm,
					   look->noise[i].y_mm / work->y_mm);
		if (!work->noise[i])
			return -ENOMEM;
	}
	for (int i = 0; i < look->n_cells; i++) {
		work->cells[i] = cells_new(work->seed + SKIN_NOISES_MAX + (uint64_t)i,
					   work->size, look->cells[i].x_mm / work->x_mm,
					   look->cells[i].y_mm / work->y_mm);
		if (!work->cells[i])
			return -ENOMEM;
	}
	return 0;
}

static void paint(const struct skin_work *work, const struct skin_look *look,
		  uint8_t *rgba, uint8_t *normal_rgb)
{
	size_t size = (size_t)work->size;
	float *rows = work->row[0] + SKIN_ROWS * size;
	float *const colour[3] = {rows, rows + size, rows + 2 * size};
	float *const ring[3] = {rows + 3 * size, rows + 4 * size, rows + 5 * size};
	const int last = work->size - 1;

	/* A row's normals follow a row later: they need the heights on both sides. */
	for (int y = 0; y <= last + 1; y++) {
		int above = y > 1 ? y - 2 : 0, below = y <= last ? y : last;
		float *const height[3] = {ring[above % 3], ring[(y + 2) % 3],
					  ring[below % 3]};

		if (y <= last) {
			look->mix(work, y, colour, ring[y % 3]);
			write_colour(work->size, colour, rgba + 4 * size * (size_t)y);
		}
		if (y > 0)
			write_normals(work, y - 1, height,
				      normal_rgb + 3 * size * (size_t)(y - 1));
	}
}

/* With smaller texels, heights would be lost in the rounding of floats. */
static double texel_mm(double mm)
{
	return fmin(fmax(mm, 1e-4), 1e3);
}

int incise_skin_paint(const struct uv_map *map, enum incise_skin skin, uint64_t seed,
		      uint8_t *rgba, uint8_t *normal_rgb)
{
	const struct skin_look *look = skin == INCISE_SKIN_NECK	   ? &skin_neck
				       : skin == INCISE_SKIN_LIVER ? &skin_liver
								   : NULL;
	/* Neighbouring seeds must not share streams. */
	struct skin_work work = {
		.seed = seed * UINT64_C(0x9e3779b97f4a7c15),
		.size = map->size,
		.x_mm = texel_mm(map->wide_mm / map->size),
		.y_mm = texel_mm(map->high_mm / map->size),
	};
	int rc;

	if (!look) {
		paint_plain(map->size, rgba, normal_rgb);
		return 0;
	}
	rc = work_init(&work, look);
	if (!rc)
		paint(&work, look, rgba, normal_rgb);
	work_free(&work);
	return rc;
}
