// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A model in the viewer: its output over the first input, at some values of the second one, with the
 * uncertainty of MODEL.fis.sd; see web.h. Each part is evaluated anew.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/model.h>
#include <incise/uncertainty.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "web.h"

#define LINES 5	   /* values of the second input, from its least to its largest */
#define POINTS 400 /* of a line at most */

struct web_model {
	struct web_file base;
	struct incise_model *model;
	struct incise_uncertainty *uncertainty; /* NULL: not known */
	const struct incise_model_info *info;
	int lines;
};

/* A line's point: other inputs than the two are in the middle. */
static void place_model(const struct web_model *w, int line, double first, double *x)
{
	for (int i = 0; i < w->info->n_inputs; i++) {
		const struct incise_variable *input = &w->info->input[i];

		x[i] = i == 0	? first
		       : i == 1 ? input->min +
					  (input->max - input->min) * line / (LINES - 1)
				: (input->min + input->max) / 2;
	}
}

static json_t *web_model_head(struct web_file *file)
{
	const struct web_model *w = (struct web_model *)file;
	const struct incise_model_info *info = w->info;
	const char *name = info->input[0].name, *unit;
	json_t *head;
	double x[INCISE_MODEL_INPUTS_MAX];
	char labels[600] = "", *label;
	size_t length;

	unit = plot_unit_of(name, &length);
	label = cli_text("%.*s", (int)length, name);
	head = web_head_new("model", file->path, label, unit, info->input[0].min,
			    info->input[0].max);
	free(label);

	for (int k = 0; k < w->lines; k++) {
		size_t n = strlen(labels);

		place_model(w, k, 0, x);
		if (info->n_inputs > 1)
			snprintf(labels + n, sizeof(labels) - n, "%sat %.4g %s",
				 k ? "|" : "", x[1],
				 plot_unit_of(info->input[1].name, &length));
		else
			snprintf(labels, sizeof(labels), "%s", info->output.name);
	}
	unit = plot_unit_of(info->output.name, &length);
	label = cli_text("%.*s", (int)length, info->output.name);
	web_head_panel(head, label, unit, labels);
	free(label);
	json_object_set_new(
		head, "facts",
		json_pack("[[ss]]", "band",
			  w->uncertainty ? "twice the standard uncertainty of a new cut"
					 : "not known: MODEL.fis.sd is not there"));
	return head;
}

static void put_list(FILE *out, const char *name, const double *values, int n)
{
	fprintf(out, "\"%s\":[", name);
	for (int i = 0; i < n; i++)
		fprintf(out, isfinite(values[i]) ? "%s%.8g" : "%snull", i ? "," : "",
			values[i]);
	fputc(']', out);
}

static void put_model_line(const struct web_model *w, int line, double from, double to,
			   int n, FILE *out)
{
	double at[POINTS], y[POINTS], u[POINTS], x[INCISE_MODEL_INPUTS_MAX];
	struct incise_uncertainty_parts parts;

	for (int i = 0; i < n; i++) {
		at[i] = from + (to - from) * i / (n - 1);
		place_model(w, line, at[i], x);
		y[i] = incise_model_eval(w->model, x, NULL);
		if (w->uncertainty)
			incise_uncertainty_parts(w->uncertainty, w->model, x, &parts);
		u[i] = w->uncertainty ? parts.total : NAN;
	}
	fputs(line ? ",{" : "{", out);
	put_list(out, "x", at, n);
	fputc(',', out);
	put_list(out, "y", y, n);
	if (w->uncertainty) {
		fputc(',', out);
		put_list(out, "u", u, n);
	}
	fputc('}', out);
}

static int web_model_part(struct web_file *file, double from, double to, int columns,
			  FILE *out, struct incise_error *err)
{
	const struct web_model *w = (struct web_model *)file;
	const struct incise_variable *input = &w->info->input[0];

	(void)err;
	/* Outside of its range a model answers as at the end of it. */
	from = fmax(from, input->min);
	to = fmin(fmax(to, from), input->max);
	fprintf(out, "{\"from\":%.10g,\"to\":%.10g,\"done\":1,\"tracks\":[", from, to);
	for (int k = 0; k < w->lines; k++)
		put_model_line(w, k, from, to,
			       columns < 2	  ? 2
			       : columns > POINTS ? POINTS
						  : columns,
			       out);
	fputs("]}", out);
	return 0;
}

static void web_model_close(struct web_file *file)
{
	struct web_model *w = (struct web_model *)file;

	incise_uncertainty_free(w->uncertainty);
	incise_model_free(w->model);
	free(w);
}

static const struct web_kind web_model_kind = {
	.head = web_model_head, .part = web_model_part, .close = web_model_close};

struct web_file *web_model_open(const char *path)
{
	struct web_model *w = cli_alloc(1, sizeof(*w));
	struct incise_error err = {0};
	char *sd = cli_text("%s.sd", path);

	w->base = (struct web_file){&web_model_kind, path};
	w->model = cli_require(incise_model_load(path, &err), &err);
	w->uncertainty = incise_uncertainty_load(sd, w->model, NULL);
	w->info = incise_model_info(w->model);
	w->lines = w->info->n_inputs > 1 ? LINES : 1;
	free(sd);
	return &w->base;
}
