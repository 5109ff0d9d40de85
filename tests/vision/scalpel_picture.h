/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pictures of a black scalpel over liver whose truth is known to a hundredth of a pixel:
 * for tests/bench/vision and the tests of lib/vision. Apart from the virtual camera of
 * the library on purpose.
 *
 *          ┌──┐             Edges are sampled 256 times per pixel. angle_deg turns the
 *          │  │ length_px   scalpel clockwise; it meets the tissue at x, y, square to its
 *          │  │             axis, or level as a surface that is seen from the side.
 *   ───────┴──┴── (x, y)
 */
#ifndef INCISE_SCALPEL_PICTURE_H
#define INCISE_SCALPEL_PICTURE_H

#include <stdbool.h>
#include <incise/camera.h>

struct scalpel_picture {
	int width, height;
	enum incise_pixels pixels; /* RGB, GREY or YUYV */
	double x, y, angle_deg;
	double length_px; /* 0: no scalpel */
	double width_px;
	bool level;
	double blade_px; /* of bright steel, so wide, below the black */
	double blur_px;	 /* sd */
	double noise;	 /* sd, of each byte; the liver's texture is not noise */
	double texture;	 /* of the liver, levels, both ways */
	int spots;	 /* reflections of up to 5 pixels radius on scalpel and liver */
	double gradient; /* of the light, from left to right, as part of it */
	double light;	 /* 1: as it is */
	uint64_t seed;	 /* of noise, texture and spots */
};

/* A picture of VGA's size with a scalpel in its middle, sharp and without noise. */
void scalpel_picture_init(struct scalpel_picture *picture);

/* Draw. 0 or -ENOMEM; frame->data is to be freed. */
int scalpel_picture_draw(const struct scalpel_picture *picture,
			 struct incise_camera_frame *frame);

/* 0 … 1 from a state that goes on. */
double scalpel_picture_random(uint64_t *state);

#endif
