/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Surfaces of all kinds, and the proxy that follows the tool on one: Bhasin et al.'s Pfing (the
 * tool's end) and Pprxy (the point of the surface that belongs to it).
 *
 *            outside       ▲ normal
 *      ────────────────────●──────────── surface      ● proxy
 *            inside        ╎ depth_mm > 0
 *                          ○ tool
 *
 * On a plane, sphere or capsule the proxy is the nearest point. On a mesh it is the nearest
 * point that can be reached by gliding over the surface from the last place of the proxy, so
 * that it does not jump to the other side of a fold. A sphere is kept as a capsule, a height
 * field as a mesh of two triangles per cell. Lengths in mm.
 */
#ifndef INCISE_SURFACE_PRIVATE_H
#define INCISE_SURFACE_PRIVATE_H

#include <math.h>
#include <incise/error.h>
#include <incise/surface.h>
#include "mesh.h"

/* Coordinates farther away count as this far: no square of them overflows. */
#define PLACE_MAX_MM 1e9

/* A place within PLACE_MAX_MM; NaN becomes a finite number. */
static inline void surface_place(double to[3], const double place_mm[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = fmin(fmax(place_mm[i], -PLACE_MAX_MM), PLACE_MAX_MM);
}

/* The kinds of surfaces. */
enum incise_surface_kind {
	INCISE_SURFACE_PLANE,
	INCISE_SURFACE_SPHERE,
	INCISE_SURFACE_CAPSULE, /* all points within radius_mm of a line segment */
	INCISE_SURFACE_HEIGHTS,
	INCISE_SURFACE_MESH,
};

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
 * On the axis all directions across it are as near: the direction of @last is taken, as far as it points
 * across.
 */
void capsule_nearest(const struct capsule *capsule, const double p[3],
		     const double last[3], struct incise_touch *touch) INCISE_REALTIME;
bool capsule_enters(const struct capsule *capsule, const double from[3],
		    const double to[3], struct incise_touch *touch) INCISE_REALTIME;

struct incise_surface {
	enum incise_surface_kind kind;
	struct plane plane;
	struct capsule capsule;
	struct mesh *mesh; /* or NULL */
};

/* @param normal outward, of any length. @return surface; NULL: EINVAL, ENOMEM. */
struct incise_surface *incise_surface_new_plane(const double point_mm[3],
						const double normal[3],
						struct incise_error *err);

/* @return surface; NULL: EINVAL (not finite, radius below 1e-6), ENOMEM. */
struct incise_surface *incise_surface_new_sphere(const double centre_mm[3],
						 double radius_mm,
						 struct incise_error *err);

/* The ends may be one point. @return as incise_surface_new_sphere(). */
struct incise_surface *incise_surface_new_capsule(const double a_mm[3],
						  const double b_mm[3], double radius_mm,
						  struct incise_error *err);

/*
 * Read a triangle mesh: an STL, or a Wavefront OBJ with `v`, `vt` and `f`; statements that
 * hold no surface are passed over. Faces turn counter-clockwise seen from outside; those with more than three
 * corners are cut into fans. Corners with equal coordinates are one. The mesh may be open;
 * where parts of it meet in a point only, no proxy passes through that point.
 *
 * The content is not trusted: every number and index is checked, and an error names file
 * and line.
 *
 * @param path   file
 * @param at_mm  added to all its coordinates
 * @param cavity closed pieces may be turned inside out: the tissue is around them
 * @return surface, to be freed with incise_surface_free(); NULL with errno of incise_infile_open(),
 *         EINVAL (malformed, no triangle, a triangle less than 1e-9 mm high, an edge with
 *         more than two triangles or with two that turn opposite ways, a closed piece that is turned inside
 *         out), E2BIG, EFBIG (2 GB
 *         and more), ENOMEM.
 */
struct incise_surface *incise_surface_load_mesh(const char *path, const double at_mm[3],
						bool cavity, struct incise_error *err);

/*
 * Read a height field: an ESRI ASCII grid (`ncols nrows xllcorner|xllcenter
 * yllcorner|yllcenter cellsize [NODATA_value]`, then rows from the largest y on), heights
 * in +z, out of the tissue. @return as incise_surface_load_mesh(); a hole is EINVAL.
 */
struct incise_surface *incise_surface_load_heights(const char *path,
						   const double at_mm[3],
						   struct incise_error *err);

/* NULL is accepted. */
void incise_surface_free(struct incise_surface *surface);

/* Get the kind. */
enum incise_surface_kind incise_surface_kind(const struct incise_surface *surface);

/* Memory it holds, bytes. */
size_t incise_surface_memory(const struct incise_surface *surface);

/*
 * The proxy of one tool on one surface. Its fields may be read; only incise_proxy_init() and
 * incise_proxy_move() set them.
 */
struct incise_proxy {
	const struct incise_surface *surface;
	double leave_mm; /* a contact ends this far outside */
	bool placed;	 /* has a tool's position */
	bool touching;	 /* in contact */
	bool began;	 /* the contact began with the last move */
	double tool_mm[3];
	/* The proxy; while it does not touch, the begin of a contact is not known. */
	struct incise_touch touch;
	struct incise_touch
		first; /* where the contact began: Bhasin et al.'s P(0), Q(0) */
	/*
	 * The proxy has got to the nearest place around; otherwise it goes on with the next
	 * moves. Always so on kinds other than a mesh.
	 */
	bool settled;
	double left_mm;	 /* of its way, if that took more work than a move may */
	double clear_mm; /* no surface is nearer than this to clear_at_mm */
	double clear_at_mm[3];
	unsigned at_face; /* of a mesh, in its own order */
};

/*
 * @param leave_mm ≥ 0; hysteresis: a contact starts at the surface and ends this far
 *                 outside of it
 */
void incise_proxy_init(struct incise_proxy *proxy, const struct incise_surface *surface,
		       double leave_mm) INCISE_REALTIME;

/*
 * Follow the tool to a new place.
 *
 * A contact starts where the way from the last place enters the tissue, or at the nearest
 * point when the first place of all lies inside. It ends leave_mm outside, and where the
 * proxy comes to the border of an open mesh with the tool beyond it. Where the way from a
 * proxy that lets go enters another part of the mesh, a contact starts there in the same
 * move: `began` is set again and `first` is new.
 *
 * On a mesh the proxy goes at most twice as far as the tool went, in a straight line from
 * its old place to its new one; a tool that does not move leaves it where it is. It goes the rest of the way
 * with the next moves (`settled`). Its work is finite: after about 1000 triangles in one move it stays where
 * it got to as well.
 *
 * @param tool_mm beyond 1e9 it counts as there; a position that is not finite changes nothing
 *                but `began`. Real-time safe.
 */
void incise_proxy_move(struct incise_proxy *proxy,
		       const double tool_mm[3]) INCISE_REALTIME;

#endif
