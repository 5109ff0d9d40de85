// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plots of a model; see model_plot.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "model_plot.h"
#include "plot.h"

#define SAMPLES 200 /* of a curve */
#define MESH 40	    /* of the surface, per input */

static double between_model_plot(const struct incise_variable *v, int i, int n)
{
	return v->min + (v->max - v->min) * i / n;
}

static void put_axis(FILE *script, const char *axis, const struct incise_variable *v)
{
	fprintf(script, "set %slabel ", axis);
	plot_put_label(script, v->name);
	fputc('\n', script);
}

static double eval_model(const void *model, const double *x)
{
	return incise_model_eval(model, x, NULL);
}

static double eval_fixed(const void *fixed, const double *x)
{
	return incise_fixed_eval_double(fixed, x);
}

struct model_surface model_surface_of(const struct incise_model *model)
{
	const struct incise_model_info *info = incise_model_info(model);
	struct model_surface surface = {
		.n_inputs = info->n_inputs,
		.output = info->output,
		.eval = eval_model,
		.of = model,
	};

	memcpy(surface.input, info->input, sizeof(surface.input));
	return surface;
}

struct model_surface model_surface_of_fixed(const struct incise_fixed *fixed)
{
	struct model_surface surface = {
		.n_inputs = fixed->n_inputs,
		.eval = eval_fixed,
		.of = fixed,
	};

	snprintf(surface.output.name, sizeof(surface.output.name), "%s", fixed->output);
	for (int i = 0; i < fixed->n_inputs; i++) {
		const struct incise_fixed_input *from = &fixed->input[i];
		struct incise_variable *input = &surface.input[i];

		snprintf(input->name, sizeof(input->name), "%s", from->name);
		input->min = from->min / (double)INCISE_FIXED_ONE;
		input->max = from->max / (double)INCISE_FIXED_ONE;
	}
	return surface;
}

void model_plot_write_functions(const struct incise_model *model, const char *folder,
				const char *data)
{
	const struct incise_model_info *info = incise_model_info(model);
	FILE *out = plot_data(folder, data);

	for (int i = 0; i < info->n_inputs; i++) {
		const struct incise_variable *v = &info->input[i];

		for (int k = 0; k < info->n_mfs[i]; k++) {
			for (int s = 0; s <= SAMPLES; s++) {
				double x = between_model_plot(v, s, SAMPLES);

				fprintf(out, "%g %g\n", x,
					incise_mf_eval(incise_model_mf(model, i, k), x));
			}
			fputs("\n\n", out);
		}
	}
	plot_data_end(out, folder);
}

/* A panel's plot is about that wide, and a character of a name is at most about that wide. */
#define PLOT_WIDTH 320.0
#define CHARACTER_WIDTH 7.5

/* A name above the peak of its function, its words below each other: '_' ends a line. */
struct peak {
	const char *name;
	double x, px; /* of the input; in the plot */
	double width; /* of the longest word, px */
};

static struct peak peak_of(const struct incise_variable *v, const struct incise_mf *mf)
{
	struct peak peak = {.name = mf->name};
	double highest = -1, from = 0, to = 0;

	for (int s = 0; s <= SAMPLES; s++) {
		double x = between_model_plot(v, s, SAMPLES), y = incise_mf_eval(mf, x);

		if (y > highest + 1e-9) {
			highest = y;
			from = x;
		}
		if (y > highest - 1e-9)
			to = x;
	}
	for (const char *word = mf->name; *word;) {
		size_t n = strcspn(word, "_");

		peak.width = fmax(peak.width, CHARACTER_WIDTH * (double)n);
		word += n + (word[n] == '_');
	}
	peak.px = ((from + to) / 2 - v->min) / (v->max - v->min) * PLOT_WIDTH;
	/* Within the plot at its ends. */
	peak.px = fmax(peak.width / 2, fmin(peak.px, PLOT_WIDTH - peak.width / 2));
	peak.x = v->min + peak.px / PLOT_WIDTH * (v->max - v->min);
	return peak;
}

/* Whether no name of more than two words, and none covers another. */
static bool peaks_fit(const struct peak *peak, int n)
{
	for (int i = 0; i < n; i++) {
		const char *first = strchr(peak[i].name, '_');

		if (first && strchr(first + 1, '_'))
			return false;
		for (int k = 0; k < i; k++)
			if (fabs(peak[i].px - peak[k].px) <
			    (peak[i].width + peak[k].width) / 2)
				return false;
	}
	return true;
}

#define NAME_SHOWN \
	16 /* characters of a name; more is cut, as a legend takes the plot's place */

/* As a string of gnuplot in double quotes; @space for '_'. */
static void put_model_plot_name(FILE *script, const char *name, const char *space)
{
	int n = 0;

	fputc('"', script);
	for (const char *c = name; *c; c++)
		if ((*c & 0xc0) != 0x80 && ++n > NAME_SHOWN) {
			fputs("…", script);
			break;
		} else if (*c == '_')
			fputs(space, script);
		else
			fputc(strchr("\"\\\n\r`", *c) ? ' ' : *c, script);
	fputc('"', script);
}

