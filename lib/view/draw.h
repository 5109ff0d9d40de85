/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Drawing by OpenGL 3.3 core, in the current context: the surface with its texture, the instrument,
 * images over it. Lengths in mm in the tracker's frame; pixels with x from the left, y from the top.
 *
 *     surface ─▶ instrument ─▶ target (samples) ─▶ resolved ─▶ images over it ─▶ read, show
 *
 * Wet surfaces shine; the shader recognizes them by the colour of fresh blood.
 */
#ifndef INCISE_VIEW_DRAW_H
#define INCISE_VIEW_DRAW_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/plan.h>
#include <incise/view.h>
#include "canvas.h"
#include "uv_map.h"

struct incise_draw;

struct incise_draw_setup {
	const struct uv_map *map;	    /* read while it is made only */
	const struct incise_canvas *canvas; /* likewise; all levels are uploaded */
	const uint8_t *normal_rgb;	    /* size² of the map; or NULL: smooth */
	enum incise_skin look; /* a liver is moist, a neck has a drape round it */
	struct incise_scene_scalpel scalpel;
	int samples; /* 1, 4; 0: 4 by a card, 1 by a CPU */
};

/* NULL with errno ENOTSUP (texture too large, no framebuffer), EIO (shader), ENOMEM. */
struct incise_draw *incise_draw_new(const struct incise_draw_setup *setup,
				    struct incise_error *err);
void incise_draw_free(struct incise_draw *draw);

/* Send changes. Rectangles outside of their level are ignored. */
void incise_draw_upload(struct incise_draw *draw, const struct incise_canvas *canvas,
			const struct incise_upload *uploads, int n);

/*
 * Draw the surface, and the instrument at a tick's pose (NULL: none).
 *
 * Returns 0, -EINVAL (size), -EIO (the graphics failed, or lost their context), -ENOMEM.
 */
int incise_draw_frame(struct incise_draw *draw, const struct incise_view_camera *camera,
		      const struct incise_tick *pose, int width, int height,
		      struct incise_error *err);

/*
 * Draw an image over the frame, premultiplied bgra as cairo's ARGB32, its top left at x, y. @slot:
 * 0 … 3, one per image; it is sent when @version differs from the slot's last.
 */
int incise_draw_overlay(struct incise_draw *draw, int slot, const uint8_t *bgra, int w,
			int h, uint64_t version, int x, int y);

/* The last frame's pixels, rows from the top. 0, -EINVAL (another size), -EIO. */
int incise_draw_read(struct incise_draw *draw, uint8_t *rgb, int width, int height);

/* Copy the last frame to the window's own framebuffer. */
void incise_draw_show(struct incise_draw *draw);

/* Wait until the last frame is drawn. */
void incise_draw_finish(struct incise_draw *draw);

struct incise_draw_info {
	double middle_mm[3], reach_mm; /* a ball round the surface */
	int samples;		       /* per pixel */
	char renderer[128];	       /* OpenGL's name */
};
const struct incise_draw_info *incise_draw_info(struct incise_draw *draw);

#endif
