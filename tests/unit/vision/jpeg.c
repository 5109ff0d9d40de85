// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/vision/jpeg.c, image.cc: JPEG frames, whole, truncated at any byte, damaged. */
#include "../unit.h"
#include <jpeglib.h>
#include <incise/vision.h>
#include "../../vision/scalpel_picture.h"

static const struct incise_vision_setup black = {
	.hue = {0, 179}, .saturation = {0, 255}, .value = {0, 60}};

/* As a camera sends it: quality 90, colour at a quarter of the pixels. */
static struct incise_camera_frame encoded(const struct incise_camera_frame *rgb,
					  bool progressive)
{
	struct incise_camera_frame frame = *rgb;
	struct jpeg_compress_struct jpeg;
	struct jpeg_error_mgr errors;
	unsigned char *data = NULL;
	unsigned long size = 0;

	jpeg.err = jpeg_std_error(&errors);
	jpeg_create_compress(&jpeg);
	jpeg_mem_dest(&jpeg, &data, &size);
	jpeg.image_width = rgb->width;
	jpeg.image_height = rgb->height;
	jpeg.input_components = 3;
	jpeg.in_color_space = JCS_RGB;
	jpeg_set_defaults(&jpeg);
	jpeg_set_quality(&jpeg, 90, TRUE);
	if (progressive)
		jpeg_simple_progression(&jpeg);
	jpeg_start_compress(&jpeg, TRUE);
	for (int y = 0; y < rgb->height; y++) {
		JSAMPROW row = (JSAMPROW)rgb->data + (size_t)y * rgb->stride;

		jpeg_write_scanlines(&jpeg, &row, 1);
	}
	jpeg_finish_compress(&jpeg);
	jpeg_destroy_compress(&jpeg);
	frame.pixels = INCISE_PIXELS_MJPEG;
	frame.stride = 0;
	frame.data = data;
	frame.size = size;
	return frame;
}

static struct incise_camera_frame drawn(int i, double *length)
{
	struct incise_camera_frame rgb, jpeg;
	struct scalpel_picture p;
	uint64_t random = i;

	scalpel_picture_init(&p);
	p.x += 10 * scalpel_picture_random(&random);
	p.y += scalpel_picture_random(&random);
	p.length_px += scalpel_picture_random(&random);
	p.angle_deg = 20 * scalpel_picture_random(&random) - 10;
	p.noise = 2;
	p.blur_px = 1;
	p.seed = i;
	*length = p.length_px;
	assert_int_equal(scalpel_picture_draw(&p, &rgb), 0);
	jpeg = encoded(&rgb, false);
	free((void *)rgb.data);
	return jpeg;
}

TEST(length_is_that_of_the_picture)
{
	enum { FRAMES = 16 };
	struct incise_vision *vision = incise_vision_new(&black, NULL);
	double sum = 0, square = 0;

	assert_non_null(vision);
	for (int i = 0; i < FRAMES; i++) {
		struct incise_vision_result r;
		double length, error;
		struct incise_camera_frame frame = drawn(i, &length);

		/* the first is searched as a whole, the others in a region */
		assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
		assert_true(r.found);
		error = r.length_px - length;
		sum += error;
		square += error * error;
		free((void *)frame.data);
	}
	sum /= FRAMES;
	square = sqrt(fmax(0, square / FRAMES - sum * sum));
	print_message("JPEG: bias %+.3f px, sd %.3f\n", sum, square);
	assert_true(fabs(sum) <= 0.1);
	/* Luma alone has a step of 41 levels, and 8 x 8 blocks their own noise. */
	assert_true(square <= 0.08);
	incise_vision_free(vision);
}

TEST(what_ends_early_is_refused)
{
	struct incise_vision_result r;
	double length;
	struct incise_camera_frame whole = drawn(1, &length);

	for (size_t size = 0; size < whole.size; size += 1 + size / 20) {
		struct incise_vision *vision = incise_vision_new(&black, NULL);
		/* a copy, so that a read behind its end is detected */
		uint8_t *copy = malloc(size + 1);
		struct incise_camera_frame frame = whole;

		memcpy(copy, whole.data, size);
		frame.data = copy;
		frame.size = size;
		if (size < whole.size - 2)
			assert_int_equal(incise_vision_measure(vision, &frame, &r),
					 -EBADMSG);
		assert_false(r.found);
		free(copy);
		incise_vision_free(vision);
	}
	free((void *)whole.data);
}

TEST(garbage_does_no_harm)
{
	struct incise_vision *vision = incise_vision_new(&black, NULL);
	uint64_t random = 3;
	double length;
	struct incise_camera_frame frame = drawn(2, &length);
	uint8_t *copy = malloc(frame.size);
	const uint8_t *data = frame.data;
	int refused = 0;

	frame.data = copy;
	for (int i = 0; i < 60; i++) {
		struct incise_vision_result r;
		int ret;

		memcpy(copy, data, frame.size);
		for (int k = 0; k <= i % 8; k++)
			copy[(size_t)(scalpel_picture_random(&random) *
				      (k == 0 ? 700 : frame.size))] =
				(uint8_t)(256 * scalpel_picture_random(&random));
		ret = incise_vision_measure(vision, &frame, &r);
		assert_true(ret == 0 || ret == -EBADMSG || ret == -EINVAL);
		assert_true(!r.found || isfinite(r.length_px));
		refused += ret != 0;
	}
	assert_true(refused > 10);
	free((void *)data);
	free(copy);
	incise_vision_free(vision);
}

TEST(other_sizes_and_progressive_ones_are_refused)
{
	struct incise_vision *vision = incise_vision_new(&black, NULL);
	struct incise_vision_result r;
	struct incise_camera_frame rgb, frame;
	struct scalpel_picture p;

	scalpel_picture_init(&p);
	assert_int_equal(scalpel_picture_draw(&p, &rgb), 0);
	frame = encoded(&rgb, false);
	frame.height = 360;
	assert_int_equal(incise_vision_measure(vision, &frame, &r), -EINVAL);
	free((void *)frame.data);
	frame = encoded(&rgb, true);
	assert_int_equal(incise_vision_measure(vision, &frame, &r), -EBADMSG);
	free((void *)frame.data);
	free((void *)rgb.data);
	incise_vision_free(vision);
}

/* Cameras leave out the standard tables. */
TEST(huffman_tables_may_be_missing)
{
	struct incise_vision *vision = incise_vision_new(&black, NULL);
	struct incise_vision_result r;
	double length;
	struct incise_camera_frame frame = drawn(4, &length);
	uint8_t *data = (uint8_t *)frame.data;
	size_t at = 2;

	while (at + 4 < frame.size && data[at] == 0xff && data[at + 1] != 0xda) {
		size_t size = 2 + (size_t)(data[at + 2] << 8 | data[at + 3]);

		if (data[at + 1] != 0xc4) {
			at += size;
			continue;
		}
		memmove(data + at, data + at + size, frame.size - at - size);
		frame.size -= size;
	}
	assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
	assert_true(r.found && fabs(r.length_px - length) < 0.3);
	free(data);
	incise_vision_free(vision);
}
