// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error of what is shown; see bench_view_error.h.
 *
 * Moments are steps of 1/240 s, each 65th of them: that meets every place between two frames
 * of 15, 30 and 60 a second alike, and the frames that are shown at a moment are never older
 * than the moment before, so that one view per texture draws all of them in order.
 */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "bench_view_error.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "similarity.h"

#define WIDTH 1280
#define HEIGHT 720
#define STEP_HZ 240
#define STRIDE 65
#define QUICK_STRIDE 119
#define FINEST_PX 4096

/* The finest takes seconds to make; quick ones end at 1024. */
static const int textures_px[] = {512, 1024, 2048, FINEST_PX};
#define QUICK_TEXTURES 2
static const int rates[] = {15, 30, 60, INT_MAX};
#define TEXTURES 4
#define RATES 4

_Static_assert(TEXTURES *RATES == SHOWN_ROWS, "room for each");

struct compared {
	struct fed_view exact, shown[TEXTURES];
	int textures;
	uint8_t *rgb, *exact_rgb;
	double square[SHOWN_ROWS], max[SHOWN_ROWS], ssim[SHOWN_ROWS];
};

static void draw(struct fed_view *fed, double t_s, uint8_t *rgb)
{
	fed_view_until(fed, t_s);
	fed_view_frame(fed);
	if (incise_view_pixels(fed->view, rgb))
		cli_fail("the picture cannot be read");
}

/* When the frame that is shown was drawn, in steps. */
static int drawn_at(int step, int fps)
{
	int steps = fps == INT_MAX ? 1 : STEP_HZ / fps;

	return step / steps * steps;
}

static void compare(struct compared *c, int step)
{
	draw(&c->exact, (double)step / STEP_HZ, c->exact_rgb);
	for (int i = 0; i < c->textures; i++)
		for (int k = 0; k < RATES; k++) {
			int row = i * RATES + k, at = drawn_at(step, rates[k]);
			struct similarity is;

			draw(&c->shown[i], (double)at / STEP_HZ, c->rgb);
			is = similarity_of(c->rgb, c->exact_rgb, WIDTH, HEIGHT);
			c->square[row] += is.rms * is.rms;
			c->max[row] = fmax(c->max[row], is.rms);
			c->ssim[row] += is.ssim;
		}
}

static void open_views(struct compared *c, const struct view_script *script, int textures)
{
	*c = (struct compared){.textures = textures,
			       .rgb = malloc(WIDTH * HEIGHT * 3),
			       .exact_rgb = malloc(WIDTH * HEIGHT * 3)};
	if (!c->rgb || !c->exact_rgb)
		cli_fail("no memory");
	fed_view_open(&c->exact, script, textures_px[textures - 1], WIDTH, HEIGHT);
	incise_view_panel(c->exact.view, false, false);
	for (int i = 0; i < textures; i++) {
		fed_view_open(&c->shown[i], script, textures_px[i], WIDTH, HEIGHT);
		incise_view_panel(c->shown[i].view, false, false);
	}
}

static void close_views(struct compared *c)
{
	fed_view_close(&c->exact);
	for (int i = 0; i < c->textures; i++)
		fed_view_close(&c->shown[i]);
	free(c->rgb);
	free(c->exact_rgb);
}

void bench_view_error(const struct view_script *script, double until_s, bool quick,
		      const struct frame_rows *frames, struct shown_rows *rows)
{
	int stride = quick ? QUICK_STRIDE : STRIDE;
	struct compared c;

	*rows = (struct shown_rows){.textures = quick ? QUICK_TEXTURES : TEXTURES};
	rows->exact_px = textures_px[rows->textures - 1];
	cli_progress("pictures beside finer ones");
	open_views(&c, script, rows->textures);
	for (int step = (int)(FRAMES_FROM_S * STEP_HZ); step < until_s * STEP_HZ;
	     step += stride) {
		if (cli_stop)
			cli_fail("interrupted");
		compare(&c, step);
		rows->moments++;
		cli_progress("pictures beside finer ones: %.1f of %.1f s",
			     (double)step / STEP_HZ, until_s);
	}
	close_views(&c);
	for (int i = 0; i < rows->textures * RATES; i++) {
		struct shown_row *row = &rows->row[rows->n];

		row->texture_px = textures_px[i / RATES];
		row->fps = rates[i % RATES];
		/* That is the exact one. */
		if (row->texture_px == rows->exact_px && row->fps == INT_MAX)
			continue;
		row->rms = sqrt(c.square[i] / rows->moments);
		row->rms_max = c.max[i];
		row->ssim = c.ssim[i] / rows->moments;
		row->ms = frame_rows_ms(frames, row->texture_px);
		row->ms_s = row->fps == INT_MAX ? NAN : row->ms * row->fps;
		rows->n++;
	}
	cli_progress_end();
}

/* ---- report ---- */

json_t *shown_rows_json(const struct shown_rows *rows)
{
	json_t *list = json_array();

	for (int i = 0; i < rows->n; i++) {
		const struct shown_row *row = &rows->row[i];

		json_array_append_new(
			list, json_pack("{si so so so so so so sn}", "texture_px",
					row->texture_px, "fps",
					row->fps == INT_MAX ? json_null()
							    : json_integer(row->fps),
					"rms", json_number(row->rms), "rms_max",
					json_number(row->rms_max), "ssim",
					json_number(row->ssim), "frame_ms",
					json_number(row->ms), "ms_per_s",
					json_number(row->ms_s), "failed"));
	}
	return json_pack("{si si so}", "moments", rows->moments, "exact_texture_px",
			 rows->exact_px, "rows", list);
}

