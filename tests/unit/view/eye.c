// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The geometry of looking: pixels to ways and back, and OpenGL's matrix beside both.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/view/eye.h"

static const struct incise_view_camera cameras[] = {
	{{0, 0, 0}, 0, 0, 100, 40},
	{{50, -3, 7}, 24, 42, 299, 24},
	{{1, 2, 3}, -170, -80, 1, 120},
	{{0, 0, 0}, 90, 89, 1e5, 5},
};
#define CAMERAS (sizeof(cameras) / sizeof(cameras[0]))

/* The middle of the picture is the target, whose right and above are where the header says. */
static void test_directions(void **state)
{
	struct incise_eye eye;
	double px[2], to_right[3] = {1, 0, 0}, over[3] = {0, 0, 1};

	incise_eye_look(&cameras[0], 200, 100, 50, &eye);
	/* At azimuth 0 one looks along +y. */
	assert_true(fabs(eye.eye_mm[1] + 100) < 1e-12 && fabs(eye.eye_mm[0]) < 1e-12);
	assert_true(incise_eye_px(&eye, 200, 100, cameras[0].target_mm, px));
	assert_true(fabs(px[0] - 100) < 1e-9 && fabs(px[1] - 50) < 1e-9);
	assert_true(incise_eye_px(&eye, 200, 100, to_right, px) && px[0] > 100);
	assert_true(incise_eye_px(&eye, 200, 100, over, px) && px[1] < 50);
	/* At 90 along -x. */
	incise_eye_look(&(struct incise_view_camera){{0, 0, 0}, 90, 0, 100, 40}, 200, 100,
			50, &eye);
	assert_true(fabs(eye.eye_mm[0] - 100) < 1e-12);
	/* What is behind is nowhere. */
	assert_false(incise_eye_px(&eye, 200, 100, (double[]){101, 0, 0}, px));
}

static void test_pixel_and_back(void **state)
{
	srand(5);
	for (size_t i = 0; i < CAMERAS; i++)
		for (int k = 0; k < 200; k++) {
			double x = 320.0 * rand() / RAND_MAX,
			       y = 180.0 * rand() / RAND_MAX;
			double way[3], p[3], px[2];
			struct incise_eye eye;

			incise_eye_look(&cameras[i], 320, 180, 100, &eye);
			incise_eye_way(&eye, 320, 180, x, y, way);
			assert_true(fabs(v3_length(way) - 1) < 1e-12);
			v3_add(p, eye.eye_mm, 3 + k, way);
			assert_true(incise_eye_px(&eye, 320, 180, p, px));
			/* 1e5 mm from the target a double leaves 1e-11 mm, a pixel is 0.1. */
			assert_true(fabs(px[0] - x) < 1e-6 && fabs(px[1] - y) < 1e-6);
		}
}

static void test_matrix_says_the_same(void **state)
{
	for (size_t i = 0; i < CAMERAS; i++)
		for (int k = 0; k < 50; k++) {
			const struct incise_view_camera *c = &cameras[i];
			double p[3], px[2], w, at[4];
			struct incise_eye eye;

			for (int j = 0; j < 3; j++)
				p[j] = c->target_mm[j] +
				       0.1 * c->distance_mm * sin(k * (j + 1.0));
			incise_eye_look(c, 320, 180, 0.2 * c->distance_mm, &eye);
			for (int row = 0; row < 4; row++)
				at[row] = eye.clip[row] * p[0] +
					  eye.clip[4 + row] * p[1] +
					  eye.clip[8 + row] * p[2] + eye.clip[12 + row];
			w = at[3];
			assert_true(w > 0);
			assert_true(incise_eye_px(&eye, 320, 180, p, px));
			/* Single precision of the matrix, over a picture of 320 pixels. */
			assert_true(fabs((at[0] / w + 1) * 160 - px[0]) < 0.01);
			assert_true(fabs((1 - at[1] / w) * 90 - px[1]) < 0.01);
			/* Within near and far. */
			assert_true(fabs(at[2] / w) <= 1);
		}
}

static void test_hold(void **state)
{
	struct incise_view_camera c = {{1e300, -1e300, 0}, 725, 200, -3, 1e9};

	assert_true(incise_eye_hold(&c));
	assert_true(c.target_mm[0] == 1e6 && c.target_mm[1] == -1e6);
	assert_true(fabs(c.azimuth_deg - 5) < 1e-9);
	assert_true(c.elevation_deg == 89 && c.distance_mm == 1 && c.fov_deg == 120);
	for (int i = 0; i < 7; i++) {
		struct incise_view_camera bad = cameras[1];

		((double *)&bad)[i] = i & 1 ? NAN : INFINITY;
		assert_false(incise_eye_hold(&bad));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_directions),
		cmocka_unit_test(test_pixel_and_back),
		cmocka_unit_test(test_matrix_says_the_same),
		cmocka_unit_test(test_hold),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
