/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a model looks like: its membership functions and its force surface, as data and
 * gnuplot commands within a picture; see picture.h.
 */
#ifndef INCISE_MODEL_PICTURE_H
#define INCISE_MODEL_PICTURE_H

#include <stdio.h>
#include <incise/model.h>

/* Write degrees over each input's support: a block per function, input after input. */
void model_picture_functions(const struct incise_model *model, const char *folder,
			     const char *data);

/* Plot one input's functions from such data. names: words for the legend, or NULL for
 * those of the model. */
void model_picture_plot_functions(FILE *script, const struct incise_model *model,
				  int input, const char *data, const char *title,
				  const char *names);

/* Write the output over the first two inputs, the others in the middle of their support;
 * over the first where there is only one. */
void model_picture_surface(const struct incise_model *model, const char *folder,
			   const char *data);

/* Plot it. more: further elements of the plot, beginning with a comma, or "". */
void model_picture_plot_surface(FILE *script, const struct incise_model *model,
				const char *data, const char *title, const char *more);

/* All of it as one picture, FOLDER/NAME.png and .svg; fails the program when it cannot. */
void model_picture_draw(const struct incise_model *model, const char *folder,
			const char *name);

#endif
