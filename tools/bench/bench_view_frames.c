// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a frame costs; see bench_view_frames.h. Frames come at 60 a second of the ticks' time,
 * as fast as they can, and are finished before the next one begins; so many in a row from time
 * to time, and the one before them is not timed.
 *
 *   procedure  ├────────────────────────────────────────┤
 *   frames     ·||||||      ·||||||      ·||||||
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "bench_view_frames.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/stopwatch.h"

#define FPS 60
#define IN_A_ROW 18
#define EVERY_S 1.3
#define PARTS 12

static const struct size {
	int texture_px, width, height;
} sizes[] =
	{
		{2048, 1280, 720}, {512, 1280, 720}, {1024, 1280, 720},
		{4096, 1280, 720}, {2048, 640, 360}, {2048, 1920, 1080},
},
  quick_sizes[] = {
	  {1024, 1280, 720},
	  {512, 1280, 720},
	  {1024, 640, 360},
};
#define QUICK_SIZES (int)(sizeof(quick_sizes) / sizeof(*quick_sizes))

_Static_assert(sizeof(sizes) / sizeof(*sizes) == FRAME_ROWS, "room for each");

/* Each of all frames, ms. */
struct samples {
	double *ticks, *texture, *draw, *whole;
	double texels; /* of all */
	int n;
};

static struct frame_times times_of(double *ms, int n)
{
	stopwatch_sort(ms, n);
	return (struct frame_times){.median = stopwatch_quantile(ms, n, 0.5),
				    .p99 = stopwatch_quantile(ms, n, 0.99),
				    .max = ms[n - 1]};
}

static void sample(struct fed_view *fed, double t_s, struct samples *to)
{
	struct incise_view_report before, after;
	double begin;

	incise_view_report(fed->view, &before);
	begin = stopwatch_ns();
	fed_view_until(fed, t_s);
	fed_view_frame(fed);
	to->whole[to->n] = (stopwatch_ns() - begin) * 1e-6;
	incise_view_report(fed->view, &after);
	to->ticks[to->n] = (after.ticks_s - before.ticks_s) * 1e3;
	to->texture[to->n] = (after.texture_s - before.texture_s) * 1e3;
	to->draw[to->n] = (after.draw_s - before.draw_s) * 1e3;
	to->texels += (double)(after.uploaded_texels - before.uploaded_texels);
	to->n++;
}

/* The procedure goes on from frame to frame: each part has some of all of it. */
static void time_of(const double *whole_ms, int n, struct harness_time *time)
{
	double medians[PARTS], *part = malloc((n / PARTS + 1) * sizeof(*part));

	if (!part)
		cli_fail("no memory");
	for (int k = 0; k < PARTS; k++) {
		int taken = 0;

		for (int i = k; i < n; i += PARTS)
			part[taken++] = whole_ms[i] * 1e6;
		stopwatch_sort(part, taken);
		medians[k] = stopwatch_quantile(part, taken, 0.5);
	}
	free(part);
	harness_time_of(medians, PARTS, time);
}

static void draw_frames(struct fed_view *fed, int bursts, struct samples *got)
{
	/* What is made at the first frame, and compiled at the second, is not of a frame. */
	for (int i = 0; i < 5; i++) {
		fed_view_until(fed, (FRAMES_FROM_S - 1.0 / FPS) * i / 5);
		fed_view_frame(fed);
	}
	for (int b = 0; b < bursts; b++) {
		double t_s = FRAMES_FROM_S + b * EVERY_S;

		fed_view_until(fed, t_s - 1.0 / FPS);
		fed_view_frame(fed);
		for (int i = 0; i < IN_A_ROW && !cli_stop; i++)
			sample(fed, t_s + (double)i / FPS, got);
	}
}

static void measure(const struct view_script *script, double until_s,
		    struct frame_row *row, char *renderer, size_t room)
{
	int bursts = (int)fmax((until_s - FRAMES_FROM_S) / EVERY_S, 1);
	int n = bursts * IN_A_ROW;
	double *all = malloc(4 * (size_t)n * sizeof(*all)), sum = 0;
	struct samples got = {all, all + n, all + 2 * n, all + 3 * n, 0, 0};
	struct incise_view_report report;
	struct fed_view fed;

