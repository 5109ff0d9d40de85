/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Pictures of the scalpel over the tissue.
 */
#ifndef INCISE_CAMERA_H
#define INCISE_CAMERA_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** One picture; its pixels belong to the camera until the next read. */
struct incise_camera_frame {
	int64_t t_ns; /**< middle of the exposure */
	uint64_t seq; /**< counts from 0; a gap is a lost picture */
	int width, height;
	int stride;	    /**< bytes from row to row */
	const uint8_t *rgb; /**< 3 bytes a pixel, red first, top row first */
};

/** What a camera says of itself. */
struct incise_camera_info {
	char name[64];
	double rate_hz;
	int width, height;
};

struct incise_camera;

/**
 * Take the newest picture, without waiting. Older ones not yet taken count as lost.
 *
 * @return 1 with a picture, 0 with none; -EIO, -ENODEV (unplugged).
 */
INCISE_API int incise_camera_read(struct incise_camera *camera,
				  struct incise_camera_frame *frame);

INCISE_API void incise_camera_info(const struct incise_camera *camera,
				   struct incise_camera_info *info);

/** Pictures lost so far. */
INCISE_API uint64_t incise_camera_lost(const struct incise_camera *camera);

INCISE_END_DECLS
#endif
