/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Pixels of a camera to those of FFV1 and back, without loss.
 *
 *     YUYV  Y0 U Y1 V …  ◄──►  yuv422p  Y0 Y1 …, U …, V …
 *     RGB   R G B …      ◄──►  bgr0     B G R 0 …
 *     grey                     gray8
 */
#ifndef INCISE_FRAMES_PLANES_H
#define INCISE_FRAMES_PLANES_H

#include <libavutil/frame.h>
#include <incise/camera.h>

/* AV_PIX_FMT_NONE: not one of those. */
enum AVPixelFormat planes_format(enum incise_pixels pixels);

/* To planes that are there; sizes are the frame's. */
void planes_from(AVFrame *planes, const struct incise_camera_frame *frame);

/* Back, into rows without padding. */
void planes_to(const AVFrame *planes, enum incise_pixels pixels, uint8_t *data);

#endif
