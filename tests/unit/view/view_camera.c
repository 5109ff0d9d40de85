// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The camera: rays of pixels and back, compared with OpenGL's matrix; control by mouse and keys.
 */
#include "../unit.h"
#include "../../../lib/base/vector.h"
#include "project.h"

static const struct incise_view_camera cameras[] = {
	{{0, 0, 0}, 0, 0, 100, 40},
	{{50, -3, 7}, 24, 42, 299, 24},
	{{1, 2, 3}, -170, -80, 1, 120},
	{{0, 0, 0}, 90, 89, 1e5, 5},
};
#define CAMERAS (sizeof(cameras) / sizeof(cameras[0]))

/* The middle of the frame is the target; directions are as documented. */
TEST(test_directions)
{
	struct view_projection projection;
	double px[2], to_right[3] = {1, 0, 0}, over[3] = {0, 0, 1};

	view_camera_project(&cameras[0], 200, 100, 50, &projection);
	/* At azimuth 0 it looks along +y. */
	assert_true(fabs(projection.position_mm[1] + 100) < 1e-12 &&
		    fabs(projection.position_mm[0]) < 1e-12);
	assert_true(project(&projection, 200, 100, cameras[0].target_mm, px));
	assert_true(fabs(px[0] - 100) < 1e-9 && fabs(px[1] - 50) < 1e-9);
	assert_true(project(&projection, 200, 100, to_right, px) && px[0] > 100);
	assert_true(project(&projection, 200, 100, over, px) && px[1] < 50);
	/* At 90 along -x. */
	view_camera_project(&(struct incise_view_camera){{0, 0, 0}, 90, 0, 100, 40}, 200,
			    100, 50, &projection);
	assert_true(fabs(projection.position_mm[0] - 100) < 1e-12);
	/* Places behind the camera have no pixel. */
	assert_false(project(&projection, 200, 100, (double[]){101, 0, 0}, px));
}

TEST(test_pixel_and_back)
{
	srand(5);
	for (size_t i = 0; i < CAMERAS; i++)
		for (int k = 0; k < 200; k++) {
			double x = 320.0 * rand() / RAND_MAX,
			       y = 180.0 * rand() / RAND_MAX;
			double way[3], p[3], px[2];
			struct view_projection projection;

			view_camera_project(&cameras[i], 320, 180, 100, &projection);
			view_camera_ray(&projection, 320, 180, x, y, way);
			assert_true(fabs(v3_length(way) - 1) < 1e-12);
			v3_add(p, projection.position_mm, 3 + k, way);
			assert_true(project(&projection, 320, 180, p, px));
			/* 1e5 mm from the target a double leaves 1e-11 mm, a pixel is 0.1. */
			assert_true(fabs(px[0] - x) < 1e-6 && fabs(px[1] - y) < 1e-6);
		}
}

TEST(test_matrix_says_the_same)
{
	for (size_t i = 0; i < CAMERAS; i++)
		for (int k = 0; k < 50; k++) {
			const struct incise_view_camera *c = &cameras[i];
			double p[3], px[2], w, at[4];
			struct view_projection projection;

			for (int j = 0; j < 3; j++)
				p[j] = c->target_mm[j] +
				       0.1 * c->distance_mm * sin(k * (j + 1.0));
			view_camera_project(c, 320, 180, 0.2 * c->distance_mm,
					    &projection);
			for (int row = 0; row < 4; row++)
				at[row] = projection.clip[row] * p[0] +
					  projection.clip[4 + row] * p[1] +
					  projection.clip[8 + row] * p[2] +
					  projection.clip[12 + row];
			w = at[3];
			assert_true(w > 0);
			assert_true(project(&projection, 320, 180, p, px));
			/* Single precision of the matrix, over an image of 320 pixels. */
			assert_true(fabs((at[0] / w + 1) * 160 - px[0]) < 0.01);
			assert_true(fabs((1 - at[1] / w) * 90 - px[1]) < 0.01);
			/* Within near and far. */
			assert_true(fabs(at[2] / w) <= 1);
		}
}

TEST(test_hold)
{
	struct incise_view_camera c = {{1e300, -1e300, 0}, 725, 200, -3, 1e9};

	assert_true(view_camera_limit(&c));
	assert_true(c.target_mm[0] == 1e6 && c.target_mm[1] == -1e6);
	assert_true(fabs(c.azimuth_deg - 5) < 1e-9);
	assert_true(c.elevation_deg == 89 && c.distance_mm == 1 && c.fov_deg == 120);
	for (int i = 0; i < 7; i++) {
		struct incise_view_camera bad = cameras[1];

		((double *)&bad)[i] = i & 1 ? NAN : INFINITY;
		assert_false(view_camera_limit(&bad));
	}
}

