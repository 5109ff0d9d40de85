// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Making surfaces of each kind, and asking what they are.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <float.h>
#include <incise/surface.h>
#include "solid.h"

static const double zero[3], bad[3] = {0, NAN, 0}, far[3] = {0, 0, 1e300};

static void refused(struct incise_surface *surface, const struct incise_error *err)
{
	assert_null(surface);
	assert_int_equal(errno, EINVAL);
	assert_int_equal(err->code, EINVAL);
	assert_non_null(strstr(err->text, "expected"));
}

static void test_refused(void **state)
{
	static const double radii[] = {0, -1, NAN, INFINITY, 1e300, 5e-324};
	struct incise_error err = {0};

	refused(incise_surface_new_plane(bad, zero, &err), &err);
	refused(incise_surface_new_plane(zero, zero, &err), &err);
	refused(incise_surface_new_plane(zero, bad, &err), &err);
	refused(incise_surface_new_plane(far, far, &err), &err);
	refused(incise_surface_new_plane(zero, (double[3]){INFINITY, 0, 0}, &err), &err);
	refused(incise_surface_new_sphere(bad, 1, &err), &err);
	refused(incise_surface_new_capsule(zero, far, 1, &err), &err);
	for (size_t k = 0; k < sizeof(radii) / sizeof(*radii); k++) {
		refused(incise_surface_new_sphere(zero, radii[k], &err), &err);
		refused(incise_surface_new_capsule(zero, zero, radii[k], &err), &err);
	}
	incise_surface_free(NULL);
}

/* Normals of any length, however odd. */
static void test_normals_of_any_length(void **state)
{
	static const double lengths[] = {1, 5e-324, 1e-200, 1e200, DBL_MAX};

	for (size_t k = 0; k < sizeof(lengths) / sizeof(*lengths); k++) {
		struct incise_surface *surface = incise_surface_new_plane(
			zero, (double[3]){0, -lengths[k], lengths[k]}, NULL);
		struct incise_touch touch;

		assert_non_null(surface);
		incise_surface_nearest(surface, (double[3]){0, 0, 1}, &touch);
		assert_true(fabs(touch.depth_mm + sqrt(0.5)) < 1e-15);
		assert_true(fabs(touch.normal[2] - sqrt(0.5)) < 1e-15);
		incise_surface_free(surface);
	}
}

/* Squares of such places overflow; on a mesh no triangle was near one, and one was read. */
static void test_places_beyond_all(void **state)
{
	static const double places[][3] = {{1e308, 0, 0},     {0, -DBL_MAX, DBL_MAX},
					   {1e155, 1e155, 3}, {INFINITY, 0, 0},
					   {0, NAN, 0},	      {1e9, -1e9, 1e9}};
	struct solid *cube = solid_cube();
	struct incise_surface *surfaces[4];

	surfaces[0] = incise_surface_new_plane(zero, (double[3]){0, 0, 1}, NULL);
	surfaces[1] = incise_surface_new_sphere(zero, 10, NULL);
	surfaces[2] = incise_surface_new_capsule(zero, (double[3]){9, 0, 0}, 10, NULL);
	surfaces[3] = solid_surface(cube);
	for (int s = 0; s < 4; s++) {
		for (size_t k = 0; k < sizeof(places) / sizeof(*places); k++) {
			const double *p = places[k];
			struct incise_touch touch;

			incise_surface_nearest(surfaces[s], p, &touch);
			assert_true(isfinite(touch.depth_mm));
			assert_true(fabs(v3_length(touch.normal) - 1) < 1e-9);
			for (int i = 0; i < 3; i++)
				assert_true(fabs(touch.point_mm[i]) <= 1e9);
			if (incise_surface_enters(surfaces[s], p, zero, &touch))
				assert_true(isfinite(touch.point_mm[2]));
			incise_surface_enters(surfaces[s], zero, p, &touch);
		}
		incise_surface_free(surfaces[s]);
	}
	free(cube);
}

static void test_tops_and_kinds(void **state)
{
	struct {
		struct incise_surface *surface;
		enum incise_surface_kind kind;
		double top[3];
	} cases[] = {
		{incise_surface_new_plane((double[3]){1, 2, 3}, (double[3]){1, 0, 1},
					  NULL),
		 INCISE_SURFACE_PLANE,
		 {1, 2, 3}},
		{incise_surface_new_sphere((double[3]){1, 2, 3}, 4, NULL),
		 INCISE_SURFACE_SPHERE,
		 {1, 2, 7}},
		{incise_surface_new_capsule(zero, (double[3]){0, 4, 1}, 2, NULL),
		 INCISE_SURFACE_CAPSULE,
		 {0, 4, 3}},
		{incise_surface_new_capsule(zero, (double[3]){0, 4, 0}, 2, NULL),
		 INCISE_SURFACE_CAPSULE,
		 {0, 2, 2}},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_touch touch;

		assert_non_null(cases[k].surface);
		assert_int_equal(incise_surface_kind(cases[k].surface), cases[k].kind);
		assert_int_equal(incise_surface_triangles(cases[k].surface), 0);
		assert_true(incise_surface_memory(cases[k].surface) > 0);
		incise_surface_top(cases[k].surface, &touch);
		assert_true(v3_distance2(touch.point_mm, cases[k].top) < 1e-28);
		assert_true(touch.depth_mm == 0 && touch.face == -1);
		incise_surface_free(cases[k].surface);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_refused),
		cmocka_unit_test(test_normals_of_any_length),
		cmocka_unit_test(test_places_beyond_all),
		cmocka_unit_test(test_tops_and_kinds),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
