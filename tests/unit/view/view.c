// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The view: the same ticks give the same image for any number of frames, and no input breaks it.
 * Neck with a small texture.
 */
#include "../unit.h"
#include <incise/view.h>
#include "../../../lib/base/vector.h"
#include "../../../lib/view/uv_map.h"
#include "../../../lib/view/view_camera.h"
#include "look.h"

#define W 320
#define H 180

static struct incise_scene *scene;
static struct incise_plan *plan;
static bool possible;
static uint8_t one[W * H * 3], two[W * H * 3];

static int setup(void **state)
{
	static const char text[] =
		"surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0];\n"
		"  to_mm = [160.0, 0.0, -55.0]; radius_mm = 55.0; };\n"
		"tissue = { reaction_N_mm = 0.14; };\n"
		"picture = { wound = true; bleeding = true; skin = \"neck\";\n"
		"  larynx = true; texture_px = 512; };\n";
	char path[] = "/tmp/incise-view-XXXXXX";
	int fd = mkstemp(path);
	struct incise_egl *egl = look_context();

	if (fd < 0 || write(fd, text, sizeof(text) - 1) != sizeof(text) - 1)
		return -1;
	close(fd);
	scene = incise_scene_load(path, NULL, NULL);
	unlink(path);
	plan = scene ? incise_plan_new(scene, NULL, NULL) : NULL;
	possible = egl != NULL;
	incise_egl_free(egl);
	return plan ? 0 : -1;
}

static int teardown(void **state)
{
	incise_plan_free(plan);
	incise_scene_free(scene);
	return 0;
}

static struct incise_view *view_new(void)
{
	const struct incise_view_setup setup = {.width = W, .height = H};
	struct incise_view *view = incise_view_new(scene, plan, &setup, &err);

	if (!view)
		print_message("%s\n", err.text);
	assert_non_null(view);
	incise_view_panel(view, false, false);
	return view;
}

/* A cut 30 mm along the top in a second, 3 mm deep; then half a second above it. */
static struct incise_tick cut(int ms)
{
	double x = 35 + 0.03 * fmin(ms, 1000), depth = ms < 1000 ? 3 : -20;

	return (struct incise_tick){
		.t_ns = INT64_C(5000000000) + ms * 1000000,
		.position_mm = {x, 0, -depth},
		.quaternion = {1, 0, 0, 0},
		.tool_mm = {x, 0, -depth},
		.proxy_mm = {x, 0, 0},
		.normal = {0, 0, 1},
		.depth_mm = depth,
		.velocity_mm_s = 30,
		.flags = depth > 0 ? INCISE_TICK_CONTACT : 0,
		.phase = depth > 0 ? INCISE_PHASE_CUTTING : INCISE_PHASE_FREE,
		.tool = INCISE_TOOL_BLADE,
	};
}

static void film(int every, uint8_t *rgb)
{
	struct incise_view *view = view_new();
	struct incise_view_report report;

	for (int ms = 0; ms < 1500; ms++) {
		struct incise_tick tick = cut(ms);

		incise_view_ticks(view, &tick, 1);
		if (ms % every == every - 1)
			assert_int_equal(incise_view_frame(view, NULL, NULL), 0);
	}
	assert_int_equal(incise_view_frame(view, NULL, NULL), 0);
	assert_int_equal(incise_view_pixels(view, rgb), 0);
	incise_view_report(view, &report);
	/* As long as the blade's way, to the texels of the ends. */
	assert_true(fabs(report.cut_mm - 30) < 1);
	assert_true(report.blood_ul_emitted > 0 && report.uploads > 0);
	incise_view_free(view);
}

TEST(test_frames_do_not_matter)
{
	uint8_t *bare = two;
	struct incise_view *view;

	if (!possible)
		skip();
	film(1500, one);
	film(40, two);
	assert_memory_equal(one, two, sizeof(one));
	/* The frame is not empty. */
	view = view_new();
	assert_int_equal(incise_view_pixels(view, bare), -ENODATA);
	assert_int_equal(incise_view_frame(view, NULL, NULL), 0);
	assert_int_equal(incise_view_pixels(view, bare), 0);
	assert_memory_not_equal(one, bare, sizeof(one));
	incise_view_free(view);
}

TEST(test_ticks_that_are_no_numbers)
{
	static const double odd[] = {NAN, INFINITY, -INFINITY, 1e300, -1e7};
	struct incise_view *view;

	if (!possible)
		skip();
	view = view_new();
	assert_int_equal(incise_view_frame(view, NULL, NULL), 0);
	assert_int_equal(incise_view_pixels(view, one), 0);
	for (int i = 0; i < 5; i++)
		for (int k = 0; k < 3; k++) {
			struct incise_tick tick = cut(i);

			tick.position_mm[k] = odd[i];
			incise_view_ticks(view, &tick, 1);
			tick = cut(i);
			tick.proxy_mm[k] = odd[i];
			tick.depth_mm = odd[i];
			incise_view_ticks(view, &tick, 1);
		}
	incise_view_ticks(view, NULL, 0);
	assert_int_equal(incise_view_frame(view, NULL, NULL), 0);
	assert_int_equal(incise_view_pixels(view, two), 0);
	assert_memory_equal(one, two, sizeof(one));
	/* Other values of a tick may be invalid, and time may go backwards. */
	for (int i = 0; i < 200; i++) {
		struct incise_tick tick = cut(i * 7919 % 1500);

		tick.depth_mm = odd[i % 5];
		tick.velocity_mm_s = odd[i % 4];
		tick.command_N[i % 3] = odd[i % 5];
		tick.quaternion[i % 4] = odd[i % 5];
		tick.t_ns = i % 3 ? tick.t_ns : i % 2 ? INT64_MIN : INT64_MAX;
		tick.phase = (enum incise_phase)(i % 7);
		tick.tool = (enum incise_tool)(i % 9);
		incise_view_ticks(view, &tick, 1);
		if (i % 50 == 0) {
			incise_view_panel(view, true, true);
			assert_int_equal(incise_view_frame(view, NULL, NULL), 0);
		}
	}
	incise_view_free(view);
}

