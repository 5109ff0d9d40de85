// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Maps of all kinds of surface: there and back, compared with finite differences and with the
 * surface itself; and their triangles.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/view/uv_map.h"
#include "../surface/solid.h"

#define SIZE 512
#define HILL 24

static double hill_mm(double x, double y)
{
	return 12 * exp(-(x * x + y * y) / 900) + 2 * sin(x / 9);
}

/* A mesh over 80 × 70 mm; with texture coordinates that are askew, mirrored or none. */
static struct incise_surface *hill(int uv)
{
	struct solid *s = solid_new();
	struct incise_surface *surface;

	for (int j = 0; j <= HILL; j++)
		for (int i = 0; i <= HILL; i++) {
			double x = 80.0 * i / HILL - 40, y = 70.0 * j / HILL - 35;

			solid_point(s, x, y, hill_mm(x, y));
		}
	for (uint32_t j = 0; j < HILL; j++)
		for (uint32_t i = 0; i < HILL; i++) {
			uint32_t at = j * (HILL + 1) + i;

			solid_square(s, at, at + 1, at + HILL + 2, at + HILL + 1);
		}
	s->textured = uv != 0;
	for (uint32_t t = 0; t < s->n_triangles && uv; t++)
		for (int k = 0; k < 3; k++) {
			const double *p = s->point[s->corner[t][k]];
			double u = 0.5 + 0.009 * p[0] + 0.001 * p[1];

			s->uv[t][k][0] = (float)(uv < 0 ? 1 - u : u);
			s->uv[t][k][1] = (float)(0.5 + 0.011 * p[1]);
		}
	surface = solid_surface(s);
	free(s);
	return surface;
}

static struct incise_surface *capsule(double bx, double bz, double radius)
{
	return incise_surface_new_capsule((const double[3]){-60, 0, -55},
					  (const double[3]){bx, 0, bz}, radius, NULL);
}

static struct incise_surface *make(int kind)
{
	const double zero[3] = {0}, far[3] = {9e4, -9e4, 9e4};

	switch (kind) {
	case 0:
		return incise_surface_new_plane(zero, (const double[3]){0, 0, 1}, NULL);
	case 1:
		return incise_surface_new_plane(far, (const double[3]){3, -1, 0.2}, NULL);
	case 2:
		return incise_surface_new_plane(zero, (const double[3]){-1, 0, 0}, NULL);
	case 3:
		return incise_surface_new_sphere((const double[3]){5, 6, 7}, 80, NULL);
	case 4:
		return incise_surface_new_sphere(zero, 1e-6, NULL);
	case 5:
		return incise_surface_new_sphere(zero, 1e5, NULL);
	case 6:
		return capsule(160, -55, 55); /* the neck of neck.scene */
	case 7:
		return capsule(20, -20, 30); /* leans: the top is on an end */
	case 8:
		return capsule(-50, -55, 40); /* short: both ends are seen */
	case 9:
		return capsule(-60, 55, 30); /* stands */
	case 10:
		return capsule(1e5, -55, 1e5);
	case 11:
		return capsule(-59, -55, 1e-6);
	case 12:
		return hill(0);
	case 13:
		return hill(1);
	case 14:
		return hill(-1);
	default:
		return NULL;
	}
}

static struct uv_map *map_of(const struct incise_surface *surface, bool larynx)
{
	const struct incise_scene_picture picture = {.texture_px = SIZE,
						     .larynx = larynx};
	struct uv_map *map = uv_map_new(surface, &picture, NULL);

	assert_non_null(map);
	return map;
}

/* From 0 to 1 (MMIX's generator, Knuth). */
static double random_next(uint64_t *state)
{
	incise_random_step(state);
	return (double)(*state >> 11) * 0x1p-53;
}

/* Largest coordinate: doubles are exact to 1e-15 of it. */
static double extent(const double p[3])
{
	return fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2])));
}

static void there_and_back(const struct incise_surface *surface, const struct uv_map *map)
{
	uint64_t state = 1;
	int found = 0;

	for (int i = 0; i < 1000; i++) {
		double px[2], back[2], point[3], normal[3], right[3], down[3];
		struct incise_touch touch;

		px[0] = SIZE * random_next(&state);
		px[1] = SIZE * random_next(&state);
		if (!uv_map_point(map, px, point, normal))
			continue;
		found++;
		assert_true(fabs(v3_length(normal) - 1) < 1e-12);
		incise_surface_nearest(surface, point, &touch);
		/* A line of sight is 1e5 long: roundings of that. */
		assert_true(fabs(touch.depth_mm) <= 1e-9 + 1e-14 * extent(point));
		assert_true(uv_map_px(map, point, back));
		/* Closed forms; of an atlas coordinates are floats, 1e-7 of 512. */
		assert_true(fabs(back[0] - px[0]) < 1e-3);
		assert_true(fabs(back[1] - px[1]) < 1e-3);
		/* Not parallel, and in the surface, which curves little there. */
		uv_map_metric(map, px, right, down);
		assert_true(v3_length(right) > 0 && v3_length(down) > 0);
		assert_true(fabs(v3_dot(right, normal)) < 1e-6 * v3_length(right));
		assert_true(fabs(v3_dot(down, normal)) < 1e-6 * v3_length(down));
	}
	/* Part of a mesh's texture is outside of it. */
	assert_true(found > (incise_surface_triangles(surface) ? 500 : 999));
}

