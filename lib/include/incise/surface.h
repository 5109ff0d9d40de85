/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The surface of the tissue, and the proxy that follows the tool on it: paper 2's
 * Pfing (the tool's end) and Pprxy (the point of the surface that belongs to it).
 *
 *            outside       ▲ normal
 *      ────────────────────●──────────── surface      ● proxy
 *            inside        ╎ depth_mm > 0
 *                          ○ tool
 *
 * Kinds: plane, sphere, capsule, height field and triangle mesh. On the first three the
 * proxy is the nearest point. On a mesh it is the nearest point that can be reached by
 * gliding over the surface from where the proxy was, so that it does not jump to the
 * other side of a fold; a height field is a mesh of two triangles per cell. All lengths
 * in mm, in one frame, the tracker's; none of a surface beyond 1e5.
 */
#ifndef INCISE_SURFACE_H
#define INCISE_SURFACE_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Triangles of a mesh at most. */
#define INCISE_SURFACE_TRIANGLES_MAX 4000000

/** What a surface is made of. */
enum incise_surface_kind {
	INCISE_SURFACE_PLANE,
	INCISE_SURFACE_SPHERE,
	INCISE_SURFACE_CAPSULE, /**< all points within radius_mm of a line segment */
	INCISE_SURFACE_HEIGHTS,
	INCISE_SURFACE_MESH,
};

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

/** @param normal outward, of any length. @return surface; NULL: EINVAL, ENOMEM. */
INCISE_API struct incise_surface *incise_surface_new_plane(const double point_mm[3],
							   const double normal[3],
							   struct incise_error *err);

/** @return surface; NULL: EINVAL (not finite, radius below 1e-6), ENOMEM. */
INCISE_API struct incise_surface *incise_surface_new_sphere(const double centre_mm[3],
							    double radius_mm,
							    struct incise_error *err);

/** The ends may be one point. @return as incise_surface_new_sphere(). */
INCISE_API struct incise_surface *incise_surface_new_capsule(const double a_mm[3],
							     const double b_mm[3],
							     double radius_mm,
							     struct incise_error *err);

/**
 * Read a triangle mesh: a Wavefront OBJ with `v`, `vt` and `f`; other statements are
 * passed over. Faces turn counter-clockwise seen from outside; those with more than three
 * corners are cut into fans. Corners with equal coordinates are one. The mesh may be open;
 * where parts of it meet in a point only, no proxy passes through that point.
 *
 * The content is not trusted: every number and index is checked, and an error names file
 * and line.
 *
 * @param path   file
 * @param at_mm  added to all its coordinates
 * @return surface, to be freed with incise_surface_free(); NULL with errno of fopen(3),
 *         EINVAL (malformed, no triangle, a triangle less than 1e-9 mm high, an edge with
 *         more than two triangles or with two that turn opposite ways), E2BIG, EFBIG (2 GB
 *         and more), ENOMEM.
 */
INCISE_API struct incise_surface *incise_surface_load_mesh(const char *path,
							   const double at_mm[3],
							   struct incise_error *err);

/**
 * Read a height field: an ESRI ASCII grid (`ncols nrows xllcorner|xllcenter
 * yllcorner|yllcenter cellsize [NODATA_value]`, then rows from the largest y on), heights
 * in +z, out of the tissue. @return as incise_surface_load_mesh(); a hole is EINVAL.
 */
INCISE_API struct incise_surface *incise_surface_load_heights(const char *path,
							      const double at_mm[3],
							      struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_surface_free(struct incise_surface *surface);

/** Which kind it is. */
INCISE_API enum incise_surface_kind incise_surface_kind(
	const struct incise_surface *surface);

/** Number of triangles; 0 where there are none. */
INCISE_API size_t incise_surface_triangles(const struct incise_surface *surface);

/** Memory it holds, bytes. */
INCISE_API size_t incise_surface_memory(const struct incise_surface *surface);

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
				       const double p[3], struct incise_touch *touch);

/**
 * Where a straight way from outside enters the tissue first. Ends beyond 1e9 count as there.
 *
 * @param touch result when there is one; its depth is 0
 * @return whether the way crosses the surface inwards. Real-time safe.
 */
INCISE_API bool incise_surface_enters(const struct incise_surface *surface,
				      const double from[3], const double to[3],
				      struct incise_touch *touch) INCISE_REALTIME;

/**
 * The proxy of one tool on one surface. Its fields may be read; they are set by
 * incise_proxy_init() and incise_proxy_move(), and by nobody else.
 */
struct incise_proxy {
	const struct incise_surface *surface;
	double leave_mm; /**< a contact ends this far outside */
	bool placed;	 /**< has a tool's position */
	bool touching;	 /**< in contact */
	bool began;	 /**< the contact began with the last move */
	double tool_mm[3];
	/** The proxy; while not touching, what a contact would begin with is not known. */
	struct incise_touch touch;
	struct incise_touch first; /**< where the contact began: paper 2's P(0), Q(0) */
	/**
	 * The proxy has got to the nearest place around; otherwise it goes on with the next
	 * moves. Always so on kinds other than a mesh.
	 */
	bool settled;
	double clear_mm; /**< no surface is nearer than this to clear_at_mm */
	double clear_at_mm[3];
	unsigned at_face; /**< of a mesh, in its own order */
};

/**
 * @param leave_mm ≥ 0; hysteresis: a contact begins at the surface and ends this far
 *                 outside of it
 */
INCISE_API void incise_proxy_init(struct incise_proxy *proxy,
				  const struct incise_surface *surface,
				  double leave_mm) INCISE_REALTIME;

/**
 * Follow the tool to a new place.
 *
 * A contact begins where the way from the last place enters the tissue, or at the nearest
 * point when the first place of all lies inside. It ends leave_mm outside, and where the
 * proxy comes to the border of an open mesh with the tool beyond it. Where the way from a
 * proxy that lets go enters another part of the mesh, a contact begins there in the same
 * move: `began` is set again and `first` is new.
 *
 * On a mesh the proxy goes at most twice as far as the tool went, in a straight line from
 * its old place to its new one; a tool that does not move leaves it where it is. What it
 * could not go it goes with the next moves (`settled`). Its work is finite: after about
 * 1000 triangles in one move it stays where it got to as well.
 *
 * @param tool_mm beyond 1e9 it counts as there; one that is not finite changes nothing but
 *                `began`. Real-time safe.
 */
INCISE_API void incise_proxy_move(struct incise_proxy *proxy,
				  const double tool_mm[3]) INCISE_REALTIME;

INCISE_END_DECLS
#endif
