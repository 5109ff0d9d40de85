/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Depth of the blade from a picture. It is done by a module on OpenCV, vision_opencv.so
 * (incise/backend.h), which the first call of incise_vision_new() or incise_vision_learn()
 * maps into the process, to stay there; who calls neither never maps it. The black scalpel
 * is found, its axis fitted, and along the axis its upper end and the place where the tissue
 * begins. As in paper 1, handle and
 * sheath are black all the way into the tissue, and both ends of what is seen of them are
 * in the picture: 47.5 mm over 400 pixels there.
 *
 *         ┌──┐  ┐            length_px: from the upper end of what is black to the edge
 *         │██│  │            of the tissue, along the axis, both at half of the step in
 *         │██│  │ length_px  brightness
 *         │██│  │
 *   ──────┤██├──┘──── tissue depth_mm = (full_px - length_px) · depth_mm_px
 *
 * A blade of bright steel below the black is not part of length_px: paint it.
 * Pixel (0, 0) covers 0 … 1 in both directions, top row first.
 *
 * What no picture tells: a hand or glove over the upper end is taken for that end; tissue,
 * blood or a shadow of the very colour of the handle, in grey of its very brightness, that
 * goes on with it is taken for more of it; so are less than about 10 pixels of any colour
 * that is within the thresholds, next to the tissue. A depth that leaps from picture to
 * picture is worth no trust whatever its quality. Light that leaves the tissue within the
 * handle's thresholds, a dark glove at the handle, and anything that cuts the handle in two
 * give "not found".
 *
 * Not real-time safe. One thread at a time per object. No exception of C++ comes out.
 * OpenCV is told to use no threads of its own, in the whole process.
 * Loading the module, with some 25 libraries, takes milliseconds: who must not wait makes
 * the object before.
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
 * What the handle looks like, and where to look; the group `vision` of rig.conf. A pixel
 * belongs to it when hue, saturation and value all are within; of a grey picture only the
 * value counts.
 */
struct incise_vision_setup {
	/* OpenCV's scale: hue 0 … 179 (low > high wraps around red), saturation and
	 * value 0 … 255. */
	int hue[2], saturation[2], value[2];
	double full_px;	    /**< exposed length at depth 0; 0: depth stays NaN */
	double depth_mm_px; /**< calibration.conf; above 0 where full_px is */
	struct incise_vision_box roi; /**< where it is looked for first; width 0: all */
};

/** What was seen in a picture. */
struct incise_vision_result {
	int64_t t_ns;	  /**< of the picture */
	bool found;	  /**< else the numbers are NaN, the quality 0 */
	double length_px; /**< exposed, sub-pixel */
	/** standard deviation of length_px, from what the fits leave; 0.6 to 2 times that of
	 * many pictures, by the tissue's texture */
	double sd_px;
	double depth_mm;   /**< a little below 0 is noise; NaN without full_px */
	double edge_px[2]; /**< where the axis meets the tissue: x, y */
	double axis[2];	   /**< unit, down the handle */
	/**
	 * 0 … 1, the least of: step at the tissue over 10 sd of what is left of the fit
	 * there; 1 - rms of the handle's sides from straight lines / 3 px; share of the
	 * pixels at both ends that the fits kept, from 1/2 (0) to 1 (1); 1 - what the fits
	 * leave beside noise / 10 % of the step, as a shelf of blood does; 1/4 where the
	 * colour of what is taken for the handle changes at once: shadow, blood or a mirror
	 * image may go on with it. Below 0.2 nothing is found.
	 */
	double quality;
	const char *why; /**< not found: why, in words; static */
};

struct incise_vision;

/**
 * @return to be freed; NULL with errno EINVAL (a value out of range), ENOMEM; ENOENT (the
 *         module is not installed: the message says where it was looked for), ENOEXEC (it
 *         is broken, or lacks a library)
 */
INCISE_API struct incise_vision *incise_vision_new(
	const struct incise_vision_setup *setup, struct incise_error *err);

/** NULL is allowed. */
INCISE_API void incise_vision_free(struct incise_vision *vision);

/**
 * Look at a picture. The region of interest follows what was found; where nothing is found
 * in it the whole picture is searched. The handle must be within 60° of upright, longer
 * than 1.5 times its width, and off the picture's border.
 *
 * @return 0, also where no handle is to be seen; -EINVAL (sizes that do not fit: below 16
 *         or above 8192 pixels, a stride or size too small, YUYV of an odd width, a JPEG of
 *         other sizes than the frame says), -EBADMSG (a JPEG that cannot be decoded, as far
 *         down as the region goes), -ENOMEM, -EIO (OpenCV failed). *result says found =
 *         false then.
 */
INCISE_API int incise_vision_measure(struct incise_vision *vision,
				     const struct incise_camera_frame *frame,
				     struct incise_vision_result *result);

/**
 * Learn the handle's thresholds from a box of pixels on it, or from a click, which is a box
 * of 1 × 1 and stands for 7 × 7 around it. Of what is black the value alone counts. Only
 * the thresholds of *setup are written.
 *
 * @return 0; -EINVAL (the box is not within the picture), -ERANGE (what is in the box is not
 *         of one colour: the message says what it spans); as incise_vision_measure(), and
 *         -ENOENT, -ENOEXEC as incise_vision_new()
 */
INCISE_API int incise_vision_learn(const struct incise_camera_frame *frame,
				   const struct incise_vision_box *box,
				   struct incise_vision_setup *setup,
				   struct incise_error *err);

INCISE_END_DECLS
#endif
