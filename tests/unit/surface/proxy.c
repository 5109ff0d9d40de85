// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Contacts: where they begin and end, on every kind of surface; ridges, creases, corners,
 * folds, borders and slivers. Any pose whatever is in ../../extremes/surface.c.
 */
#include "../unit.h"
#include <float.h>
#include "../cases.h"
#include "../../../lib/surface/surface.h"
#include "solid.h"
#include "wavy.h"

static const double origin[3], up[3] = {0, 0, 1};

static void move(struct incise_proxy *proxy, double x, double y, double z)
{
	incise_proxy_move(proxy, (double[3]){x, y, z});
}

/* Move in a straight line of @n ticks. */
static void drag(struct incise_proxy *proxy, double x, double y, double z, int n)
{
	double from[3];

	v3_copy(from, proxy->tool_mm);
	for (int i = 1; i <= n; i++)
		move(proxy, from[0] + (x - from[0]) * i / n,
		     from[1] + (y - from[1]) * i / n, from[2] + (z - from[2]) * i / n);
}

static void assert_at(const struct incise_proxy *proxy, double x, double y, double z)
{
	const double p[3] = {x, y, z};

	assert_true(proxy->touching);
	/* a few millimetres, a few operations */
	if (v3_distance2(proxy->touch.point_mm, p) > 1e-24)
		fail_msg("at %g %g %g, not at %g %g %g", proxy->touch.point_mm[0],
			 proxy->touch.point_mm[1], proxy->touch.point_mm[2], x, y, z);
}

/* A surface of each kind around the origin, whose top is at 0, 0, 1 or near it. */
static struct incise_surface *of_kind(int kind)
{
	const struct wavy wavy = {30, 20, 1, 8};
	struct solid *cube;
	struct incise_surface *surface;

	switch (kind) {
	case 0:
		return incise_surface_new_plane(up, up, NULL);
	case 1:
		return incise_surface_new_sphere(origin, 1, NULL);
	case 2:
		return incise_surface_new_capsule(origin, (double[3]){3, 1, 0}, 1, NULL);
	case 3:
		return wavy_surface(&wavy);
	default:
		cube = solid_cube();
		surface = solid_surface(cube);
		free(cube);
		return surface;
	}
}

#define N_KINDS 5

/* Of the test that runs. */
static struct incise_proxy proxy;
static struct incise_surface *surface;

/* Down onto the top of a plane, a sphere, a capsule and a cube, and up again. */
TEST(test_begins_and_ends)
{
	for (int kind = 0; kind < N_KINDS; kind++) {
		struct incise_surface *surface = of_kind(kind);

		if (kind == 3) {
			incise_surface_free(surface);
			continue;
		}
		incise_proxy_init(&proxy, surface, 0.05);
		move(&proxy, 0, 0, 1.5);
		assert_false(proxy.touching);
		move(&proxy, 0, 0, 1.01);
		assert_false(proxy.touching || proxy.began);
		move(&proxy, 0, 0, 0.9);
		assert_true(proxy.touching && proxy.began && proxy.settled);
		assert_true(fabs(proxy.touch.depth_mm - 0.1) < 1e-15);
		assert_true(fabs(proxy.touch.normal[2] - 1) < 1e-15);
		assert_true(fabs(proxy.first.depth_mm) == 0);
		assert_true(v3_distance2(proxy.first.point_mm, up) < 1e-30);
		assert_at(&proxy, 0, 0, 1);
		move(&proxy, 0, 0, 1.04);
		assert_true(proxy.touching && !proxy.began);
		assert_true(fabs(proxy.touch.depth_mm + 0.04) < 1e-15);
		move(&proxy, 0, 0, 1.06);
		assert_false(proxy.touching || proxy.began);
		/* a tool that ends on the surface touches it */
		move(&proxy, 0, 0, 1);
		assert_true(proxy.touching && proxy.began);
		assert_true(fabs(proxy.touch.depth_mm) == 0);
		/* no number is no move */
		move(&proxy, 0, NAN, 0);
		assert_true(proxy.touching && !proxy.began && proxy.tool_mm[2] == 1);
		incise_surface_free(surface);
	}
}

