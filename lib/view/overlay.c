// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Panels over the image, by cairo; see overlay.h. Graphs consist of columns, each with the least
 * and the largest value of its 40 ms, so that single ticks are visible. Without DejaVu Sans cairo
 * uses another font, and without any font there are still graphs.
 */
#include <cairo.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "overlay.h"

#define OVERLAY_COLUMNS 250	   /* of a graph: 10 s */
#define OVERLAY_COLUMN_NS 40000000 /* per column */
#define OVERLAY_LINES_MAX 24
#define OVERLAY_PANEL_WIDTH 316
#define OVERLAY_PANEL_HEIGHT 244
#define OVERLAY_KEYS_WIDTH 380

struct overlay_column {
	int64_t at; /* number of the column since time 0 */
	bool any;
	float low, high;
};

struct overlay_graph {
	int64_t last; /* column; INT64_MIN: no column yet */
	struct overlay_column column[OVERLAY_COLUMNS];
};

#define GRAPH_LEFT 44
#define GRAPH_HEIGHT 62
#define LINE 18

#define REDRAW_NS 66666667 /* 15 times per second */

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

static struct overlay_column *column_at(const struct overlay_graph *graph, int64_t at)
{
	int number = (int)((at % OVERLAY_COLUMNS + OVERLAY_COLUMNS) % OVERLAY_COLUMNS);

	return (struct overlay_column *)&graph->column[number];
}

/* --- Painting --- */

static cairo_surface_t *overlay_surface(int width, int height)
{
	cairo_surface_t *surface =
		cairo_image_surface_create(CAIRO_FORMAT_ARGB32, width, height);

	if (cairo_surface_status(surface) == CAIRO_STATUS_SUCCESS)
		return surface;
	cairo_surface_destroy(surface);
	return NULL;
}

static cairo_t *begin_overlay(cairo_surface_t *surface)
{
	cairo_t *cr = cairo_create(surface);
	double w = cairo_image_surface_get_width(surface);
	double h = cairo_image_surface_get_height(surface), r = 9;

	cairo_set_operator(cr, CAIRO_OPERATOR_CLEAR);
	cairo_paint(cr);
	cairo_set_operator(cr, CAIRO_OPERATOR_OVER);
	cairo_arc(cr, r, r, r, M_PI, 1.5 * M_PI);
	cairo_arc(cr, w - r, r, r, 1.5 * M_PI, 2 * M_PI);
	cairo_arc(cr, w - r, h - r, r, 0, 0.5 * M_PI);
	cairo_arc(cr, r, h - r, r, 0.5 * M_PI, M_PI);
	cairo_close_path(cr);
	cairo_set_source_rgba(cr, 0.04, 0.06, 0.08, 0.72);
	cairo_fill(cr);
	cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
			       CAIRO_FONT_WEIGHT_NORMAL);
	return cr;
}

static void grey(cairo_t *cr, double light)
{
	cairo_set_source_rgba(cr, light, light, light, 1);
}

/* @align: 0 starts at x, 1 ends there. */
static void text(cairo_t *cr, double x, double y, double size, double align,
		 const char *words)
{
	cairo_text_extents_t extents;

	cairo_set_font_size(cr, size);
	cairo_text_extents(cr, words, &extents);
	cairo_move_to(cr, floor(x - align * extents.x_advance), y);
	cairo_show_text(cr, words);
}

/* The least of 1, 2, 5, 10 … times @unit that covers a graph. */
static double range_of_overlay(const struct overlay_graph *graph, double unit)
{
	double most = 0, range = unit;

	for (int i = 0; i < OVERLAY_COLUMNS; i++)
		if (graph->column[i].any &&
		    graph->last - graph->column[i].at < OVERLAY_COLUMNS)
			most = fmax(most, graph->column[i].high);
	for (int i = 0; range < most && i < 30; i++)
		range *= i % 3 == 1 ? 2.5 : 2;
	return range;
}

static void curve(cairo_t *cr, const struct overlay_graph *graph, double top,
		  double range)
{
	double bottom = top + GRAPH_HEIGHT;
	bool on = false;

	for (int i = 0; i < OVERLAY_COLUMNS && graph->last != INT64_MIN; i++) {
		int64_t at = graph->last - (OVERLAY_COLUMNS - 1) + i;
		const struct overlay_column *column = column_at(graph, at);
		double x = GRAPH_LEFT + i + 0.5;

		if (!column->any || column->at != at) {
			on = false;
			continue;
		}
		if (on)
			cairo_line_to(cr, x, bottom - column->low / range * GRAPH_HEIGHT);
		else
			cairo_move_to(cr, x,
				      bottom - column->low / range * GRAPH_HEIGHT + 0.5);
		cairo_line_to(cr, x, bottom - column->high / range * GRAPH_HEIGHT);
		on = true;
	}
	cairo_set_line_width(cr, 1.4);
	cairo_set_line_join(cr, CAIRO_LINE_JOIN_ROUND);
	cairo_stroke(cr);
}

