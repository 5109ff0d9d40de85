/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Triangles in the graphics' memory, as the shaders take them: attribute 0 is the place in
 * mm, 1 the normal, 2 the tangent or the colour, 3 the texel.
 */
#ifndef INCISE_VIEW_SOLID_H
#define INCISE_VIEW_SOLID_H

#include "chart.h"
#include "instrument.h"

struct incise_solid {
	unsigned array, vertices, indices; /* OpenGL's names */
	int n_indices;
};

/* And a ball round it. */
void incise_solid_surface(struct incise_solid *solid, const struct incise_chart *chart,
			  double middle_mm[3], double *reach_mm);
void incise_solid_instrument(struct incise_solid *solid,
			     const struct incise_instrument_mesh *mesh);
void incise_solid_draw(const struct incise_solid *solid);
void incise_solid_free(struct incise_solid *solid);

#endif
