// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise merge FACTOR.fac... -o MODEL.fis: the model that all the pairs of some factors together
 * would have given, or one factor of them.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/corpus.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"

struct merge_options {
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
	 CLI_OUTPUT(struct merge_options, output), .extensions = ".fis .fac"},
	{0, "ridge", "R", "ridge on scaled data (default: by cross-validation)",
	 CLI_NUMBER(struct merge_options, ridge, 0, 1e12)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct merge_options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "merge",
	.synopsis = "FACTOR.fac… -o MODEL.fis|ALL.fac [OPTIONS]",
	.summary = "Make the model that the pairs of all factors together give.",
	.options = option_table,
	.examples = "incise merge lyon.fac graz.fac -o liver.fis",
};

static void parse_merge(struct merge_options *options, int argc, char **argv)
{
	char *sd;

	*options = (struct merge_options){.ridge = NAN};
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

/* The same files as those of a training from the sources themselves. */
static void save_model(const struct merge_options *options,
		       const struct incise_trained *trained)
{
	struct incise_error err = {0};
	char *sd = cli_text("%s.sd", options->output);

	if (incise_model_save_notes(trained->model, options->output, trained->notes,
				    &err) ||
	    (cli_ends_with(options->output, ".fis") &&
	     incise_uncertainty_save(trained->uncertainty, sd, &err)))
		cli_fail_with(&err);
	free(sd);
}

static void print_merge_report(const struct merge_options *options,
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
		printf("RMSE %.5g, of the mean %.5g, R² %.5g, ridge %g\n",
		       report->train_rmse,
		       report->train_rmse / sqrt(1 - report->train_r2), report->train_r2,
		       report->ridge);
	if (!isnan(report->crossval_rmse))
		printf("RMSE of parts that were held out %.5g\n", report->crossval_rmse);
	cli_written();
}

int main(int argc, char **argv)
{
	const struct incise_train_report none = {
		.train_rmse = NAN, .train_r2 = NAN, .crossval_rmse = NAN, .ridge = NAN};
	enum incise_train_end end;
	struct incise_factor_info info;
	struct incise_trained trained;
	struct incise_error err = {0};
	struct merge_options options;

	parse_merge(&options, argc, argv);
	for (int i = 0; i < options.n; i++)
		file_expect(options.paths[i], FILE_FACTOR);
	end = cli_ends_with(options.output, ".fac") ? INCISE_TRAIN_TO_FACTOR
						    : INCISE_TRAIN_TO_MODEL;
	cli_check(incise_train_factors((const char *const *)options.paths, options.n,
				       options.ridge, end, &trained, &err),
		  &err);
	if (trained.model)
		save_model(&options, &trained);
	else if (incise_factor_save(trained.factor, options.output, &err))
		cli_fail_with(&err);
	incise_factor_info(trained.factor, &info);
	if (strcmp(options.output, "-"))
		print_merge_report(&options, &info,
				   trained.model ? &trained.report : &none);
	incise_trained_free(&trained);
	cli_finish();
	return 0;
}
