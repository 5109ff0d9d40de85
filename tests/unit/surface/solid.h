/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Small meshes made in memory, and what they are held against: searches through all
 * triangles by other formulas than the library's.
 */
#ifndef INCISE_TEST_SOLID_H
#define INCISE_TEST_SOLID_H

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/surface/surface.h"

/* Points and triangles, with room for more. */
struct solid {
	uint32_t n_points, n_triangles;
	double point[13000][3];
	uint32_t corner[24000][3];
	float uv[24000][3][2];
	bool textured;
};

static inline uint32_t solid_point(struct solid *s, double x, double y, double z)
{
	double *p = s->point[s->n_points];

	p[0] = x;
	p[1] = y;
	p[2] = z;
	return s->n_points++;
}

static inline void solid_face(struct solid *s, uint32_t a, uint32_t b, uint32_t c)
{
	uint32_t *corner = s->corner[s->n_triangles++];

	corner[0] = a;
	corner[1] = b;
	corner[2] = c;
}

/* Four corners, counter-clockwise. */
static inline void solid_square(struct solid *s, uint32_t a, uint32_t b, uint32_t c,
				uint32_t d)
{
	solid_face(s, a, b, c);
	solid_face(s, a, c, d);
}

static inline struct solid *solid_new(void)
{
	struct solid *s = calloc(1, sizeof(*s));

	if (!s)
		abort();
	return s;
}

static inline struct incise_surface *solid_surface(struct solid *s)
{
	struct incise_surface *surface = calloc(1, sizeof(*surface));
	struct incise_error err = {0};
	struct mesh_draft draft = {.path = "solid",
				   .n_points = s->n_points,
				   .n_triangles = s->n_triangles,
				   .point = s->point,
				   .corner = s->corner,
				   .uv = s->textured ? s->uv : NULL};

	if (!surface)
		abort();
	surface->kind = INCISE_SURFACE_MESH;
	surface->mesh = mesh_new(&draft, &err);
	if (!surface->mesh)
		abort();
	return surface;
}

