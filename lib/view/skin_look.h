/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The look of one kind of tissue: its noises and cells, and the function that mixes a row of texels.
 */
#ifndef INCISE_SKIN_LOOK_H
#define INCISE_SKIN_LOOK_H

#include "noise.h"

#define SKIN_NOISES_MAX 32
#define SKIN_CELLS_MAX 8
#define SKIN_ROWS 16

struct skin_scale {
	double x_mm, y_mm; /* of a cell */
};

/* A texture while it is painted. */
struct skin_work {
	uint64_t seed;
	int size;
	double x_mm, y_mm; /* of a texel */
	struct noise *noise[SKIN_NOISES_MAX];
	struct cells *cells[SKIN_CELLS_MAX];
	float *row[SKIN_ROWS]; /* buffers of the mixer */
};

struct skin_look {
	int n_noises, n_cells;
	struct skin_scale noise[SKIN_NOISES_MAX], cells[SKIN_CELLS_MAX];
	/* A row's colour, 0 to 255 and beyond, and its height, mm. */
	void (*mix)(const struct skin_work *work, int y, float *const colour[3],
		    float *height_mm);
};

extern const struct skin_look skin_neck, skin_liver;

/* From 1 at 0 to 0 at 1 and beyond, smooth. */
static inline float skin_bump(float x)
{
	float t = 1 - x * x;

	return t > 0 ? t * t : 0;
}

static inline float skin_clamp(float x, float least, float most)
{
	return x < least ? least : x > most ? most : x;
}

static inline float *skin_clear(float *row, int n, float value)
{
	for (int i = 0; i < n; i++)
		row[i] = value;
	return row;
}

/* Row @row of the work: noises from @first on, each with its gain. */
#define SKIN_SUM(work, y, row, first, ...)                          \
	skin_sum(work, y, row, first, (const float[]){__VA_ARGS__}, \
		 (int)(sizeof((const float[]){__VA_ARGS__}) / sizeof(float)))

static inline float *skin_sum(const struct skin_work *work, int y, int row, int first,
			      const float *gain, int n)
{
	float *sum = skin_clear(work->row[row], work->size, 0);

	for (int i = 0; i < n; i++)
		noise_row(work->noise[first + i], y, gain[i], sum);
	return sum;
}

#endif