TEST(test_first_place_of_all)
{
	for (int kind = 0; kind < N_KINDS; kind++) {
		struct incise_surface *surface = of_kind(kind);

		incise_proxy_init(&proxy, surface, 0);
		move(&proxy, 0.2, 0.1, -0.3);
		assert_true(proxy.touching && proxy.began);
		assert_true(proxy.touch.depth_mm > 0);
		assert_memory_equal(&proxy.touch, &proxy.first, sizeof(proxy.first));
		incise_proxy_init(&proxy, surface, 0);
		move(&proxy, 0.2, 0.1, 30);
		assert_false(proxy.touching || proxy.began);
		incise_surface_free(surface);
	}
}

/* Through a sphere in one tick: the way entered it and has left it. */
TEST(test_through_a_ball)
{
	struct incise_surface *surface = of_kind(1);

	incise_proxy_init(&proxy, surface, 0.05);
	move(&proxy, 0, 0, 5);
	move(&proxy, 0, 0, -5);
	assert_false(proxy.touching || proxy.began);
	/* the centre keeps the direction that led to it */
	move(&proxy, -0.5, 0, 0);
	move(&proxy, 0, 0, 0);
	assert_at(&proxy, -1, 0, 0);
	incise_surface_free(surface);
}

/* Through a cube in one tick: the proxy stays on the side that was entered. */
TEST(test_through_a_cube)
{
	struct incise_surface *surface = of_kind(4);

	incise_proxy_init(&proxy, surface, 0.05);
	move(&proxy, 0.25, 0.5, 5);
	move(&proxy, 0.25, 0.5, -5);
	assert_at(&proxy, 0.25, 0.5, 1);
	assert_true(proxy.touch.depth_mm == 6);
	drag(&proxy, 0.25, 0.5, 1.01, 100);
	assert_at(&proxy, 0.25, 0.5, 1);
	drag(&proxy, 0.25, 0.5, 1.06, 1);
	assert_false(proxy.touching);
	incise_surface_free(surface);
}

/* Over an edge and around a corner of a cube, along an edge, exactly on it. */
TEST(test_cube)
{
	struct incise_surface *surface = of_kind(4);

	incise_proxy_init(&proxy, surface, 0.05);
	move(&proxy, 0, 0, 1.5);
	drag(&proxy, 0, 0, 0.9, 20);
	drag(&proxy, 0.5, 0.25, 0.9, 20);
	assert_at(&proxy, 0.5, 0.25, 1);
	/* nearer to +x than to the top: it goes over the edge when its face ends only */
	drag(&proxy, 0.95, 0.25, 0.9, 20);
	assert_at(&proxy, 0.95, 0.25, 1);
	drag(&proxy, 1.01, 0.25, 0.9, 20);
	/* 0.1 of a way of its own, which the tool has not paid for yet */
	assert_true(proxy.touching && !proxy.settled && proxy.touch.depth_mm >= -0.05);
	assert_true(proxy.touch.point_mm[0] == 1 && proxy.touch.point_mm[2] > 0.9);
	drag(&proxy, 1.01, 0.25, 0.7, 20);
	assert_at(&proxy, 1, 0.25, 0.7);
	assert_true(fabs(proxy.touch.normal[0] - 1) < 1e-15);
	assert_true(fabs(proxy.touch.depth_mm + 0.01) < 1e-15);
	/* along the edge, with the tool on it */
	drag(&proxy, 1, 0.25, 1, 20);
	assert_at(&proxy, 1, 0.25, 1);
	for (int i = 0; i < 50; i++) {
		move(&proxy, 1, 0.25 - i * 0.02, 1);
		assert_at(&proxy, 1, 0.25 - i * 0.02, 1);
		assert_true(proxy.touch.depth_mm == 0);
	}
	/* around the corner on a ring just outside of it */
	drag(&proxy, 1.01, -1.01, 1.01, 50);
	assert_at(&proxy, 1, -1, 1);
	/* 0.01 √3 outside, along the middle of three faces */
	assert_true(fabs(proxy.touch.depth_mm + 0.01 * sqrt(3)) < 1e-14);
	assert_true(fabs(proxy.touch.normal[0] - sqrt(1 / 3.0)) < 1e-14);
	drag(&proxy, 0.5, -1.01, 0.5, 50);
	assert_at(&proxy, 0.5, -1, 0.5);
	drag(&proxy, 0.5, -1.06, 0.5, 5);
	assert_false(proxy.touching);
	incise_surface_free(surface);
}

