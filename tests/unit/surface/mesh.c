// SPDX-License-Identifier: GPL-2.0-or-later
/* Places on a mesh: normals, texture coordinates, fans, highest place. */
#include "../unit.h"
#include "../../../lib/surface/surface.h"
#include "solid.h"
#include "wavy.h"

/* On a cube the normals of edges and corners are known, however its sides are cut. */
TEST(test_normals_of_a_cube)
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
TEST(test_sign_at_a_lopsided_corner)
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
TEST(test_texture_follows_the_proxy)
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

TEST(test_top)
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
TEST(test_slivers_nearest)
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

/* Searches by the tree of boxes against searches through all triangles. */

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

TEST(test_nearest_is_nearest)
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
			/* A shorter search shows less, and nothing wrong. */
			bound = mesh_nearest(surface->mesh, p, hint, 0.5, &spot);
			assert_true(bound <= truth && bound >= truth * (0.5 - 1e-9));
			assert_true(sqrt(v3_distance2(spot.point, p)) <= 2.001 * truth);
		}
		incise_surface_free(surface);
		free(s);
	}
}

TEST(test_enters_where_all_triangles_say)
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
TEST(test_sphere_of_triangles)
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
TEST(test_no_way_slips_through)
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

/*
 * Gliding over waves of 2 mm at five resolutions: the proxy never jumps, never
 * locks, never falls behind for good, and a contact below the waves is never lost.
 */

/* Cells along a side: 512, 5 000, 20 000, 100 352 and 500 000 triangles. */
static const int cells[] = {16, 50, 100, 224, 500};
#define N_MESHES (sizeof(cells) / sizeof(*cells))
static struct incise_surface *surface[N_MESHES];
static struct wavy wavy[N_MESHES];

#define SIZE_MM 100
#define AMPLITUDE_MM 1 /* waves of 2 mm from valley to crest */
#define WAVELENGTH_MM 8
#define STEP_MM 0.03

/* The steepest slope of A sin(kx) sin(ky) is A k; where both factors change, √2 less. */
#define SLOPE (AMPLITUDE_MM * 2 * M_PI / WAVELENGTH_MM)

enum path { ALONG_X, ALONG_Y, DIAGONAL, CIRCLE, WALK, N_PATHS };

static int setup(void **state)
{
	for (size_t k = 0; k < N_MESHES; k++) {
		wavy[k] = (struct wavy){cells[k], SIZE_MM, AMPLITUDE_MM, WAVELENGTH_MM};
		surface[k] = wavy_surface(wavy + k);
	}
	return 0;
}

static int teardown(void **state)
{
	for (size_t k = 0; k < N_MESHES; k++)
		incise_surface_free(surface[k]);
	return 0;
}

/* Where the tool is over the sheet, at most 25 mm from its middle. */
static void path_at(enum path path, int tick, int ticks, uint64_t *random, double at[2])
{
	double s = 50.0 * tick / ticks - 25;

	switch (path) {
	case ALONG_X:
		at[0] = s;
		at[1] = 1.3;
		break;
	case ALONG_Y:
		at[0] = -2.1;
		at[1] = s;
		break;
	case DIAGONAL:
		at[0] = s;
		at[1] = -0.7 * s;
		break;
	case CIRCLE:
		at[0] = 18 * cos(s / 4);
		at[1] = 18 * sin(s / 4);
		break;
	default:
		for (int i = 0; i < 2; i++) {
			at[i] += (tick ? STEP_MM : 0) * (2 * solid_random(random) - 1);
			at[i] = fmin(fmax(at[i], -25), 25);
		}
	}
}

/*
 * The slope at which the distance to the tool falls from the proxy in the steepest of 64
 * directions: 0 at the nearest place around. By the sheet's own formula, without its
 * triangles. A face is often nearest by itself, with another nearer one beyond a ridge;
 * what is asked is whether there is a way down, so steps are small.
 */
