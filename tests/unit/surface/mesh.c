// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Places on a mesh: normals, texture coordinates, fans, highest place.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <incise/surface.h>
#include "solid.h"

/* On a cube the normals of edges and corners are known, however its sides are cut. */
static void test_normals_of_a_cube(void **state)
{
	struct solid *s = solid_cube();
	struct incise_surface *surface = solid_surface(s);

	for (int k = 0; k < 27; k++) {
		/* each of the cube's 26 parts, looked at from outside and from inside */
		double p[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1}, out[3], near[3];
		struct incise_touch touch;

		if (!v3_unit(out, p, 0.5))
			continue;
		v3_add(near, p, 0.5, out);
		incise_surface_nearest(surface, near, &touch);
		assert_true(v3_distance2(touch.point_mm, p) < 1e-30);
		assert_true(v3_distance2(touch.normal, out) < 1e-28);
		assert_true(fabs(touch.depth_mm + 0.5) < 1e-15);
		v3_add(near, p, -0.25, out);
		incise_surface_nearest(surface, near, &touch);
		assert_true(touch.depth_mm > 0);
	}
	incise_surface_free(surface);
	free(s);
}

/*
 * The case for normals weighted by angle (Bærentzen & Aanæs): a corner with many small
 * faces on one side. The sign is right all around it.
 */
static void test_sign_at_a_lopsided_corner(void **state)
{
	struct solid *s = solid_new();
	struct incise_surface *surface;
	uint64_t random = 88172645463325252u;
	uint32_t top, base;
	int n = 40;

	/* a pyramid whose one side is cut into many thin faces */
	top = solid_point(s, 0, 0, 1);
	base = solid_point(s, 0, 0, -1);
	for (int i = 0; i <= n; i++)
		solid_point(s, 1, -1 + 2.0 * i / n, -1);
	solid_point(s, -3, 1, -1);
	solid_point(s, -3, -1, -1);
	for (int i = 0; i < n + 3; i++) {
		uint32_t a = base + 1 + (uint32_t)i;
		uint32_t b = base + 1 + (uint32_t)((i + 1) % (n + 3));

		solid_face(s, top, a, b);
		solid_face(s, base, b, a);
	}
	surface = solid_surface(s);
	for (int k = 0; k < 20000; k++) {
		struct incise_touch touch;
		double p[3];
		bool inside;

		for (int i = 0; i < 3; i++)
			p[i] = (i == 2) + 0.3 * (2 * solid_random(&random) - 1);
		/* a convex pyramid: behind the planes of all its sides */
		inside = true;
		for (uint32_t f = 0; f < s->n_triangles; f += 2) {
			const uint32_t *c = s->corner[f];
			double normal[3], out[3];

			triangle_area_normal(normal, s->point[c[0]], s->point[c[1]],
					     s->point[c[2]]);
			v3_sub(out, p, s->point[top]);
			inside = inside && v3_dot(out, normal) < 0;
		}
		incise_surface_nearest(surface, p, &touch);
		assert_int_equal(inside, touch.depth_mm > 0);
	}
	incise_surface_free(surface);
	free(s);
}

/* A map of the plane onto texture: u and v follow the proxy linearly. */
static void test_texture_follows_the_proxy(void **state)
{
	struct solid *s = solid_new();
	struct incise_surface *surface;
	struct incise_proxy proxy;

	for (int j = 0; j <= 10; j++)
		for (int i = 0; i <= 10; i++)
			solid_point(s, i, j, 0.1 * ((i ^ j) & 1));
	for (uint32_t j = 0; j < 10; j++) {
		for (uint32_t i = 0; i < 10; i++) {
			uint32_t a = j * 11 + i;

			solid_square(s, a, a + 1, a + 12, a + 11);
		}
	}
	s->textured = true;
	for (uint32_t f = 0; f < s->n_triangles; f++) {
		for (int k = 0; k < 3; k++) {
			const double *p = s->point[s->corner[f][k]];

			s->uv[f][k][0] = (float)(0.1 * p[0] + 0.02 * p[1]);
			s->uv[f][k][1] = (float)(1 - 0.1 * p[1]);
		}
	}
	surface = solid_surface(s);
	incise_proxy_init(&proxy, surface, 0.05);
	incise_proxy_move(&proxy, (double[3]){1, 1, -0.2});
	for (int k = 0; k < 2000; k++) {
		const double *p = proxy.touch.point_mm;

		incise_proxy_move(&proxy, (double[3]){1 + 0.004 * k,
						      5 + 4 * sin(0.01 * k), -0.2});
		assert_true(proxy.touching);
		/* floats */
		assert_true(fabs(proxy.touch.uv[0] - 0.1 * p[0] - 0.02 * p[1]) < 2e-7);
		assert_true(fabs(proxy.touch.uv[1] - 1 + 0.1 * p[1]) < 2e-7);
		assert_true(proxy.touch.face >= 0 && proxy.touch.face < 200);
		/* the file's face is the one below the proxy */
		assert_true(solid_triangle_distance(
				    s->point[s->corner[proxy.touch.face][0]],
				    s->point[s->corner[proxy.touch.face][1]],
				    s->point[s->corner[proxy.touch.face][2]], p) < 1e-14);
	}
	incise_surface_free(surface);
	free(s);
}

