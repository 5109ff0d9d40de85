/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a view is made of; see view.c.
 */
#ifndef INCISE_VIEW_PARTS_H
#define INCISE_VIEW_PARTS_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/view.h>
#include "canvas.h"
#include "chart.h"
#include "draw.h"
#include "effects.h"
#include "egl.h"
#include "orbit.h"
#include "overlay.h"
#include "window.h"

#define VIEW_UPLOADS 256 /* that are sent at once */

struct incise_view {
	const struct incise_surface *surface;
	struct incise_scene_picture picture;
	struct incise_scene_scalpel scalpel;
	struct incise_egl *egl; /* one of these */
	struct incise_window *window;
	uint8_t *base; /* the canvas's, of size² texels */
	struct incise_chart *chart;
	struct incise_canvas *canvas;
	struct incise_effects *effects;
	struct incise_draw *draw;
	struct incise_overlay *overlay;
	struct incise_orbit orbit;
	struct incise_tick tick; /* the last one that has a place */
	bool ticked, drawn, panel, keys;
	int width, height; /* of frames */
	uint64_t uploads, uploaded_texels, ticks, frames;
	double ticks_s, texture_s, draw_s;
};

/* Fill in what is still empty. What was made stays when it fails: incise_view_free(). */
int incise_view_make(struct incise_view *view, const struct incise_plan *plan,
		     const struct incise_view_setup *setup, struct incise_error *err);

#endif