static double falls(const struct wavy *w, const struct incise_proxy *proxy)
{
	double x = proxy->touch.point_mm[0], y = proxy->touch.point_mm[1];
	double here = fabs(proxy->touch.depth_mm), least = here, step = 1e-6;

	for (int k = 0; k < 64; k++) {
		double u = x + step * cos(k * M_PI / 32),
		       v = y + step * sin(k * M_PI / 32);
		const double p[3] = {u, v, wavy_height(w, u, v)};

		least = fmin(least, sqrt(v3_distance2(p, proxy->tool_mm)));
	}
	return (here - least) / step;
}

struct sweep {
	double jump;	   /* the proxy's way to the tool's, at most */
	double horizontal; /* between proxy and tool, at most, mm */
	double off;	   /* the proxy from the sheet, at most, mm */
	int lost;	   /* ticks without contact */
	double falls;	   /* after settling */
	bool settled;
};

static struct sweep sweep(size_t mesh, enum path path, double depth)
{
	uint64_t random = 88172645463325252u + mesh;
	struct sweep result = {0};
	struct incise_proxy proxy;
	double at[2] = {0};
	int ticks = 50 / STEP_MM;

	incise_proxy_init(&proxy, surface[mesh], 0.05);
	/* At last ten small circles, and then a tremble of 5 µm in depth. */
	for (int tick = 0; tick < ticks + 2000; tick++) {
		double before[3], tool[3], last[3], round = (tick - ticks) * M_PI / 50;
		bool circles = tick >= ticks && tick < ticks + 1000;
		double x, y, way;

		if (tick < ticks)
			path_at(path, tick, ticks, &random, at);
		x = at[0] + (circles ? 0.1 * (1 - cos(round)) : 0);
		y = at[1] + (circles ? 0.1 * sin(round) : 0);
		tool[0] = x;
		tool[1] = y;
		/* Shallow ones follow the waves, deep ones go below all of them. */
		tool[2] = (depth < 2 ? wavy_height(wavy + mesh, x, y) : -AMPLITUDE_MM) -
			  depth - (tick >= ticks + 1000 ? 5e-3 * (tick & 1) : 0);
		v3_copy(last, proxy.tool_mm);
		v3_copy(before, proxy.touch.point_mm);
		incise_proxy_move(&proxy, tool);
		result.lost += !proxy.touching;
		if (!tick)
			continue;
		way = sqrt(v3_distance2(tool, last));
		result.jump =
			fmax(result.jump,
			     sqrt(v3_distance2(before, proxy.touch.point_mm)) / way);
		result.horizontal =
			fmax(result.horizontal, hypot(proxy.touch.point_mm[0] - x,
						      proxy.touch.point_mm[1] - y));
		result.off = fmax(result.off,
				  fabs(proxy.touch.point_mm[2] -
				       wavy_height(wavy + mesh, proxy.touch.point_mm[0],
						   proxy.touch.point_mm[1])));
	}
	result.settled = proxy.settled;
	result.falls = falls(wavy + mesh, &proxy);
	return result;
}

TEST(test_waves_at_five_resolutions)
{
	static const double depths[] = {0.3, 3, 9};

	for (size_t mesh = 0; mesh < N_MESHES; mesh++) {
		for (int path = 0; path < N_PATHS; path++) {
			for (size_t d = 0; d < 3; d++) {
				struct sweep s = sweep(mesh, path, depths[d]);

				/* 60 mm coordinates are good to 1e-14, a step to 1e-12 */
				assert_true(s.jump <= 2 * (1 + 1e-9));
				assert_int_equal(s.lost, 0);
				assert_true(s.off < 1e-12);
				/*
				 * A proxy at rest has the tool below it along a normal,
				 * which leans by the slope at most: that is what a wave can
				 * hold it back. One that slides to the next wave may be
				 * half a wavelength more behind, and no more however long
				 * the sweep is. Coarse meshes are steeper by chance.
				 */
				assert_true(s.horizontal <=
					    (depths[d] + 2 * AMPLITUDE_MM) * SLOPE +
						    WAVELENGTH_MM / 2.0);
				assert_true(s.settled);
				/*
				 * The distance's rounding over the step is 1e-8. A proxy
				 * 1 µm beside its place would show 1e-3 mm over the depth,
				 * 1e-4 or more.
				 */
				assert_true(s.falls < 1e-5);
			}
		}
	}
}

