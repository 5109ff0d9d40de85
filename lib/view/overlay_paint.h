/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The panels' drawing, by cairo. Pixels.
 */
#ifndef INCISE_VIEW_OVERLAY_PAINT_H
#define INCISE_VIEW_OVERLAY_PAINT_H

#include <cairo.h>
#include <stdbool.h>
#include <stdint.h>
#include <incise/plan.h>
#include <incise/view.h>

#define OVERLAY_COLUMNS 250	   /* of a graph: 10 s */
#define OVERLAY_COLUMN_NS 40000000 /* that one of them stands for */
#define OVERLAY_LINES_MAX 24
#define OVERLAY_PANEL_WIDTH 316
#define OVERLAY_PANEL_HEIGHT 244
#define OVERLAY_KEYS_WIDTH 380

struct overlay_column {
	int64_t at; /* which column of all time */
	bool any;
	float low, high;
};

struct overlay_graph {
	int64_t last; /* column; INT64_MIN: none yet */
	struct overlay_column column[OVERLAY_COLUMNS];
};

struct overlay_words {
	const struct incise_tick *tick;		 /* or NULL */
	const struct incise_view_status *status; /* or NULL */
	const struct overlay_graph *force, *depth;
};

/* NULL: no memory. Its rows have no gap. */
cairo_surface_t *overlay_surface(int width, int height);

void overlay_paint_panel(cairo_surface_t *surface, const struct overlay_words *words);
int overlay_keys_height(int lines);
void overlay_paint_keys(cairo_surface_t *surface, const char *const *lines, int n);

#endif