/*
 * A groove of 60°, 2 mm wide. From the left wall's tissue through the air to the right
 * wall's: each contact starts on its own wall.
 *
 *    ────╲    ╱────
 *         ╲  ╱
 *          ╲╱
 */
TEST(test_crease)
{
	static const double profile[][2] = {
		{10, 0}, {1, 0}, {0, -1.7320508075688772}, {-1, 0}, {-10, 0}};
	struct solid *s = solid_profile(profile, 5, 3);
	struct incise_surface *surface = solid_surface(s);
	int began = 0;

	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, -3, 0.7, 1);
	drag(&proxy, -3, 0.7, -0.3, 50);
	assert_at(&proxy, -3, 0.7, 0);
	for (int i = 0; i <= 300; i++) {
		move(&proxy, -3 + 0.02 * i, 0.7, -0.3);
		began += proxy.began;
		/* 0.3 deep the groove's air is from -0.827 to 0.827 */
		if (fabs(proxy.tool_mm[0]) < 0.78)
			assert_false(proxy.touching);
		if (fabs(proxy.tool_mm[0]) > 0.84)
			assert_true(proxy.touching);
	}
	assert_int_equal(began, 1);
	/* 1.5 below the bottom, from wall to wall: the bottom holds it, and lets it go */
	drag(&proxy, 0, 0.7, -3.2, 200);
	drag(&proxy, 0, 0.71, -3.2, 50);
	assert_at(&proxy, 0, 0.71, -1.7320508075688772);
	assert_true(fabs(proxy.touch.normal[0]) < 1e-15);
	/* in one jump from the left wall through the air: the right wall has it then */
	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, -0.9, 0, -0.3);
	assert_true(proxy.touching);
	move(&proxy, 1.2, 0, -0.3);
	assert_true(proxy.touching && proxy.began);
	assert_true(proxy.first.point_mm[0] > 0);
	incise_surface_free(surface);
	free(s);
}

/* A ridge of 60° and a saw of such: the tool below is never lost. */
TEST(test_ridge_and_saw)
{
	static const double ridge[][2] = {
		{10, 0}, {1, 0}, {0, 1.7320508075688772}, {-1, 0}, {-10, 0}};
	double saw[40][2];
	struct solid *s = solid_profile(ridge, 5, 4);

	surface = solid_surface(s);
	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, -5, 0, 1);
	drag(&proxy, -5, 0.3, -0.5, 50);
	/*
	 * 0.5 below, the near flank's nearest point comes to the top when the tool is at
	 * (2 + 0.433)/0.5 - 1 = 3.87; from there the proxy goes 2 mm down and 8.5 on, in
	 * twice the tool's 5.63.
	 */
	drag(&proxy, 3.85, 0.3, -0.5, 500);
	assert_true(proxy.touch.point_mm[0] < 0 && proxy.touch.point_mm[2] > 1.7);
	drag(&proxy, 9.5, 0.3, -0.5, 500);
	assert_at(&proxy, 9.5, 0.3, 0);
	incise_surface_free(surface);
	free(s);

	for (int i = 0; i < 40; i++) {
		saw[i][0] = 10 - 20 * i / 39.0;
		saw[i][1] = i & 1 ? 0.5 : 0;
	}
	s = solid_profile(saw, 40, 4);
	surface = solid_surface(s);
	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, -7, 0.3, 1);
	drag(&proxy, -7, 0.3, -0.2, 50);
	for (int i = 0; i < 1000; i++) {
		move(&proxy, -7 + 0.014 * i, 0.3, -0.2);
		assert_true(proxy.touching);
		/* a flank of 44° holds the tool back by its depth at most, and one tooth */
		assert_true(fabs(proxy.touch.point_mm[0] - proxy.tool_mm[0]) <
			    0.7 + 0.52);
	}
	incise_surface_free(surface);
	free(s);
}

