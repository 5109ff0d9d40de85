// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Frames as rows of pixels; see pixels.h.
 */
#include <errno.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#ifdef HAVE_JPEG
#include <jpeglib.h>
#endif
#include "cli.h"
#include "pixels.h"

#define SIDE_MOST 16384
#define PIXELS_MOST (64u << 20)

static bool set_size(struct pixels *pixels, int width, int height, int components)
{
	size_t n = (size_t)width * (size_t)height * (size_t)components;

	if (width < 1 || height < 1 || width > SIDE_MOST || height > SIDE_MOST ||
	    n > 3 * (size_t)PIXELS_MOST)
		return false;
	if (n > pixels->capacity) {
		pixels->bytes = cli_resize(pixels->bytes, n, 1);
		pixels->capacity = n;
	}
	pixels->width = width;
	pixels->height = height;
	pixels->components = components;
	return true;
}

#ifdef HAVE_JPEG
struct jpeg_failure {
	struct jpeg_error_mgr base;
	jmp_buf back;
};

static void jpeg_fail(j_common_ptr jpeg)
{
	longjmp(((struct jpeg_failure *)jpeg->err)->back, 1);
}

/* Warnings of libjpeg are about pixels that are missing: the frame is sent as it is. */
static void jpeg_be_quiet(j_common_ptr jpeg)
{
	(void)jpeg;
}

static int decode_pixels(struct pixels *pixels, const struct incise_camera_frame *frame)
{
	struct jpeg_decompress_struct jpeg;
	struct jpeg_failure failure;

	jpeg.err = jpeg_std_error(&failure.base);
	failure.base.error_exit = jpeg_fail;
	failure.base.output_message = jpeg_be_quiet;
	if (setjmp(failure.back)) {
		jpeg_destroy_decompress(&jpeg);
		return -EBADMSG;
	}
	jpeg_create_decompress(&jpeg);
	jpeg_mem_src(&jpeg, frame->data, frame->size);
	jpeg_read_header(&jpeg, TRUE);
	jpeg.out_color_space = jpeg.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
	if (jpeg.image_width > SIDE_MOST || jpeg.image_height > SIDE_MOST)
		jpeg_fail((j_common_ptr)&jpeg);
	jpeg_start_decompress(&jpeg);
	if (!set_size(pixels, (int)jpeg.output_width, (int)jpeg.output_height,
		      jpeg.output_components))
		jpeg_fail((j_common_ptr)&jpeg);
	while (jpeg.output_scanline < jpeg.output_height) {
		JSAMPROW row = pixels->bytes + (size_t)jpeg.output_scanline *
						       jpeg.output_width *
						       (size_t)jpeg.output_components;

		jpeg_read_scanlines(&jpeg, &row, 1);
	}
	jpeg_finish_decompress(&jpeg);
	jpeg_destroy_decompress(&jpeg);
	return 0;
}

uint8_t *pixels_jpeg(const struct pixels *pixels, size_t *size)
{
	struct jpeg_compress_struct jpeg;
	struct jpeg_error_mgr failure; /* ends the program: memory alone can fail */
	unsigned char *bytes = NULL;
	unsigned long n = 0;

	jpeg.err = jpeg_std_error(&failure);
	jpeg_create_compress(&jpeg);
	jpeg_mem_dest(&jpeg, &bytes, &n);
	jpeg.image_width = (JDIMENSION)pixels->width;
	jpeg.image_height = (JDIMENSION)pixels->height;
	jpeg.input_components = pixels->components;
	jpeg.in_color_space = pixels->components == 1 ? JCS_GRAYSCALE : JCS_RGB;
	jpeg_set_defaults(&jpeg);
	jpeg_start_compress(&jpeg, TRUE);
	while (jpeg.next_scanline < jpeg.image_height) {
		JSAMPROW row = pixels->bytes + (size_t)jpeg.next_scanline *
						       jpeg.image_width *
						       (size_t)jpeg.input_components;

		jpeg_write_scanlines(&jpeg, &row, 1);
	}
	jpeg_finish_compress(&jpeg);
	jpeg_destroy_compress(&jpeg);
	*size = n;
	return bytes;
}
#else
uint8_t *pixels_jpeg(const struct pixels *pixels, size_t *size)
{
	(void)pixels;
	(void)size;
	return NULL;
}

static int decode_pixels(struct pixels *pixels, const struct incise_camera_frame *frame)
{
	(void)pixels;
	(void)frame;
	return -ENOTSUP;
}
#endif

int pixels_convert(struct pixels *pixels, const struct incise_camera_frame *frame)
{
	int components = frame->pixels == INCISE_PIXELS_RGB ? 3 : 1;
	size_t row = (size_t)frame->width *
		     (frame->pixels == INCISE_PIXELS_YUYV ? 2 : (size_t)components);

	if (frame->pixels == INCISE_PIXELS_MJPEG)
		return decode_pixels(pixels, frame);
	if (!set_size(pixels, frame->width, frame->height, components) ||
	    (size_t)frame->stride < row ||
	    frame->size < (size_t)frame->stride * ((size_t)frame->height - 1) + row)
		return -EBADMSG;
	for (int y = 0; y < frame->height; y++) {
		const uint8_t *from = frame->data + (size_t)y * (size_t)frame->stride;
		uint8_t *to =
			pixels->bytes + (size_t)y * (size_t)(frame->width * components);

		if (frame->pixels != INCISE_PIXELS_YUYV)
			memcpy(to, from, row);
		else
			for (int x = 0; x < frame->width; x++)
				to[x] = from[2 * x];
	}
	return 0;
}
