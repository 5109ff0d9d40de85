/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What is behind struct incise_surface. A sphere is kept as a capsule, a height field as
 * a mesh.
 */
#ifndef INCISE_TISSUE_SURFACE_H
#define INCISE_TISSUE_SURFACE_H

#include <math.h>
#include "mesh.h"
#include "shape.h"

/* Farther away a place counts as there: no square of it overflows. */
#define PLACE_MAX_MM 1e9

/* A place that can be asked about; of one that is no number some place, however bad. */
static inline void surface_place(double to[3], const double place_mm[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = fmin(fmax(place_mm[i], -PLACE_MAX_MM), PLACE_MAX_MM);
}

struct incise_surface {
	enum incise_surface_kind kind;
	struct plane plane;
	struct capsule capsule;
	struct mesh *mesh; /* or NULL */
};

#endif
