/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What is drawn on: a framebuffer object with several samples per pixel and depth, and the
 * one of single pixels that it comes to.
 */
#ifndef INCISE_VIEW_TARGET_H
#define INCISE_VIEW_TARGET_H

#include <incise/error.h>

struct incise_target {
	int width, height;
	int samples;	 /* 1: drawn on single pixels straight away */
	unsigned drawn;	 /* framebuffer to draw the scene on */
	unsigned single; /* framebuffer of single pixels; the same with one sample */
	unsigned colour, depth, pixels; /* their renderbuffers */
};

/*
 * Make it that size; what is in it is lost then. With fewer samples when the graphics have
 * no more. 0, -ENOTSUP, -EINVAL (larger than the graphics can).
 */
int incise_target_size(struct incise_target *target, int width, int height,
		       struct incise_error *err);

/* From the samples to single pixels; draws on those from then on. */
void incise_target_resolve(const struct incise_target *target);
void incise_target_free(struct incise_target *target);

#endif
