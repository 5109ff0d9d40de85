/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How far what a screen shows is from the picture of that very moment, by texture and by
 * frames per second.
 *
 *     exact   ─●──●──●──●──●──●──●──●──●─▶   finest texture, any moment
 *     shown    ■━━━━━━━━━━━■━━━━━━━━━━━■━    the last frame that was drawn
 *                    ↑ error at a moment
 */
#ifndef INCISE_BENCH_VIEW_ERROR_H
#define INCISE_BENCH_VIEW_ERROR_H

#include <jansson.h>
#include "bench_view_frames.h"

struct shown_row {
	int texture_px;
	int fps; /* INT_MAX: drawn at the moment itself */
	double rms, rms_max, ssim;
	double ms;   /* of a frame */
	double ms_s; /* of run time for a second that is shown; NaN at the moment itself */
};

#define SHOWN_ROWS 16

struct shown_rows {
	struct shown_row row[SHOWN_ROWS];
	int n, moments, textures;
	int exact_px; /* of the texture of what they are compared with */
};

/* @frames: what they cost. */
void bench_view_error(const struct view_script *script, double until_s, bool quick,
		      const struct frame_rows *frames, struct shown_rows *rows);

void shown_rows_figures(const struct shown_rows *rows, json_t *figures);
json_t *shown_rows_json(const struct shown_rows *rows);
void shown_rows_print(const struct shown_rows *rows);

/* NAME.png and .svg: error over run time. */
void shown_rows_draw(const struct shown_rows *rows, const char *folder, const char *name);

#endif