/* Compared with the distance of points half a texel to each side. */
static void metric(const struct uv_map *map)
{
	const double step = 0.01;
	uint64_t state = 2;

	for (int i = 0; i < 300; i++) {
		double px[2], m[2][3], a[3], b[3], na[3], nb[3], difference[3];

		px[0] = 1 + (SIZE - 2) * random_next(&state);
		px[1] = 1 + (SIZE - 2) * random_next(&state);
		uv_map_metric(map, px, m[0], m[1]);
		for (int k = 0; k < 2; k++) {
			double before[2] = {px[0], px[1]}, after[2] = {px[0], px[1]};

			before[k] -= step;
			after[k] += step;
			if (!uv_map_point(map, before, a, na) ||
			    !uv_map_point(map, after, b, nb))
				continue;
			/* An edge of a mesh lies between. */
			if (v3_dot(na, nb) < 1 - 1e-6)
				continue;
			v3_sub(difference, b, a);
			v3_add(difference, difference, -2 * step, m[k]);
			/* Quadratic in curvature, linear in rounding of coordinates. */
			assert_true(v3_length(difference) <=
				    1e-4 * step * v3_length(m[k]) +
					    1e-13 * fmax(extent(a), 1e-3));
		}
	}
}

static void drawn(const struct uv_map *map)
{
	int n = map->n_vertices;

	assert_true(map->n_indices % 3 == 0 && map->n_indices > 0);
	for (int i = 0; i < map->n_indices; i += 3) {
		const struct uv_map_vertex *v[3];
		double e[2][3], out[3], area;

		for (int k = 0; k < 3; k++) {
			assert_true(map->indices[i + k] < (uint32_t)n);
			v[k] = map->vertices + map->indices[i + k];
		}
		for (int k = 0; k < 3; k++) {
			e[0][k] = (double)v[1]->position_mm[k] - v[0]->position_mm[k];
			e[1][k] = (double)v[2]->position_mm[k] - v[0]->position_mm[k];
		}
		v3_cross(out, e[0], e[1]);
		area = v3_length(out);
		/* Counter-clockwise from outside, except for slivers, which floats may turn. */
		if (area > 1e-2 * v3_length(e[0]) * v3_length(e[1]) &&
		    v3_length(e[0]) > 1e-2)
			assert_true(out[0] * v[0]->normal[0] + out[1] * v[0]->normal[1] +
					    out[2] * v[0]->normal[2] >
				    0);
	}
	for (int i = 0; i < n; i++) {
		const struct uv_map_vertex *v = map->vertices + i;
		double nn = 0, tt = 0, nt = 0;

		for (int k = 0; k < 3; k++) {
			nn += (double)v->normal[k] * v->normal[k];
			tt += (double)v->tangent[k] * v->tangent[k];
			nt += (double)v->normal[k] * v->tangent[k];
			assert_true(isfinite(v->position_mm[k]));
		}
		/* Of floats. */
		assert_true(fabs(nn - 1) < 1e-6 && fabs(tt - 1) < 1e-6 &&
			    fabs(nt) < 1e-6);
		assert_true(fabsf(v->tangent[3]) == 1);
		/* The hill's askew coordinates go a little beyond. */
		assert_true(v->px[0] >= -0.2F * SIZE && v->px[0] <= 1.2F * SIZE);
		assert_true(v->px[1] >= -0.2F * SIZE && v->px[1] <= 1.2F * SIZE);
	}
}

/* A vertex is at its texel's point, raised by the relief. */
static void drawn_in_place(const struct uv_map *map)
{
	for (int i = 0; i < map->n_vertices; i++) {
		const struct uv_map_vertex *v = map->vertices + i;
		const double px[2] = {v->px[0], v->px[1]};
		double point[3], normal[3], right[3], down[3], bitangent[3];

		if (!uv_map_point(map, px, point, normal))
			continue; /* rounded to a float over the border of a mesh */
		v3_add(point, point, uv_map_relief_mm(map, px), normal);
		for (int k = 0; k < 3; k++)
			/* Rounding to floats: of the place, and of the texel it is at. */
			assert_true(fabs(point[k] - v->position_mm[k]) <=
				    1e-4 + 1e-7 * extent(point));
		uv_map_metric(map, px, right, down);
		v3_cross(bitangent,
			 (const double[3]){v->normal[0], v->normal[1], v->normal[2]},
			 (const double[3]){v->tangent[0], v->tangent[1], v->tangent[2]});
		assert_true(v3_dot(bitangent, down) * v->tangent[3] > 0);
		assert_true(v->tangent[0] * right[0] + v->tangent[1] * right[1] +
				    v->tangent[2] * right[2] >
			    0);
	}
}