/* A wedge, 0.2 mm thick 2 mm behind its edge: the proxy does not go through it. */
TEST(test_thin_wedge)
{
	static const double wedge[][2] = {{0, -0.1}, {2, 0}, {0, 0.1}};
	struct solid *s = solid_profile(wedge, 3, 5);
	struct incise_surface *surface = solid_surface(s);

	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, 0.5, 0, 1);
	drag(&proxy, 0.5, 0, -1, 67);
	assert_true(proxy.touching && proxy.touch.point_mm[2] > 0.05);
	/* out below, and still held by the upper side, which it has not left */
	assert_true(proxy.touch.depth_mm > 1);
	assert_true(proxy.touch.normal[2] > 0.9);
	/* over the edge it may go, in steps of the surface */
	drag(&proxy, 2.5, 0, 0, 100);
	assert_false(proxy.touching);
	incise_surface_free(surface);
	free(s);
}

/* A sheet that ends: over its border contact ends, below it none starts from the side. */
TEST(test_open_border)
{
	static const double flat[][2] = {{2, 0}, {0, 0}, {-2, 0}};
	struct solid *s = solid_profile(flat, 3, 10);
	struct incise_surface *surface = solid_surface(s);

	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, 1, 0.5, 1);
	drag(&proxy, 1, 0.5, -0.5, 50);
	drag(&proxy, 1.99, 0.5, -0.5, 50);
	assert_at(&proxy, 1.99, 0.5, 0);
	drag(&proxy, 2.01, 0.5, -0.5, 2);
	assert_false(proxy.touching);
	drag(&proxy, 1, 0.5, -0.5, 50);
	assert_false(proxy.touching);
	/* up through it from behind, and down again onto it */
	drag(&proxy, 1, 0.5, 0.5, 50);
	assert_false(proxy.touching);
	drag(&proxy, 1, 0.5, -0.1, 50);
	assert_at(&proxy, 1, 0.5, 0);
	/* around a corner of the border, and first places beside it */
	drag(&proxy, 1.5, 9.9, -0.1, 500);
	assert_at(&proxy, 1.5, 9.9, 0);
	drag(&proxy, 2.5, 10.5, -0.1, 50);
	assert_false(proxy.touching);
	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, 2.5, 0, -0.1);
	assert_false(proxy.touching);
	incise_surface_free(surface);
	free(s);
}

/* A first place is in contact if it is inside, however near the other side of a plate is; its depth may be a tenth more. */
TEST(test_first_places_of_plates)
{
	uint64_t random = 88172645463325252u;

	for (int i = 0; i < 200; i++) {
		double half[3] = {10, 10, pow(10, 2 * solid_random(&random) - 2)};
		struct solid *s = solid_cube();

		for (uint32_t k = 0; k < s->n_points; k++)
			for (int j = 0; j < 3; j++)
				s->point[k][j] *= half[j];
		surface = solid_surface(s);
		for (int k = 0; k < 200; k++) {
			double at[3], out = -INFINITY;

			for (int j = 0; j < 3; j++) {
				at[j] = (2 * solid_random(&random) - 1) *
					(half[j] + (j == 2 ? 5 : 2));
				out = fmax(out, fabs(at[j]) - half[j]);
			}
			incise_proxy_init(&proxy, surface, 0.02);
			move(&proxy, at[0], at[1], at[2]);
			if (proxy.touching != (out < 0) ||
			    (out < 0 && !(proxy.touch.depth_mm < -out / 0.9 + 1e-9)))
				fail_msg("plate of %g mm, at %g %g %g: %d, %g mm deep",
					 2 * half[2], at[0], at[1], at[2], proxy.touching,
					 proxy.touch.depth_mm);
		}
		incise_surface_free(surface);
		free(s);
	}
}

