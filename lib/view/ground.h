/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surface at a place of the texture: the length of a texel, and the way downhill.
 *
 *     a step of (dx, dy) texels is (a dx + b dy, c dy) mm in a frame of the surface whose
 *     first axis is along the rows of the texture
 *
 * Blood runs over the surface as drawn, with its relief.
 */
#ifndef INCISE_VIEW_GROUND_H
#define INCISE_VIEW_GROUND_H

#include <stdbool.h>
#include "uv_map.h"

struct ground_metric {
	float a, b, c; /* mm per texel; a, c > 0 */
};

struct ground {
	struct ground_metric metric;
	double area_mm2;     /* of a texel */
	double slope;	     /* sine of the angle to the level, 0 … 1 */
	double down_px[2];   /* texels per mm downhill; 0 where it is level */
	double across_px[2]; /* the same to the right of it, along the level */
};

/* False: there is no surface there, or the map is degenerate; nothing is written. */
bool ground_metric(const struct uv_map *map, const double px[2],
		   struct ground_metric *metric);
bool ground_at(const struct uv_map *map, const double gravity[3], const double px[2],
	       struct ground *ground);

/* Length of a step, mm. */
double ground_length_mm(const struct ground_metric *metric, double dx, double dy);

#endif
