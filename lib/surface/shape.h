/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Surfaces in closed form: plane and capsule; a sphere is a capsule whose ends are one
 * point. Lengths in mm.
 */
#ifndef INCISE_SHAPE_H
#define INCISE_SHAPE_H

#include <stdbool.h>
#include <incise/surface.h>

struct plane {
	double point[3], normal[3];
};

struct capsule {
	double a[3], b[3], radius;
};

void plane_nearest(const struct plane *plane, const double p[3],
		   struct incise_touch *touch) INCISE_REALTIME;
bool plane_enters(const struct plane *plane, const double from[3], const double to[3],
		  struct incise_touch *touch) INCISE_REALTIME;

/*
 * On the axis all directions across it are as near: the one that @last points to is
 * taken, as far as it points across.
 */
void capsule_nearest(const struct capsule *capsule, const double p[3],
		     const double last[3], struct incise_touch *touch) INCISE_REALTIME;
bool capsule_enters(const struct capsule *capsule, const double from[3],
		    const double to[3], struct incise_touch *touch) INCISE_REALTIME;
void capsule_top(const struct capsule *capsule, struct incise_touch *touch);

#endif
