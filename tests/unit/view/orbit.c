// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The camera in a hand.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>
#include "../../../lib/view/eye.h"
#include "../../../lib/view/orbit.h"

static struct incise_orbit start(void)
{
	struct incise_orbit orbit = {0};

	incise_orbit_home(&orbit, (double[]){50, 0, -6}, (double[]){0.1, 0, 0}, 100);
	return orbit;
}

static struct incise_view_event motion(double x, double y, unsigned buttons)
{
	return (struct incise_view_event){
		.type = INCISE_VIEW_MOTION, .x_px = x, .y_px = y, .buttons = buttons};
}

static void test_home_sees_all(void **state)
{
	struct incise_orbit orbit = start(), turned = {0};
	const struct incise_view_camera *c = &orbit.camera;

	assert_true(c->target_mm[0] == 50 && c->target_mm[2] == -6);
	/* From the side and above. */
	assert_true(c->elevation_deg > 20 && c->elevation_deg < 70);
	/* A ball of 100 mm is wider than the picture is high, not wider than 16 : 9. */
	assert_true(tan(c->fov_deg * M_PI / 360) * c->distance_mm > 100 * 9 / 16.0);
	/* What lies along y is seen as what lies along x. */
	incise_orbit_home(&turned, c->target_mm, (double[]){0, 2, 0}, 100);
	assert_true(fabs(turned.camera.azimuth_deg - c->azimuth_deg - 90) < 1e-9);
	/* A way straight up is none. */
	incise_orbit_home(&turned, c->target_mm, (double[]){0, 0, 1}, 100);
	assert_true(turned.camera.azimuth_deg == c->azimuth_deg);
}

/* The place under the mouse comes with it when the middle button is held. */
static void test_moves_with_the_mouse(void **state)
{
	struct incise_orbit orbit = start();
	struct incise_view_event event = motion(640, 360, 0);
	struct incise_eye eye;
	double px[2], old[3];

	memcpy(old, orbit.camera.target_mm, sizeof(old));
	assert_false(incise_orbit_event(&orbit, &event, 720));
	event = motion(700, 300, 2);
	assert_true(incise_orbit_event(&orbit, &event, 720));
	incise_eye_look(&orbit.camera, 1280, 720, 100, &eye);
	assert_true(incise_eye_px(&eye, 1280, 720, old, px));
	assert_true(fabs(px[0] - 700) < 1e-6 && fabs(px[1] - 300) < 1e-6);
}

static void test_turns_and_comes_home(void **state)
{
	struct incise_orbit orbit = start();
	const struct incise_view_camera home = orbit.camera;
	struct incise_view_event key = {.type = INCISE_VIEW_KEY, .pressed = true};
	struct incise_view_event event = motion(0, 0, 0);

	incise_orbit_event(&orbit, &event, 720);
	event = motion(100, -20, 4);
	assert_true(incise_orbit_event(&orbit, &event, 720));
	assert_true(orbit.camera.azimuth_deg < home.azimuth_deg);
	assert_true(orbit.camera.elevation_deg < home.elevation_deg);
	event = (struct incise_view_event){.type = INCISE_VIEW_WHEEL, .wheel = 2};
	assert_true(incise_orbit_event(&orbit, &event, 720));
	assert_true(orbit.camera.distance_mm < home.distance_mm);
	for (int i = INCISE_VIEW_LEFT; i <= INCISE_VIEW_PAGE_DOWN; i++) {
		struct incise_view_camera before = orbit.camera;

		key.key = i;
		assert_true(incise_orbit_event(&orbit, &key, 720));
		assert_memory_not_equal(&before, &orbit.camera, sizeof(before));
	}
	key.key = INCISE_VIEW_HOME;
	assert_true(incise_orbit_event(&orbit, &key, 720));
	assert_memory_equal(&home, &orbit.camera, sizeof(home));
	key.key = 'x';
	assert_false(incise_orbit_event(&orbit, &key, 720));
	/* The left button is the caller's. */
	event = motion(5, 5, 1);
	assert_false(incise_orbit_event(&orbit, &event, 720));
}

static void test_stays_within_range(void **state)
{
	static const double odd[] = {1e300, -1e300, NAN, INFINITY};
	struct incise_orbit orbit = start();

	for (int i = 0; i < 64; i++) {
		struct incise_view_event event = {.type = i & 1 ? INCISE_VIEW_MOTION
								: INCISE_VIEW_WHEEL,
						  .x_px = odd[i / 2 % 4],
						  .y_px = odd[i / 8 % 4],
						  .wheel = odd[i / 2 % 4],
						  .buttons = (unsigned)i >> 3};

		incise_orbit_event(&orbit, &event, i % 3);
		assert_true(isfinite(orbit.camera.azimuth_deg));
		assert_true(isfinite(orbit.camera.target_mm[0]));
		assert_true(fabs(orbit.camera.elevation_deg) <= 89);
		assert_true(orbit.camera.distance_mm >= 1 &&
			    orbit.camera.distance_mm <= 1e5);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_home_sees_all),
		cmocka_unit_test(test_moves_with_the_mouse),
		cmocka_unit_test(test_turns_and_comes_home),
		cmocka_unit_test(test_stays_within_range),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