static struct view_orbit start(void)
{
	struct view_orbit orbit = {0};

	view_orbit_home(&orbit, (double[]){50, 0, -6}, (double[]){0.1, 0, 0}, 100);
	return orbit;
}

static struct incise_view_event motion(double x, double y, unsigned buttons)
{
	return (struct incise_view_event){
		.type = INCISE_VIEW_MOTION, .x_px = x, .y_px = y, .buttons = buttons};
}

TEST(test_home_sees_all)
{
	struct view_orbit orbit = start(), turned = {0};
	const struct incise_view_camera *c = &orbit.camera;

	assert_true(c->target_mm[0] == 50 && c->target_mm[2] == -6);
	/* From the side and above. */
	assert_true(c->elevation_deg > 20 && c->elevation_deg < 70);
	/* A ball of 100 mm is wider than the image is high, not wider than 16 : 9. */
	assert_true(tan(c->fov_deg * M_PI / 360) * c->distance_mm > 100 * 9 / 16.0);
	/* A direction along y looks the same as one along x. */
	view_orbit_home(&turned, c->target_mm, (double[]){0, 2, 0}, 100);
	assert_true(fabs(turned.camera.azimuth_deg - c->azimuth_deg - 90) < 1e-9);
	/* A vertical direction has no effect. */
	view_orbit_home(&turned, c->target_mm, (double[]){0, 0, 1}, 100);
	assert_true(turned.camera.azimuth_deg == c->azimuth_deg);
}

/* With the middle button, the place under the mouse follows it. */
TEST(test_moves_with_the_mouse)
{
	struct view_orbit orbit = start();
	struct incise_view_event event = motion(640, 360, 0);
	struct view_projection projection;
	double px[2], old[3];

	memcpy(old, orbit.camera.target_mm, sizeof(old));
	assert_false(view_orbit_event(&orbit, &event, 720));
	event = motion(700, 300, 2);
	assert_true(view_orbit_event(&orbit, &event, 720));
	view_camera_project(&orbit.camera, 1280, 720, 100, &projection);
	assert_true(project(&projection, 1280, 720, old, px));
	assert_true(fabs(px[0] - 700) < 1e-6 && fabs(px[1] - 300) < 1e-6);
}

TEST(test_turns_and_comes_home)
{
	struct view_orbit orbit = start();
	const struct incise_view_camera home = orbit.camera;
	struct incise_view_event key = {.type = INCISE_VIEW_KEY, .pressed = true};
	struct incise_view_event event = motion(0, 0, 0);

	view_orbit_event(&orbit, &event, 720);
	event = motion(100, -20, 4);
	assert_true(view_orbit_event(&orbit, &event, 720));
	assert_true(orbit.camera.azimuth_deg < home.azimuth_deg);
	assert_true(orbit.camera.elevation_deg < home.elevation_deg);
	event = (struct incise_view_event){.type = INCISE_VIEW_WHEEL, .wheel = 2};
	assert_true(view_orbit_event(&orbit, &event, 720));
	assert_true(orbit.camera.distance_mm < home.distance_mm);
	for (int i = INCISE_VIEW_LEFT; i <= INCISE_VIEW_PAGE_DOWN; i++) {
		struct incise_view_camera before = orbit.camera;

		key.key = i;
		assert_true(view_orbit_event(&orbit, &key, 720));
		assert_memory_not_equal(&before, &orbit.camera, sizeof(before));
	}
	key.key = INCISE_VIEW_HOME;
	assert_true(view_orbit_event(&orbit, &key, 720));
	assert_memory_equal(&home, &orbit.camera, sizeof(home));
	key.key = 'x';
	assert_false(view_orbit_event(&orbit, &key, 720));
	/* The left button is the caller's. */
	event = motion(5, 5, 1);
	assert_false(view_orbit_event(&orbit, &event, 720));
}

TEST(test_stays_within_range)
{
	static const double odd[] = {1e300, -1e300, NAN, INFINITY};
	struct view_orbit orbit = start();

	for (int i = 0; i < 64; i++) {
		struct incise_view_event event = {.type = i & 1 ? INCISE_VIEW_MOTION
								: INCISE_VIEW_WHEEL,
						  .x_px = odd[i / 2 % 4],
						  .y_px = odd[i / 8 % 4],
						  .wheel = odd[i / 2 % 4],
						  .buttons = (unsigned)i >> 3};

		view_orbit_event(&orbit, &event, i % 3);
		assert_true(isfinite(orbit.camera.azimuth_deg));
		assert_true(isfinite(orbit.camera.target_mm[0]));
		assert_true(fabs(orbit.camera.elevation_deg) <= 89);
		assert_true(orbit.camera.distance_mm >= 1 &&
			    orbit.camera.distance_mm <= 1e5);
	}
}
