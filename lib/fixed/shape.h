/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Surfaces in integers, each asked in a time that does not depend on it: a plane, a capsule (a sphere
 * is a capsule without length), and a grid of heights, which stands for anything without overhangs.
 * lib/surface has the same in double, and meshes as they are.
 *
 *   places, depths Q16.16 mm     normals Q2.30
 */
#ifndef INCISE_FIXED_SHAPE_H
#define INCISE_FIXED_SHAPE_H

#include <incise/export.h>
#include "grid.h"
#include "integers.h"

enum incise_fixed_shape_kind {
	INCISE_FIXED_PLANE,
	INCISE_FIXED_CAPSULE,
	INCISE_FIXED_GRID,
};

struct incise_fixed_shape {
	int32_t kind;	   /* enum incise_fixed_shape_kind */
	int32_t point[3];  /* of the plane, or the capsule's one end */
	int32_t normal[3]; /* of the plane, or from one end of the capsule to the other */
	int32_t length;	   /* of the capsule's axis, ≥ 0 */
	int32_t radius;	   /* of the capsule, ≥ 1 */
	int32_t reserved;
};

#include "../number/fixed_kind.h"
#include "../tissue/touch.proto.h"
#include "../number/no_kind.h"

/* Tell whether a shape's numbers are good; a grid's are checked by incise_fixed_grid_open(). */
bool incise_fixed_shape_good(const struct incise_fixed_shape *shape);

/*
 * Look for the nearest point.
 *
 * @param grid of a shape of that kind
 * @param last a unit vector: the normal where all directions are as near, on a capsule's axis
 *
 * Returns whether there is a point: not beyond a grid's edge, where @touch is left as it is.
 */
bool incise_fixed_shape_nearest(const struct incise_fixed_shape *shape,
				const struct incise_fixed_grid *grid, const int32_t p[3],
				const int32_t last[3],
				struct incise_fixed_touch *touch) INCISE_REALTIME;

/*
 * Follow the tool to a new place: a contact begins where the way enters the tissue, or at the nearest
 * point when the first place of all lies inside, and ends @leave outside, or beyond a grid's edge.
 *
 * A way that enters and leaves within one tick is no contact.
 */
void incise_fixed_proxy_move(struct incise_fixed_proxy *proxy,
			     const struct incise_fixed_shape *shape,
			     const struct incise_fixed_grid *grid, int32_t leave,
			     const int32_t tool[3]) INCISE_REALTIME;

#endif
