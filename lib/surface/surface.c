// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Surfaces of all kinds: making, asking, freeing.
 */
#include <errno.h>
#include <stdlib.h>
#include "reader.h"
#include "surface.h"

static const double up[3] = {0, 0, 1};

static bool within_reach(const double p[3])
{
	return fabs(p[0]) <= MESH_COORDINATE_MAX_MM &&
	       fabs(p[1]) <= MESH_COORDINATE_MAX_MM &&
	       fabs(p[2]) <= MESH_COORDINATE_MAX_MM;
}

static struct incise_surface *surface_new(enum incise_surface_kind kind,
					  struct incise_error *err)
{
	struct incise_surface *surface = calloc(1, sizeof(*surface));

	if (surface)
		surface->kind = kind;
	else
		incise_error_set(err, ENOMEM, "no memory for a surface");
	return surface;
}

static struct incise_surface *refuse(struct incise_error *err, const char *what,
				     const char *expected)
{
	incise_error_set(err, EINVAL, "%s: expected %s", what, expected);
	return NULL;
}

static const char coordinates[] = "numbers of mm, 1e5 at most";

struct incise_surface *incise_surface_new_plane(const double point_mm[3],
						const double normal[3],
						struct incise_error *err)
{
	struct incise_surface *surface;
	double largest = fmax(fabs(normal[0]), fmax(fabs(normal[1]), fabs(normal[2])));

	if (!within_reach(point_mm))
		return refuse(err, "the plane's point", coordinates);
	if (!v3_finite(normal) || !(largest > 0))
		return refuse(err, "the plane's normal", "numbers, not all 0");
	surface = surface_new(INCISE_SURFACE_PLANE, err);
	if (!surface)
		return NULL;
	v3_copy(surface->plane.point, point_mm);
	/* Of any length: scaled first, so that no square overflows or vanishes. */
	for (int i = 0; i < 3; i++)
		surface->plane.normal[i] = normal[i] / largest;
	v3_unit(surface->plane.normal, surface->plane.normal, 0);
	return surface;
}

static struct incise_surface *new_capsule(enum incise_surface_kind kind,
					  const double a_mm[3], const double b_mm[3],
					  double radius_mm, struct incise_error *err)
{
	struct incise_surface *surface;
	bool sphere = kind == INCISE_SURFACE_SPHERE;

	if (!within_reach(a_mm) || !within_reach(b_mm))
		return refuse(err, sphere ? "the sphere's centre" : "the capsule's ends",
			      coordinates);
	if (!(radius_mm >= 1e-6 && radius_mm <= MESH_COORDINATE_MAX_MM))
		return refuse(err,
			      sphere ? "the sphere's radius" : "the capsule's radius",
			      "from 1e-6 to 1e5 mm");
	surface = surface_new(kind, err);
	if (!surface)
		return NULL;
	v3_copy(surface->capsule.a, a_mm);
	v3_copy(surface->capsule.b, b_mm);
	surface->capsule.radius = radius_mm;
	return surface;
}

struct incise_surface *incise_surface_new_sphere(const double centre_mm[3],
						 double radius_mm,
						 struct incise_error *err)
{
	return new_capsule(INCISE_SURFACE_SPHERE, centre_mm, centre_mm, radius_mm, err);
}

struct incise_surface *incise_surface_new_capsule(const double a_mm[3],
						  const double b_mm[3], double radius_mm,
						  struct incise_error *err)
{
	return new_capsule(INCISE_SURFACE_CAPSULE, a_mm, b_mm, radius_mm, err);
}

static struct incise_surface *load(enum incise_surface_kind kind, const char *path,
				   const double at_mm[3], struct incise_error *err)
{
	struct incise_surface *surface;

	if (!within_reach(at_mm))
		return refuse(err, path, "to be put at numbers of mm, 1e5 at most");
	surface = surface_new(kind, err);
	if (!surface)
		return NULL;
	surface->mesh = kind == INCISE_SURFACE_MESH ? obj_load(path, at_mm, err)
						    : height_grid_load(path, at_mm, err);
	if (!surface->mesh) {
		int code = errno;

		free(surface);
		errno = code;
		return NULL;
	}
	return surface;
}

struct incise_surface *incise_surface_load_mesh(const char *path, const double at_mm[3],
						struct incise_error *err)
{
	return load(INCISE_SURFACE_MESH, path, at_mm, err);
}

struct incise_surface *incise_surface_load_heights(const char *path,
						   const double at_mm[3],
						   struct incise_error *err)
{
	return load(INCISE_SURFACE_HEIGHTS, path, at_mm, err);
}

void incise_surface_free(struct incise_surface *surface)
{
	if (!surface)
		return;
	mesh_free(surface->mesh);
	free(surface);
}

enum incise_surface_kind incise_surface_kind(const struct incise_surface *surface)
{
	return surface->kind;
}

size_t incise_surface_triangles(const struct incise_surface *surface)
{
	return surface->mesh ? surface->mesh->n_triangles : 0;
}

size_t incise_surface_memory(const struct incise_surface *surface)
{
	return sizeof(*surface) + (surface->mesh ? mesh_memory(surface->mesh) : 0);
}

void incise_surface_top(const struct incise_surface *surface, struct incise_touch *touch)
{
	if (surface->kind == INCISE_SURFACE_PLANE)
		plane_nearest(&surface->plane, surface->plane.point, touch);
	else if (surface->mesh)
		mesh_top(surface->mesh, touch);
	else
		capsule_top(&surface->capsule, touch);
}

void incise_surface_nearest(const struct incise_surface *surface,
			    const double place_mm[3], struct incise_touch *touch)
{
	double p[3];

	surface_place(p, place_mm);
	if (surface->kind == INCISE_SURFACE_PLANE) {
		plane_nearest(&surface->plane, p, touch);
	} else if (surface->mesh) {
		struct mesh_spot spot;

		mesh_nearest(surface->mesh, p, 0, 1, &spot);
		mesh_touch(surface->mesh, &spot, p, touch);
	} else {
		capsule_nearest(&surface->capsule, p, up, touch);
	}
}

bool incise_surface_enters(const struct incise_surface *surface, const double from_mm[3],
			   const double to_mm[3], struct incise_touch *touch)
{
	struct mesh_spot spot;
	double from[3], to[3];

	surface_place(from, from_mm);
	surface_place(to, to_mm);
	if (surface->kind == INCISE_SURFACE_PLANE)
		return plane_enters(&surface->plane, from, to, touch);
	if (!surface->mesh)
		return capsule_enters(&surface->capsule, from, to, touch);
	if (!mesh_enters(surface->mesh, from, to, 0, &spot))
		return false;
	mesh_touch(surface->mesh, &spot, spot.point, touch);
	touch->depth_mm = 0;
	return true;
}
