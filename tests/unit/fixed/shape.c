// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Surfaces in integers compared with the same in double: planes and capsules at random places, grids
 * of a plane, and the proxy of a tool that goes in and out. tests/unit/scene/heights.c has grids of
 * all that is curved.
 */
#include "../unit.h"
#include "trial_plan.h"
#include "../../../lib/surface/surface.h"

#define CASES 100000
#define ONE 65536.0
#define UNIT 1073741824.0
#define LSB (1 / ONE)

/* Of 200 mm along a direction whose parts are off by 4 · 2^-30 at most. */
#define DIRECTION (200 * 4 / UNIT * 2)

static const int32_t up[3] = {0, 0, INCISE_FIXED_UNIT};
static struct incise_fx_trial trial;

static void any_place(int32_t p[3], double p_mm[3], int32_t most_mm)
{
	for (int i = 0; i < 3; i++) {
		p[i] = incise_fx_trial_in(&trial, -most_mm * 65536, most_mm * 65536);
		p_mm[i] = p[i] / ONE;
	}
}

static void any_unit(int32_t unit[3], double to[3])
{
	incise_fx_trial_unit(&trial, unit, 3);
	for (int i = 0; i < 3; i++)
		to[i] = unit[i] / UNIT;
}

static void assert_touch(const struct incise_fixed_touch *got,
			 const struct incise_touch *want, double most_mm, double most_rad)
{
	assert_true(fabs(got->depth / ONE - want->depth_mm) <= most_mm);
	for (int i = 0; i < 3; i++) {
		assert_true(fabs(got->point[i] / ONE - want->point_mm[i]) <= most_mm);
		assert_true(fabs(got->normal[i] / UNIT - want->normal[i]) <= most_rad);
	}
}

static struct incise_surface *any_plane(struct incise_fixed_shape *shape)
{
	double point[3], normal[3];

	*shape = (struct incise_fixed_shape){.kind = INCISE_FIXED_PLANE};
	any_place(shape->point, point, 50);
	any_unit(shape->normal, normal);
	return incise_surface_new_plane(point, normal, NULL);
}

static struct incise_surface *any_capsule(struct incise_fixed_shape *shape)
{
	double a[3], b[3], axis[3];

	*shape = (struct incise_fixed_shape){
		.kind = INCISE_FIXED_CAPSULE,
		.length = incise_fx_trial_one_in(&trial, 4)
				  ? 0
				  : incise_fx_trial_in(&trial, 0, 100 << 16),
		.radius = incise_fx_trial_in(&trial, 1 << 16, 60 << 16)};
	any_place(shape->point, a, 50);
	any_unit(shape->normal, axis);
	for (int i = 0; i < 3; i++)
		b[i] = a[i] + shape->length / ONE * axis[i];
	return incise_surface_new_capsule(a, b, shape->radius / ONE, NULL);
}

TEST(test_nearest)
{
	trial.seed = 1;
	for (int k = 0; k < CASES; k++) {
		struct incise_fixed_shape shape;
		struct incise_surface *surface =
			k & 1 ? any_plane(&shape) : any_capsule(&shape);
		struct incise_fixed_touch got;
		struct incise_touch want;
		double p_mm[3], off;
		int32_t p[3];

		any_place(p, p_mm, 100);
		assert_true(incise_fixed_shape_good(&shape));
		assert_true(incise_fixed_shape_nearest(&shape, NULL, p, up, &got));
		incise_surface_nearest(surface, p_mm, &want);
		/* Rounding of the foot on the axis turns the direction, the more the nearer it is. */
		off = k & 1 ? 1 : shape.radius / ONE - want.depth_mm;
		if (off > 0.1)
			assert_touch(&got, &want,
				     (3 + 2 * shape.radius / ONE / off) * LSB + DIRECTION,
				     2 * LSB / off + 8 / UNIT);
		incise_surface_free(surface);
	}
}

