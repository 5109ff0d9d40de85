/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Depth of the blade in a frame. The module vision_opencv.so uses OpenCV (incise/backend.h).
 * The first call of incise_vision_new() or incise_vision_learn() maps it into the process,
 * where it remains. It finds the black scalpel, fits its axis, and finds along the axis its
 * upper end and the edge of the tissue. As in Song et al. (2006), handle and sheath are black
 * down to the tissue, and both ends of the visible part are in the frame: 47.5 mm over 400
 * pixels.
 *
 *         ┌──┐  ┐            length_px: from the upper end of the black part to the edge of
 *         │██│  │            the tissue, along the axis, both at half of the step in
 *         │██│  │ length_px  brightness
 *         │██│  │
 *   ──────┤██├──┘──── tissue depth_mm = (full_px - length_px) · depth_mm_px
 *
 * A blade of bright steel below the black part is not included in length_px: paint it. Pixel
 * (0, 0) covers 0 … 1 in both directions, top row first.
 *
 * Errors that a frame does not show: a hand or glove over the upper end counts as that end;
 * adjacent tissue, blood or shadow with the colour of the handle (in a grey frame, its
 * brightness) counts as part of the handle, and so do up to about 10 pixels within the
 * thresholds next to the tissue. Do not use a depth that jumps from frame to frame, whatever
 * its quality. The result is "not found" if the light brings the tissue within the thresholds,
 * with a dark glove at the handle, and if an object divides the handle in two.
 *
 * Not real-time safe. One thread at a time per object. No function throws a C++ exception. The
 * module switches off OpenCV's threads in the whole process. Loading the module, with some 25
 * libraries, takes milliseconds: create the object before the real-time part.
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

/**
 * Colour of the handle, and where to search; the group `vision` of rig.conf. A pixel
 * belongs to it when hue, saturation and value are within the limits; in a grey frame
 * only the value counts.
 */
struct incise_vision_setup {
	/* OpenCV's scale: hue 0 … 179 (low > high wraps around red), saturation and
	 * value 0 … 255. */
	int hue[2], saturation[2], value[2];
	double full_px;	    /**< exposed length at depth 0; 0: depth stays NaN */
	double depth_mm_px; /**< calibration.conf; above 0 where full_px is */
	struct incise_vision_box roi; /**< searched first; width 0: all */
};

/** Measurement of one frame. */
struct incise_vision_result {
	int64_t t_ns;	  /**< time of the frame */
	bool found;	  /**< if false, the numbers are NaN and the quality is 0 */
	double length_px; /**< exposed length, sub-pixel */
	/** standard deviation of length_px, from the residuals of the fits; 0.6 to 2 times that
	 * over many frames, depending on the texture of the tissue */
	double sd_px;
	double depth_mm;   /**< a little below 0 is noise; NaN without full_px */
	double edge_px[2]; /**< where the axis meets the tissue: x, y */
	double axis[2];	   /**< unit, down the handle */
	/**
	 * 0 … 1, the smallest of: step at the tissue over 10 sd of the residuals there; 1 -
	 * rms of the handle's sides from straight lines / 3 px; share of the pixels at both
	 * ends that the fits kept, from 1/2 (0) to 1 (1); 1 - residuals in excess of noise /
	 * 10 % of the step, for example of a shelf of blood; 1/4 where the colour of the
	 * handle changes at once, for example by a shadow, blood or a mirror image. Below 0.2
	 * found is false.
	 */
	double quality;
	const char *why; /**< why it was not found, in words; static */
};

struct incise_vision;

/**
 * Load the module and make an object.
 *
 * @return object, to be freed with incise_vision_free(); NULL with errno EINVAL (a value out of
 *         range), ENOMEM; ENOENT (the module is not installed; the message names the folder),
 *         ENOEXEC (it is broken, or lacks a library)
 */
INCISE_API struct incise_vision *incise_vision_new(
	const struct incise_vision_setup *setup, struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_vision_free(struct incise_vision *vision);

/**
 * Measure a frame. The region of interest follows the handle; if the handle is not in it, the
 * whole frame is searched. The handle must be within 60° of vertical, longer than 1.5 times
 * its width, and away from the border.
 *
 * @return 0, also without a handle; -EINVAL (invalid sizes: below 16 or above 8192 pixels, a
 *         stride or size too small, YUYV of an odd width, a JPEG whose size differs from the
 *         frame's), -EBADMSG (a JPEG that cannot be decoded down to the end of the region),
 *         -ENOMEM, -EIO (OpenCV failed); on errors result->found is false.
 */
INCISE_API int incise_vision_measure(struct incise_vision *vision,
				     const struct incise_camera_frame *frame,
				     struct incise_vision_result *result);

/**
 * Learn the handle's thresholds from a box of pixels on it, or from a click, a box of 1 ×
 * 1, which stands for 7 × 7 around it. For black, only the value is learnt. Only the
 * thresholds of *setup are written.
 *
 * @return 0; -EINVAL (the box is not within the frame), -ERANGE (the box has several colours;
 *         the message gives their range); as incise_vision_measure(), and -ENOENT, -ENOEXEC
 *         as incise_vision_new()
 */
INCISE_API int incise_vision_learn(const struct incise_camera_frame *frame,
				   const struct incise_vision_box *box,
				   struct incise_vision_setup *setup,
				   struct incise_error *err);

INCISE_END_DECLS
#endif
