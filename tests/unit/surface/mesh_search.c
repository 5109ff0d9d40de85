// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Searches by the tree of boxes against searches through all triangles.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include "solid.h"

/* Coordinates of some 10 mm, and formulas of some ten operations. */
#define ROUNDING_MM 1e-12

/* Triangles anywhere, of any size, that have nothing to do with each other. */
static struct solid *soup(uint64_t *random, int n)
{
	struct solid *s = solid_new();

	for (int f = 0; f < n; f++) {
		double at[3], size = pow(10, -3 + 4 * solid_random(random));

		for (int i = 0; i < 3; i++)
			at[i] = 20 * solid_random(random) - 10;
		for (int k = 0; k < 3; k++)
			solid_point(s, at[0] + size * solid_random(random),
				    at[1] + size * solid_random(random),
				    at[2] + size * solid_random(random));
		solid_face(s, 3 * (uint32_t)f, 3 * (uint32_t)f + 1, 3 * (uint32_t)f + 2);
	}
	return s;
}

static void test_nearest_is_nearest(void **state)
{
	static const int sizes[] = {1, 2, 3, 4, 5, 8, 9, 100, 1000};
	uint64_t random = 88172645463325252u;

	for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
		struct solid *s = soup(&random, sizes[k]);
		struct incise_surface *surface = solid_surface(s);

		for (int i = 0; i < 300; i++) {
			double reach = i % 3 ? 12 : 1000, p[3], truth, bound;
			uint32_t hint = (uint32_t)(solid_random(&random) * 2000);
			struct mesh_spot spot;

			for (int j = 0; j < 3; j++)
				p[j] = reach * (2 * solid_random(&random) - 1);
			truth = solid_distance(s, p);
			bound = mesh_nearest(surface->mesh, p, hint, 1, &spot);
			/* the billionth that the bound gives away */
			assert_true(bound <= truth && bound >= truth * (1 - 2e-9));
			/* from far away the distance itself is rounded */
			assert_true(fabs(sqrt(v3_distance2(spot.point, p)) - truth) <=
				    ROUNDING_MM * (1 + reach));
			/* A shorter search tells less, and nothing wrong. */
			bound = mesh_nearest(surface->mesh, p, hint, 0.5, &spot);
			assert_true(bound <= truth && bound >= truth * (0.5 - 1e-9));
			assert_true(sqrt(v3_distance2(spot.point, p)) <= 2.001 * truth);
		}
		incise_surface_free(surface);
		free(s);
	}
}

static void test_enters_where_all_triangles_say(void **state)
{
	static const int sizes[] = {1, 4, 5, 100, 1000};
	uint64_t random = 88172645463325252u;
	int found = 0;

	for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
		struct solid *s = soup(&random, sizes[k]);
		struct incise_surface *surface = solid_surface(s);

		for (int i = 0; i < 500; i++) {
			double from[3], to[3], way[3], x[3], truth;
			struct incise_touch touch;
			bool enters;

			for (int j = 0; j < 3; j++) {
				from[j] = 24 * solid_random(&random) - 12;
				/* some along an axis */
				to[j] = i % 5 == 0 && j ? from[j]
							: 24 * solid_random(&random) - 12;
			}
			truth = solid_enters(s, from, to);
			enters = incise_surface_enters(surface, from, to, &touch);
			assert_int_equal(enters, truth <= 1);
			if (!enters)
				continue;
			found++;
			v3_sub(way, to, from);
			v3_add(x, from, truth, way);
			/* a way along a face meets it at a point that is badly known */
			assert_true(sqrt(v3_distance2(touch.point_mm, x)) < 1e-9);
			assert_true(touch.depth_mm == 0);
			assert_true(v3_dot(way, touch.normal) < 0);
		}
		incise_surface_free(surface);
		free(s);
	}
	assert_true(found > 100);
}

/* A closed mesh against the sphere that it is cut of: sign, distance and normal. */
static void test_sphere_of_triangles(void **state)
{
	struct solid *s = solid_sphere(10, 5);
	struct incise_surface *surface = solid_surface(s);
	uint64_t random = 88172645463325252u;
	double sag = 0;

	/* how far a face lies within the sphere, and as a mesh nothing lies deeper */
	for (uint32_t f = 0; f < s->n_triangles; f++) {
		const double *a = s->point[s->corner[f][0]];
		double n[3];

		triangle_area_normal(n, a, s->point[s->corner[f][1]],
				     s->point[s->corner[f][2]]);
		sag = fmax(sag, 10 - v3_dot(n, a) / v3_length(n));
	}
	assert_true(sag > 0 && sag < 0.02);

	for (int i = 0; i < 2000; i++) {
		struct incise_touch touch;
		double p[3], depth, out[3];

		for (int j = 0; j < 3; j++)
			p[j] = 40 * solid_random(&random) - 20;
		depth = 10 - v3_length(p);
		incise_surface_nearest(surface, p, &touch);
		assert_true(touch.depth_mm <= depth + ROUNDING_MM &&
			    touch.depth_mm >= depth - sag);
		assert_true(fabs(v3_length(touch.normal) - 1) < 1e-12);
		v3_sub(out, touch.point_mm, p);
		assert_true(fabs(v3_length(out) - fabs(touch.depth_mm)) < ROUNDING_MM);
		/* An edge turns by 2.8° at most, and so does the normal from the radius. */
		if (fabs(depth) > 1 && depth < 9) {
			v3_unit(out, p, 0);
			assert_true(v3_dot(out, touch.normal) > cos(0.1));
		}
	}
	/* In the middle all is equally near; the places asked about are not quite there. */
	for (int i = 0; i < 3; i++) {
		struct incise_touch touch;

		incise_surface_nearest(surface, (double[3]){0, 0, 1e-12 * i}, &touch);
		assert_true(fabs(touch.depth_mm - 10) <= sag + 1e-11);
	}
	incise_surface_free(surface);
	free(s);
}

/*
 * Nothing slips through: ways aimed exactly at corners and along edges, from corners'
 * own places and with coordinates that no double holds exactly.
 */
static void test_no_way_slips_through(void **state)
{
	struct solid *s = solid_sphere(10 / 3.0, 3);
	struct incise_surface *surface = solid_surface(s);
	uint64_t random = 88172645463325252u;

	for (uint32_t f = 0; f < s->n_triangles; f++) {
		for (int i = 0; i < 3; i++) {
			const double *a = s->point[s->corner[f][i]];
			const double *b = s->point[s->corner[f][(i + 1) % 3]];
			double t = solid_random(&random), aim[3], from[3], to[3];
			double end = 0.9 * solid_random(&random) - 0.5;
			struct incise_touch touch;

			for (int j = 0; j < 3; j++) {
				aim[j] = i ? a[j] + t * (b[j] - a[j]) : a[j];
				from[j] = aim[j] * 3;
				to[j] = aim[j] * end;
			}
			assert_true(incise_surface_enters(surface, from, to, &touch));
			assert_true(v3_distance2(touch.point_mm, aim) < 1e-20);
			/* from the corner itself inwards, and not outwards */
			v3_copy(aim, a);
			assert_true(incise_surface_enters(surface, aim, to, &touch));
			assert_false(incise_surface_enters(surface, to, from, &touch));
		}
	}
	incise_surface_free(surface);
	free(s);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_nearest_is_nearest),
		cmocka_unit_test(test_enters_where_all_triangles_say),
		cmocka_unit_test(test_sphere_of_triangles),
		cmocka_unit_test(test_no_way_slips_through),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