/* A grid of a plane is that plane, whatever way it lies. */
TEST(test_grid_of_a_plane)
{
	static int32_t height[33 * 33];
	struct incise_fixed_grid_frame frame = {
		.axis = {{INCISE_FIXED_UNIT},
			 {0, INCISE_FIXED_UNIT},
			 {0, 0, INCISE_FIXED_UNIT}},
		.origin = {-(16 << 16), -(16 << 16)},
		.cell_shift = 16,
		.columns = 33,
		.rows = 33,
		.reach = 5 << 16,
	};
	struct incise_fixed_grid grid;
	int found = 0, deeper = 0;

	trial.seed = 2;
	for (int k = 0; k < 2000; k++) {
		int32_t u = incise_fx_trial_in(&trial, -(1 << 16), 1 << 16);
		int32_t v = incise_fx_trial_in(&trial, -(1 << 16), 1 << 16);
		double normal[3] = {-u / ONE, -v / ONE, 1}, origin[3] = {-16, -16, 0};
		struct incise_surface *surface =
			incise_surface_new_plane(origin, normal, NULL);

		for (int i = 0; i < 33 * 33; i++)
			height[i] = i % 33 * u + i / 33 * v;
		assert_int_equal(
			incise_fixed_grid_open(&grid, &frame, height, sizeof(height)), 0);
		for (int n = 0; n < 50; n++) {
			struct incise_fixed_spot spot;
			struct incise_fixed_touch got;
			struct incise_touch want;
			double p_mm[3];
			int32_t p[3];
			bool there, inside = true;

			any_place(p, p_mm, 16);
			there = incise_fixed_grid_nearest(&grid, p, &spot);
			incise_surface_nearest(surface, p_mm, &want);
			for (int i = 0; i < 2; i++)
				inside &= fabs(want.point_mm[i]) < 15.9;
			if (want.depth_mm < -5.001 || fabs(want.point_mm[0]) > 16.001 ||
			    fabs(want.point_mm[1]) > 16.001)
				assert_false(there);
			else if (inside && fabs(want.depth_mm) < 4.999)
				assert_true(there);
			if (!there || !inside)
				continue;
			/* Deeper than the reach it counts as that deep. */
			if (want.depth_mm > 5) {
				assert_true(spot.depth <= 5 << 16 &&
					    spot.depth > (5 << 16) - 70);
				deeper++;
				continue;
			}
			found++;
			incise_fx_copy(got.point, spot.point);
			incise_fx_copy(got.normal, spot.normal);
			got.depth = spot.depth;
			/* A step as short as 2 LSB ends the search; heights and depth are rounded. */
			assert_touch(&got, &want, 6 * LSB, 1e-7);
		}
		incise_surface_free(surface);
	}
	assert_true(found > 10000 && deeper > 1000);
}

/* In and out: contacts begin and end in the same ticks, and begin at the same place. */
TEST(test_proxy)
{
	int began = 0, apart = 0, ticks = 0;

	trial.seed = 3;
	for (int k = 0; k < 400; k++) {
		struct incise_fixed_shape shape;
		struct incise_surface *surface =
			k & 1 ? any_plane(&shape) : any_capsule(&shape);
		struct incise_fixed_proxy got = {0};
		struct incise_proxy want;
		struct incise_fixed_touch touch;
		int32_t place[3], leave = 1 << 15;
		double place_mm[3], tool_mm[3];

		/* Deeper than its axis a capsule's other side is nearer. */
		if (!(k & 1) && shape.radius < 12 << 16)
			shape.radius += 12 << 16;
		if (!(k & 1))
			surface->capsule.radius = shape.radius / ONE;
		incise_proxy_init(&want, surface, leave / ONE);
		any_place(place, place_mm, 50);
		for (int t = 0; t < 300; t++) {
			int32_t tool[3];
			/* 10 mm out to 10 in, and a little aside. */
			int32_t depth = (int32_t)lrint(10 * sin((t + 30) / 20.0) * ONE);

			for (int i = 0; i < 3; i++)
				place[i] += incise_fx_trial_in(&trial, -9999, 9999);
			incise_fixed_shape_nearest(&shape, NULL, place, up, &touch);
			incise_fx_add(tool, touch.point, -depth, touch.normal);
			for (int i = 0; i < 3; i++)
				tool_mm[i] = tool[i] / ONE;
			incise_fixed_proxy_move(&got, &shape, NULL, leave, tool);
			incise_proxy_move(&want, tool_mm);
			ticks++;
			/* At the very edge of a contact rounding decides. */
			apart += !got.touching != !want.touching;
			if (!got.began || !want.began)
				continue;
			began++;
			assert_int_equal(got.first.depth,
					 got.first.depth > 0 ? got.first.depth : 0);
			/* False position leaves a part of a way that is 1 mm at most. */
			for (int i = 0; i < 3; i++)
				assert_true(fabs(got.first.point[i] / ONE -
						 want.first.point_mm[i]) < 0.01);
		}
		incise_surface_free(surface);
	}
	assert_true(began > 400);
	if (apart * 1000 >= ticks)
		fail_msg("%d of %d ticks are apart", apart, ticks);
}

/* On its axis all directions of a capsule are as near: the last one stays. */
TEST(test_axis_keeps_the_normal)
{
	struct incise_fixed_shape shape = {.kind = INCISE_FIXED_CAPSULE,
					   .normal = {INCISE_FIXED_UNIT},
					   .length = 20 << 16,
					   .radius = 5 << 16};
	const int32_t last[3] = {0, INCISE_FIXED_UNIT, 0}, p[3] = {10 << 16, 0, 0};
	struct incise_fixed_touch touch;

	assert_true(incise_fixed_shape_nearest(&shape, NULL, p, last, &touch));
	assert_int_equal(touch.depth, 5 << 16);
	assert_int_equal(touch.point[1], 5 << 16);
	assert_memory_equal(touch.normal, last, sizeof(last));
}
