/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Heights of a surface for the integers: a mesh, or anything that lib/surface has, as a grid of
 * lib/fixed/grid.h, with a certified bound of the difference between the two.
 *
 * The bound holds for every place, by construction: a mesh is compared with the grid triangle by
 * triangle in each cell, and the search for the nearest point by the curvature of the grid's normals.
 * It is a bound for places
 *
 *   - no deeper than frame.reach and no farther outside than leave_mm
 *   - whose nearest point is no border, and above which, in a circle as wide as 5/4 of the reach
 *     and two cells, all cells have a height: nearer to the border slopes are of one cell, and a
 *     contact may end a cell earlier
 */
#ifndef INCISE_HEIGHTS_H
#define INCISE_HEIGHTS_H

#include <incise/error.h>
#include <incise/surface.h>
#include "../fixed/grid.h"

struct incise_heights {
	struct incise_fixed_grid_frame frame;
	int32_t *height; /* rows × columns */
	double depth_bound_mm, point_bound_mm, normal_bound_rad;
};

/*
 * Make the heights of a surface.
 *
 * The region is the mesh as seen from above; of a capsule its upper side, of a plane 1 m. Cells are as
 * wide as they may be for the wanted bound. Where curvature forbids the wanted reach, the frame's is the
 * largest one within the wanted bound; where no cell has that either, the bounds are above @wanted_mm,
 * and the caller decides.
 *
 * @param up       unit: heights are along it
 * @param leave_mm outside, ≥ 0
 * @param reach_mm inside, ≥ 0
 * @param wanted_mm of the depth, > 0
 * @param heights  to be freed with incise_heights_free()
 * @return 0; -ERANGE: an overhang, or too large; -ENOMEM
 */
int incise_heights_make(const struct incise_surface *surface, const double up[3],
			double leave_mm, double reach_mm, double wanted_mm,
			struct incise_heights *heights, struct incise_error *err);

/* Accepts {0}. */
void incise_heights_free(struct incise_heights *heights);

#endif