static void graph(cairo_t *cr, const struct overlay_graph *graph, double top,
		  const char *name, const char *unit, double least, const double rgb[3])
{
	double range = range_of_overlay(graph, least);
	char words[64];

	grey(cr, 0.32);
	cairo_set_line_width(cr, 1);
	for (int i = 0; i <= 2; i++) {
		double y = floor(top + GRAPH_HEIGHT * (1 - 0.5 * i)) + 0.5;

		cairo_move_to(cr, GRAPH_LEFT, y);
		cairo_line_to(cr, GRAPH_LEFT + OVERLAY_COLUMNS, y);
	}
	/* A line every two seconds. */
	for (int i = 0; i <= OVERLAY_COLUMNS; i += 50) {
		cairo_move_to(cr, GRAPH_LEFT + i + 0.5, top + GRAPH_HEIGHT);
		cairo_line_to(cr, GRAPH_LEFT + i + 0.5, top + GRAPH_HEIGHT + 3);
	}
	cairo_stroke(cr);
	grey(cr, 0.72);
	for (int i = 0; i <= 2; i++) {
		snprintf(words, sizeof(words), "%g", 0.5 * i * range);
		text(cr, GRAPH_LEFT - 5, top + GRAPH_HEIGHT * (1 - 0.5 * i) + 4, 10, 1,
		     words);
	}
	cairo_save(cr);
	cairo_rectangle(cr, GRAPH_LEFT, top - 1, OVERLAY_COLUMNS, GRAPH_HEIGHT + 2);
	cairo_clip(cr);
	cairo_set_source_rgba(cr, rgb[0], rgb[1], rgb[2], 1);
	curve(cr, graph, top, range);
	cairo_restore(cr);
	cairo_set_source_rgba(cr, rgb[0], rgb[1], rgb[2], 1);
	snprintf(words, sizeof(words), "%s  %s", name, unit);
	text(cr, GRAPH_LEFT + 4, top + 11, 11, 0, words);
}

static const char *const phases[] = {
	[INCISE_PHASE_FREE] = "free",
	[INCISE_PHASE_CUTTING] = "cutting",
	[INCISE_PHASE_INSERTION] = "insertion",
};
static const char *const tools[] = {
	[INCISE_TOOL_AUTO] = "blade",
	[INCISE_TOOL_BLADE] = "blade",
	[INCISE_TOOL_HANDLE] = "handle",
	[INCISE_TOOL_TUBE] = "tube",
};

/* The most important flag. */
static const char *warning_of(const struct incise_tick *tick)
{
	if (tick->flags & INCISE_TICK_FAULT)
		return "FAULT";
	if (tick->flags & INCISE_TICK_STALE)
		return "no pose";
	if (tick->flags & INCISE_TICK_CLAMPED)
		return "force held";
	return "";
}

static void say_tick(cairo_t *cr, double y, const struct incise_tick *tick)
{
	char words[160], size[2][32] = {"–", "–"};
	double force = sqrt(tick->command_N[0] * tick->command_N[0] +
			    tick->command_N[1] * tick->command_N[1] +
			    tick->command_N[2] * tick->command_N[2]);

	if (isfinite(force))
		snprintf(size[0], sizeof(size[0]), "%.2f", force);
	if (isfinite(tick->depth_mm))
		snprintf(size[1], sizeof(size[1]), "%.1f",
			 tick->depth_mm < 0 ? 0 : tick->depth_mm);
	grey(cr, 0.95);
	snprintf(words, sizeof(words), "%s · %s",
		 tick->phase <= INCISE_PHASE_INSERTION ? phases[tick->phase] : "?",
		 tick->tool <= INCISE_TOOL_TUBE ? tools[tick->tool] : "?");
	text(cr, 14, y, 12.5, 0, words);
	snprintf(words, sizeof(words), "%s N   %s mm", size[0], size[1]);
	text(cr, OVERLAY_PANEL_WIDTH - 20, y, 12.5, 1, words);
	cairo_set_source_rgba(cr, 1, 0.55, 0.35, 1);
	text(cr, OVERLAY_PANEL_WIDTH / 2 - 4, y, 12.5, 0.4, warning_of(tick));
}

static void micros(char *words, size_t size, double us)
{
	if (!isfinite(us))
		snprintf(words, size, "–");
	else if (us < 9999)
		snprintf(words, size, "%.0f µs", us);
	else
		snprintf(words, size, "%.0f ms", us / 1000);
}