static void test_top(void **state)
{
	static const double ridge[][2] = {{2, 0}, {0.5, 1}, {-1, 0}};
	struct solid *s = solid_cube();
	struct incise_surface *surface = solid_surface(s);
	struct incise_touch touch;

	/* a flat top: its middle */
	incise_surface_top(surface, &touch);
	assert_true(v3_distance2(touch.point_mm, (double[3]){0, 0, 1}) < 1e-30);
	assert_true(touch.depth_mm == 0 && touch.normal[2] == 1);
	incise_surface_free(surface);
	free(s);
	/* a ridge: the middle of it */
	s = solid_profile(ridge, 3, 3);
	surface = solid_surface(s);
	incise_surface_top(surface, &touch);
	assert_true(v3_distance2(touch.point_mm, (double[3]){0.5, 0, 1}) < 1e-30);
	incise_surface_free(surface);
	free(s);
	/* a tip */
	s = solid_sphere(3, 2);
	surface = solid_surface(s);
	incise_surface_top(surface, &touch);
	assert_true(v3_distance2(touch.point_mm, (double[3]){0, 0, 3}) < 1e-30);
	incise_surface_free(surface);
	free(s);
}

/* Triangles down to a height of 1e-7 of their length, against points tried on them. */
static void test_slivers_nearest(void **state)
{
	uint64_t random = 88172645463325252u;

	for (int k = 0; k < 2000; k++) {
		double point[3][3], p[3], x[3], truth = INFINITY;
		const double *const corner[3] = {point[0], point[1], point[2]};
		double height = pow(10, -7 * solid_random(&random));

		for (int i = 0; i < 3; i++) {
			p[i] = 4 * solid_random(&random) - 2;
			point[0][i] = solid_random(&random);
			point[1][i] = solid_random(&random);
			/* near the line of the two others */
			point[2][i] = point[0][i] + 0.4 * (point[1][i] - point[0][i]) +
				      height * solid_random(&random);
		}
		triangle_nearest(corner, p, x);
		/* a search over the triangle, with the finer direction along its base */
		for (int a = 0; a <= 200; a++) {
			for (int b = 0; b <= 4; b++) {
				double y[3], s = a / 200.0, t = b / 4.0 * (1 - s);

				for (int i = 0; i < 3; i++)
					y[i] = point[0][i] +
					       s * (point[1][i] - point[0][i]) +
					       t * (point[2][i] - point[0][i]);
				truth = fmin(truth, v3_distance2(p, y));
			}
		}
		/* nothing that was tried is nearer, but for the rounding of a sliver's plane */
		assert_true(sqrt(v3_distance2(p, x)) <= sqrt(truth) + 1e-9);
		/* and the point is one of the triangle */
		if (height > 1e-3)
			assert_true(solid_triangle_distance(point[0], point[1], point[2],
							    x) < 1e-11);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_normals_of_a_cube),
		cmocka_unit_test(test_sign_at_a_lopsided_corner),
		cmocka_unit_test(test_texture_follows_the_proxy),
		cmocka_unit_test(test_top),
		cmocka_unit_test(test_slivers_nearest),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
