// SPDX-License-Identifier: GPL-2.0-or-later
/* From points and triangles to a mesh: welding, neighbours, fans, order. */
#include "../unit.h"
#include "../../../lib/surface/surface.h"
#include "solid.h"

/* The invariants of a mesh. */
static void check(const struct solid *s, const struct mesh *mesh)
{
	uint32_t *corners = calloc(mesh->n_vertices, sizeof(*corners));

	for (uint32_t f = 0; f < mesh->n_triangles; f++) {
		const uint32_t *c = s->corner[mesh->number[f]];

		for (int i = 0; i < 3; i++) {
			uint32_t a = mesh->corner[f][i], b = mesh->corner[f][(i + 1) % 3];
			uint32_t g = mesh->neighbour[f][i];

			corners[a]++;
			assert_memory_equal(mesh->vertex[a], s->point[c[i]],
					    sizeof(mesh->vertex[a]));
			assert_true(fabs(v3_length(mesh->normal[a]) - 1) < 1e-12);
			if (g == MESH_NONE)
				continue;
			/* back over the same edge, which runs the other way there */
			i = mesh_corner_of(mesh, f, a);
			assert_int_equal(mesh->neighbour[g][mesh_corner_of(mesh, g, b)],
					 f);
			assert_int_equal(
				mesh->corner[g][(mesh_corner_of(mesh, g, b) + 1) % 3], a);
		}
	}
	/* A walk around a vertex meets all of its corners, each once. */
	for (uint32_t f = 0; f < mesh->n_triangles; f++) {
		for (int i = 0; i < 3; i++) {
			struct mesh_fan fan = mesh_fan(f, mesh->corner[f][i]);
			uint32_t face, met = 0;

			while (mesh_fan_face(mesh, &fan, &face))
				met++;
			assert_int_equal(met, corners[mesh->corner[f][i]]);
		}
	}
	free(corners);
}

TEST(test_closed_open_and_bow_tie)
{
	struct solid *s[] = {solid_cube(), solid_sphere(2, 3), solid_new(), solid_new()};
	static const uint32_t vertices[] = {8, 258, 4, 6};

	/* two back to back, and a bow tie: one point, two vertices */
	for (int k = 2; k < 4; k++) {
		solid_point(s[k], 0, 0, 0);
		solid_point(s[k], 1, 0, 0);
		solid_point(s[k], 0, 1, 0);
		solid_point(s[k], -1, 0, 0);
		solid_point(s[k], 0, -1, 0);
		solid_face(s[k], 0, 1, 2);
	}
	solid_face(s[2], 0, 2, 3);
	solid_face(s[3], 0, 3, 4);
	for (int k = 0; k < 4; k++) {
		struct incise_surface *surface = solid_surface(s[k]);

		/* Euler: 8 faces cut three times in four have 512/2 + 2 corners */
		assert_int_equal(surface->mesh->n_vertices, vertices[k]);
		check(s[k], surface->mesh);
		assert_true(incise_surface_memory(surface) >
			    surface->mesh->n_triangles * 28);
		incise_surface_free(surface);
		free(s[k]);
	}
}

/* Two faces back to back enclose nothing: normals are still unit vectors. */
TEST(test_two_back_to_back)
{
	struct solid *s = solid_new();
	struct incise_surface *surface;
	struct incise_touch touch;

	solid_point(s, 0, 0, 0);
	solid_point(s, 1, 0, 0);
	solid_point(s, 0, 1, 0);
	solid_face(s, 0, 1, 2);
	solid_face(s, 0, 2, 1);
	surface = solid_surface(s);
	for (int k = 0; k < 9; k++) {
		incise_surface_nearest(
			surface, (double[3]){k % 3 - 0.5, k / 3 - 0.5, 0.1}, &touch);
		assert_true(fabs(v3_length(touch.normal) - 1) < 1e-12);
	}
	incise_surface_free(surface);
	free(s);
}

/* A fan of 5000 triangles around one point, and a proxy that goes around on it. */
TEST(test_a_large_fan)
{
	struct solid *s = solid_new();
	struct incise_surface *surface;
	struct incise_proxy proxy;
	int n = 5000;

	solid_point(s, 0, 0, -1);
	for (int i = 0; i < n; i++)
		solid_point(s, 5 * cos(2 * M_PI * i / n), 5 * sin(2 * M_PI * i / n), 0);
	for (int i = 0; i < n; i++)
		solid_face(s, 0, 1 + (uint32_t)i, 1 + (uint32_t)((i + 1) % n));
	surface = solid_surface(s);
	check(s, surface->mesh);
	incise_proxy_init(&proxy, surface, 0.05);
	incise_proxy_move(&proxy, (double[3]){0, 0, -1.5});
	assert_true(proxy.touching);
	for (int i = 0; i < 200; i++) {
		double r = 0.02 * i, z = -1 + r / 5 - 0.2;

		incise_proxy_move(&proxy, (double[3]){r * cos(i), r * sin(i), z});
		assert_true(proxy.touching);
	}
	incise_surface_free(surface);
	free(s);
}

