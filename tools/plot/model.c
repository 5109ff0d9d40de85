// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figure of a model: its membership functions, its output as a map with contours, or of one input
 * as a curve, and the residuals of a dataset. See figure.h.
 *
 *     ┌─ functions ──┬─ functions ──┐   of a .fis
 *     ├─ output ─────┴──────────────┤
 *     ├─ band ───────┬─ band ───────┤   over the first two inputs, with MODEL.fis.sd
 *     ├─ residuals ──┼─ quantiles ──┤   with --data
 *     └──────────────┴──────────────┘
 */
#include <math.h>
#include <stdlib.h>
#include <incise/dataset.h>
#include <incise/uncertainty.h>
#include "../../lib/base/ascending.h"
#include "../cli/cli.h"
#include "../cli/model_plot.h"
#include "../cli/plot.h"
#include "figure.h"

#define FUNCTIONS_HEIGHT 280
#define SURFACE_HEIGHT 500
#define BAND_HEIGHT 360
#define RESIDUALS_HEIGHT 400

#define QUANTILES 400
#define MEANS 12 /* of residuals, over the first input */

/* Panels in rows, two of them side by side, from the top. */
struct model_grid {
	FILE *script;
	int height, top; /* pixels */
	/* Files of data, of this figure alone: another figure may be in its folder. */
	const char *functions, *surface, *bands[2], *residuals, *quantiles;
};

/* The next row of that height has panels of half the figure's width, or of all of it. */
static void place_model_plot(struct model_grid *grid, int column, int columns, int height)
{
	fprintf(grid->script, "set size %g,%g\nset origin %g,%g\n", 1.0 / columns,
		(double)height / grid->height, (double)column / columns,
		1 - (double)(grid->top + height) / grid->height);
	if (column == columns - 1)
		grid->top += height;
}

/* --- residuals ------------------------------------------------------------------------- */

struct residuals {
	size_t n, left_out;
	double *value, *at; /* measured - model, over the first input */
	double mean, rms;
};

static struct residuals residuals_of(const struct model_surface *surface,
				     const char *path)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1];
	struct residuals r = {0};
	struct incise_error err = {0};
	struct incise_dataset *data;
	int n = surface->n_inputs;

	for (int i = 0; i < n; i++)
		columns[i] = surface->input[i].name;
	columns[n] = surface->output.name;
	/* As incise train, which does not learn from rows where the blade did not advance. */
	data = cli_require(incise_dataset_read_where(path, columns, n + 1, NULL,
						     "advancing", &r.left_out, &err),
			   &err);
	r.n = incise_dataset_rows(data);
	r.value = cli_alloc(r.n, sizeof(*r.value));
	r.at = cli_alloc(r.n, sizeof(*r.at));
	for (size_t i = 0; i < r.n; i++) {
		const double *row = incise_dataset_row(data, i);

		r.at[i] = row[0];
		r.value[i] = row[n] - surface->eval(surface->of, row);
		r.mean += r.value[i] / (double)r.n;
		r.rms += r.value[i] * r.value[i] / (double)r.n;
	}
	r.rms = sqrt(r.rms);
	incise_dataset_free(data);
	return r;
}

static void widen_model(double *low, double *high, const double *value, size_t n)
{
	*low = *high = value[0];
	for (size_t i = 1; i < n; i++) {
		*low = fmin(*low, value[i]);
		*high = fmax(*high, value[i]);
	}
}

/* Rows "middle, mean, its standard error" of equal parts of the first input that have two residuals or more. */
static void write_means(const struct residuals *r, double low, double high, FILE *data)
{
	struct {
		double n, sum, squares;
	} part[MEANS] = {{0}};
	const double width = fmax((high - low) / MEANS, 1e-300);

	for (size_t i = 0; i < r->n; i++) {
		const int k = (int)fmin((r->at[i] - low) / width, MEANS - 1);

		part[k].n++;
		part[k].sum += r->value[i];
		part[k].squares += r->value[i] * r->value[i];
	}
	for (int k = 0; k < MEANS; k++) {
		const double n = part[k].n, mean = part[k].sum / n;

		if (n > 1)
			fprintf(data, "%.6g %.6g %.6g\n", low + (k + 0.5) * width, mean,
				sqrt(fmax(0, part[k].squares / n - mean * mean) /
				     (n - 1)));
	}
}

static void write_residuals(const struct residuals *r, const char *folder,
			    const char *name)
{
	FILE *data = plot_data(folder, name);
	double low[2], high[2];
	struct scatter scatter;

	widen_model(&low[0], &high[0], r->at, r->n);
	widen_model(&low[1], &high[1], r->value, r->n);
	scatter_begin(&scatter, low, high);
	for (size_t i = 0; i < r->n; i++)
		if (scatter_takes(&scatter, r->at[i], r->value[i]))
			fprintf(data, "%.6g %.6g\n", r->at[i], r->value[i]);
	scatter_end(&scatter);
	fputs("\n\n", data);
	write_means(r, low[0], high[0], data);
	plot_data_end(data, folder);
}