/* Strips 20 mm long and 20 nm wide: over, along and across them. */
TEST(test_slivers)
{
	struct solid *s = solid_new();

	for (int i = 0; i <= 200; i++) {
		/* 2 mm, 100 strips of 20 nm, 2 mm */
		double x = i < 51 ? -2 + 0.04 * i : i < 151 ? (i - 50) * 2e-5 : 0;

		if (i >= 151)
			x = 100 * 2e-5 + 0.04 * (i - 150);
		solid_point(s, x, -10, 0.01 * x * x);
		solid_point(s, x, 10, 0.01 * x * x);
	}
	for (uint32_t i = 0; i < 200; i++)
		solid_square(s, 2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1);
	surface = solid_surface(s);
	incise_proxy_init(&proxy, surface, 0.02);
	move(&proxy, -1, 0, 1);
	drag(&proxy, -1, 0, -1, 50);
	for (int i = 0; i < 1000; i++) {
		double x = -1 + 0.002 * i, y = 3 * sin(i * 0.01);

		/* Over all strips it goes in three moves. */
		for (int k = 0; k < 3; k++)
			move(&proxy, x, y + 1e-9 * k, -1);
		assert_true(proxy.touching);
		/* the slope is 0.02 at most and the depth 1: so far a proxy may be aside */
		assert_true(fabs(proxy.touch.point_mm[0] - x) < 0.025);
		assert_true(fabs(proxy.touch.point_mm[1] - y) < 1e-6);
		assert_true(fabs(proxy.touch.point_mm[2] -
				 0.01 * pow(proxy.touch.point_mm[0], 2)) < 1e-5);
	}
	incise_surface_free(surface);
	free(s);
}

/* A tool on the mesh itself, on a face, on edges and on corners. */
TEST(test_on_the_surface)
{
	struct solid *s = solid_sphere(10 / 3.0, 2);
	struct incise_surface *surface = solid_surface(s);

	incise_proxy_init(&proxy, surface, 0.01);
	move(&proxy, 0, 0, 5);
	drag(&proxy, 0, 0, 3, 50);
	for (uint32_t f = 0; f < s->n_triangles; f++) {
		for (int i = 0; i < 7; i++) {
			const double *a = s->point[s->corner[f][i % 3]];
			const double *b = s->point[s->corner[f][(i + 1) % 3]];
			const double *c = s->point[s->corner[f][(i + 2) % 3]];
			double share = i < 3 ? 0 : i < 6 ? 0.25 : 0.375, at[3];
			double third = i < 6 ? 0 : 0.125;

			for (int k = 0; k < 3; k++)
				at[k] = (1 - share - third) * a[k] + share * b[k] +
					third * c[k];
			drag(&proxy, 0.9 * at[0], 0.9 * at[1], 0.9 * at[2], 20);
			/* from deep below it may rest on the face beside; so up slowly */
			drag(&proxy, at[0], at[1], at[2], 20);
			drag(&proxy, at[0] * (1 - 1e-15), at[1], at[2], 3);
			assert_true(proxy.touching);
			assert_true(fabs(proxy.touch.depth_mm) < 1e-12);
			assert_true(v3_distance2(proxy.touch.point_mm, at) < 1e-24);
		}
	}
	incise_surface_free(surface);
	free(s);
}

/*
 * Walks in and out of a potato: whoever is inside has come in, and is in contact; whoever
 * has been outside for long is not.
 */
TEST(test_inside_is_in_contact)
{
	struct solid *s = solid_sphere(5, 4);
	uint64_t random = 88172645463325252u;
	int inside = 0, outside = 0;

	for (uint32_t k = 0; k < s->n_points; k++) {
		double *p = s->point[k], bump = 1;

		/* of the place only: a point that is made twice stays one */
		for (int i = 0; i < 3; i++)
			bump += 0.08 * sin(3 * p[i] + i) * cos(2 * p[(i + 1) % 3]);
		for (int i = 0; i < 3; i++)
			p[i] *= bump;
	}
	surface = solid_surface(s);
	for (int k = 0; k < 60000; k++) {
		double size = pow(10, 3 * solid_random(&random) - 2.5), tool[3];
		struct incise_touch touch;

		if (k % 1000 == 0) {
			incise_proxy_init(&proxy, surface, k % 2000 ? 0 : 0.05);
			move(&proxy, 7, 1, 2);
			assert_false(proxy.touching);
		}
		/* towards the surface, and some to a corner or to a middle of an edge */
		for (int i = 0; i < 3; i++) {
			double out = v3_length(proxy.tool_mm) - 5;

			tool[i] = proxy.tool_mm[i] * (1 - 0.01 * out) +
				  size * (2 * solid_random(&random) - 1);
		}
		if (k % 17 == 0) {
			uint32_t f = (uint32_t)(solid_random(&random) * s->n_triangles);

			for (int i = 0; i < 3; i++)
				tool[i] = (s->point[s->corner[f][0]][i] +
					   s->point[s->corner[f][k % 2]][i]) /
					  2;
		}
		incise_proxy_move(&proxy, tool);
		incise_surface_nearest(surface, tool, &touch);
		/* on the surface either is right: rounding is 1e-15 of 5 mm */
		if (touch.depth_mm > 1e-12) {
			inside++;
			assert_true(proxy.touching);
			if (proxy.settled)
				assert_true(proxy.touch.depth_mm >=
					    touch.depth_mm - 1e-12);
		} else if (touch.depth_mm < -0.06 && !proxy.touching) {
			outside++;
		}
	}
	assert_true(inside > 10000 && outside > 10000);
	incise_surface_free(surface);
	free(s);
}

