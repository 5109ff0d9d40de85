/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Depth of the blade from a picture: the black handle is found, its axis fitted, and along
 * the axis the place where the tissue begins (libincise-vision, on OpenCV). What of the
 * handle can be seen, and how long it is, gives the depth.
 *
 *      ██ handle            length_px: from the handle's lower end, along its axis, to the
 *      ██                   edge of the tissue, at half of the step in brightness
 *      ▓▓ ┐
 *      ││ │ length_px       depth_mm = (full_px - length_px) · depth_mm_px
 *   ───┴┴─┘───── tissue
 *
 * Not real-time safe. One thread at a time per object. No exception of C++ comes out.
 */
#ifndef INCISE_VISION_H
#define INCISE_VISION_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/camera.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A rectangle of pixels. */
struct incise_vision_box {
	int x, y, width, height;
};

/** What the handle looks like, and where to look; the group `vision` of rig.conf. */
struct incise_vision_setup {
	/* Of the handle, by OpenCV's scale: hue 0 … 179 (low > high wraps around red),
	 * saturation and value 0 … 255. */
	int hue[2], saturation[2], value[2];
	double full_px;	    /**< exposed length at depth 0; 0: depth stays NaN */
	double depth_mm_px; /**< calibration.conf */
	struct incise_vision_box roi; /**< where it is looked for first; width 0: all */
};

/** What was seen in a picture. */
struct incise_vision_result {
	int64_t t_ns;	  /**< of the picture */
	bool found;	  /**< else the numbers are NaN */
	double length_px; /**< exposed, sub-pixel */
	double depth_mm;
	double edge_px[2]; /**< where the axis meets the tissue: x, y */
	double axis[2];	   /**< unit, down the handle */
	double quality;	 /**< 0 … 1: contrast of the edge, straightness of the sides */
	const char *why; /**< not found: why, in words; lives as long as the object */
};

struct incise_vision;

/** @return NULL with errno EINVAL (a threshold out of range), ENOMEM; to be freed. */
INCISE_API struct incise_vision *incise_vision_new(
	const struct incise_vision_setup *setup, struct incise_error *err);

INCISE_API void incise_vision_free(struct incise_vision *vision);

/**
 * Look at a picture. The region of interest follows what was found.
 *
 * @return 0, also where no handle is to be seen; -EINVAL (a picture whose sizes do not fit),
 *         -EBADMSG (a JPEG that cannot be decoded), -ENOMEM.
 */
INCISE_API int incise_vision_measure(struct incise_vision *vision,
				     const struct incise_camera_frame *frame,
				     struct incise_vision_result *result);

/**
 * Learn the handle's thresholds from a box of pixels on it, or from a click, which is a box
 * of 1 × 1.
 *
 * @return 0; -EINVAL (the box is not within the picture), -ERANGE (what is in the box is not
 *         of one colour: the message says what it spans)
 */
INCISE_API int incise_vision_learn(const struct incise_camera_frame *frame,
				   const struct incise_vision_box *box,
				   struct incise_vision_setup *setup,
				   struct incise_error *err);

INCISE_END_DECLS
#endif
