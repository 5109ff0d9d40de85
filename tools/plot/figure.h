/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The figure of a file: a function for each kind writes its data and script, of which incise plot
 * makes a file or a window. See cli/plot.h.
 */
#ifndef INCISE_FIGURE_H
#define INCISE_FIGURE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define FIGURE_WIDTH 1200 /* pixels */

struct figure {
	const char *path; /* the file that is drawn */
	const char *data; /* of a model: the dataset of its residuals, or NULL */
	/* For a recording: the time that is drawn; -INFINITY, INFINITY: all. */
	double from_s, to_s;
	const char *folder, *name; /* of cli/plot.h */
};

/* Each returns the script, to be drawn. Every failure ends the program. */
FILE *figure_of_model(const struct figure *figure);
FILE *figure_of_compiled(const struct figure *figure);
FILE *figure_of_recording(const struct figure *figure);
FILE *figure_of_session(const struct figure *figure);
FILE *figure_of_calibration(const struct figure *figure);
FILE *figure_of_dataset(const struct figure *figure);
FILE *figure_of_texture(const struct figure *figure);

/*
 * Points of a scatter plot, of which those that would fall on a drawn one are left out: as many
 * are drawn as there are places for them, however many there are.
 */
struct scatter {
	double low[2], high[2]; /* of the axes */
	uint8_t *taken;		/* places */
};

/* All places are free. scatter_end(). */
void scatter_begin(struct scatter *scatter, const double low[2], const double high[2]);

/* Whether the point falls on a free place, which it takes. */
bool scatter_takes(struct scatter *scatter, double x, double y);

void scatter_end(struct scatter *scatter);

#endif
