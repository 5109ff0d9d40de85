/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Where the frames of a view go that is not for a window: a folder of PNG files, a film, a
 * strip of a few of them side by side.
 */
#ifndef INCISE_VIEW_OUTPUT_H
#define INCISE_VIEW_OUTPUT_H

#include <incise/film.h>
#include <incise/view.h>

#define VIEW_STRIP_MAX 12

struct view_output {
	const char *folder, *film_path, *strip_path; /* each may be NULL */
	double strip_s[VIEW_STRIP_MAX]; /* times of its pictures, ascending */
	int n_strip;
	int width, height, fps;

	struct incise_film *film;
	uint8_t *rgb, *strip;
	int stripped;
	uint64_t frames;
};

/* Make what is needed, or fail the program. */
void view_output_begin(struct view_output *output);

/* Whether anything is to be written. */
bool view_output_wanted(const struct view_output *output);

/* The frame that the view drew last; of that time since the begin. Fails the program. */
void view_output_frame(struct view_output *output, struct incise_view *view, double t_s);

/* Finish files; what cannot be fails the program. */
void view_output_end(struct view_output *output);

#endif