TEST(test_all_kinds)
{
	struct incise_surface *surface;

	for (int kind = 0; (surface = make(kind)); kind++) {
		struct uv_map *map = map_of(surface, kind % 2);

		there_and_back(surface, map);
		metric(map);
		drawn(map);
		drawn_in_place(map);
		if (!incise_surface_triangles(surface))
			assert_int_equal(map->n_indices, 3 * 20000);
		uv_map_free(map);
		incise_surface_free(surface);
	}
	uv_map_free(NULL);
}

/* The top is in the middle, right is +x and the image is not mirrored. */
TEST(test_lies_as_it_should)
{
	static const int kinds[] = {0, 3, 6};

	for (size_t k = 0; k < sizeof(kinds) / sizeof(*kinds); k++) {
		struct incise_surface *surface = make(kinds[k]);
		struct uv_map *map = map_of(surface, false);
		const double middle[2] = {SIZE / 2.0, SIZE / 2.0};
		double point[3], normal[3], right[3], down[3], out[3];
		struct incise_touch top;

		incise_surface_top(surface, &top);
		assert_true(uv_map_point(map, middle, point, normal));
		v3_sub(out, point, top.point_mm);
		assert_true(v3_length(out) < 1e-9);
		uv_map_metric(map, middle, right, down);
		assert_true(right[0] > 0.99 * v3_length(right));
		assert_true(-down[1] > 0.99 * v3_length(down));
		uv_map_free(map);
		incise_surface_free(surface);
	}
}

/* A neck's texels are squares to within a twentieth. */
TEST(test_neck_is_not_stretched)
{
	struct incise_surface *surface = make(6);
	struct uv_map *map = map_of(surface, true);

	for (int i = 0; i <= 16; i++) {
		const double px[2] = {SIZE * i / 16.0, SIZE * (16 - i) / 16.0};
		double right[3], down[3], ratio;

		uv_map_metric(map, px, right, down);
		ratio = v3_length(right) / v3_length(down);
		assert_true(ratio > 1 / 1.05 && ratio < 1.05);
		assert_true(fabs(v3_length(right) * SIZE - 160) < 1e-9);
	}
	uv_map_free(map);
	incise_surface_free(surface);
}

/* The texture is on a mesh as far as possible, with the top on it. */
TEST(test_fits_a_mesh)
{
	struct incise_surface *surface = hill(0);
	struct uv_map *map = map_of(surface, false);
	struct incise_touch top;
	int found = 0;
	double px[2];

	/* 80 × 70 mm of 80 × 80. */
	assert_true(fabs(map->wide_mm - 80) < 1e-9 && map->high_mm == map->wide_mm);
	incise_surface_top(surface, &top);
	assert_true(uv_map_px(map, top.point_mm, px));
	for (int k = 0; k < 2; k++)
		assert_true(fabs((px[k] / SIZE - 0.5) * 80 - map->top_mm[k]) < 1e-9);
	for (int i = 0; i < SIZE * SIZE; i += 16) {
		double point[3], normal[3];

		px[0] = i % SIZE + 0.5;
		px[1] = i / SIZE + 0.5;
		found += uv_map_point(map, px, point, normal);
	}
	assert_true(fabs(found * 16.0 / (SIZE * SIZE) - 70 / 80.0) < 0.005);
	/* So are triangles, except those cut at the border. */
	assert_true(map->n_indices / 3 >= 17500 && map->n_indices / 3 < 18200);
	uv_map_free(map);
	incise_surface_free(surface);
}