/* The cube from -1 to 1. */
static inline struct solid *solid_cube(void)
{
	struct solid *s = solid_new();

	for (int k = 0; k < 8; k++)
		solid_point(s, k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
	solid_square(s, 4, 5, 7, 6); /* +z */
	solid_square(s, 0, 2, 3, 1);
	solid_square(s, 1, 3, 7, 5); /* +x */
	solid_square(s, 0, 4, 6, 2);
	solid_square(s, 2, 6, 7, 3); /* +y */
	solid_square(s, 0, 1, 5, 4);
	return s;
}

/*
 * A profile in x and z, drawn out along y from -10 to 10 in @n strips: tissue below,
 * points from the largest x to the smallest.
 */
static inline struct solid *solid_profile(const double (*profile)[2], int points, int n)
{
	struct solid *s = solid_new();

	for (int j = 0; j <= n; j++)
		for (int i = 0; i < points; i++)
			solid_point(s, profile[i][0], -10 + 20.0 * j / n, profile[i][1]);
	for (int j = 0; j < n; j++) {
		for (int i = 0; i + 1 < points; i++) {
			uint32_t a = (uint32_t)(j * points + i), b = a + (uint32_t)points;

			solid_square(s, a, b, b + 1, a + 1);
		}
	}
	return s;
}

/* An octahedron, each of its faces cut into four @times over, on a sphere. */
static inline struct solid *solid_sphere(double radius, int times)
{
	static const double axis[6][3] = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
					  {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
	struct solid *s = solid_new(), *fine;

	for (int k = 0; k < 6; k++)
		solid_point(s, axis[k][0] * radius, axis[k][1] * radius,
			    axis[k][2] * radius);
	for (uint32_t k = 0; k < 8; k++) {
		uint32_t x = k & 1, y = 2 + (k >> 1 & 1), z = 4 + (k >> 2 & 1);
		bool odd = ((k & 1) + (k >> 1 & 1) + (k >> 2 & 1)) & 1;

		solid_face(s, x, odd ? z : y, odd ? y : z);
	}
	for (; times; times--) {
		fine = solid_new();
		for (uint32_t f = 0; f < s->n_triangles; f++) {
			uint32_t id[6];

			for (int i = 0; i < 6; i++) {
				const double *a = s->point[s->corner[f][i % 3]];
				const double *b = s->point[s->corner[f][(i + 1) % 3]];
				double p[3], scale;

				/* The first three are the corners, then their middles. */
				for (int k = 0; k < 3; k++)
					p[k] = i < 3 ? a[k] : a[k] + b[k];
				scale = i < 3 ? 1 : radius / v3_length(p);
				id[i] = solid_point(fine, p[0] * scale, p[1] * scale,
						    p[2] * scale);
			}
			solid_face(fine, id[0], id[3], id[5]);
			solid_face(fine, id[3], id[1], id[4]);
			solid_face(fine, id[5], id[4], id[2]);
			solid_face(fine, id[3], id[4], id[5]);
		}
		/* Middles are made twice, bit by bit the same: welding joins them. */
		free(s);
		s = fine;
	}
	return s;
}

/* Uniform in 0…1, the same in every run. */
static inline double solid_random(uint64_t *state)
{
	*state ^= *state << 13;
	*state ^= *state >> 7;
	*state ^= *state << 17;
	return (double)(*state >> 11) * 0x1p-53;
}

/* Nearest point of a triangle by barycentric regions (Ericson 2005), not by sides. */
static inline double solid_triangle_distance(const double *a, const double *b,
					     const double *c, const double p[3])
{
	double ab[3], ac[3], ap[3], bp[3], cp[3], x[3], d1, d2, d3, d4, d5, d6, va, vb,
		vc;

	v3_sub(ab, b, a);
	v3_sub(ac, c, a);
	v3_sub(ap, p, a);
	v3_sub(bp, p, b);
	v3_sub(cp, p, c);
	d1 = v3_dot(ab, ap);
	d2 = v3_dot(ac, ap);
	d3 = v3_dot(ab, bp);
	d4 = v3_dot(ac, bp);
	d5 = v3_dot(ab, cp);
	d6 = v3_dot(ac, cp);
	vc = d1 * d4 - d3 * d2;
	vb = d5 * d2 - d1 * d6;
	va = d3 * d6 - d5 * d4;
	if (d1 <= 0 && d2 <= 0)
		return v3_length(ap);
	if (d3 >= 0 && d4 <= d3)
		return v3_length(bp);
	if (d6 >= 0 && d5 <= d6)
		return v3_length(cp);
	if (vc <= 0 && d1 >= 0 && d3 <= 0) {
		v3_add(x, a, d1 / (d1 - d3), ab);
	} else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
		v3_add(x, a, d2 / (d2 - d6), ac);
	} else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
		double bc[3];

		v3_sub(bc, c, b);
		v3_add(x, b, (d4 - d3) / (d4 - d3 + d5 - d6), bc);
	} else {
		v3_add(x, a, vb / (va + vb + vc), ab);
		v3_add(x, x, vc / (va + vb + vc), ac);
	}
	v3_sub(x, x, p);
	return v3_length(x);
}

static inline double solid_distance(const struct solid *s, const double p[3])
{
	double best = INFINITY;

	for (uint32_t f = 0; f < s->n_triangles; f++) {
		const uint32_t *c = s->corner[f];

		best = fmin(best, solid_triangle_distance(s->point[c[0]], s->point[c[1]],
							  s->point[c[2]], p));
	}
	return best;
}

/* The first front face on a way, as a part of it; 2 where there is none. */
static inline double solid_enters(const struct solid *s, const double from[3],
				  const double to[3])
{
	double way[3], best = 2;

	v3_sub(way, to, from);
	for (uint32_t f = 0; f < s->n_triangles; f++) {
		const double *a = s->point[s->corner[f][0]];
		const double *b = s->point[s->corner[f][1]];
		const double *c = s->point[s->corner[f][2]];
		double ab[3], ac[3], n[3], af[3], q[3], fall, t, u, v;

		v3_sub(ab, b, a);
		v3_sub(ac, c, a);
		v3_cross(n, ab, ac);
		fall = -v3_dot(way, n);
		v3_sub(af, from, a);
		v3_cross(q, af, way);
		t = v3_dot(af, n) / fall;
		u = v3_dot(ac, q) / fall;
		v = -v3_dot(ab, q) / fall;
		if (fall > 0 && t >= 0 && t <= 1 && u >= 0 && v >= 0 && u + v <= 1)
			best = fmin(best, t);
	}
	return best;
}

#endif
