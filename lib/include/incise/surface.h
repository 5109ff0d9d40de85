/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surface of the tissue, as incise_plan_surface() returns it: a plane, sphere, capsule,
 * height field or triangle mesh from the scene file. Lengths are in mm, in the tracker's
 * frame; coordinates are within ±1e5.
 */
#ifndef INCISE_SURFACE_H
#define INCISE_SURFACE_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A point on the surface. */
struct incise_touch {
	double point_mm[3]; /**< on the surface */
	/** Outward unit normal; on an edge or corner of a mesh between the normals of its faces. */
	double normal[3];
	/** distance; > 0 inside, < 0 outside; at a border as on its side */
	double depth_mm;
	int face;     /**< face of a mesh, from 0 in the order of the file; else -1 */
	double uv[2]; /**< texture coordinates; 0, 0 if there are none */
};

struct incise_surface;

/** Number of triangles; 0 if the surface is not a mesh. */
INCISE_API size_t incise_surface_triangles(const struct incise_surface *surface);

/**
 * A starting point: the highest point of the surface in +z, the nearest to its centre if there
 * are several; for a plane its defining point.
 */
INCISE_API void incise_surface_top(const struct incise_surface *surface,
				   struct incise_touch *touch);

/** Size of a mesh or height field, and where it is open. */
struct incise_surface_size {
	double lo_mm[3], hi_mm[3]; /**< smallest and largest coordinates */
	size_t open_edges; /**< with one triangle only: of borders, holes and seams */
	double open_lo_mm[3], open_hi_mm[3]; /**< the same of those edges */
	struct incise_touch
		inner; /**< well within it: the middle of a face near its middle */
};

/** @return false: neither a mesh nor a height field */
INCISE_API bool incise_surface_size(const struct incise_surface *surface,
				    struct incise_surface_size *size);

/**
 * Find the nearest point of the whole surface.
 *
 * @param p clamped to ±1e9, also for the depth
 * @param touch result; finite, normal of length 1. Real-time safe. The time grows with the
 *              logarithm of the number of triangles, except if many triangles are equally
 *              near, as at the centre of a sphere.
 */
INCISE_API void incise_surface_nearest(const struct incise_surface *surface,
				       const double p[3],
				       struct incise_touch *touch) INCISE_REALTIME;

/**
 * Find the first entry of a straight line from outside into the tissue. Ends are clamped to
 * ±1e9.
 *
 * @param touch result if there is an entry; its depth is 0
 * @return whether the line crosses the surface inwards. Real-time safe.
 */
INCISE_API bool incise_surface_enters(const struct incise_surface *surface,
				      const double from[3], const double to[3],
				      struct incise_touch *touch) INCISE_REALTIME;

INCISE_END_DECLS
#endif
