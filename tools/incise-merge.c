// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise merge FACTOR.fac... -o MODEL.fis: the model that all the pairs of some factors together
 * would have given, or one factor of them.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/factor.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"

struct options {
	char **paths;
	int n;
	const char *output;
	double ridge;
	bool json;
};

static const struct cli_option option_table[] = {
	{'o', "output", "FILE",
	 "write the model (.fis) or the factor (.fac) of all; - is standard "
	 "output, for a model",
	 CLI_OUTPUT(struct options, output), .extensions = ".fis .fac"},
	{0, "ridge", "R", "ridge on scaled data (default: by cross-validation)",
	 CLI_NUMBER(struct options, ridge, 0, 1e12)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "merge",
	.synopsis = "FACTOR.fac… -o MODEL.fis|ALL.fac [OPTIONS]",
	.summary = "Make the model that the pairs of all factors together give.",
	.options = option_table,
	.examples = "incise merge lyon.fac graz.fac -o liver.fis",
};

static void parse(struct options *options, int argc, char **argv)
{
	char *sd;

	*options = (struct options){.ridge = NAN};
	cli_parse(&command, argc, argv, options);
	options->paths = argv + optind;
	options->n = argc - optind;
	if (!options->n)
		cli_usage("missing FACTOR.fac (factors of incise train --factor)");
	if (!options->output || !*options->output)
		cli_usage("missing -o MODEL.fis or ALL.fac (output)");
	if (options->json && !strcmp(options->output, "-"))
		cli_usage("--json and -o - would both write to standard output");
	if (!cli_ends_with(options->output, ".fis"))
		return;
	sd = cli_text("%s.sd", options->output);
	cli_output_once(sd);
	free(sd);
}

static struct incise_factor *load(const char *path)
{
	struct incise_error err = {0};

	file_expect(path, FILE_FACTOR);
	return cli_require(incise_factor_load(path, &err), &err);
}

static struct incise_factor *merge_all(const struct options *options)
{
	struct incise_error err = {0};
	struct incise_factor *all = load(options->paths[0]);

	for (int i = 1; i < options->n; i++) {
		struct incise_factor *other = load(options->paths[i]);

		if (incise_factor_merge(all, other, options->paths[i], &err))
			cli_fail_with(&err);
		incise_factor_free(other);
	}
	return all;
}

/* The same notes as those of a training from the sources themselves. */
static void save_model(const struct options *options, struct incise_factor *factor,
		       struct incise_train_report *report)
{
	struct incise_factor_ridge ridge = {options->ridge, 1, NAN};
	struct incise_uncertainty *uncertainty;
	struct incise_error err = {0};
	struct incise_model *model = cli_require(
		incise_factor_solve(factor, &ridge, report, &uncertainty, &err), &err);
	char *notes = incise_factor_notes(factor);

	if (!notes)
		cli_fail("no memory");
	if (incise_model_save_notes(model, options->output, notes, &err))
		cli_fail_with(&err);
	if (cli_ends_with(options->output, ".fis")) {
		char *sd = cli_text("%s.sd", options->output);

		if (incise_uncertainty_save(uncertainty, sd, &err))
			cli_fail_with(&err);
		free(sd);
	}
	free(notes);
	incise_uncertainty_free(uncertainty);
	incise_model_free(model);
}

static void print_report(const struct options *options,
			 const struct incise_factor_info *info,
			 const struct incise_train_report *report)
{
	if (options->json) {
		json_t *object = json_pack("{sIsIsI}", "pairs", (json_int_t)info->rows,
					   "groups", (json_int_t)info->groups, "sources",
					   (json_int_t)info->n_sources);

		json_set_number(object, "rms_error", report->train_rmse);
		json_set_number(object, "r2", report->train_r2);
		json_set_number(object, "crossval_rms_error", report->crossval_rmse);
		json_set_number(object, "ridge", report->ridge);
		json_object_set_new(object, "output", json_string(options->output));
		json_print(object);
		return;
	}
	printf("%s: %s of %s from %s\n", cli_count(options->n, "factor"),
	       cli_count(info->rows, "pair"), cli_count(info->groups, "group"),
	       cli_count(info->n_sources, "source"));
	if (info->parts < INCISE_FACTOR_FOLDS)
		printf("%d of %d parts: the factors have small ones joined\n",
		       info->parts, INCISE_FACTOR_FOLDS);
	if (!isnan(report->train_rmse))
		printf("RMSE %.5g, R² %.5g, ridge %g\n", report->train_rmse,
		       report->train_r2, report->ridge);
	if (!isnan(report->crossval_rmse))
		printf("RMSE of parts that were held out %.5g\n", report->crossval_rmse);
	cli_written();
}

int main(int argc, char **argv)
{
	struct incise_train_report report = {
		.train_rmse = NAN, .train_r2 = NAN, .crossval_rmse = NAN, .ridge = NAN};
	struct incise_factor_info info;
	struct incise_error err = {0};
	struct incise_factor *factor;
	struct options options;

	parse(&options, argc, argv);
	factor = merge_all(&options);
	if (!cli_ends_with(options.output, ".fac"))
		save_model(&options, factor, &report);
	else if (incise_factor_save(factor, options.output, &err))
		cli_fail_with(&err);
	incise_factor_info(factor, &info);
	if (strcmp(options.output, "-"))
		print_report(&options, &info, &report);
	incise_factor_free(factor);
	cli_finish();
	return 0;
}
