// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What is written over the picture; see overlay.h. History is kept as columns of a graph,
 * each with the least and the largest value of its 40 ms: what lasted one tick is seen.
 */
#include <cairo.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "overlay.h"
#include "overlay_paint.h"

#define REDRAW_NS 66666667 /* 15 times in a second */

struct incise_overlay {
	struct overlay_graph force, depth;
	struct incise_tick tick; /* the last one */
	bool ticked;
	int64_t drawn_at; /* in redraws' periods */
	char state[32];	  /* as drawn */
	cairo_surface_t *panel, *keys;
	struct incise_overlay_image panel_image, keys_image;
	int n_lines;
	char *line[OVERLAY_LINES_MAX];
};

struct incise_overlay *incise_overlay_new(struct incise_error *err)
{
	struct incise_overlay *overlay = calloc(1, sizeof(*overlay));

	if (!overlay)
		incise_error_set(err, ENOMEM, "picture: no memory");
	else
		overlay->force.last = overlay->depth.last = INT64_MIN;
	return overlay;
}

static void forget_lines(struct incise_overlay *overlay)
{
	for (int i = 0; i < overlay->n_lines; i++)
		free(overlay->line[i]);
	overlay->n_lines = 0;
}

void incise_overlay_free(struct incise_overlay *overlay)
{
	if (!overlay)
		return;
	forget_lines(overlay);
	cairo_surface_destroy(overlay->panel);
	cairo_surface_destroy(overlay->keys);
	free(overlay);
}

static int64_t floor_of(int64_t t, int64_t period)
{
	return t / period - (t % period < 0);
}

static void graph_add(struct overlay_graph *graph, int64_t t_ns, double value)
{
	int64_t at = floor_of(t_ns, OVERLAY_COLUMN_NS);
	struct overlay_column *column =
		&graph->column[((at % OVERLAY_COLUMNS) + OVERLAY_COLUMNS) %
			       OVERLAY_COLUMNS];

	/* Another recording begins. */
	if (graph->last != INT64_MIN && at < graph->last)
		memset(graph->column, 0, sizeof(graph->column));
	graph->last = at;
	if (!isfinite(value))
		return;
	/* Beyond it there is nothing to be read from a graph. */
	value = fmin(value, 1e6);
	if (!column->any || column->at != at)
		*column = (struct overlay_column){at, true, (float)value, (float)value};
	column->low = fminf(column->low, (float)value);
	column->high = fmaxf(column->high, (float)value);
}

void incise_overlay_tick(struct incise_overlay *overlay, const struct incise_tick *tick)
{
	double force = 0;

	for (int i = 0; i < 3; i++)
		force += tick->command_N[i] * tick->command_N[i];
	graph_add(&overlay->force, tick->t_ns, sqrt(force));
	/* Outside of the tissue there is none. */
	graph_add(&overlay->depth, tick->t_ns, tick->depth_mm < 0 ? 0 : tick->depth_mm);
	overlay->tick = *tick;
	overlay->ticked = true;
}

static bool due(const struct incise_overlay *overlay, const char *state)
{
	return !overlay->panel || strcmp(overlay->state, state) != 0 ||
	       floor_of(overlay->tick.t_ns, REDRAW_NS) != overlay->drawn_at;
}

static void finish(cairo_surface_t *surface, struct incise_overlay_image *image)
{
	cairo_surface_flush(surface);
	image->pixels = cairo_image_surface_get_data(surface);
	image->width = cairo_image_surface_get_width(surface);
	image->height = cairo_image_surface_get_height(surface);
	image->version++;
}

const struct incise_overlay_image *incise_overlay_panel(
	struct incise_overlay *overlay, const struct incise_view_status *status)
{
	struct overlay_words words = {.tick = overlay->ticked ? &overlay->tick : NULL,
				      .status = status,
				      .force = &overlay->force,
				      .depth = &overlay->depth};
	char state[sizeof(overlay->state)];

	snprintf(state, sizeof(state), "%s",
		 status && status->state ? status->state : "");
	if (!due(overlay, state))
		return &overlay->panel_image;
	if (!overlay->panel)
		overlay->panel =
			overlay_surface(OVERLAY_PANEL_WIDTH, OVERLAY_PANEL_HEIGHT);
	if (!overlay->panel)
		return NULL;
	overlay_paint_panel(overlay->panel, &words);
	finish(overlay->panel, &overlay->panel_image);
	overlay->drawn_at = floor_of(overlay->tick.t_ns, REDRAW_NS);
	snprintf(overlay->state, sizeof(overlay->state), "%s", state);
	return &overlay->panel_image;
}

int incise_overlay_set_keys(struct incise_overlay *overlay, const char *const *lines,
			    int n)
{
	forget_lines(overlay);
	cairo_surface_destroy(overlay->keys);
	overlay->keys = NULL;
	for (int i = 0; i < n && i < OVERLAY_LINES_MAX; i++) {
		overlay->line[i] = strdup(lines[i]);
		if (!overlay->line[i])
			return -ENOMEM;
		overlay->n_lines = i + 1;
	}
	return 0;
}

const struct incise_overlay_image *incise_overlay_keys(struct incise_overlay *overlay)
{
	if (overlay->keys)
		return &overlay->keys_image;
	overlay->keys = overlay_surface(OVERLAY_KEYS_WIDTH,
					overlay_keys_height(overlay->n_lines));
	if (!overlay->keys)
		return NULL;
	overlay_paint_keys(overlay->keys, (const char *const *)overlay->line,
			   overlay->n_lines);
	finish(overlay->keys, &overlay->keys_image);
	return &overlay->keys_image;
}
