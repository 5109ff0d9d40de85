/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Image files: PNG, JPEG, PGM and PPM of 8 bits into a frame of a camera, pixels into a PNG.
 */
#ifndef INCISE_IMAGE_H
#define INCISE_IMAGE_H

#include <stdint.h>
#include <incise/camera.h>
#include <incise/error.h>

/*
 * Read a file, recognized by its content. A JPEG stays coded: vision decodes it. Fails the
 * program; frame->data is to be freed.
 */
void image_read(const char *path, struct incise_camera_frame *frame);

/* Write rows of RGB from the top; the file appears whole. 0 or a negative errno. */
int image_write_png(const char *path, const uint8_t *rgb, int width, int height,
		    struct incise_error *err);

#endif