void model_plot_functions(FILE *script, const struct incise_model *model, int input,
			  const char *data, const char *title)
{
	const struct incise_model_info *info = incise_model_info(model);
	const struct incise_variable *v = &info->input[input];
	int first = 0, n = info->n_mfs[input];
	struct peak peak[INCISE_MODEL_MFS_MAX];
	bool fit;

	for (int i = 0; i < input; i++)
		first += info->n_mfs[i];
	for (int k = 0; k < n; k++)
		peak[k] = peak_of(v, incise_model_mf(model, input, k));
	fit = peaks_fit(peak, n);
	fprintf(script,
		"set title '%s'\nset xrange [%.9g:%.9g]\nset yrange [0:%s]\n"
		"set ytics 0,0.25,1\nset ylabel 'degree of membership'\n",
		title, v->min, v->max, fit ? "1.35" : "1.05");
	put_axis(script, "x", v);
	for (int k = 0; k < n && fit; k++) {
		fprintf(script, "set label %d ", k + 1);
		put_model_plot_name(script, peak[k].name, "\\n");
		fprintf(script, " at %.9g,1.2 center noenhanced font small\n", peak[k].x);
	}
	fputs("plot", script);
	for (int k = 0; k < n; k++) {
		fprintf(script, "%s '%s' index %d using 1:2 with lines lt %d title ",
			k ? ", \\\n " : "", data, first + k, k + 1);
		put_model_plot_name(script, fit ? "" : peak[k].name, " ");
	}
	fputs("\nunset label\nset ytics auto\nset xrange [*:*]\n", script);
}

void model_plot_write_surface(const struct model_surface *surface, const char *folder,
			      const char *data)
{
	const struct incise_variable *a = &surface->input[0], *b = &surface->input[1];
	FILE *out = plot_data(folder, data);
	double x[INCISE_MODEL_INPUTS_MAX];
	int n = surface->n_inputs;

	for (int i = 2; i < n; i++)
		x[i] = between_model_plot(&surface->input[i], 1, 2);
	for (int i = 0; n > 1 && i <= MESH; i++, fputc('\n', out))
		for (int j = 0; j <= MESH; j++) {
			x[0] = between_model_plot(a, i, MESH);
			x[1] = between_model_plot(b, j, MESH);
			fprintf(out, "%g %g %g\n", x[0], x[1],
				surface->eval(surface->of, x));
		}
	for (int i = 0; n == 1 && i <= SAMPLES; i++) {
		x[0] = between_model_plot(a, i, SAMPLES);
		fprintf(out, "%g %g\n", x[0], surface->eval(surface->of, x));
	}
	plot_data_end(out, folder);
}

void model_plot_surface(FILE *script, const struct model_surface *surface,
			const char *data, const char *title, const char *more)
{
	fprintf(script, "set title '%s'\n", title);
	put_axis(script, "x", &surface->input[0]);
	if (surface->n_inputs == 1) {
		put_axis(script, "y", &surface->output);
		fprintf(script, "set yrange [*:*]\nplot '%s' with lines ls 1 lw 2%s\n",
			data, more);
		return;
	}
	put_axis(script, "y", &surface->input[1]);
	put_axis(script, "z", &surface->output);
	put_axis(script, "cb", &surface->output);
	fprintf(script,
		"set cblabel offset 1,0\nset xlabel rotate parallel\nset ylabel rotate parallel\nset zlabel rotate parallel\n"
		"set yrange [*:*]\nset autoscale fix\nset ticslevel 0\nset view 55,320,0.95\n"
		"set border 31\nset xtics offset 0.3,-0.3\nset ytics offset -0.3,-0.3\n"
		"splot '%s' with pm3d%s\n"
		"set border 3\nset xtics offset 0,0\nset ytics offset 0,0\nset autoscale xy\n"
		"set xlabel norotate\nset ylabel rotate\n",
		data, more);
}

struct contours {
	double first, step, last;
};

/* Some eight steps of 1, 2 or 5 times a power of ten over the output's range on the mesh. */
static struct contours contours_of(const struct model_surface *surface)
{
	double low = INFINITY, high = -INFINITY, x[INCISE_MODEL_INPUTS_MAX], step, power;

	for (int i = 2; i < surface->n_inputs; i++)
		x[i] = between_model_plot(&surface->input[i], 1, 2);
	for (int i = 0; i <= MESH; i++)
		for (int j = 0; j <= MESH; j++) {
			x[0] = between_model_plot(&surface->input[0], i, MESH);
			x[1] = between_model_plot(&surface->input[1], j, MESH);
			low = fmin(low, surface->eval(surface->of, x));
			high = fmax(high, surface->eval(surface->of, x));
		}
	step = (high - low) / 8;
	if (!(step > 1e-9 * fmax(fabs(low), fabs(high))))
		return (struct contours){low, 1, low + 1};
	power = pow(10, floor(log10(step)));
	step = power * (step < 1.5 * power ? 1 : step < 3.5 * power ? 2 : 5);
	return (struct contours){ceil(low / step) * step, step, high};
}

void model_plot_contours(FILE *script, const struct model_surface *surface,
			 const char *data, const char *title)
{
	struct contours contours = contours_of(surface);
	const char *unit = strrchr(surface->output.name, '_');

	fprintf(script, "set title '%s%scontours every %g", title, *title ? "; " : "",
		contours.step);
	fprintf(script, unit && unit[1] ? " %.16s'\n" : "'\n", unit ? unit + 1 : "");
	put_axis(script, "x", &surface->input[0]);
	put_axis(script, "y", &surface->input[1]);
	put_axis(script, "cb", &surface->output);
	fprintf(script,
		"set ylabel offset -2,0\nset view map\nset pm3d noborder\nset contour base\n"
		"set cntrlabel onecolor\n"
		"set cntrparam levels incremental %g, %g, %g\nset cbtics %g\n"
		"set autoscale fix\nunset grid\n"
		"splot '%s' with pm3d nocontour, '' with lines lc rgb 'white' nosurface\n"
		"unset contour\nset ylabel offset 0,0\nset grid\nset autoscale xy\n",
		contours.first, contours.step, contours.last, contours.step, data);
}
