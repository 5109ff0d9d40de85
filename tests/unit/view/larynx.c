// SPDX-License-Identifier: GPL-2.0-or-later
/* The larynx: its shape, and the surface as drawn with it. */
#include "../unit.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/surface/surface.h"
#include "../../../lib/view/uv_map.h"

#define SIZE 512

TEST(test_landmarks)
{
	double prominence = larynx_height_mm(-20, 0), notch = larynx_height_mm(-30, 0);
	double beside_notch = larynx_height_mm(-30, 6), membrane = larynx_height_mm(0, 0);
	double cricoid = larynx_height_mm(9, 0), below = larynx_height_mm(16, 0);

	assert_true(prominence > 4 && prominence <= 5);
	/* A finger feels the notch between the plates, and a dip at the membrane. */
	assert_true(notch < 0.5 * beside_notch);
	assert_true(membrane < 0.3 && membrane < 0.2 * cricoid);
	assert_true(cricoid > 1.5 && cricoid < prominence);
	assert_true(below < 0.6 * cricoid);
	/* Both sides are equal. */
	assert_true(larynx_height_mm(-20, 6) == larynx_height_mm(-20, -6));
	/* Nothing at the texture's borders, or there would be an edge. */
	for (int i = -80; i <= 80; i++) {
		assert_true(larynx_height_mm(-80, i) < 1e-3);
		assert_true(larynx_height_mm(80, i) < 1e-3);
		assert_true(larynx_height_mm(i, 76) < 1e-3);
	}
}

/* Within 0 to 5 mm, slopes of skin over cartilage, and no edge. */
TEST(test_smooth)
{
	const double h = 0.25;

	for (double x = -80; x <= 80; x += h)
		for (double y = -77; y <= 77; y += h) {
			double here = larynx_height_mm(x, y);
			double dx = larynx_height_mm(x + h, y) - here;
			double dy = larynx_height_mm(x, y + h) - here;
			double bend = larynx_height_mm(x - h, y) - here + dx;

			assert_true(here >= 0 && here <= UV_MAP_RELIEF_MAX_MM);
			/* 45°, and radii of curvature of 1 mm and more */
			assert_true(fabs(dx) < h && fabs(dy) < h);
			assert_true(fabs(bend) < h * h);
		}
	assert_true(larynx_height_mm(NAN, 0) == 0);
	assert_true(larynx_height_mm(0, INFINITY) == 0);
}

static struct uv_map *neck(struct incise_surface **surface, bool larynx)
{
	const struct incise_scene_picture picture = {.texture_px = SIZE,
						     .larynx = larynx};
	struct uv_map *map;

	*surface = incise_surface_new_capsule((const double[3]){-60, 0, -55},
					      (const double[3]){160, 0, -55}, 55, NULL);
	map = uv_map_new(*surface, &picture, NULL);
	assert_non_null(map);
	return map;
}

/* The surface is drawn with the relief, and normals follow it. */
TEST(test_drawn)
{
	struct incise_surface *surface;
	struct uv_map *map = neck(&surface, true);
	double highest = 0;

	for (int i = 0; i < map->n_vertices; i++) {
		const struct uv_map_vertex *v = map->vertices + i;
		const double at[3] = {v->position_mm[0], v->position_mm[1],
				      v->position_mm[2]};
		const double px[2] = {v->px[0], v->px[1]};
		double height = uv_map_relief_mm(map, px);
		double x = (px[0] / SIZE - 0.5) * map->wide_mm;
		double y = (px[1] / SIZE - 0.5) * map->high_mm;
		double flat[3], normal[3], right[3], down[3], slope[2], out[3];
		struct incise_touch touch;

		incise_surface_nearest(surface, at, &touch);
		/* Floats of 100 mm. */
		assert_true(fabs(-touch.depth_mm - height) < 3e-5);
		highest = fmax(highest, height);
		/*
		 * By the slopes of the relief on the cylinder; what is drawn has facets of
		 * 1.6 mm, that at a radius of curvature of 5 mm are off by tan 4°.
		 */
		assert_true(uv_map_point(map, px, flat, normal));
		uv_map_metric(map, px, right, down);
		v3_unit(right, right, 0);
		v3_unit(down, down, 0);
		slope[0] =
			(larynx_height_mm(x + 0.01, y) - larynx_height_mm(x - 0.01, y)) /
			0.02;
		slope[1] =
			(larynx_height_mm(x, y + 0.01) - larynx_height_mm(x, y - 0.01)) /
			0.02 / (1 + height / 55);
		v3_add(out, normal, -slope[0], right);
		v3_add(out, out, -slope[1], down);
		v3_unit(out, out, 0);
		assert_true(out[0] * v->normal[0] + out[1] * v->normal[1] +
				    out[2] * v->normal[2] >
			    cos(4 * M_PI / 180));
	}
	assert_true(highest > 4);
	uv_map_free(map);
	incise_surface_free(surface);
}

/* There is none unless requested, and none on a texture that is too small. */
TEST(test_none)
{
	struct incise_surface *surface;
	struct uv_map *map = neck(&surface, false);
	const struct incise_scene_picture picture = {.texture_px = SIZE, .larynx = true};
	double most = 0;

	for (int i = 0; i < SIZE * SIZE; i += 7)
		most = fmax(most,
			    uv_map_relief_mm(map, (const double[2]){i % SIZE, i / SIZE}));
	assert_true(most == 0);
	uv_map_free(map);
	incise_surface_free(surface);
	surface = incise_surface_new_sphere((const double[3]){0}, 20, NULL);
	map = uv_map_new(surface, &picture, NULL);
	assert_non_null(map);
	for (int i = 0; i < SIZE * SIZE; i += 7)
		most = fmax(most,
			    uv_map_relief_mm(map, (const double[2]){i % SIZE, i / SIZE}));
	assert_true(most == 0);
	uv_map_free(map);
	incise_surface_free(surface);
}