/* Places outside of the texture, or not finite, have no texel and no point. */
TEST(test_outside)
{
	static const double nowhere[][3] = {
		{NAN, 0, 0},	{0, INFINITY, 0},   {0, 0, -INFINITY}, {1e300, 0, 0},
		{0, -1e300, 0}, {1e10, 1e10, 1e10}, {-1e4, 3e4, 2e4},
	};
	static const double off[][2] = {
		{NAN, 1},	  {1, NAN},	 {-1e-9, 5},
		{5, SIZE + 1e-9}, {INFINITY, 1}, {1e300, 1},
	};
	struct incise_surface *surface;

	for (int kind = 0; (surface = make(kind)); kind++) {
		struct uv_map *map = map_of(surface, true);
		double px[2] = {7, 7}, point[3] = {7}, normal[3], right[3], down[3];

		for (size_t k = 0; k < sizeof(nowhere) / sizeof(*nowhere); k++) {
			/* On a mesh with coordinates, the nearest point still has a texel. */
			bool there = uv_map_px(map, nowhere[k], px);

			assert_false(there && (k < 6 || kind < 5));
			assert_true(px[0] >= 0 && px[0] <= SIZE);
		}
		for (size_t k = 0; k < sizeof(off) / sizeof(*off); k++) {
			assert_false(uv_map_point(map, off[k], point, normal));
			assert_true(point[0] == 7);
			assert_true(uv_map_relief_mm(map, off[k]) == 0);
			uv_map_metric(map, off[k], right, down);
			assert_true(v3_finite(right) && v3_finite(down));
			assert_true(v3_length(right) > 0 && v3_length(down) > 0);
		}
		uv_map_free(map);
		incise_surface_free(surface);
	}
}

/* The lower side of a ball is not on its texture. */
TEST(test_underside)
{
	struct incise_surface *surface = make(3);
	struct uv_map *map = map_of(surface, false);
	double px[2];

	assert_true(uv_map_px(map, (const double[3]){5, 6, 87}, px));
	assert_true(uv_map_px(map, (const double[3]){5, 6, 86}, px));
	assert_false(uv_map_px(map, (const double[3]){5, 6, -73}, px));
	uv_map_free(map);
	incise_surface_free(surface);
}

TEST(test_refused)
{
	static const int sizes[] = {0, -1, 8, 100, 32768, INT32_MIN, INT32_MAX};
	struct incise_surface *surface = make(0);

	for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
		const struct incise_scene_picture picture = {.texture_px = sizes[k]};

		assert_error(uv_map_new(surface, &picture, &err), EINVAL, &err,
			     "expected");
	}
	incise_surface_free(surface);
}

/* A mesh whose coordinates have no area is seen from above. */
TEST(test_useless_coordinates)
{
	static const float values[] = {0, 0.5F, 1e6F};

	for (size_t k = 0; k < sizeof(values) / sizeof(*values); k++) {
		struct incise_surface *surface = hill(1);
		struct mesh *mesh = surface->mesh;
		struct uv_map *map;

		for (uint32_t t = 0; t < mesh->n_triangles; t++)
			for (int i = 0; i < 3; i++)
				mesh->uv[t][i][0] = mesh->uv[t][i][1] = values[k];
		map = map_of(surface, false);
		assert_int_equal(map->kind, UV_MAP_FROM_ABOVE);
		there_and_back(surface, map);
		uv_map_free(map);
		incise_surface_free(surface);
	}
}

/* All triangles over all of the texture: the cells' lists stay within bounds. */
TEST(test_crowded_coordinates)
{
	static const float corner[3][2] = {{-1e6F, -1e6F}, {1e6F, -1e6F}, {0, 1e6F}};
	struct incise_surface *surface = hill(1);
	struct mesh *mesh = surface->mesh;
	double point[3], normal[3];
	struct uv_map *map;

	for (uint32_t t = 0; t < mesh->n_triangles; t++)
		memcpy(mesh->uv[t], corner, sizeof(corner));
	map = map_of(surface, false);
	assert_int_equal(map->kind, UV_MAP_ATLAS);
	assert_true(uv_map_point(map, (const double[2]){9, 9}, point, normal));
	assert_true(v3_finite(point));
	uv_map_free(map);
	incise_surface_free(surface);
}

/* Seams: a corner of the mesh has a vertex for each of its texture coordinates. */
TEST(test_seam)
{
	struct incise_surface *surface = hill(1);
	struct mesh *mesh = surface->mesh;
	struct uv_map *whole = map_of(surface, false), *parted;

	assert_int_equal(whole->n_vertices, (HILL + 1) * (HILL + 1));
	assert_int_equal(whole->n_indices, 6 * HILL * HILL);
	/* Its right half gets a place of its own. */
	for (uint32_t t = 0; t < mesh->n_triangles; t++) {
		double middle = 0;

		for (int k = 0; k < 3; k++)
			middle += mesh->vertex[mesh->corner[t][k]][0];
		for (int k = 0; k < 3 && middle > 0; k++)
			mesh->uv[t][k][0] += 0.05F;
	}
	parted = map_of(surface, false);
	assert_int_equal(parted->n_vertices, whole->n_vertices + HILL + 1);
	assert_int_equal(parted->n_indices, whole->n_indices);
	uv_map_free(parted);
	uv_map_free(whole);
	incise_surface_free(surface);
}