/* Each triangle with corners of its own, each moved by up to @by along each axis. */
static struct incise_surface *apart(const struct solid *whole, double by, uint64_t *seed)
{
	struct solid *s = solid_new();
	struct incise_surface *surface;

	for (uint32_t f = 0; f < whole->n_triangles; f++) {
		for (int i = 0; i < 3; i++) {
			const double *p = whole->point[whole->corner[f][i]];
			double at[3];

			for (int k = 0; k < 3; k++)
				at[k] = p[k] + by * (2 * solid_random(seed) - 1);
			solid_point(s, at[0], at[1], at[2]);
		}
		solid_face(s, 3 * f, 3 * f + 1, 3 * f + 2);
	}
	surface = solid_surface(s);
	free(s);
	return surface;
}

/* Strokes into a ball that is in one piece and one that is in pieces: the same contacts. */
static void assert_same_strokes(const struct incise_surface *whole,
				const struct incise_surface *pieces, double within,
				uint64_t *seed)
{
	struct incise_proxy a, b;

	for (int stroke = 0; stroke < 20; stroke++) {
		double from[3], to[3], way[3];

		for (int k = 0; k < 3; k++) {
			from[k] = 2 * solid_random(seed) - 1;
			to[k] = 2 * solid_random(seed) - 1;
		}
		v3_unit(way, from, 0);
		v3_add(from, origin, 22, way);
		/* Deeper in, two faces are nearest places at once, and either may hold. */
		v3_add(to, origin, 18 + 1.5 * solid_random(seed), way);
		for (int k = 0; k < 3; k++)
			to[k] += 2 * solid_random(seed) - 1;
		incise_proxy_init(&a, whole, 0.2);
		incise_proxy_init(&b, pieces, 0.2);
		for (int i = 0; i <= 400; i++) {
			/* in, along, and out */
			double t = sin(M_PI * i / 400), u = i / 400.0, p[3];

			for (int k = 0; k < 3; k++)
				p[k] = from[k] + t * (to[k] - from[k]) +
				       u * (k == stroke % 3 ? 3 : 0);
			incise_proxy_move(&a, p);
			incise_proxy_move(&b, p);
			/* On their way they are at different places of it. */
			if (!a.settled || !b.settled)
				continue;
			/* Where it begins and ends within the tolerance, either is right. */
			if (a.touching != b.touching &&
			    fmax(fabs(a.touch.depth_mm), fabs(b.touch.depth_mm)) >
				    0.2 + within)
				fail_msg("tick %d: touching %d, not %d, at %g mm", i,
					 b.touching, a.touching, a.touch.depth_mm);
			if (a.touching && b.touching &&
			    fabs(a.touch.depth_mm - b.touch.depth_mm) > within)
				fail_msg("tick %d: %g mm deep, not %g", i,
					 b.touch.depth_mm, a.touch.depth_mm);
		}
	}
}

/* Copies of a corner that differ by rounding are one; the mesh has no border. */
TEST(test_rounded_copies_are_welded)
{
	uint64_t seed = cases_seed(5);

	for (int n = 0; n < cases_of(100, 6); n++) {
		struct solid *ball = solid_sphere(20, 2 + n % 2);
		struct incise_surface *whole = solid_surface(ball);
		/* of 20 mm: copies lie within 4e-5 mm of each other */
		double by = 1e-5 * pow(solid_random(&seed), 4);
		struct incise_surface *pieces = apart(ball, by, &seed);

		assert_false(pieces->mesh->open);
		assert_int_equal(pieces->mesh->n_vertices, whole->mesh->n_vertices);
		assert_same_strokes(whole, pieces, 1e-3, &seed);
		incise_surface_free(whole);
		incise_surface_free(pieces);
		free(ball);
	}
}