/* Shares and quantiles; both ends are there, however many are left out between. */
static void write_quantiles(struct residuals *r, const char *folder, const char *name)
{
	FILE *data = plot_data(folder, name);
	size_t last = r->n - 1, step = r->n / QUANTILES + 1;

	qsort(r->value, r->n, sizeof(*r->value), ascending);
	for (size_t i = 0; i <= last; i = i < last && i + step > last ? last : i + step)
		fprintf(data, "%.9g %.6g\n", ((double)i + 0.5) / (double)r->n,
			r->value[i]);
	plot_data_end(data, folder);
}

static void put_residual_label(FILE *script, const struct model_surface *surface)
{
	fputs("set ylabel 'residual of '.", script);
	plot_put_label(script, surface->output.name);
	fputc('\n', script);
}

static void put_residuals(struct model_grid *grid, const struct model_surface *surface,
			  const struct residuals *r)
{
	/* Three digits of the RMSE. */
	int decimals = r->rms > 0 ? (int)fmin(fmax(2 - floor(log10(r->rms)), 0), 12) : 0;
	size_t n;
	const char *unit = plot_unit_of(surface->output.name, &n),
		   *gap = *unit ? " " : "";

	place_model_plot(grid, 0, 2, RESIDUALS_HEIGHT);
	fprintf(grid->script,
		"set key outside bottom center horizontal\nset xrange [*:*]\nset yrange [*:*]\n"
		"set title '%zu rows: measured - model, RMSE %.*f%s%s, mean "
		"%.*f%s%s'\n"
		"set xlabel ",
		r->n, decimals, r->rms, gap, unit, decimals,
		round(r->mean * pow(10, decimals)) / pow(10, decimals) + 0.0, /* no -0 */
		gap, unit);
	plot_put_label(grid->script, surface->input[0].name);
	fputc('\n', grid->script);
	put_residual_label(grid->script, surface);
	fprintf(grid->script,
		"plot '%s' index 0 with points pt 7 ps 0.4 lc rgb blue title 'rows', "
		"0 with lines lc rgb ink notitle, '' index 1 with yerrorbars pt 7 ps 0.8 lw 1.5 "
		"lc rgb orange title 'mean and its standard error'\n",
		grid->residuals);
	place_model_plot(grid, 1, 2, RESIDUALS_HEIGHT);
	fprintf(grid->script,
		"unset key\nset title 'quantiles of the residuals; line: normal distribution'\n"
		"set xlabel 'quantile of the normal distribution / SD'\n"
		"plot '%s' using (invnorm($1)):2 with points pt 7 ps 0.4 lc rgb "
		"blue, %g + %g * x with lines lc rgb ink\n",
		grid->quantiles, r->mean,
		sqrt(fmax(0, r->rms * r->rms - r->mean * r->mean)));
}

/* --- bands ----------------------------------------------------------------------------- */

#define BAND_POINTS 200

/* The uncertainty next to a model, or NULL. */
static struct incise_uncertainty *uncertainty_of(const char *path,
						 const struct incise_model *model)
{
	char *sd = cli_text("%s.sd", path);
	struct incise_uncertainty *uncertainty = incise_uncertainty_load(sd, model, NULL);

	free(sd);
	return uncertainty;
}

/* Input, output, half the 95 % interval of a new cut and of the mean of all cuts. Returns the last parts. */
static struct incise_uncertainty_parts write_band(
	const struct incise_model *model, const struct incise_uncertainty *uncertainty,
	int input, const char *folder, const char *name)
{
	const struct incise_model_info *info = incise_model_info(model);
	FILE *data = plot_data(folder, name);
	struct incise_uncertainty_parts u = {0};
	double x[INCISE_MODEL_INPUTS_MAX];

	for (int i = 0; i < info->n_inputs; i++)
		x[i] = info->input[i].min + (info->input[i].max - info->input[i].min) / 2;
	for (int k = 0; k <= BAND_POINTS; k++) {
		const struct incise_variable *v = &info->input[input];

		x[input] = v->min + (v->max - v->min) * k / BAND_POINTS;
		incise_uncertainty_parts(uncertainty, model, x, &u);
		fprintf(data, "%.6g %.6g %.6g %.6g\n", x[input],
			incise_model_eval(model, x, NULL), INCISE_INTERVAL95 * u.total,
			INCISE_INTERVAL95 * u.mean);
	}
	plot_data_end(data, folder);
	return u;
}

static const char mean_band[] =
	"'' using 1:($2-$4):($2+$4) with filledcurves lc rgb blue fs transparent solid 0.4 "
	"noborder title 'the mean of all cuts', \\\n  ";

