/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The point of a triangle that is nearest to a point, and the part of the triangle that
 * it lies on.
 *
 *              c               FACE          within
 *            ╱   ╲             EDGE + i      between corner i and the next
 *    EDGE+2 ╱     ╲ EDGE+1     CORNER + i    at corner i
 *          ╱       ╲
 *         a ─────── b          seen from outside: a, b, c turn counter-clockwise
 *           EDGE+0
 *
 * Which part it is comes from signs, not from a distance to a border, and the point on an
 * edge is computed from the edge's two ends only, in an order of their own. So the two
 * faces of an edge, and all faces around a corner, find the same point to the bit, and a
 * walk from face to face needs no epsilon.
 */
#ifndef INCISE_TRIANGLE_H
#define INCISE_TRIANGLE_H

#include "../base/vector.h"

enum triangle_part { TRIANGLE_FACE = 0, TRIANGLE_EDGE = 1, TRIANGLE_CORNER = 4 };

static inline double v3_distance2(const double a[3], const double b[3])
{
	double d[3];

	v3_sub(d, a, b);
	return v3_dot(d, d);
}

/* Outward, as long as twice the area. */
static inline void triangle_area_normal(double n[3], const double *a, const double *b,
					const double *c)
{
	double ab[3], ac[3];

	v3_sub(ab, b, a);
	v3_sub(ac, c, a);
	v3_cross(n, ab, ac);
}

/* Towards the inside of the triangle at its edge from a to b: > 0 inside of it. */
static inline double triangle_side(const double n[3], const double *a, const double *b,
				   const double p[3])
{
	double ab[3], in[3], ap[3];

	v3_sub(ab, b, a);
	v3_sub(ap, p, a);
	v3_cross(in, n, ab);
	return v3_dot(in, ap);
}

/*
 * The nearest point of an edge; @end is 0 at a, 1 at b, -1 between them. Its ends are
 * taken in the order of their addresses, which both faces of the edge agree on.
 */
static inline void triangle_edge_nearest(const double *a, const double *b,
					 const double p[3], double x[3], int *end)
{
	const double *lo = a < b ? a : b, *hi = a < b ? b : a;
	double e[3], w[3], along, whole;

	v3_sub(e, hi, lo);
	v3_sub(w, p, lo);
	along = v3_dot(w, e);
	whole = v3_dot(e, e);
	*end = -1;
	if (along <= 0) {
		v3_copy(x, lo);
		*end = lo == b;
	} else if (along >= whole) {
		v3_copy(x, hi);
		*end = hi == b;
	} else {
		v3_add(x, lo, along / whole, e);
	}
}

/* The nearest point of the triangle to p, and its part. Slivers are as good as others. */
static inline int triangle_nearest(const double *const corner[3], const double p[3],
				   double x[3])
{
	double n[3], best = INFINITY;
	bool outside = false;
	int part = TRIANGLE_FACE;

	triangle_area_normal(n, corner[0], corner[1], corner[2]);
	for (int i = 0; i < 3; i++) {
		const double *a = corner[i], *b = corner[i == 2 ? 0 : i + 1];
		double y[3], d;
		int end;

		if (triangle_side(n, a, b, p) >= 0)
			continue;
		outside = true;
		triangle_edge_nearest(a, b, p, y, &end);
		d = v3_distance2(y, p);
		if (!(d < best))
			continue;
		best = d;
		v3_copy(x, y);
		part = end < 0	  ? TRIANGLE_EDGE + i
		       : end == 0 ? TRIANGLE_CORNER + i
				  : TRIANGLE_CORNER + (i == 2 ? 0 : i + 1);
	}
	if (!outside) {
		double ap[3];

		v3_sub(ap, p, corner[0]);
		v3_add(x, p, -v3_dot(ap, n) / v3_dot(n, n), n);
	}
	return part;
}

#endif
