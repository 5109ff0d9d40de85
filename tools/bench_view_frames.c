// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a frame costs; see bench_view_frames.h. Frames come at 60 a second of the ticks' time,
 * as fast as they can, and are finished before the next one begins.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "bench_view_frames.h"
#include "cli.h"
#include "json.h"
#include "stopwatch.h"

#define FPS 60

static const struct {
	int texture_px, width, height;
} sizes[] = {
	{2048, 1280, 720}, {512, 1280, 720}, {1024, 1280, 720},
	{4096, 1280, 720}, {2048, 640, 360}, {2048, 1920, 1080},
};

_Static_assert(sizeof(sizes) / sizeof(*sizes) == FRAME_ROWS, "room for each");

/* Each of all frames, ms. */
struct samples {
	double *ticks, *texture, *draw, *whole;
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
	to->n++;
}

static void measure(const struct view_script *script, double until_s,
		    struct frame_row *row, char *renderer, size_t room)
{
	int n = (int)((until_s - FRAMES_FROM_S) * FPS);
	double *all = malloc(4 * (size_t)n * sizeof(*all)), sum = 0;
	struct samples got = {all, all + n, all + 2 * n, all + 3 * n, 0};
	struct incise_view_report before, after;
	struct fed_view fed;

	if (!all)
		cli_fail("no memory");
	fed_view_open(&fed, script, row->texture_px, row->width, row->height);
	/* What is made at the first frame, and compiled at the second, is not of a frame. */
	for (int i = 0; i < 5; i++) {
		fed_view_until(&fed, FRAMES_FROM_S * i / 5);
		fed_view_frame(&fed);
	}
	incise_view_report(fed.view, &before);
	for (int i = 0; i < n && !cli_stop; i++)
		sample(&fed, FRAMES_FROM_S + (double)i / FPS, &got);
	incise_view_report(fed.view, &after);
	if (cli_stop)
		cli_fail("interrupted");
	for (int i = 0; i < n; i++)
		sum += got.whole[i];
	row->frames = n;
	row->hz = n / (sum * 1e-3);
	row->triangles = after.triangles;
	row->samples = after.samples;
	row->texels = (double)(after.uploaded_texels - before.uploaded_texels) / n;
	row->tick_us = (after.ticks_s - before.ticks_s) * 1e6 /
		       (double)(after.ticks - before.ticks);
	row->ticks = times_of(got.ticks, n);
	row->texture = times_of(got.texture, n);
	row->draw = times_of(got.draw, n);
	row->whole = times_of(got.whole, n);
	snprintf(renderer, room, "%s", after.renderer);
	fed_view_close(&fed);
	free(all);
}

void bench_view_frames(const struct view_script *script, double until_s,
		       struct frame_rows *rows)
{
	*rows = (struct frame_rows){.n = FRAME_ROWS};
	for (int i = 0; i < FRAME_ROWS; i++) {
		struct frame_row *row = &rows->row[i];

		row->texture_px = sizes[i].texture_px;
		row->width = sizes[i].width;
		row->height = sizes[i].height;
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
			json_pack("{si si si si si si so so so so so so so}",
				  "texture_px", row->texture_px, "width", row->width,
				  "height", row->height, "triangles", row->triangles,
				  "samples", row->samples, "frames", row->frames,
				  "effects_ms", times_json(&row->ticks), "texture_ms",
				  times_json(&row->texture), "draw_ms",
				  times_json(&row->draw), "whole_ms",
				  times_json(&row->whole), "frames_hz",
				  json_number(row->hz), "texels",
				  json_number(row->texels), "effects_us_tick",
				  json_number(row->tick_us)));
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