/* Over one of the inputs; the others are at the middle of their support. @u: parts of the sd anywhere. */
static void put_band(struct model_grid *grid, const struct model_surface *surface,
		     int input, int columns, const struct incise_uncertainty_parts *u)
{
	place_model_plot(grid, input, columns, BAND_HEIGHT);
	fprintf(grid->script,
		"set key outside bottom center horizontal\nset xrange [%.9g:%.9g]\n"
		"set yrange [*:*]\nset title '95 %% intervals%s'",
		surface->input[input].min, surface->input[input].max,
		surface->n_inputs > 2 ? "; other inputs at the middle of their support"
				      : "");
	if (surface->n_inputs == 2) {
		const struct incise_variable *other = &surface->input[!input];
		double middle = (other->min + other->max) / 2;
		size_t n;
		const char *unit = plot_unit_of(other->name, &n);
		char *at = *unit ? cli_text(" at %.3g %s", middle, unit)
				 : cli_text(" at %s = %.3g", other->name, middle);

		putc('.', grid->script);
		plot_put_text(grid->script, at);
		free(at);
	}
	fputs("\nset xlabel ", grid->script);
	plot_put_label(grid->script, surface->input[input].name);
	fputs("\nset ylabel ", grid->script);
	plot_put_label(grid->script, surface->output.name);
	fprintf(grid->script,
		"\nplot '%s' using 1:($2-$3):($2+$3) with filledcurves lc rgb blue fs "
		"transparent solid 0.2 noborder title 'a new cut%s', \\\n  "
		"%s'' using 1:2 with lines lc rgb ink title 'output'\n",
		grid->bands[input], u->rig > 0 ? " on a new rig" : "",
		isnan(u->mean) ? "" : mean_band);
}

/* --- the figure -------------------------------------------------------------------------- */

static void put_surface(struct model_grid *grid, const struct model_surface *surface)
{
	const char *title = surface->n_inputs > 2
				    ? "the other inputs at the middle of their support"
				    : "";

	fputs("unset key\nset xrange [*:*]\nset yrange [*:*]\n", grid->script);
	place_model_plot(grid, 0, 1, SURFACE_HEIGHT);
	if (surface->n_inputs == 1)
		model_plot_surface(grid->script, surface, grid->surface, title, "");
	else
		model_plot_contours(grid->script, surface, grid->surface, title);
}

/* @model NULL: a compiled model has no known functions; @uncertainty NULL: unknown. */
static FILE *draw_model(const struct figure *figure, const struct model_surface *surface,
			const struct incise_model *model,
			const struct incise_uncertainty *uncertainty)
{
	int n = model ? surface->n_inputs : 0, columns = n > 1 ? 2 : 1;
	int rows = (n + columns - 1) / columns;
	int bands = uncertainty ? columns : 0;
	struct incise_uncertainty_parts u = {0};
	struct residuals residuals = {0};
	struct model_grid grid = {
		.height = rows * FUNCTIONS_HEIGHT + SURFACE_HEIGHT +
			  (bands ? BAND_HEIGHT : 0),
		.functions = cli_text("%s-functions.dat", figure->name),
		.surface = cli_text("%s-surface.dat", figure->name),
		.bands = {cli_text("%s-band.dat", figure->name),
			  cli_text("%s-band-2.dat", figure->name)},
		.residuals = cli_text("%s-residuals.dat", figure->name),
		.quantiles = cli_text("%s-quantiles.dat", figure->name),
	};

	if (figure->data) {
		residuals = residuals_of(surface, figure->data);
		write_residuals(&residuals, figure->folder, grid.residuals);
		write_quantiles(&residuals, figure->folder, grid.quantiles);
		grid.height += RESIDUALS_HEIGHT;
	}
	if (model)
		model_plot_write_functions(model, figure->folder, grid.functions);
	model_plot_write_surface(surface, figure->folder, grid.surface);
	for (int i = 0; i < bands; i++)
		u = write_band(model, uncertainty, i, figure->folder, grid.bands[i]);
	grid.script = plot_begin(figure->folder, figure->name, FIGURE_WIDTH, grid.height);
	fputs("set multiplot\nset key outside right center\n", grid.script);
	for (int i = 0; i < n; i++) {
		place_model_plot(&grid, i % columns, columns, FUNCTIONS_HEIGHT);
		model_plot_functions(grid.script, model, i, grid.functions, "");
	}
	if (n % columns)
		grid.top += FUNCTIONS_HEIGHT;
	put_surface(&grid, surface);
	for (int i = 0; i < bands; i++)
		put_band(&grid, surface, i, bands, &u);
	if (figure->data)
		put_residuals(&grid, surface, &residuals);
	fputs("unset multiplot\n", grid.script);
	free(residuals.at), free(residuals.value);
	return grid.script;
}

FILE *figure_of_model(const struct figure *figure)
{
	struct incise_error err = {0};
	struct incise_model *model =
		cli_require(incise_model_load(figure->path, &err), &err);
	struct model_surface surface = model_surface_of(model);
	struct incise_uncertainty *uncertainty = uncertainty_of(figure->path, model);
	FILE *script = draw_model(figure, &surface, model, uncertainty);

	incise_uncertainty_free(uncertainty);

	incise_model_free(model);
	return script;
}

FILE *figure_of_compiled(const struct figure *figure)
{
	struct incise_error err = {0};
	struct incise_fixed *fixed =
		cli_require(incise_fixed_load(figure->path, &err), &err);
	struct model_surface surface = model_surface_of_fixed(fixed);
	FILE *script = draw_model(figure, &surface, NULL, NULL);

	incise_fixed_free(fixed);
	return script;
}
