// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Gliding over waves of 2 mm at five resolutions: the proxy never jumps, never
 * locks, never falls behind for good, and a contact below the waves is never lost.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <incise/surface.h>
#include "solid.h"
#include "wavy.h"

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
 * How steeply the distance to the tool falls from the proxy in the steepest of 64
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

static void test_waves_at_five_resolutions(void **state)
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

/* However the tool leaps, the proxy stays in reach; a tool at rest leaves it at rest. */
static void test_never_farther_than_the_reach(void **state)
{
	uint64_t random = 88172645463325252u;
	struct incise_proxy proxy;
	int moved = 0;

	for (size_t mesh = 0; mesh < N_MESHES; mesh++) {
		incise_proxy_init(&proxy, surface[mesh], 0.05);
		incise_proxy_move(&proxy, (double[3]){1, 2, -3});
		for (int i = 0; i < 4000; i++) {
			double size = pow(10, 6 * solid_random(&random) - 5), tool[3];
			double before[3], last[3];
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
				    2 * sqrt(v3_distance2(tool, last)) + 1e-13);
			v3_copy(before, proxy.touch.point_mm);
			incise_proxy_move(&proxy, tool);
			assert_memory_equal(before, proxy.touch.point_mm, sizeof(before));
		}
	}
	assert_true(moved > 15000);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_waves_at_five_resolutions),
		cmocka_unit_test(test_never_farther_than_the_reach),
	};

	return cmocka_run_group_tests(tests, setup, teardown);
}
