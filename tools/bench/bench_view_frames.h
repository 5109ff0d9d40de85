/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a frame of the picture costs, by sizes of the texture and of the picture.
 */
#ifndef INCISE_BENCH_VIEW_FRAMES_H
#define INCISE_BENCH_VIEW_FRAMES_H

#include <jansson.h>
#include <stdbool.h>
#include "metrics.h"
#include "../view/procedure.h"

/* Of the frames of a run, ms. */
struct frame_times {
	double median, p99, max;
};

struct frame_row {
	int texture_px, width, height, triangles, samples, frames;
	struct frame_times ticks; /* wound and blood */
	struct frame_times texture, draw, whole;
	struct harness_time time; /* of a whole frame */
	double hz;		  /* that whole frames would come one after the other */
	double texels;		  /* sent to the graphics, of a frame */
	double tick_us;		  /* of the first, per tick */
};

#define FRAME_ROWS 6

struct frame_rows {
	struct frame_row row[FRAME_ROWS];
	int n;
	char renderer[128];
};

/* The script bleeds from its first second to its end. */
#define FRAMES_FROM_S 1.0

/* @quick: few sizes, and none that takes long to make. */
void bench_view_frames(const struct view_script *script, double until_s, bool quick,
		       struct frame_rows *rows);

/* The median of a whole frame at the usual picture; NaN where it was not measured. */
double frame_rows_ms(const struct frame_rows *rows, int texture_px);

void frame_rows_figures(const struct frame_rows *rows, json_t *figures);
json_t *frame_rows_json(const struct frame_rows *rows);
void frame_rows_print(const struct frame_rows *rows);

#endif
