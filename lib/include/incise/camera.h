/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Pictures of the scalpel over the tissue.
 */
#ifndef INCISE_CAMERA_H
#define INCISE_CAMERA_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** How a picture's bytes are pixels. */
enum incise_pixels {
	INCISE_PIXELS_RGB,  /**< 3 bytes a pixel, red first */
	INCISE_PIXELS_GREY, /**< 1 byte a pixel */
	INCISE_PIXELS_YUYV, /**< 4 bytes for two pixels: Y0 U Y1 V, full resolution in Y */
	INCISE_PIXELS_MJPEG, /**< a JPEG picture; stride is 0 */
};

/** One picture; its pixels belong to the camera until the next read that gives one. */
struct incise_camera_frame {
	int64_t t_ns; /**< middle of the exposure */
	uint64_t seq; /**< counts from 0; a gap is a lost picture */
	int width, height;
	int stride; /**< bytes from row to row, top row first */
	enum incise_pixels pixels;
	const uint8_t *data;
	size_t size; /**< bytes of data */
};

/** What a camera says of itself. */
struct incise_camera_info {
	char name[64];
	double rate_hz;
	int width, height;
	enum incise_pixels pixels;
	int64_t exposure_ns; /**< 0: not known; then t_ns is what the device stamped */
	uint64_t damaged; /**< pictures that came with an error or too short; lost too */
};

/** What a real camera is set to; the group `camera_setup` of rig.conf. 0: as it is. */
struct incise_camera_setup {
	int width, height;
	double rate_hz;
	enum incise_pixels
		pixels; /**< YUYV has no smear of colour at an edge; the default */
	double exposure_ms;
	double gain; /**< the driver's units */
	double white_balance_K;
	double focus; /**< the driver's units */
};

struct incise_camera;

/**
 * Take the oldest picture that waits, without waiting for one. Up to 24 wait for a reader that
 * is held up; fewer where the driver of a camera has fewer than 32 buffers: three quarters of
 * them, and all but 3 at most. Where there is no more room the oldest is lost, and counted.
 *
 * @return 1 with a picture, 0 with none; -EIO, -ENODEV (unplugged): then
 *         incise_camera_cause() says why, and no picture will come any more.
 */
INCISE_API int incise_camera_read(struct incise_camera *camera,
				  struct incise_camera_frame *frame);

/** What it says of itself. */
INCISE_API void incise_camera_info(const struct incise_camera *camera,
				   struct incise_camera_info *info);

/**
 * Take all that wait, and keep the newest: for who looks, and does not record. Those before
 * it do not count as lost.
 *
 * @return as incise_camera_read(); -EIO, -ENODEV only where no picture waited
 */
INCISE_API int incise_camera_newest(struct incise_camera *camera,
				    struct incise_camera_frame *frame);

/** Pictures lost so far. */
INCISE_API uint64_t incise_camera_lost(const struct incise_camera *camera);

/**
 * Why read() gives an error, in one line that says what to do: what was unplugged, which
 * control has changed from what it was locked at.
 *
 * @param text always a string; empty as long as there is no error, or nothing is known
 * @return length of the line, as snprintf(3). For people: not real-time safe.
 */
INCISE_API int incise_camera_cause(struct incise_camera *camera, char *text, size_t size);

INCISE_END_DECLS
#endif
