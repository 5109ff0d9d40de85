/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Frames of the scalpel over the tissue.
 */
#ifndef INCISE_CAMERA_H
#define INCISE_CAMERA_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Pixel formats. */
enum incise_pixels {
	INCISE_PIXELS_RGB,  /**< 3 bytes a pixel, red first */
	INCISE_PIXELS_GREY, /**< 1 byte a pixel */
	INCISE_PIXELS_YUYV, /**< 4 bytes for two pixels: Y0 U Y1 V, full resolution in Y */
	INCISE_PIXELS_MJPEG, /**< a JPEG; stride is 0 */
};

/** One frame; its pixels are valid until the next read that returns one. */
struct incise_camera_frame {
	int64_t t_ns; /**< middle of the exposure */
	uint64_t seq; /**< counts from 0; a gap is a lost frame */
	int width, height;
	int stride; /**< bytes from row to row, top row first */
	enum incise_pixels pixels;
	const uint8_t *data;
	size_t size; /**< bytes of data */
};

/** Properties of a camera. */
struct incise_camera_info {
	char name[64];
	double rate_hz;
	int width, height;
	enum incise_pixels pixels;
	int64_t exposure_ns; /**< 0: unknown; then t_ns is the device's timestamp */
	uint64_t
		damaged; /**< frames that are corrupt or too short; also counted as lost */
	/** Change so far of the age of frames at their arrival, the least of many. */
	int64_t clock_ns;
	char note[300]; /**< a doubt of its timestamps; empty: none */
};

/** Settings of a real camera; the group `camera_setup` of rig.conf. 0: not changed. */
struct incise_camera_setup {
	int width, height;
	double rate_hz;
	enum incise_pixels pixels; /**< default YUYV, which keeps colour edges sharp */
	double exposure_ms;
	double gain; /**< units of the driver */
	double white_balance_K;
	double focus; /**< units of the driver */
	double age_ms; /**< largest age of a timestamp; default exposure + 3 periods + 100 */
};

struct incise_camera;

/**
 * Take the oldest frame, without waiting. Up to 24 frames are queued for a slow reader; if the
 * driver has fewer than 32 buffers, three quarters of them, and at most all but 3. When the
 * queue is full, the oldest frame is lost and counted.
 *
 * @return 1 with a frame, 0 without; -EIO, -ENODEV (unplugged): no more frames will come, and
 *         incise_camera_cause() returns the cause.
 */
INCISE_API int incise_camera_read(struct incise_camera *camera,
				  struct incise_camera_frame *frame);

/** Properties of the camera. */
INCISE_API void incise_camera_info(const struct incise_camera *camera,
				   struct incise_camera_info *info);

/**
 * Take all queued frames and return the newest, for display rather than recording. The others
 * do not count as lost.
 *
 * @return as incise_camera_read(); -EIO, -ENODEV only if no frame was queued
 */
INCISE_API int incise_camera_newest(struct incise_camera *camera,
				    struct incise_camera_frame *frame);

/** Frames lost so far. */
INCISE_API uint64_t incise_camera_lost(const struct incise_camera *camera);

/**
 * Print the cause of a read error in one line that says what to do.
 *
 * @param text empty without an error, or without a known cause
 * @return length of the line, as snprintf(3). Not real-time safe.
 */
INCISE_API int incise_camera_cause(struct incise_camera *camera, char *text, size_t size);

INCISE_END_DECLS
#endif