void shown_rows_print(const struct shown_rows *rows)
{
	printf("\nwhat is shown, against texture %d at that very moment; %d moments\n"
	       "%7s %6s %8s %8s %8s %9s %9s\n",
	       rows->exact_px, rows->moments, "texture", "fps", "rms", "largest", "SSIM",
	       "ms/frame", "ms/s");
	for (int i = 0; i < rows->n; i++) {
		const struct shown_row *row = &rows->row[i];

		printf("%7d ", row->texture_px);
		if (row->fps == INT_MAX)
			printf("%6s", "exact");
		else
			printf("%6d", row->fps);
		printf(" %8.3f %8.3f %8.5f %9.2f", row->rms, row->rms_max, row->ssim,
		       row->ms);
		if (row->fps != INT_MAX)
			printf(" %9.0f", row->ms_s);
		printf("\n");
	}
}

/* A block for each texture; the exact moment has none of the axis. */
static void write_data(const struct shown_rows *rows, FILE *out)
{
	for (int i = 0; i < rows->n; i++) {
		const struct shown_row *row = &rows->row[i];

		if (i && row->texture_px != rows->row[i - 1].texture_px)
			fputs("\n\n", out);
		if (row->fps != INT_MAX)
			fprintf(out, "%g %g %g %d\n", row->ms_s, row->rms, 1 - row->ssim,
				row->fps);
	}
}

/* Of 1, 2, 5, 10 … all that are near the axis. */
static void set_axis(FILE *script, char axis, double low, double high)
{
	double decade = pow(10, floor(log10(low)));

	fprintf(script, "set %crange [%g:%g]\nset %ctics (", axis, low / 1.3, high * 1.5,
		axis);
	for (int i = 0; decade < high * 2; i++) {
		static const double part[] = {1, 2, 5};

		fprintf(script, "%s%g", i ? ", " : "", part[i % 3] * decade);
		if (i % 3 == 2)
			decade *= 10;
	}
	fputs(")\n", script);
}

static void set_axes(FILE *script, const struct shown_rows *rows, bool ssim)
{
	double low = INFINITY, high = 0, fast = INFINITY, slow = 0;

	for (int i = 0; i < rows->n; i++) {
		const struct shown_row *row = &rows->row[i];
		/* Where two are the same to the last digit there is no place of 0. */
		double error = fmax(ssim ? 1 - row->ssim : row->rms, 1e-6);

		if (row->fps == INT_MAX)
			continue;
		low = fmin(low, error);
		high = fmax(high, error);
		fast = fmin(fast, row->ms_s);
		slow = fmax(slow, row->ms_s);
	}
	set_axis(script, 'x', fast, slow);
	set_axis(script, 'y', low, high);
}

static void draw_panel(FILE *script, int textures, int column)
{
	fputs("plot \\\n", script);
	for (int i = 0; i < textures; i++)
		fprintf(script,
			"  data index %d using 1:%d with linespoints ls %d pt 7 ps 0.9 title "
			"'texture %d²', \\\n"
			"  '' index %d using 1:%d:4 with labels offset 0.6,0.6 left font ',9' "
			"notitle%s\n",
			i, column, i + 1, textures_px[i], i, column,
			i < textures - 1 ? ", \\" : "");
}

void shown_rows_draw(const struct shown_rows *rows, const char *folder, const char *name)
{
	FILE *out, *script;
	char data[300];

	snprintf(data, sizeof(data), "%s.dat", name);
	out = plot_data(folder, data);
	write_data(rows, out);
	plot_data_end(out, folder);
	script = plot_begin(folder, name, 1320, 620);
	fprintf(script,
		"set multiplot layout 1,2 title \"What a screen shows of a cut that bleeds, "
		"at 15, 30 and 60 frames a second, against a texture of %d² at that very "
		"moment\" font ',13'\n"
		"set logscale xy\ndata = '%s'\nset key bottom left\n"
		"set xlabel 'run time for a second that is shown / ms'\n"
		"set ylabel 'rms error / values of sRGB'\n",
		rows->exact_px, data);
	set_axes(script, rows, false);
	draw_panel(script, rows->textures, 2);
	fputs("set ylabel '1 - structural similarity'\n", script);
	set_axes(script, rows, true);
	draw_panel(script, rows->textures, 3);
	fputs("unset multiplot\n", script);
	if (!plot_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}

void shown_rows_figures(const struct shown_rows *rows, json_t *figures)
{
	for (int i = 0; i < rows->n; i++) {
		const struct shown_row *row = &rows->row[i];
		char fps[20] = "exact";

		if (row->fps != INT_MAX && row->fps != 60)
			continue;
		if (row->fps != INT_MAX)
			snprintf(fps, sizeof(fps), "%d fps", row->fps);
		metrics_exact(figures, row->rms, "1", "texture %d, %s rms",
			      row->texture_px, fps);
		metrics_exact(figures, row->rms_max, "1", "texture %d, %s largest rms",
			      row->texture_px, fps);
		metrics_exact(figures, 1 - row->ssim, "1", "texture %d, %s dissimilarity",
			      row->texture_px, fps);
	}
}
