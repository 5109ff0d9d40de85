// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Image files; see image.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef HAVE_PNG
#include <png.h>
#endif
#include <incise/infile.h>
#include <incise/outfile.h>
#include "cli.h"
#include "file_kind.h"
#include "image.h"

#define SIDE_MAX 8192 /* incise/vision.h */

static void check_sides(const char *path, unsigned long width, unsigned long height)
{
	if (width < 16 || height < 16 || width > SIDE_MAX || height > SIDE_MAX)
		cli_fail("%s: %lu x %lu pixels; expected 16 to %d each way", path, width,
			 height, SIDE_MAX);
}

/* The size is in the start-of-frame marker; markers before it have a length. */
static void read_jpeg(const char *path, struct incise_camera_frame *frame)
{
	const uint8_t *d = frame->data;
	size_t at = 2;

	while (at + 9 < frame->size && d[at] == 0xff) {
		uint8_t marker = d[at + 1];

		if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 &&
		    marker != 0xc8 && marker != 0xcc) {
			frame->height = d[at + 5] << 8 | d[at + 6];
			frame->width = d[at + 7] << 8 | d[at + 8];
			check_sides(path, frame->width, frame->height);
			frame->pixels = INCISE_PIXELS_MJPEG;
			return;
		}
		at += marker == 0xff ? 1 : 2 + (size_t)(d[at + 2] << 8 | d[at + 3]);
	}
	cli_fail("%s: a JPEG without sizes; it may be incomplete", path);
}

/* Parse the next number of a header after blanks and comments; returns its end. */
static size_t read_image_number(const uint8_t *d, size_t size, size_t at,
				unsigned long *value)
{
	bool any = false;

	*value = 0;
	while (at < size && (d[at] == '#' || memchr(" \t\r\n", d[at], 4))) {
		if (d[at] == '#')
			while (at < size && d[at] != '\n')
				at++;
		at += at < size;
	}
	for (; at < size && d[at] >= '0' && d[at] <= '9' && *value < 1000000; at++) {
		*value = 10 * *value + (d[at] - '0');
		any = true;
	}
	return any ? at : size;
}

static void read_pnm(const char *path, struct incise_camera_frame *frame, uint8_t *data)
{
	unsigned long width, height, top;
	size_t at = read_image_number(data, frame->size, 2, &width);
	int channels = data[1] == '6' ? 3 : 1;

	at = read_image_number(data, frame->size, at, &height);
	at = read_image_number(data, frame->size, at, &top) + 1;
	if (at >= frame->size || top != 255)
		cli_fail("%s: expected a PGM or PPM of 8 bits, with 255 in its header",
			 path);
	check_sides(path, width, height);
	if (frame->size - at < width * height * channels)
		cli_fail("%s: incomplete: %zu bytes of pixels, expected %lu", path,
			 frame->size - at, width * height * channels);
	frame->width = (int)width;
	frame->height = (int)height;
	frame->stride = frame->width * channels;
	frame->pixels = channels == 3 ? INCISE_PIXELS_RGB : INCISE_PIXELS_GREY;
	frame->size = (size_t)frame->stride * height;
	memmove(data, data + at, frame->size);
}

#ifdef HAVE_PNG
static void read_png(const char *path, struct incise_camera_frame *frame)
{
	png_image image = {.version = PNG_IMAGE_VERSION};
	uint8_t *pixels;

	if (!png_image_begin_read_from_memory(&image, frame->data, frame->size))
		cli_fail("%s: %s", path, image.message);
	check_sides(path, image.width, image.height);
	image.format =
		image.format & PNG_FORMAT_FLAG_COLOR ? PNG_FORMAT_RGB : PNG_FORMAT_GRAY;
	pixels = cli_alloc(PNG_IMAGE_SIZE(image), 1);
	if (!png_image_finish_read(&image, NULL, pixels, 0, NULL))
		cli_fail("%s: %s", path, image.message);
	frame->width = (int)image.width;
	frame->height = (int)image.height;
	frame->pixels =
		image.format == PNG_FORMAT_RGB ? INCISE_PIXELS_RGB : INCISE_PIXELS_GREY;
	frame->stride = (int)PNG_IMAGE_ROW_STRIDE(image);
	frame->size = PNG_IMAGE_SIZE(image);
	free((uint8_t *)frame->data);
	frame->data = pixels;
}

int image_write_png(const char *path, const uint8_t *rgb, int width, int height,
		    struct incise_error *err)
{
	png_image image = {.version = PNG_IMAGE_VERSION,
			   .width = (png_uint_32)width,
			   .height = (png_uint_32)height,
			   .format = PNG_FORMAT_RGB};
	struct incise_outfile *file = incise_outfile_open(path, err);

	if (!file)
		return -errno;
	if (!png_image_write_to_stdio(&image, incise_outfile_stream(file), 0, rgb, 0,
				      NULL)) {
		incise_outfile_abort(file);
		return incise_error_set(err, EIO, "%s: %s", path, image.message);
	}
	return incise_outfile_commit(file, err);
}
#else
static void read_png(const char *path, struct incise_camera_frame *frame)
{
	(void)frame;
	cli_fail("%s: this build cannot read PNG (no libpng-dev); convert it to PGM",
		 path);
}

int image_write_png(const char *path, const uint8_t *rgb, int width, int height,
		    struct incise_error *err)
{
	(void)rgb, (void)width, (void)height;
	return incise_error_set(err, ENOTSUP,
				"%s: built without PNG: install libpng-dev, build again",
				path);
}
#endif

void image_read(const char *path, struct incise_camera_frame *frame)
{
	static const struct incise_infile_kind image = {
		.name = "a PNG, JPEG, PGM or PPM image",
		.size_max = 64 << 20,
	};
	static const uint8_t png[4] = {0x89, 'P', 'N', 'G'};
	struct incise_error err = {0};
	uint8_t *data;

	*frame = (struct incise_camera_frame){0};
	file_expect(path, FILE_IMAGE);
	data = cli_require(incise_infile_read(path, &image, &frame->size, &err), &err);
	frame->data = data;
	if (frame->size > 10 && !memcmp(data, png, sizeof(png)))
		read_png(path, frame);
	else if (frame->size > 10 && data[0] == 0xff && data[1] == 0xd8)
		read_jpeg(path, frame);
	else if (frame->size > 10 && data[0] == 'P' && (data[1] == '5' || data[1] == '6'))
		read_pnm(path, frame, data);
	else
		cli_fail("%s: not an image; expected PNG, JPEG, PGM or PPM", path);
}