/* However the tool jumps, the proxy stays in reach, with what the work of the last move left of it; a tool at rest leaves it at rest. */
TEST(test_never_farther_than_the_reach)
{
	uint64_t random = 88172645463325252u;
	struct incise_proxy proxy;
	int moved = 0;

	for (size_t mesh = 0; mesh < N_MESHES; mesh++) {
		incise_proxy_init(&proxy, surface[mesh], 0.05);
		incise_proxy_move(&proxy, (double[3]){1, 2, -3});
		for (int i = 0; i < 4000; i++) {
			double size = pow(10, 6 * solid_random(&random) - 5), tool[3];
			double before[3], last[3], left_mm = proxy.left_mm;
			bool touching = proxy.touching;

			v3_copy(before, proxy.touch.point_mm);
			v3_copy(last, proxy.tool_mm);
			for (int j = 0; j < 3; j++) {
				tool[j] =
					last[j] + size * (2 * solid_random(&random) - 1);
				tool[j] = fmin(fmax(tool[j], -30), j == 2 ? -1 : 30);
			}
			incise_proxy_move(&proxy, tool);
			if (!touching || !proxy.touching || proxy.began)
				continue;
			moved++;
			assert_true(sqrt(v3_distance2(before, proxy.touch.point_mm)) <=
				    left_mm + 2 * sqrt(v3_distance2(tool, last)) + 1e-13);
			v3_copy(before, proxy.touch.point_mm);
			incise_proxy_move(&proxy, tool);
			assert_memory_equal(before, proxy.touch.point_mm, sizeof(before));
		}
	}
	assert_true(moved > 15000);
}

/* The size, the border, and a place within: of a sheet that stands at any angle. */
TEST(test_size)
{
	uint64_t seed = 11;
	struct incise_surface *plane =
		incise_surface_new_plane((double[3]){0}, (double[3]){0, 0, 1}, NULL);
	struct incise_surface_size size;

	assert_false(incise_surface_size(plane, &size));
	incise_surface_free(plane);
	for (int n = 0; n < 50; n++) {
		struct solid *s = n % 2 ? solid_cube() : solid_new();
		double axis[3] = {solid_random(&seed) - 0.5, solid_random(&seed) - 0.5,
				  solid_random(&seed) - 0.5};
		double side[3], up[3], in[3];
		struct incise_surface *surface;

		v3_unit(up, axis, 0);
		v3_cross(side, up, (double[3]){1, 0, 0});
		v3_unit(side, side, 0);
		v3_cross(in, up, side);
		for (int j = 0; j <= 10 && n % 2 == 0; j++)
			for (int i = 0; i <= 20; i++)
				solid_point(s, 3 + i * side[0] + j * in[0],
					    i * side[1] + j * in[1],
					    i * side[2] + j * in[2]);
		for (uint32_t j = 0; j < 10 && n % 2 == 0; j++)
			for (uint32_t i = 0; i < 20; i++)
				solid_square(s, 21 * j + i, 21 * j + i + 1,
					     21 * j + i + 22, 21 * j + i + 21);
		surface = solid_surface(s);
		assert_true(incise_surface_size(surface, &size));
		assert_int_equal(size.open_edges, n % 2 ? 0 : 60);
		for (uint32_t k = 0; k < s->n_points; k++)
			for (int i = 0; i < 3; i++) {
				assert_true(size.lo_mm[i] <= s->point[k][i] &&
					    s->point[k][i] <= size.hi_mm[i]);
				/* a sheet's border reaches as far as the sheet */
				assert_true(n % 2 ||
					    (size.open_lo_mm[i] == size.lo_mm[i] &&
					     size.open_hi_mm[i] == size.hi_mm[i]));
			}
		if (n % 2 == 0) {
			const double middle[3] = {3 + 10 * side[0] + 5 * in[0],
						  10 * side[1] + 5 * in[1],
						  10 * side[2] + 5 * in[2]};

			assert_true(v3_distance2(size.inner.point_mm, middle) < 1);
			assert_true(fabs(v3_dot(size.inner.normal, up)) > 1 - 1e-9);
		}
		incise_surface_free(surface);
		free(s);
	}
}
GROUP(setup, teardown);
