/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surface of the tissue, as incise_plan_surface() returns it: a plane, sphere, capsule,
 * height field or triangle mesh that the scene file describes. All lengths in mm, in the
 * tracker's frame; no coordinate is beyond 1e5.
 */
#ifndef INCISE_SURFACE_H
#define INCISE_SURFACE_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Where a point meets the surface. */
struct incise_touch {
	double point_mm[3]; /**< of the surface */
	/** Outward unit normal there; on an edge or corner of a mesh between its faces'. */
	double normal[3];
	double depth_mm; /**< distance; > 0 inside, < 0 outside; at a border its side's */
	int face;	 /**< of a mesh, from 0 in the file's order; else -1 */
	double uv[2];	 /**< texture coordinates there; 0, 0 where there are none */
};

struct incise_surface;

/** Number of triangles; 0 where there are none. */
INCISE_API size_t incise_surface_triangles(const struct incise_surface *surface);

/**
 * A place to begin at: the surface point highest in +z, the one nearest to the middle of
 * the surface when there are many; of a plane the point it was made of.
 */
INCISE_API void incise_surface_top(const struct incise_surface *surface,
				   struct incise_touch *touch);

/**
 * The nearest point of the whole surface.
 *
 * @param p beyond 1e9 it counts as there, and the depth is from there
 * @param touch result; finite, its normal of length 1. Real-time safe, in a time that
 *              grows with the logarithm of the number of triangles; only where very many
 *              are equally near, as in the middle of a sphere, does it look at all these.
 */
INCISE_API void incise_surface_nearest(const struct incise_surface *surface,
				       const double p[3],
				       struct incise_touch *touch) INCISE_REALTIME;

/**
 * Where a straight way from outside enters the tissue first. Ends beyond 1e9 count as there.
 *
 * @param touch result when there is one; its depth is 0
 * @return whether the way crosses the surface inwards. Real-time safe.
 */
INCISE_API bool incise_surface_enters(const struct incise_surface *surface,
				      const double from[3], const double to[3],
				      struct incise_touch *touch) INCISE_REALTIME;

INCISE_END_DECLS
#endif
