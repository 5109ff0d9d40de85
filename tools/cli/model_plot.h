/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Plots of a model: its membership functions and its force surface, as data and gnuplot
 * commands within a plot; see plot.h.
 */
#ifndef INCISE_MODEL_PLOT_H
#define INCISE_MODEL_PLOT_H

#include <stdio.h>
#include <incise/fixed.h>
#include <incise/model.h>

/* A model, compiled or not, as a function over its inputs. */
struct model_surface {
	int n_inputs;
	struct incise_variable input[INCISE_MODEL_INPUTS_MAX], output;
	double (*eval)(const void *of, const double *x);
	const void *of;
};

/* The model must outlive it. */
struct model_surface model_surface_of(const struct incise_model *model);
struct model_surface model_surface_of_fixed(const struct incise_fixed *fixed);

/* Write degrees over each input's support: a block per function, input after input. */
void model_plot_write_functions(const struct incise_model *model, const char *folder,
				const char *data);

/* Plot one input's functions from such data, with their names above them, or as a legend if these
 * would cover each other. */
void model_plot_functions(FILE *script, const struct incise_model *model, int input,
			  const char *data, const char *title);

/* Write the output over the first one or two inputs, the others at the middle of their
 * support. */
void model_plot_write_surface(const struct model_surface *surface, const char *folder,
			      const char *data);

/* Plot that surface. @more: further elements of the plot, beginning with a comma, or "". */
void model_plot_surface(FILE *script, const struct model_surface *surface,
			const char *data, const char *title, const char *more);

/* Plot that surface of two inputs as a map with contours. */
void model_plot_contours(FILE *script, const struct model_surface *surface,
			 const char *data, const char *title);

#endif
