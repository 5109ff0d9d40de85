// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/vision/learn.cc: thresholds from a box, or a click, which then find the handle.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/vision.h>
#include "../../../tools/bench/scalpel_picture.h"

static struct incise_camera_frame drawn(enum incise_pixels pixels, double noise,
					double *length)
{
	struct incise_camera_frame frame;
	struct scalpel_picture p;

	scalpel_picture_init(&p);
	p.pixels = pixels;
	p.noise = noise;
	p.blur_px = 1;
	*length = p.length_px;
	assert_int_equal(scalpel_picture_draw(&p, &frame), 0);
	return frame;
}

/* On the handle, which is 67 wide at 320, 80 to 440. */
static const struct incise_vision_box box = {301, 201, 35, 91}, click = {320, 250, 1, 1};

static void what_is_learnt_finds_the_handle(void **state)
{
	static const enum incise_pixels formats[] = {
		INCISE_PIXELS_RGB, INCISE_PIXELS_GREY, INCISE_PIXELS_YUYV};

	for (int k = 0; k < 12; k++) {
		struct incise_vision_setup setup = {.full_px = 7, .depth_mm_px = 3};
		double length;
		struct incise_camera_frame frame =
			drawn(formats[k % 3], k < 6 ? 2 : 4, &length);
		struct incise_vision_result r;
		struct incise_vision *vision;

		assert_int_equal(incise_vision_learn(&frame, k % 2 ? &box : &click,
						     &setup, NULL),
				 0);
		/* black: the value alone; noise is 2.1 sd at its 2 %, 24 of RGB 41 in Y */
		assert_int_equal(setup.hue[0], 0);
		assert_int_equal(setup.hue[1], 179);
		assert_int_equal(setup.value[0], 0);
		assert_true(setup.value[1] > 30 && setup.value[1] < 80);
		assert_true(setup.full_px == 7 && setup.depth_mm_px == 3);
		vision = incise_vision_new(&setup, NULL);
		assert_non_null(vision);
		assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
		assert_true(r.found);
		assert_true(fabs(r.length_px - length) < 0.3);
		incise_vision_free(vision);
		free((void *)frame.data);
	}
}

/* Of one colour, and noise of one level. */
static struct incise_camera_frame plain(uint8_t *data, int red, int green, int blue)
{
	for (int i = 0; i < 64 * 64; i++) {
		data[3 * i] = (uint8_t)(red + i % 2);
		data[3 * i + 1] = (uint8_t)(green + i / 2 % 2);
		data[3 * i + 2] = (uint8_t)(blue + i / 4 % 2);
	}
	return (struct incise_camera_frame){.width = 64,
					    .height = 64,
					    .stride = 192,
					    .data = data,
					    .size = 64 * 64 * 3};
}

static void colours_have_a_hue(void **state)
{
	static uint8_t data[64 * 64 * 3];
	static const struct incise_vision_box all = {0, 0, 64, 64};
	struct incise_camera_frame frame = plain(data, 20, 200, 20); /* green: 60 */
	struct incise_vision_setup setup = {0};

	assert_int_equal(incise_vision_learn(&frame, &all, &setup, NULL), 0);
	assert_true(setup.hue[0] >= 50 && setup.hue[0] <= 56);
	assert_true(setup.hue[1] >= 64 && setup.hue[1] <= 70);
	assert_true(setup.saturation[0] > 60);
	/* red is at both ends of the scale */
	frame = plain(data, 200, 20, 20);
	assert_int_equal(incise_vision_learn(&frame, &all, &setup, NULL), 0);
	assert_true(setup.hue[0] > 165 && setup.hue[1] < 15);
	/* grey: no hue */
	frame = plain(data, 150, 150, 150);
	assert_int_equal(incise_vision_learn(&frame, &all, &setup, NULL), 0);
	assert_true(setup.hue[0] == 0 && setup.hue[1] == 179);
	assert_true(setup.saturation[1] < 40 && setup.value[0] > 60);
}

static void two_colours_are_refused(void **state)
{
	static const struct incise_vision_box across = {260, 200, 60, 60};
	struct incise_vision_setup setup = {.value = {1, 2}}, before = setup;
	struct incise_error err = {0};
	double length;
	struct incise_camera_frame frame = drawn(INCISE_PIXELS_RGB, 2, &length);

	assert_int_equal(incise_vision_learn(&frame, &across, &setup, &err), -ERANGE);
	assert_int_equal(err.code, ERANGE);
	assert_non_null(strstr(err.text, "not one colour"));
	assert_memory_equal(&setup, &before, sizeof(setup));
	free((void *)frame.data);
}

static void a_box_elsewhere_is_refused(void **state)
{
	static const struct incise_vision_box bad[] = {
		{-1, 0, 5, 5},	{0, 0, 0, 5},	      {636, 0, 5, 5},
		{0, 476, 5, 5}, {INT32_MAX, 0, 5, 5}, {5, 5, INT32_MAX, 5},
		{0, -5, 5, 5},
	};
	struct incise_vision_setup setup = {0};
	double length;
	struct incise_camera_frame frame = drawn(INCISE_PIXELS_RGB, 2, &length);

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++)
		assert_int_equal(incise_vision_learn(&frame, &bad[i], &setup, NULL),
				 -EINVAL);
	frame.stride = 5;
	assert_int_equal(incise_vision_learn(&frame, &box, &setup, NULL), -EINVAL);
	free((void *)frame.data);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_is_learnt_finds_the_handle),
		cmocka_unit_test(colours_have_a_hue),
		cmocka_unit_test(two_colours_are_refused),
		cmocka_unit_test(a_box_elsewhere_is_refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