/* As the view reads the ray of an event. */
static struct incise_view_ray ray_of(const struct incise_view *view,
				     const struct uv_map *map, double x, double y)
{
	struct incise_view_camera camera;
	struct incise_view_ray ray = {.met = false};
	struct view_projection projection;

	incise_view_camera(view, &camera);
	view_camera_project(&camera, W, H, 1, &projection);
	view_camera_ray(&projection, W, H, x, y, ray.way);
	ray.met = uv_map_meet(map, projection.position_mm, ray.way,
			      2 * camera.distance_mm + 1e4, ray.point_mm, ray.normal);
	return ray;
}

/* The ray of a pixel meets the surface as drawn there, including the larynx. */
TEST(test_rays)
{
	struct incise_view_ray ray;
	struct incise_scene_picture picture;
	struct incise_view *view;
	struct uv_map *map;
	int met = 0;

	if (!possible)
		skip();
	view = view_new();
	incise_scene_picture(scene, &picture);
	map = uv_map_new(incise_plan_surface(plan), &picture, NULL);
	assert_non_null(map);
	for (double y = 5.5; y < H; y += 17)
		for (double x = 5.5; x < W; x += 17) {
			struct incise_touch touch;

			ray = ray_of(view, map, x, y);
			assert_true(fabs(v3_length(ray.way) - 1) < 1e-12);
			if (!ray.met)
				continue;
			met++;
			incise_surface_nearest(incise_plan_surface(plan), ray.point_mm,
					       &touch);
			assert_true(fabs(touch.depth_mm) < 1e-9);
			assert_true(v3_dot(ray.normal, ray.way) < 0);
		}
	assert_true(met > 50);
	/* In the middle is the target, or something in front of it. */
	ray = ray_of(view, map, W / 2.0, H / 2.0);
	assert_true(ray.met);
	/* The upper corners look past the neck. */
	ray = ray_of(view, map, W - 1, 1);
	assert_false(ray.met);
	ray = ray_of(view, map, NAN, 1);
	assert_false(ray.met);
	uv_map_free(map);
	incise_view_free(view);
}

TEST(test_camera_and_sizes)
{
	static const int sizes[][2] = {{0, 100}, {15, 100}, {100, -1}, {8193, 100}};
	struct incise_view_camera camera, kept;
	struct incise_view_event event;
	struct incise_view *view;
	int w, h;

	for (int i = 0; i < 4; i++) {
		struct incise_view_setup s = {.width = sizes[i][0],
					      .height = sizes[i][1]};

		assert_null(incise_view_new(scene, plan, &s, &err));
		assert_int_equal(errno, EINVAL);
	}
	if (!possible)
		skip();
	view = view_new();
	incise_view_camera(view, &kept);
	camera = kept;
	camera.azimuth_deg = NAN;
	incise_view_set_camera(view, &camera);
	incise_view_camera(view, &camera);
	assert_memory_equal(&camera, &kept, sizeof(kept));
	camera.elevation_deg = 500;
	incise_view_set_camera(view, &camera);
	incise_view_camera(view, &camera);
	assert_true(camera.elevation_deg == 89);
	incise_view_size(view, &w, &h);
	assert_true(w == W && h == H);
	/* Without a window there are no events. */
	assert_int_equal(incise_view_event(view, &event), 0);
	assert_int_equal(incise_view_keys(view, (const char *const[]){"q\tquit"}, 1), 0);
	incise_view_free(view);
	incise_view_free(NULL);
}

/* Two views in a thread are independent. */
TEST(test_two_views)
{
	struct incise_tick tick = cut(3);
	struct incise_view *a, *b;

	if (!possible)
		skip();
	a = view_new();
	b = view_new();
	incise_view_ticks(b, &tick, 1);
	assert_int_equal(incise_view_frame(a, NULL, NULL), 0);
	assert_int_equal(incise_view_frame(b, NULL, NULL), 0);
	assert_int_equal(incise_view_pixels(a, one), 0);
	assert_int_equal(incise_view_pixels(b, two), 0);
	assert_memory_not_equal(one, two, sizeof(one));
	incise_view_free(a);
	assert_int_equal(incise_view_frame(b, NULL, NULL), 0);
	assert_int_equal(incise_view_pixels(b, one), 0);
	assert_memory_equal(one, two, sizeof(one));
	incise_view_free(b);
}

GROUP(setup, teardown);
