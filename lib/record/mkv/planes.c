// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Pixels of a camera to those of FFV1 and back; see planes.h.
 */
#include <string.h>
#include "../frames.h"
#include "planes.h"

enum AVPixelFormat planes_format(enum incise_pixels pixels)
{
	switch (pixels) {
	case INCISE_PIXELS_RGB:
		return AV_PIX_FMT_BGR0;
	case INCISE_PIXELS_GREY:
		return AV_PIX_FMT_GRAY8;
	case INCISE_PIXELS_YUYV:
		return AV_PIX_FMT_YUV422P;
	default:
		return AV_PIX_FMT_NONE;
	}
}

/* Rows of @planes at @y. */
static uint8_t *row_of(const AVFrame *planes, int plane, int y)
{
	return planes->data[plane] + (ptrdiff_t)y * planes->linesize[plane];
}

static void yuyv_from(const AVFrame *planes, int y, const uint8_t *restrict from)
{
	uint8_t *restrict luma = row_of(planes, 0, y);
	uint8_t *restrict u = row_of(planes, 1, y), *restrict v = row_of(planes, 2, y);

	for (int x = 0; x < planes->width / 2; x++) {
		luma[2 * x] = from[4 * x];
		u[x] = from[4 * x + 1];
		luma[2 * x + 1] = from[4 * x + 2];
		v[x] = from[4 * x + 3];
	}
}

static void yuyv_to(const AVFrame *planes, int y, uint8_t *restrict to)
{
	const uint8_t *luma = row_of(planes, 0, y);
	const uint8_t *u = row_of(planes, 1, y), *v = row_of(planes, 2, y);

	for (int x = 0; x < planes->width / 2; x++) {
		to[4 * x] = luma[2 * x];
		to[4 * x + 1] = u[x];
		to[4 * x + 2] = luma[2 * x + 1];
		to[4 * x + 3] = v[x];
	}
}

static void rgb_from(const AVFrame *planes, int y, const uint8_t *restrict from)
{
	uint8_t *restrict bgr = row_of(planes, 0, y);

	for (int x = 0; x < planes->width; x++) {
		bgr[4 * x] = from[3 * x + 2];
		bgr[4 * x + 1] = from[3 * x + 1];
		bgr[4 * x + 2] = from[3 * x];
		bgr[4 * x + 3] = 0;
	}
}

static void rgb_to(const AVFrame *planes, int y, uint8_t *restrict to)
{
	const uint8_t *bgr = row_of(planes, 0, y);

	for (int x = 0; x < planes->width; x++) {
		to[3 * x] = bgr[4 * x + 2];
		to[3 * x + 1] = bgr[4 * x + 1];
		to[3 * x + 2] = bgr[4 * x];
	}
}

void planes_from(AVFrame *planes, const struct incise_camera_frame *frame)
{
	for (int y = 0; y < planes->height; y++) {
		const uint8_t *from = frame->data + (size_t)y * frame->stride;

		if (frame->pixels == INCISE_PIXELS_YUYV)
			yuyv_from(planes, y, from);
		else if (frame->pixels == INCISE_PIXELS_RGB)
			rgb_from(planes, y, from);
		else
			memcpy(row_of(planes, 0, y), from, (size_t)planes->width);
	}
}

void planes_to(const AVFrame *planes, enum incise_pixels pixels, uint8_t *data)
{
	size_t row = incise_frames_row(pixels, planes->width);

	for (int y = 0; y < planes->height; y++, data += row) {
		if (pixels == INCISE_PIXELS_YUYV)
			yuyv_to(planes, y, data);
		else if (pixels == INCISE_PIXELS_RGB)
			rgb_to(planes, y, data);
		else
			memcpy(data, row_of(planes, 0, y), row);
	}
}
