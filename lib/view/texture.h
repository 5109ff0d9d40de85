/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Textures of OpenGL: the surface's, which is sent by rectangles, and images over the
 * picture.
 *
 * The surface's texture is one, for each lookup costs a CPU that draws a quarter of its
 * frame: red, green and blue are the canvas's; alpha is how much the skin leans towards the
 * lamp, 128 + 127 times the slope along @way, for lamp and surface stand still. It comes
 * from the skin's normals, and where there is wet blood from where its film ends:
 *
 *          wet            next, some texels along the way to the lamp
 *     ▁▁▁▂▅▇▇▇▇▇▇▅▂▁▁▁    slope = a share of (wet - next)
 *        ▲       ▲
 *     leans     leans
 *     away      to the lamp
 */
#ifndef INCISE_VIEW_TEXTURE_H
#define INCISE_VIEW_TEXTURE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include "canvas.h"

struct incise_texture;

struct incise_texture_setup {
	const struct incise_canvas *canvas; /* all of it is sent */
	const uint8_t *normal_rgb;	    /* size²; or NULL: a smooth skin */
	double way[2]; /* unit: to the lamp, in texels right and down */
	bool fine;     /* what costs more on a CPU than it shows */
};

/* NULL with errno ENOTSUP (too large), ENOMEM. */
struct incise_texture *incise_texture_new(const struct incise_texture_setup *setup,
					  struct incise_error *err);
void incise_texture_free(struct incise_texture *texture);

/* What has changed, and a few texels round it; what is not within its level is left out. */
void incise_texture_upload(struct incise_texture *texture,
			   const struct incise_canvas *canvas,
			   const struct incise_upload *uploads, int n);

unsigned incise_texture_name(const struct incise_texture *texture);
int incise_texture_side(const struct incise_texture *texture);

/* An image for the first time (0), or anew. */
unsigned incise_texture_image(unsigned image, const uint8_t *bgra, int w, int h);

#endif
