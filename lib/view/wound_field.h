/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The fields of a wound, and a stretch of its line that raises them; see wound.h.
 */
#ifndef INCISE_VIEW_WOUND_FIELD_H
#define INCISE_VIEW_WOUND_FIELD_H

#include <stdbool.h>
#include <stdint.h>
#include "canvas.h"
#include "wound.h"

#define FIELD_TEXELS (CANVAS_TILE * CANVAS_TILE)
/* How far outside of the lips their distance is kept, mm. */
#define FIELD_INSIDE_MIN_MM -1.0f
#define FIELD_STEPS_MM 4096.0f /* to a mm */
#define FIELD_BIAS_MM 8.0f

/* All 0: there is no wound. */
struct field_texel {
	uint16_t
		inside; /* (mm inside of the lips + FIELD_BIAS_MM) FIELD_STEPS_MM; 0: far */
	uint16_t depth; /* mm FIELD_STEPS_MM */
	uint16_t halo;	/* 0 … 65535 */
};

/* An end of a stretch, as it is to be drawn. */
struct field_end {
	float px[2], half_mm, depth_mm;
};

/* A stretch, prepared; from_px … to_px is what it can touch, texels. */
struct field_stretch {
	struct ground_metric metric;
	float x, y;		     /* one end, texels */
	float along[2], inverse_mm2; /* to the other, mm; 1 / length², or 0 */
	float half_mm, half_more_mm; /* there, and by how much more at the other */
	float depth_mm, depth_more_mm;
	float reach_mm;
	int from_px[2], to_px[2]; /* to_px is outside */
};

/* Returns false when it touches nothing of size × size texels. */
bool field_prepare(struct field_stretch *stretch, const struct field_end *a,
		   const struct field_end *b, const struct ground_metric *metric,
		   int size);

/* Raise the fields of the tile that begins at this texel, where the stretch is. */
void field_raise(struct field_texel *tile, int x, int y,
		 const struct field_stretch *stretch);

static inline float field_inside_mm(const struct field_texel *texel)
{
	return (float)texel->inside * (1 / FIELD_STEPS_MM) - FIELD_BIAS_MM;
}

/* Colours of a tile; texel_mm is the size of one, for the grain of the flesh. */
void field_colour(const struct field_texel *tile, int x, int y, float texel_mm,
		  uint8_t *rgba, int stride);

#endif
