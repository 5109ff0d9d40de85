// SPDX-License-Identifier: GPL-2.0-or-later
/* Making surfaces of each kind, and asking what they are. */
#include "../unit.h"
#include <float.h>
#include "../../../lib/surface/surface.h"
#include "solid.h"

static const double zero[3], bad[3] = {0, NAN, 0}, far[3] = {0, 0, 1e300};

static void refused(struct incise_surface *surface, const struct incise_error *err)
{
	assert_null(surface);
	assert_int_equal(errno, EINVAL);
	assert_int_equal(err->code, EINVAL);
	assert_says(err->text, NULL);
}

TEST(test_refused)
{
	static const double radii[] = {0, -1, NAN, INFINITY, 1e300, 5e-324};

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
TEST(test_normals_of_any_length)
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
TEST(test_places_beyond_all)
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

TEST(test_tops_and_kinds)
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

/*
 * Plane, sphere and capsule against points sampled on them and ways walked in small steps.
 */

static const double up[3] = {0, 0, 1};

static void random_point(uint64_t *random, double reach, double p[3])
{
	for (int i = 0; i < 3; i++)
		p[i] = reach * (2 * solid_random(random) - 1);
}

/* Distance of p from the axis of a capsule, by trying its points. */
static double axis_distance(const struct capsule *c, const double p[3])
{
	double best = INFINITY;

	for (int k = 0; k <= 4000; k++) {
		double on[3];

		for (int i = 0; i < 3; i++)
			on[i] = c->a[i] + (c->b[i] - c->a[i]) * k / 4000.0;
		best = fmin(best, sqrt(v3_distance2(on, p)));
	}
	return best;
}

TEST(test_capsule_nearest)
{
	static const struct capsule capsules[] = {
		{{1, 2, 3}, {1, 2, 3}, 2},
		{{-3, 0, 1}, {4, 2, -1}, 1.5},
		{{0, 0, -2}, {0, 0, 2}, 0.5},
	};
	uint64_t random = 88172645463325252u;

	for (size_t k = 0; k < 3; k++) {
		const struct capsule *c = capsules + k;

		for (int i = 0; i < 300; i++) {
			struct incise_touch touch;
			double p[3], away[3], depth;

			random_point(&random, 8, p);
			capsule_nearest(c, p, up, &touch);
			depth = c->radius - axis_distance(c, p);
			/* Samples are 1.9 µm apart: 1e-6 farther than the nearest at 1 mm. */
			assert_true(touch.depth_mm >= depth - 1e-12 &&
				    touch.depth_mm <= depth + 1e-5);
			assert_true(fabs(axis_distance(c, touch.point_mm) - c->radius) <
				    1e-5);
			v3_sub(away, p, touch.point_mm);
			assert_true(fabs(v3_dot(away, touch.normal) + touch.depth_mm) <
				    1e-12);
			assert_true(fabs(v3_length(away) - fabs(touch.depth_mm)) < 1e-12);
			assert_int_equal(touch.face, -1);
		}
	}
}

/* On the axis: a unit normal across it, the last one where that is one of the nearest. */
TEST(test_on_the_axis)
{
	static const struct {
		struct capsule capsule;
		double p[3], last[3], normal[3];
	} cases[] = {
		{{{0, 0, 0}, {0, 0, 0}, 2}, {0, 0, 0}, {0, 0, 1}, {0, 0, 1}},
		{{{0, 0, 0}, {0, 0, 0}, 2}, {0, 0, 0}, {0.6, 0, -0.8}, {0.6, 0, -0.8}},
		{{{0, 0, 0}, {9, 0, 0}, 2}, {4, 0, 0}, {0, 0, 1}, {0, 0, 1}},
		{{{0, 0, 0}, {9, 0, 0}, 2}, {4, 0, 0}, {0.6, 0.8, 0}, {0, 1, 0}},
		{{{0, 0, 0}, {9, 0, 0}, 2}, {4, 0, 0}, {1, 0, 0}, {0, 0, 1}},
		{{{0, 0, 0}, {0, 0, 9}, 2}, {0, 0, 4}, {0, 0, 1}, {1, 0, 0}},
		{{{0, 0, 0}, {0, 0, 9}, 2}, {0, 0, 9}, {0, 0, 1}, {0, 0, 1}},
		{{{0, 0, 0}, {0, 0, 9}, 2}, {0, 0, 0}, {0, 0, 1}, {1, 0, 0}},
		{{{0, 0, 0}, {0, 0, 9}, 2}, {0, 0, 0}, {0, 0, -1}, {0, 0, -1}},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_touch touch;

		capsule_nearest(&cases[k].capsule, cases[k].p, cases[k].last, &touch);
		assert_true(v3_distance2(touch.normal, cases[k].normal) < 1e-30);
		assert_true(touch.depth_mm == 2);
		/* the samples of the axis are 2.3 µm apart */
		assert_true(fabs(axis_distance(&cases[k].capsule, touch.point_mm) - 2) <
			    1e-6);
	}
}

TEST(test_capsule_enters)
{
	static const struct capsule capsules[] = {
		{{1, 2, 3}, {1, 2, 3}, 2},
		{{-3, 0, 1}, {4, 2, -1}, 1.5},
	};
	uint64_t random = 88172645463325252u;
	int found = 0;

	for (int k = 0; k < 2000; k++) {
		const struct capsule *c = capsules + k % 2;
		struct incise_touch touch, at;
		double from[3], to[3], p[3], first = 2;
		bool enters;

		random_point(&random, 8, from);
		random_point(&random, 8, to);
		enters = capsule_enters(c, from, to, &touch);
		capsule_nearest(c, from, up, &at);
		/* Walk: 0.5 % of 14 mm is 0.07 mm, and what is less deep may be missed. */
		for (int i = 1; at.depth_mm < 0 && i <= 200 && first > 1; i++) {
			for (int j = 0; j < 3; j++)
				p[j] = from[j] + (to[j] - from[j]) * i / 200;
			capsule_nearest(c, p, up, &at);
			if (at.depth_mm >= 0)
				first = i / 200.0;
		}
		if (first <= 1)
			assert_true(enters);
		if (!enters)
			continue;
		found++;
		capsule_nearest(c, touch.point_mm, up, &at);
		assert_true(fabs(at.depth_mm) < 1e-12);
		v3_sub(p, to, from);
		assert_true(v3_dot(p, touch.normal) <= 1e-9);
		/* on the way, and not after where the walk was inside */
		v3_sub(from, touch.point_mm, from);
		assert_true(v3_length(from) <= first * v3_length(p) + 1e-9);
	}
	assert_true(found > 200);
}

/* A way that ends or starts on the surface itself: it starts the contact just once. */
TEST(test_ways_from_and_to_the_surface)
{
	const struct capsule ball = {{0, 0, 0}, {0, 0, 0}, 3};
	const struct plane plane = {{0, 0, 0}, {0, 0, 1}};
	uint64_t random = 88172645463325252u;

	for (int k = 0; k < 1000; k++) {
		double on[3], out[3], in[3], length;
		struct incise_touch touch;

		random_point(&random, 1, on);
		length = v3_length(on);
		for (int i = 0; i < 3; i++) {
			on[i] *= 3 / length;
			out[i] = 2 * on[i];
			in[i] = on[i] / 2;
		}
		assert_true(capsule_enters(&ball, out, in, &touch));
		assert_true(v3_distance2(touch.point_mm, on) < 1e-28);
		assert_true(capsule_enters(&ball, on, in, &touch));
		assert_false(capsule_enters(&ball, on, out, &touch));
		assert_false(capsule_enters(&ball, in, out, &touch));
		on[2] = 0;
		out[2] = 1;
		in[2] = -1;
		assert_true(plane_enters(&plane, out, on, &touch));
		assert_true(plane_enters(&plane, on, in, &touch));
		assert_false(plane_enters(&plane, on, out, &touch));
		assert_false(plane_enters(&plane, in, out, &touch));
		assert_false(plane_enters(&plane, on, on, &touch));
	}
}

/* From 1000 km away the ball is still hit where it is, as precisely as a double can be. */
TEST(test_far_away)
{
	const struct capsule ball = {{0, 0, 0}, {0, 0, 0}, 3};
	struct incise_touch touch;

	assert_true(capsule_enters(&ball, (double[3]){2e8, 3e8, 1e9},
				   (double[3]){0, 0, 0}, &touch));
	assert_true(fabs(v3_length(touch.point_mm) - 3) < 1e-6);
}
