// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise eval MODEL.fis: reads lines of inputs (depth velocity), prints the force.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/fixed.h>
#include <incise/infile.h>
#include <incise/model.h>
#include <incise/uncertainty.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/scene_argument.h"

struct eval_job {
	const char *arith, *grid;
	bool no_clamp, json;
	enum { NONE, TOTAL, PARTS } uncertainty;
};

static const char *const uncertainties[] = {"none", "total", "parts", NULL};

static const struct cli_option options[] = {
	{0, "arith", "KIND", "double (default) or fixed; a .fx is always fixed",
	 CLI_PARSED(struct eval_job, arith, scene_argument_arith)},
	{0, "no-clamp", NULL, "extrapolate outside the support (double only)",
	 CLI_FLAG(struct eval_job, no_clamp)},
	{0, "grid", "NxM",
	 "evaluate on a grid over the support instead of reading; prints inputs "
	 "and output, an empty line after each row",
	 CLI_TEXT(struct eval_job, grid)},
	{0, "uncertainty", "WHICH",
	 "also print the standard deviation of a new measurement, from "
	 "MODEL.fis.sd, which incise train writes: total, or parts, also its parts "
	 "data, model and calibration (default: none)",
	 CLI_CHOICE(struct eval_job, uncertainty, uncertainties)},
	{0, "json", NULL, "report as JSON, one row for each evaluation",
	 CLI_FLAG(struct eval_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "eval",
	.synopsis = "MODEL.fis|MODEL.fx [FILE] [OPTIONS]",
	.summary =
		"Evaluate a model: read lines of inputs (depth_mm velocity_mm_s) from "
		"FILE or standard input, and print one force for each. Inputs out of the "
		"training range are clamped to it, and counted in a warning.",
	.options = options,
	.examples = "echo '5 20' | incise eval liver.fis",
};

struct evaluator {
	struct incise_model *model; /* NULL: only the compiled form is there */
	struct incise_fixed *fixed; /* NULL: double */
	struct incise_uncertainty *uncertainty; /* NULL: none */
	int n_inputs;
	struct incise_variable input[INCISE_MODEL_INPUTS_MAX];
	const char *output;
	unsigned long outside;	   /* of the support */
	unsigned long line, first; /* of the file; of the first point outside, 0: none */
	unsigned long unfired;	   /* inside, where no rule fires */
	json_t *rows;		   /* NULL: text */
	bool parts;		   /* of the uncertainty */
};

/* Parts of the standard deviation, in the order in which they are printed, and that of the mean. */
#define SD_PARTS 4
static const char *const part_names[SD_PARTS] = {"data", "model", "calibration", "mean"};

/* The standard deviation and its parts are NaN outside the data, where nothing bounds the error. */
static double find_sd(const struct evaluator *e, const double *x, bool outside)
{
	return outside ? NAN : incise_uncertainty_sd(e->uncertainty, e->model, x);
}

static void find_parts(const struct evaluator *e, const double *x, bool outside,
		       double parts[SD_PARTS])
{
	struct incise_uncertainty_parts all;

	incise_uncertainty_parts(e->uncertainty, e->model, x, &all);
	parts[0] = all.data;
	parts[1] = all.model;
	/* The rigs that trained, and the rig that measures. */
	parts[2] = hypot(all.calibration, all.rig);
	parts[3] = all.mean;
	for (int i = 0; i < SD_PARTS && outside; i++)
		parts[i] = NAN;
}

static void add_eval_row(struct evaluator *e, const double *x, double y, bool outside)
{
	const char *unit = strrchr(e->output, '_');
	json_t *row = json_object();
	char key[INCISE_MODEL_NAME_MAX + 20];
	double parts[SD_PARTS];

	snprintf(key, sizeof(key), "sd%s", unit ? unit : "");
	for (int i = 0; i < e->n_inputs; i++)
		json_object_set_new(row, e->input[i].name, json_number(x[i]));
	json_object_set_new(row, e->output, json_number(y));
	if (e->uncertainty)
		json_object_set_new(row, key, json_number(find_sd(e, x, outside)));
	if (e->parts)
		find_parts(e, x, outside, parts);
	for (int i = 0; e->parts && i < SD_PARTS; i++) {
		snprintf(key, sizeof(key), "sd_%s%s", part_names[i], unit ? unit : "");
		json_set_number(row, key, parts[i]);
	}
	json_object_set_new(row, "extrapolated", json_boolean(outside));
	json_array_append_new(e->rows, row);
}

/* Evaluate and print; a grid's text has its inputs in front. */
static void evaluate(struct evaluator *e, const double *x, size_t outside, bool inputs)
{
	unsigned int flags = 0;
	double y, parts[SD_PARTS];

	y = e->model ? incise_model_eval(e->model, x, &flags) : 0;
	if (e->fixed)
		y = incise_fixed_eval_double(e->fixed, x);
	if (outside && !e->first)
		e->first = e->line;
	e->outside += outside;
	e->unfired += !outside && flags & INCISE_MODEL_EXTRAPOLATED;
	outside |= flags & INCISE_MODEL_EXTRAPOLATED;
	if (e->rows) {
		add_eval_row(e, x, y, outside);
		return;
	}
	for (int i = 0; inputs && i < e->n_inputs; i++)
		printf("%.10g ", x[i]);
	printf("%.10g", y);
	if (e->uncertainty)
		printf(" %.10g", find_sd(e, x, outside));
	if (e->parts)
		find_parts(e, x, outside, parts);
	for (int i = 0; e->parts && i < SD_PARTS; i++)
		printf(" %.10g", parts[i]);
	putchar('\n');
}

#define SEPARATORS " \t,;"

/* Behind a line with more numbers than there are inputs: they may be decimal commas. */
static const char *advice(const char *text)
{
	const char *comma = strchr(text, ',');

	return comma && strpbrk(text, " \t;") ? "write decimal points, not commas"
					      : "remove what is not an input";
}

static void parse_line(const struct evaluator *e, const char *path, unsigned long line,
		       const char *text, double *x)
{
	const char *at = text;
	int n = e->n_inputs;

	for (int i = 0; i < n; i++) {
		const char *name = e->input[i].name;
		size_t length;
		char *end;

		at += strspn(at, SEPARATORS);
		length = strcspn(at, SEPARATORS);
		x[i] = incise_decimal(at, &end);
		if (!length)
			cli_fail("%s:%lu: column %d (%s) is missing; a line needs %d "
				 "numbers",
				 path, line, i + 1, name, n);
		if (end == at || end != at + length)
			cli_fail("%s:%lu: column %d (%s): '%.*s' is not a number; write "
				 "%d numbers without units, and '#' before a heading",
				 path, line, i + 1, name,
				 (int)(length < 20 ? length : 20), at, n);
		at = end;
	}
	at += strspn(at, SEPARATORS);
	if (*at)
		cli_fail("%s:%lu: column %d: '%.20s' is more than the %d inputs; %s",
			 path, line, n + 1, at, n, advice(text));
}

static void load_uncertainty(struct evaluator *e, const char *model)
{
	struct incise_error err = {0};
	char *path;

	if (!e->model)
		cli_usage("--uncertainty: %s is compiled; give the .fis file that it was "
			  "compiled from",
			  model);
	if (!strcmp(model, "-"))
		cli_fail(
			"--uncertainty: the model comes from standard input; give its file, "
			"next to which MODEL.fis.sd is");
	path = cli_text("%s.sd", model);
	e->uncertainty = cli_require(incise_uncertainty_load(path, e->model, &err), &err);
	free(path);
}

static void eval_grid(struct evaluator *e, const char *size)
{
	int n, m, end = 0;

	if (e->n_inputs != 2)
		cli_fail("--grid: the model has %s, expected 2; give points on "
			 "standard input instead",
			 cli_count(e->n_inputs, "input"));
	if (sscanf(size, "%dx%d%n", &n, &m, &end) != 2 || size[end] || n < 2 || m < 2 ||
	    n > 10000 || m > 10000)
		cli_usage("--grid: expected NxM with 2 to 10000 each, for example "
			  "20x15, found '%s'",
			  size);
	for (int i = 0; i < n; i++) {
		for (int j = 0; j < m; j++) {
			/* Weighted so that both ends are met to the digit. */
			double u = (double)i / (n - 1), v = (double)j / (m - 1);
			double x[] = {e->input[0].min * (1 - u) + e->input[0].max * u,
				      e->input[1].min * (1 - v) + e->input[1].max * v};

			evaluate(e, x, 0, true);
		}
		if (!e->rows)
			putchar('\n');
	}
}

static void open_compiled(struct evaluator *e, const char *path)
{
	struct incise_error err = {0};

	e->fixed = cli_require(incise_fixed_load(path, &err), &err);
	e->n_inputs = e->fixed->n_inputs;
	e->output = e->fixed->output;
	for (int i = 0; i < e->n_inputs; i++) {
		snprintf(e->input[i].name, sizeof(e->input[i].name), "%s",
			 e->fixed->input[i].name);
		e->input[i].min = e->fixed->input[i].min / (double)INCISE_FIXED_ONE;
		e->input[i].max = e->fixed->input[i].max / (double)INCISE_FIXED_ONE;
	}
}

static void open_model(struct evaluator *e, const char *path, const char *arith,
		       bool clamp)
{
	enum file_kind kind = file_kind_of(path);
	struct incise_error err = {0};

	file_expect(path, FILE_MODEL | FILE_COMPILED);
	if (kind ? kind == FILE_COMPILED : cli_ends_with(path, ".fx")) {
		if (arith && !strcmp(arith, "double"))
			cli_usage("--arith double: %s is compiled to fixed point; give "
				  "the .fis file that it was compiled from",
				  path);
		if (!clamp)
			cli_usage("--no-clamp: %s is compiled and cannot extrapolate; "
				  "give the .fis file that it was compiled from",
				  path);
		open_compiled(e, path);
		return;
	}
	e->model = cli_require(incise_model_load(path, &err), &err);
	incise_model_set_clamp(e->model, clamp);
	e->n_inputs = incise_model_info(e->model)->n_inputs;
	e->output = incise_model_info(e->model)->output.name;
	memcpy(e->input, incise_model_info(e->model)->input, sizeof(e->input));
	if (!arith || strcmp(arith, "fixed"))
		return;
	e->fixed = incise_fixed_compile(e->model, NULL, &err);
	if (!e->fixed)
		cli_fail("%s: %s", path, err.text);
}

static void eval_file(struct evaluator *e, const char *path)
{
	/* It may have any size: no line is kept. */
	static const struct incise_infile_kind points = {
		.name = "a file of points",
		.advice = "give a file of lines 'depth velocity'",
	};
	const char *name = strcmp(path, "-") ? path : "standard input";
	double x[INCISE_MODEL_INPUTS_MAX];
	struct incise_error err = {0};
	struct incise_infile *in;
	size_t outside;
	char *text;
	int rc;

	file_expect(path, FILE_TABLE | FILE_SEMICOLONS | FILE_TABS);
	in = cli_require(incise_infile_open(path, &points, &err), &err);
	while ((rc = incise_infile_line(in, &text, &err)) > 0) {
		e->line++;
		for (size_t n = strlen(text); n && text[n - 1] == '\r';)
			text[--n] = 0;
		if (!text[strspn(text, " \t")] || *text == '#')
			continue;
		parse_line(e, name, e->line, text, x);
		if (incise_inputs_check(e->input, e->n_inputs, x, 1, &outside, &err))
			cli_fail("%s:%lu: %s", name, e->line, err.text);
		evaluate(e, x, outside, false);
	}
	cli_check(rc, &err);
	incise_infile_close(in);
}

static void parse_eval(struct eval_job *job, int argc, char **argv)
{
	cli_parse(&command, argc, argv, job);
	if (optind >= argc)
		cli_usage("missing MODEL.fis or MODEL.fx (model)");
	if (argc - optind > 2)
		cli_usage(
			"unexpected argument '%s'; give a model, and one file of inputs",
			argv[optind + 2]);
	if (job->no_clamp && job->arith && !strcmp(job->arith, "fixed"))
		cli_usage("--no-clamp needs --arith double: fixed point cannot "
			  "extrapolate");
	if (job->grid && argc - optind == 2)
		cli_usage("--grid does not go with a file of inputs: it evaluates "
			  "points of its own");
}

static void warn_outside(const struct evaluator *e, bool no_clamp)
{
	char support[1000] = ""; /* of at most 8 inputs */
	int n = 0;

	for (int i = 0; i < e->n_inputs; i++)
		n += snprintf(support + n, sizeof(support) - (size_t)n,
			      "%s%.40s %.4g to %.4g", i ? ", " : "", e->input[i].name,
			      e->input[i].min, e->input[i].max);
	cli_warn("%s out of the training range (%s): %s; the first is in line %lu",
		 cli_count(e->outside, "input"), support,
		 no_clamp ? "extrapolated" : "clamped to it", e->first);
}

int main(int argc, char **argv)
{
	struct evaluator e = {0};
	struct eval_job job = {0};

	parse_eval(&job, argc, argv);
	open_model(&e, argv[optind], job.arith, !job.no_clamp);
	e.rows = job.json ? json_array() : NULL;
	e.parts = job.uncertainty == PARTS;
	if (job.uncertainty)
		load_uncertainty(&e, argv[optind]);
	if (job.grid)
		eval_grid(&e, job.grid);
	else
		eval_file(&e, argc - optind == 2 ? argv[optind + 1] : "-");
	if (e.rows)
		json_print(json_pack("{so}", "rows", e.rows));
	cli_finish();
	if (e.outside)
		warn_outside(&e, job.no_clamp);
	if (e.unfired)
		cli_warn("%s where no rule of the model fires; the nearest rule was used",
			 cli_count(e.unfired, "input"));
	incise_uncertainty_free(e.uncertainty);
	incise_model_free(e.model);
	incise_fixed_free(e.fixed);
	return 0;
}