	if (!all)
		cli_fail("no memory");
	fed_view_open(&fed, script, row->texture_px, row->width, row->height);
	draw_frames(&fed, bursts, &got);
	incise_view_report(fed.view, &report);
	if (cli_stop)
		cli_fail("interrupted");
	for (int i = 0; i < n; i++)
		sum += got.whole[i];
	row->frames = n;
	row->hz = n / (sum * 1e-3);
	row->triangles = report.triangles;
	row->samples = report.samples;
	row->texels = got.texels / n;
	row->tick_us = report.ticks_s * 1e6 / (double)report.ticks;
	time_of(got.whole, n, &row->time);
	row->ticks = times_of(got.ticks, n);
	row->texture = times_of(got.texture, n);
	row->draw = times_of(got.draw, n);
	row->whole = times_of(got.whole, n);
	snprintf(renderer, room, "%s", report.renderer);
	fed_view_close(&fed);
	free(all);
}

void bench_view_frames(const struct view_script *script, double until_s, bool quick,
		       struct frame_rows *rows)
{
	*rows = (struct frame_rows){.n = quick ? QUICK_SIZES : FRAME_ROWS};
	for (int i = 0; i < rows->n; i++) {
		const struct size *size = quick ? &quick_sizes[i] : &sizes[i];
		struct frame_row *row = &rows->row[i];

		row->texture_px = size->texture_px;
		row->width = size->width;
		row->height = size->height;
		cli_progress("frames of %d x %d, texture of %d", row->width, row->height,
			     row->texture_px);
		measure(script, until_s, row, rows->renderer, sizeof(rows->renderer));
	}
	cli_progress_end();
}

double frame_rows_ms(const struct frame_rows *rows, int texture_px)
{
	for (int i = 0; i < rows->n; i++)
		if (rows->row[i].texture_px == texture_px &&
		    rows->row[i].width == sizes[0].width)
			return rows->row[i].whole.median;
	return NAN;
}

/* ---- report ---- */

static json_t *times_json(const struct frame_times *times)
{
	return json_pack("{so so so}", "median", json_number(times->median), "p99",
			 json_number(times->p99), "max", json_number(times->max));
}

json_t *frame_rows_json(const struct frame_rows *rows)
{
	json_t *list = json_array();

	for (int i = 0; i < rows->n; i++) {
		const struct frame_row *row = &rows->row[i];

		json_array_append_new(
			list,
			json_pack(
				"{si si si si si si so so so so so so so so so so so so so sn}",
				"texture_px", row->texture_px, "width", row->width,
				"height", row->height, "triangles", row->triangles,
				"samples", row->samples, "frames", row->frames,
				"effects_ms", times_json(&row->ticks), "texture_ms",
				times_json(&row->texture), "draw_ms",
				times_json(&row->draw), "whole_ms",
				times_json(&row->whole), "frames_hz",
				json_number(row->hz), "texels", json_number(row->texels),
				"effects_us_tick", json_number(row->tick_us),
				"effects_median_ms", json_number(row->ticks.median),
				"texture_median_ms", json_number(row->texture.median),
				"draw_median_ms", json_number(row->draw.median),
				"whole_median_ms", json_number(row->whole.median),
				"whole_p99_ms", json_number(row->whole.p99),
				"whole_max_ms", json_number(row->whole.max), "failed"));
	}
	return list;
}

static void print_times(const struct frame_times *times)
{
	printf(" %6.2f %6.2f %6.1f", times->median, times->p99, times->max);
}

void frame_rows_print(const struct frame_rows *rows)
{
	printf("ms a frame, %s, %d triangles, %d frames each\n%-15s %-20s %-20s %-20s %-20s "
	       "%6s %9s\n%-15s",
	       rows->renderer, rows->row[0].triangles, rows->row[0].frames, "",
	       " wound, blood", " texture", " drawing", " whole", "fps", "texels",
	       "texture picture");
	for (int i = 0; i < 4; i++)
		printf(" %6s %6s %6s", "median", "99 %", "max");
	printf("\n");
	for (int i = 0; i < rows->n; i++) {
		const struct frame_row *row = &rows->row[i];

		printf("%5d %4dx%-4d", row->texture_px, row->width, row->height);
		print_times(&row->ticks);
		print_times(&row->texture);
		print_times(&row->draw);
		print_times(&row->whole);
		printf(" %6.1f %9.0f\n", row->hz, row->texels);
	}
}

void frame_rows_figures(const struct frame_rows *rows, json_t *figures)
{
	for (int i = 0; i < rows->n; i++) {
		const struct frame_row *row = &rows->row[i];

		metrics_time(figures, &row->time, "ms", "frame %dx%d, texture %d",
			     row->width, row->height, row->texture_px);
	}
}
