// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Surfaces of all kinds: making, asking, freeing.
 */
#include <errno.h>
#include <stdlib.h>
#include "../base/vector.h"
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

static struct incise_surface *refuse_surface(struct incise_error *err, const char *what,
					     const char *expected)
{
	return INCISE_ERROR_NULL(err, EINVAL, "%s: expected %s", what, expected);
}

static const char coordinates[] = "numbers of mm, at most 1e5";

struct incise_surface *incise_surface_new_plane(const double point_mm[3],
						const double normal[3],
						struct incise_error *err)
{
	struct incise_surface *surface;
	double largest = fmax(fabs(normal[0]), fmax(fabs(normal[1]), fabs(normal[2])));

	if (!within_reach(point_mm))
		return refuse_surface(err, "the plane's point", coordinates);
	if (!v3_finite(normal) || !(largest > 0))
		return refuse_surface(err, "the plane's normal", "numbers, not all 0");
	surface = surface_new(INCISE_SURFACE_PLANE, err);
	if (!surface)
		return NULL;
	v3_copy(surface->plane.point, point_mm);
	/* A vector is scaled first, so that no square overflows or vanishes. */
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
		return refuse_surface(
			err, sphere ? "the sphere's centre" : "the capsule's ends",
			coordinates);
	if (!(radius_mm >= 1e-6 && radius_mm <= MESH_COORDINATE_MAX_MM))
		return refuse_surface(
			err, sphere ? "the sphere's radius" : "the capsule's radius",
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

static struct incise_surface *load_surface(enum incise_surface_kind kind,
					   const char *path, const double at_mm[3],
					   bool cavity, struct incise_error *err)
{
	struct incise_surface *surface;

	if (!within_reach(at_mm))
		return refuse_surface(err, path, "at a position in mm, at most 1e5");
	surface = surface_new(kind, err);
	if (!surface)
		return NULL;
	surface->mesh = kind == INCISE_SURFACE_MESH ? obj_load(path, at_mm, cavity, err)
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
						bool cavity, struct incise_error *err)
{
	return load_surface(INCISE_SURFACE_MESH, path, at_mm, cavity, err);
}

struct incise_surface *incise_surface_load_heights(const char *path,
						   const double at_mm[3],
						   struct incise_error *err)
{
	return load_surface(INCISE_SURFACE_HEIGHTS, path, at_mm, false, err);
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

static void touch_capsule_top(const struct capsule *capsule, struct incise_touch *touch)
{
	double a = capsule->a[2], b = capsule->b[2], top[3];

	for (int i = 0; i < 3; i++)
		top[i] = a > b	 ? capsule->a[i]
			 : b > a ? capsule->b[i]
				 : capsule->a[i] / 2 + capsule->b[i] / 2;
	top[2] += capsule->radius;
	capsule_nearest(capsule, top, (const double[3]){0, 0, 1}, touch);
	touch->depth_mm = 0;
}

void incise_surface_top(const struct incise_surface *surface, struct incise_touch *touch)
{
	if (surface->kind == INCISE_SURFACE_PLANE)
		plane_nearest(&surface->plane, surface->plane.point, touch);
	else if (surface->mesh)
		mesh_top(surface->mesh, touch);
	else
		touch_capsule_top(&surface->capsule, touch);
}

bool incise_surface_size(const struct incise_surface *surface,
			 struct incise_surface_size *size)
{
	if (surface->mesh)
		mesh_size(surface->mesh, size);
	return surface->mesh;
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
	if (!mesh_enters(surface->mesh, from, to, 0, 0, &spot))
		return false;
	mesh_touch(surface->mesh, &spot, spot.point, touch);
	touch->depth_mm = 0;
	return true;
}

/*
 * Plane and capsule in closed form.
 *
 *            ╭───────────────────╮
 *            │   a ───────── b   │  radius around the segment from a to b
 *            ╰───────────────────╯
 */

/* Nothing of a mesh. */
static void no_face(struct incise_touch *touch)
{
	touch->face = -1;
	touch->uv[0] = touch->uv[1] = 0;
}

void plane_nearest(const struct plane *plane, const double p[3],
		   struct incise_touch *touch)
{
	double out[3];

	no_face(touch);
	v3_sub(out, p, plane->point);
	touch->depth_mm = -v3_dot(out, plane->normal);
	v3_copy(touch->normal, plane->normal);
	v3_add(touch->point_mm, p, touch->depth_mm, plane->normal);
}

bool plane_enters(const struct plane *plane, const double from[3], const double to[3],
		  struct incise_touch *touch)
{
	double out[3], way[3], above, below;

	v3_sub(out, from, plane->point);
	above = v3_dot(out, plane->normal);
	v3_sub(out, to, plane->point);
	below = v3_dot(out, plane->normal);
	if (!(above >= 0 && below <= 0 && above > below))
		return false;
	v3_sub(way, to, from);
	v3_add(out, from, above / (above - below), way);
	plane_nearest(plane, out, touch);
	touch->depth_mm = 0;
	return true;
}

/* A unit vector across the axis, towards @preferred where that is possible. */
static void across(const double axis[3], const double preferred[3], double normal[3])
{
	const double *const tries[] = {preferred, (const double[3]){0, 0, 1},
				       (const double[3]){1, 0, 0}};
	double side[3];

	for (int i = 0; i < 3; i++) {
		v3_add(side, tries[i], -v3_dot(tries[i], axis), axis);
		if (v3_unit(normal, side, 1e-6))
			return;
	}
}

void capsule_nearest(const struct capsule *capsule, const double p[3],
		     const double last[3], struct incise_touch *touch)
{
	double axis[3], ap[3], on[3], out[3], length2, t = 0, distance;

	no_face(touch);
	v3_sub(axis, capsule->b, capsule->a);
	v3_sub(ap, p, capsule->a);
	length2 = v3_dot(axis, axis);
	if (length2 > 0)
		t = fmin(fmax(v3_dot(ap, axis) / length2, 0), 1);
	v3_add(on, capsule->a, t, axis);
	v3_sub(out, p, on);
	distance = v3_length(out);
	touch->depth_mm = capsule->radius - distance;
	/* Nearer to the axis than a double resolves there is no direction. */
	if (!v3_unit(touch->normal, out, 1e-12 * capsule->radius)) {
		double unit[3] = {0}, ahead;

		v3_unit(unit, axis, 0);
		ahead = v3_dot(last, unit);
		/* At an end the half sphere beyond it is as near. */
		if ((t == 0 && ahead <= 0) || (t == 1 && ahead >= 0))
			v3_copy(touch->normal, last);
		else
			across(unit, last, touch->normal);
	}
	v3_add(touch->point_mm, on, capsule->radius, touch->normal);
}

/*
 * Where a line from outside meets a ball or, with an axis, the wall of a cylinder through
 * its centre: mm along the line, whose @way is a unit vector; INFINITY where it does not.
 */
static double meets(const double from[3], const double way[3], const double centre[3],
		    const double *axis, double radius)
{
	double m[3], d[3], side[3], along, dd, rest;

	v3_sub(m, from, centre);
	v3_copy(d, way);
	if (axis) {
		v3_add(m, m, -v3_dot(m, axis), axis);
		v3_add(d, d, -v3_dot(d, axis), axis);
	}
	dd = v3_dot(d, d);
	along = -v3_dot(m, d);
	if (!(along >= 0) || !(dd > 1e-24))
		return INFINITY;
	along /= dd;
	/* The line's nearest point first: from far away the difference of squares is lost. */
	v3_add(side, m, along, d);
	rest = radius * radius - v3_dot(side, side);
	if (!(rest >= 0))
		return INFINITY;
	/* A start on the surface may come out a rounding before it. */
	return fmax(along - sqrt(rest / dd), 0);
}

bool capsule_enters(const struct capsule *capsule, const double from[3],
		    const double to[3], struct incise_touch *touch)
{
	const double up[3] = {0, 0, 1};
	double way[3], unit[3] = {0}, axis[3], point[3], length, axis_length, first;

	v3_sub(way, to, from);
	length = v3_length(way);
	capsule_nearest(capsule, from, up, touch);
	/* Only from outside: more than rounding within is inside. */
	if (!v3_unit(unit, way, 0) || touch->depth_mm > 1e-12 * capsule->radius)
		return false;
	first = fmin(meets(from, unit, capsule->a, NULL, capsule->radius),
		     meets(from, unit, capsule->b, NULL, capsule->radius));
	v3_sub(way, capsule->b, capsule->a);
	axis_length = v3_length(way);
	if (v3_unit(axis, way, 0)) {
		double wall = meets(from, unit, capsule->a, axis, capsule->radius), at;

		if (wall < first) {
			v3_add(point, from, wall, unit);
			v3_sub(way, point, capsule->a);
			at = v3_dot(way, axis);
			if (at >= 0 && at <= axis_length)
				first = wall;
		}
	}
	if (!(first <= length))
		return false;
	v3_add(point, from, first, unit);
	capsule_nearest(capsule, point, up, touch);
	touch->depth_mm = 0;
	return true;
}