static void say_status(cairo_t *cr, double y, const struct incise_view_status *status)
{
	char words[160], median[32], most[32];

	grey(cr, 0.8);
	snprintf(words, sizeof(words), "%.40s", status->state ? status->state : "");
	text(cr, 14, y, 12, 0, words);
	if (isfinite(status->rate_hz)) {
		snprintf(words, sizeof(words), "%.0f Hz", status->rate_hz);
		text(cr, OVERLAY_PANEL_WIDTH - 20, y, 12, 1, words);
	}
	micros(median, sizeof(median), status->lateness_median_us);
	micros(most, sizeof(most), status->lateness_999_us);
	snprintf(words, sizeof(words), "late %s   99.9 %% %s", median, most);
	text(cr, 14, y + LINE, 12, 0, words);
	if (status->lost) {
		cairo_set_source_rgba(cr, 1, 0.55, 0.35, 1);
		snprintf(words, sizeof(words), "%llu lost",
			 (unsigned long long)status->lost);
		text(cr, OVERLAY_PANEL_WIDTH - 20, y + LINE, 12, 1, words);
	}
}

static void paint_panel(const struct incise_overlay *overlay,
			const struct incise_view_status *status)
{
	static const double force[3] = {1.0, 0.80, 0.38}, depth[3] = {0.45, 0.80, 1.0};
	cairo_t *cr = begin_overlay(overlay->panel);
	double y = 14;

	graph(cr, &overlay->force, y, "force", "N", 0.5, force);
	y += GRAPH_HEIGHT + 14;
	graph(cr, &overlay->depth, y, "depth", "mm", 1, depth);
	y += GRAPH_HEIGHT + 15;
	grey(cr, 0.72);
	text(cr, GRAPH_LEFT, y, 10, 0, "-10 s");
	text(cr, GRAPH_LEFT + OVERLAY_COLUMNS, y, 10, 1, "now");
	y += LINE + 4;
	if (overlay->ticked)
		say_tick(cr, y, &overlay->tick);
	y += LINE + 2;
	if (status)
		say_status(cr, y, status);
	cairo_destroy(cr);
}

static void paint_keys(const struct incise_overlay *overlay)
{
	cairo_t *cr = begin_overlay(overlay->keys);

	for (int i = 0; i < overlay->n_lines; i++) {
		const char *line = overlay->line[i], *tab = strchr(line, '\t');
		double y = 26 + LINE * i;
		char key[64];

		snprintf(key, sizeof(key), "%.*s",
			 tab ? (int)(tab - line) : (int)strlen(line), line);
		cairo_set_source_rgba(cr, 1.0, 0.80, 0.38, 1);
		text(cr, 16, y, 12, 0, key);
		grey(cr, 0.92);
		text(cr, 140, y, 12, 0, tab ? tab + 1 : "");
	}
	cairo_destroy(cr);
}

int incise_view_caption(uint8_t *rgb, int width, int height, const char *line)
{
	bool fits = width > 0 && height > 0 && width <= INCISE_VIEW_SIDE_MAX &&
		    height <= INCISE_VIEW_SIDE_MAX;
	cairo_surface_t *surface = fits ? overlay_surface(width, height) : NULL;
	const uint8_t *pixels;
	cairo_t *cr;

	if (!surface)
		return fits ? -ENOMEM : -EINVAL;
	cr = cairo_create(surface);
	grey(cr, 1);
	cairo_paint(cr);
	grey(cr, 0);
	cairo_select_font_face(cr, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
			       CAIRO_FONT_WEIGHT_NORMAL);
	text(cr, 0.5 * width, 0.75 * height, 0.7 * height, 0.5, line);
	cairo_destroy(cr);
	cairo_surface_flush(surface);
	pixels = cairo_image_surface_get_data(surface);
	for (size_t i = 0; i < (size_t)width * (size_t)height; i++)
		for (int k = 0; k < 3; k++)
			rgb[3 * i + k] = pixels[4 * i + 2 - k];
	cairo_surface_destroy(surface);
	return 0;
}

/* --- The overlay --- */

struct incise_overlay *incise_overlay_new(struct incise_error *err)
{
	struct incise_overlay *overlay = calloc(1, sizeof(*overlay));

	if (!overlay)
		incise_error_set(err, ENOMEM, "image: no memory");
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
	struct overlay_column *column = column_at(graph, at);

	/* Time went back: another recording. */
	if (graph->last != INT64_MIN && at < graph->last)
		memset(graph->column, 0, sizeof(graph->column));
	graph->last = at;
	if (!isfinite(value))
		return;
	/* Larger values are not readable from a graph. */
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
	/* Outside of the tissue the depth is 0. */
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
	paint_panel(overlay, status);
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
	overlay->keys = overlay_surface(OVERLAY_KEYS_WIDTH, 26 + LINE * overlay->n_lines);
	if (!overlay->keys)
		return NULL;
	paint_keys(overlay);
	finish(overlay->keys, &overlay->keys_image);
	return &overlay->keys_image;
}