TEST(test_refusals)
{
	struct solid *s = solid_cube();
	struct mesh_draft draft = {.path = "x", .point = s->point, .corner = s->corner};

	assert_null(mesh_new(&draft, &err));
	assert_int_equal(errno, EINVAL);
	draft.n_triangles = INCISE_SURFACE_TRIANGLES_MAX + 1;
	assert_null(mesh_new(&draft, &err));
	assert_int_equal(errno, E2BIG);
	assert_int_equal(err.code, E2BIG);
	free(s);
}

/* The tree of boxes: each box in one leaf, within all boxes above it, not too deep. */

struct count {
	const struct bvh *bvh;
	const float (*box)[2][3];
	const uint32_t *order;
	uint32_t seen;
	int deepest;
};

static void walk(struct count *count, uint32_t child, const float lo[3],
		 const float hi[3], int depth)
{
	if (depth > count->deepest)
		count->deepest = depth;
	if (!(child & BVH_LEAF)) {
		const struct bvh_node *node = count->bvh->node + child;

		assert_true(child < count->bvh->n_nodes);
		for (int side = 0; side < 2; side++) {
			for (int i = 0; i < 3 && node->lo[side][i] <= node->hi[side][i];
			     i++)
				assert_true(node->lo[side][i] >= lo[i] &&
					    node->hi[side][i] <= hi[i]);
			walk(count, node->child[side], node->lo[side], node->hi[side],
			     depth + 1);
		}
		return;
	}
	/* leaves lie one behind the other */
	if (BVH_COUNT(child))
		assert_int_equal(BVH_FIRST(child), count->seen);
	for (uint32_t k = 0; k < BVH_COUNT(child); k++) {
		const float(*box)[3] = count->box[count->order[BVH_FIRST(child) + k]];

		for (int i = 0; i < 3; i++)
			assert_true(box[0][i] >= lo[i] && box[1][i] <= hi[i]);
	}
	count->seen += BVH_COUNT(child);
}

TEST(test_every_box_once)
{
	static const uint32_t sizes[] = {1, 2, 3, 4, 5, 7, 8, 9, 100, 5000};
	static const float all[2][3] = {{-INFINITY, -INFINITY, -INFINITY},
					{INFINITY, INFINITY, INFINITY}};
	uint64_t random = 88172645463325252u;

	/* boxes anywhere, all the same, and in a row as a file may have them */
	for (int kind = 0; kind < 3; kind++) {
		for (size_t k = 0; k < sizeof(sizes) / sizeof(*sizes); k++) {
			uint32_t n = sizes[k], *order = malloc(n * sizeof(*order));
			float(*box)[2][3] = malloc(n * sizeof(*box));
			bool *seen = calloc(n, sizeof(*seen));
			struct count count = {.order = order};
			struct bvh bvh;

			for (uint32_t b = 0; b < n; b++) {
				for (int i = 0; i < 3; i++) {
					double x = kind == 0   ? solid_random(&random)
						   : kind == 1 ? 0.5
							       : (double)(i ? 0 : b);

					box[b][0][i] = (float)x;
					box[b][1][i] = (float)(x + 0.1);
				}
			}
			assert_int_equal(
				bvh_build(&bvh, (const float(*)[2][3])box, n, order), 0);
			count.bvh = &bvh;
			count.box = (const float(*)[2][3])box;
			walk(&count, 0, all[0], all[1], 0);
			assert_int_equal(count.seen, n);
			/* a query keeps one child per level */
			assert_true(count.deepest < BVH_DEPTH_MAX);
			assert_true(count.deepest <= 1 + ceil(log2(n / 2.0 + 1)));
			for (uint32_t b = 0; b < n; b++) {
				assert_false(seen[order[b]]);
				seen[order[b]] = true;
			}
			bvh_free(&bvh);
			free(order);
			free(box);
			free(seen);
		}
	}
}

TEST(test_outwards)
{
	static const double values[] = {0, 1e-300, 1 / 3.0, -1 / 3.0, 1e5, -1e5, 1e-7};

	for (size_t k = 0; k < sizeof(values) / sizeof(*values); k++) {
		double x = values[k], lo = bvh_outwards(x, 0), hi = bvh_outwards(x, 1);

		/* wider than a query's rounding, and not by much */
		assert_true(lo < x - 5e-7 && hi > x + 5e-7);
		assert_true(hi - lo < 1e-5 + fabs(x) * 1e-6);
	}
}
