// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of tools/cli/pixels.c: frames of all formats as rows without gaps, and damaged ones.
 */
#include "../unit.h"
#if __has_include(<jpeglib.h>)
#include <jpeglib.h>
#define PEER 1
#endif
#include "../../../tools/cli/pixels.h"

enum { WIDTH = 6, HEIGHT = 3, STRIDE = 24 };

TEST(rows_lose_their_gaps)
{
	static const struct {
		enum incise_pixels pixels;
		int components, step;
	} cases[] = {{INCISE_PIXELS_RGB, 3, 1},
		     {INCISE_PIXELS_GREY, 1, 1},
		     {INCISE_PIXELS_YUYV, 1, 2}};
	uint8_t data[STRIDE * HEIGHT];
	struct pixels pixels = {0};

	for (int i = 0; i < STRIDE * HEIGHT; i++)
		data[i] = (uint8_t)i;
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int row = WIDTH * cases[i].components * cases[i].step;
		struct incise_camera_frame frame = {
			.width = WIDTH,
			.height = HEIGHT,
			.stride = STRIDE,
			.pixels = cases[i].pixels,
			.data = data,
			/* the last row needs no gap behind it */
			.size = (size_t)(STRIDE * (HEIGHT - 1) + row),
		};

		assert_int_equal(pixels_convert(&pixels, &frame), 0);
		assert_int_equal(pixels.width, WIDTH);
		assert_int_equal(pixels.height, HEIGHT);
		assert_int_equal(pixels.components, cases[i].components);
		for (int y = 0; y < HEIGHT; y++)
			for (int x = 0; x < WIDTH * cases[i].components; x++)
				assert_int_equal(
					pixels.bytes[y * WIDTH * cases[i].components + x],
					STRIDE * y + cases[i].step * x);
		frame.size--;
		assert_int_equal(pixels_convert(&pixels, &frame), -EBADMSG);
		frame.size++;
		frame.stride = row - 1;
		assert_int_equal(pixels_convert(&pixels, &frame), -EBADMSG);
		frame.stride = STRIDE;
		frame.width = 0;
		assert_int_equal(pixels_convert(&pixels, &frame), -EBADMSG);
		frame.width = 1 << 20;
		assert_int_equal(pixels_convert(&pixels, &frame), -EBADMSG);
	}
	free(pixels.bytes);
}

#ifdef PEER
/* A frame of one colour. */
static size_t encode(int components, uint8_t **bytes)
{
	struct jpeg_compress_struct jpeg;
	struct jpeg_error_mgr error;
	unsigned char *out = NULL;
	unsigned long n = 0;
	uint8_t row[3 * 32];
	JSAMPROW rows = row;

	for (int i = 0; i < 3 * 32; i++)
		row[i] = components == 3 ? (uint8_t[]){200, 100, 50}[i % 3] : 77;
	jpeg.err = jpeg_std_error(&error);
	jpeg_create_compress(&jpeg);
	jpeg_mem_dest(&jpeg, &out, &n);
	jpeg.image_width = 32;
	jpeg.image_height = 16;
	jpeg.input_components = components;
	jpeg.in_color_space = components == 3 ? JCS_RGB : JCS_GRAYSCALE;
	jpeg_set_defaults(&jpeg);
	jpeg_set_quality(&jpeg, 95, TRUE);
	jpeg_start_compress(&jpeg, TRUE);
	while (jpeg.next_scanline < jpeg.image_height)
		jpeg_write_scanlines(&jpeg, &rows, 1);
	jpeg_finish_compress(&jpeg);
	jpeg_destroy_compress(&jpeg);
	*bytes = out;
	return n;
}

TEST(a_jpeg_is_decoded_as_it_is)
{
	for (int components = 1; components <= 3; components += 2) {
		uint8_t *bytes;
		size_t n = encode(components, &bytes);
		struct incise_camera_frame frame = {
			.pixels = INCISE_PIXELS_MJPEG, .data = bytes, .size = n};
		struct pixels pixels = {0};

		assert_int_equal(pixels_convert(&pixels, &frame), 0);
		assert_int_equal(pixels.width, 32);
		assert_int_equal(pixels.height, 16);
		assert_int_equal(pixels.components, components);
		/* one colour at 95 %: rounding alone */
		for (int i = 0; i < 32 * 16 * components; i++)
			assert_in_range(
				pixels.bytes[i],
				(components == 3 ? (int[]){200, 100, 50}[i % 3] : 77) - 3,
				(components == 3 ? (int[]){200, 100, 50}[i % 3] : 77) +
					3);
		/* each end, and each changed byte: an error or a frame, nothing else */
		for (size_t i = 0; i < n; i++) {
			int rc;

			frame.size = i;
			rc = pixels_convert(&pixels, &frame);
			assert_true(!rc || rc == -EBADMSG);
			frame.size = n;
			bytes[i] ^= 0x55;
			rc = pixels_convert(&pixels, &frame);
			assert_true(!rc || rc == -EBADMSG);
			bytes[i] ^= 0x55;
		}
		frame.size = 0;
		assert_int_equal(pixels_convert(&pixels, &frame), -EBADMSG);
		free(pixels.bytes);
		free(bytes);
	}
}
#else
TEST(a_jpeg_is_decoded_as_it_is)
{
	skip(); /* libjpeg-dev is not installed */
}
#endif
