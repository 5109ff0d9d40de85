/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Frames of any format as rows of luminance or of red, green and blue, without gaps.
 */
#ifndef INCISE_TOOLS_PIXELS_H
#define INCISE_TOOLS_PIXELS_H

#include <stddef.h>
#include <stdint.h>
#include <incise/camera.h>

struct pixels {
	uint8_t *bytes; /* free(3) */
	size_t capacity;
	int width, height, components; /* 1 or 3 */
};

/*
 * Convert a frame: YUYV to its luminance, a JPEG to its pixels. Returns 0; -EBADMSG (damaged, or
 * sizes that contradict each other), -ENOTSUP (a JPEG, and this program has no libjpeg).
 */
int pixels_convert(struct pixels *pixels, const struct incise_camera_frame *frame);

/* A JPEG of them, and its size: free(3). NULL: this program has no libjpeg, or there is no memory. */
uint8_t *pixels_jpeg(const struct pixels *pixels, size_t *size);

#endif