/* Wider seams stay open; a contact passes over them, and none is missed between them. */
TEST(test_seams_are_passed)
{
	uint64_t seed = cases_seed(6);

	for (int n = 0; n < cases_of(100, 6); n++) {
		struct solid *ball = solid_sphere(20, 2 + n % 2);
		struct incise_surface *whole = solid_surface(ball);
		double by = 1e-4 * pow(150, solid_random(&seed));
		struct incise_surface *pieces = apart(ball, by, &seed);

		assert_true(pieces->mesh->open);
		/* a slope of the surface of a few degrees, and the seam's width */
		assert_same_strokes(whole, pieces, 0.05 + 4 * by, &seed);
		incise_surface_free(whole);
		incise_surface_free(pieces);
		free(ball);
	}
}

/* A sheet of which one half has finer triangles: their corners lie on the other's edges. */
TEST(test_t_junctions_are_passed)
{
	uint64_t seed = cases_seed(7);
	struct solid *s = solid_new();
	struct incise_surface *sheet;

	for (int half = 0; half < 2; half++) {
		int n = half ? 21 : 7; /* thirds are no numbers of a double */
		uint32_t first = s->n_points;

		for (int j = 0; j <= n; j++)
			for (int i = 0; i <= n; i++)
				solid_point(s, -10 + 20.0 * i / n,
					    half ? 10.0 * j / n : -10 + 10.0 * j / n, 0);
		for (int j = 0; j < n; j++)
			for (int i = 0; i < n; i++) {
				uint32_t a = first + (uint32_t)(j * (n + 1) + i),
					 b = a + (uint32_t)n + 1;

				solid_square(s, a, a + 1, b + 1, b);
			}
	}
	sheet = solid_surface(s);
	for (int n = 0; n < cases_of(2000, 200); n++) {
		double x = 18 * solid_random(&seed) - 9, y = 9 * solid_random(&seed);
		double to = 18 * solid_random(&seed) - 9, deep = 3 * solid_random(&seed);

		incise_proxy_init(&proxy, sheet, 0.05);
		move(&proxy, x, y, 0.5);
		drag(&proxy, x, n % 4 ? y : 0, -deep, 20);
		for (int i = 0; i < 40; i++) {
			move(&proxy, x + (to - x) * i / 40, (n % 4 ? y : 0) - y * i / 40,
			     -deep);
			assert_true(proxy.touching && !proxy.began);
			assert_true(fabs(proxy.touch.depth_mm - deep) < 1e-9);
		}
	}
	incise_surface_free(sheet);
	free(s);
}

/* A border without another part beside it is one: the contact ends there, as before. */
TEST(test_borders_stay)
{
	struct solid *s = solid_new();

	solid_square(s, solid_point(s, 0, 0, 0), solid_point(s, 5, 0, 0),
		     solid_point(s, 5, 5, 0), solid_point(s, 0, 5, 0));
	/* one that is a little too far */
	solid_square(s, solid_point(s, 5.11, 0, 0), solid_point(s, 9, 0, 0),
		     solid_point(s, 9, 5, 0), solid_point(s, 5.11, 5, 0));
	surface = solid_surface(s);
	incise_proxy_init(&proxy, surface, 0.2);
	move(&proxy, 4, 2, 1);
	drag(&proxy, 4.98, 2, -1, 10);
	assert_true(proxy.touching);
	move(&proxy, 5.02, 2, -1);
	assert_false(proxy.touching);
	/* past it, and through the gap */
	move(&proxy, 5.05, -0.05, 1);
	drag(&proxy, 5.05, -0.05, -1, 10);
	assert_false(proxy.touching);
	move(&proxy, 5.05, 2, 1);
	drag(&proxy, 5.05, 2, -1, 10);
	assert_false(proxy.touching);
	incise_surface_free(surface);
	free(s);
}
