// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What is asked of incise train; see train_wish.h.
 */
#include <getopt.h>
#include <string.h>
#include "../cli/cli.h"
#include "train_wish.h"

enum {
	OPT_INPUTS = CLI_LONG,
	OPT_OUTPUT,
	OPT_GROUP,
	OPT_CHECK,
	OPT_SEED,
	OPT_MF,
	OPT_MF_TYPE,
	OPT_EPOCHS,
	OPT_STEP,
	OPT_RIDGE,
	OPT_STARTS,
	OPT_CLASSIC,
	OPT_INITIAL,
	OPT_HISTORY,
	OPT_JSON,
};

static const struct cli_option options[] = {
	{'o', "output-model", "FILE",
	 "write the model there (.fis); '-' is standard output"},
	{OPT_INPUTS, "inputs", "A,B", "input columns (default: depth_mm,velocity_mm_s)"},
	{OPT_OUTPUT, "output", "Y", "output column (default: force_N)"},
	{OPT_GROUP, "group", "COLUMN",
	 "column naming the cut; data are split by whole cuts"},
	{OPT_CHECK, "check", "SHARE", "keep this share back as unseen data, e.g. 0.3"},
	{OPT_SEED, "seed", "N", "of every random choice (default: 1)"},
	{OPT_MF, "mf", "N,M",
	 "membership functions per input (default: 5,4; else 3 each),\n"
	 "or 'auto': chosen by cross-validation"},
	{OPT_MF_TYPE, "mf-type", "KIND", "gaussmf (default) or gbellmf"},
	{OPT_EPOCHS, "epochs", "N", "epochs, at most (default: 80)"},
	{OPT_STEP, "step", "K",
	 "initial step of the premises (default: 0.01); --classic only"},
	{OPT_RIDGE, "ridge", "R", "ridge on scaled data (default: by cross-validation)"},
	{OPT_STARTS, "starts", "N", "premises to start from (default: 3)"},
	{OPT_CLASSIC, "classic", NULL,
	 "as MATLAB's anfis: no scaling, no ridge but 1e-6;\n"
	 "the check data choose the epoch"},
	{OPT_INITIAL, "initial", "FILE",
	 "also write the model as it was before training"},
	{OPT_HISTORY, "history", "FILE", "write RMSE by epoch as CSV"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_command command = {
	.name = "train",
	.synopsis = "DATA.csv -o MODEL.fis [OPTIONS]",
	.summary = "Learn a Takagi-Sugeno force model from data (ANFIS).",
	.options = options,
	.notes =
		"Example:\n  incise train pairs.csv --group cut --check 0.3 -o liver.fis\n\n"
		"Exit: 0 trained, 1 failed, 2 bad usage. See incise-train(1).",
};

static void parse_mfs(struct train_wish *wish, char *text)
{
	char *items[INCISE_MODEL_INPUTS_MAX];

	wish->n_mfs = 0;
	wish->auto_mfs = !strcmp(text, "auto");
	if (wish->auto_mfs)
		return;
	wish->n_mfs = cli_list("mf", text, items, INCISE_MODEL_INPUTS_MAX);
	for (int i = 0; i < wish->n_mfs; i++)
		wish->mfs[i] = cli_integer("mf", items[i], 1, INCISE_MODEL_MFS_MAX);
}

static enum incise_mf_type parse_type(const char *text)
{
	static const enum incise_mf_type types[] = {INCISE_MF_GAUSS, INCISE_MF_GBELL};

	for (size_t i = 0; i < sizeof(types) / sizeof(*types); i++)
		if (!strcmp(text, incise_mf_type_name(types[i])))
			return types[i];
	cli_usage("--mf-type: '%s' is neither gaussmf nor gbellmf", text);
}

void train_wish_take(struct train_wish *wish, int argc, char **argv)
{
	int opt;

	*wish = (struct train_wish){
		.inputs = {"depth_mm", "velocity_mm_s"},
		.n_inputs = 2,
		.output = "force_N",
	};
	incise_train_options_init(&wish->train);
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case 'o':
			wish->model = optarg;
			break;
		case OPT_INPUTS:
			wish->n_inputs = cli_list("inputs", optarg, wish->inputs,
						  INCISE_MODEL_INPUTS_MAX);
			break;
		case OPT_OUTPUT:
			wish->output = optarg;
			break;
		case OPT_GROUP:
			wish->group = optarg;
			break;
		case OPT_CHECK:
			wish->check = cli_number("check", optarg, 0.01, 0.99);
			break;
		case OPT_SEED:
			wish->train.seed = cli_integer("seed", optarg, 0, 1L << 53);
			break;
		case OPT_MF:
			parse_mfs(wish, optarg);
			break;
		case OPT_MF_TYPE:
			wish->type = parse_type(optarg);
			break;
		case OPT_EPOCHS:
			wish->train.epochs = cli_integer("epochs", optarg, 1, 100000);
			break;
		case OPT_STEP:
			wish->train.step = cli_number("step", optarg, 1e-9, 10);
			break;
		case OPT_RIDGE:
			wish->train.ridge = cli_number("ridge", optarg, 0, 1e12);
			break;
		case OPT_STARTS:
			wish->train.starts = cli_integer("starts", optarg, 1, 100);
			break;
		case OPT_CLASSIC:
			wish->train.classic = true;
			break;
		case OPT_INITIAL:
			wish->initial = optarg;
			break;
		case OPT_HISTORY:
			wish->history = optarg;
			break;
		case OPT_JSON:
			wish->json = true;
			break;
		}
	if (optind + 1 != argc)
		cli_usage("expected one data file, got %d", argc - optind);
	if (!wish->model || !*wish->model)
		cli_usage("where should the model go? Give -o MODEL.fis");
	if (wish->json && !strcmp(wish->model, "-"))
		cli_usage("--json and -o - would both write to standard output");
	wish->data = argv[optind];
	if (wish->n_mfs && wish->n_mfs != wish->n_inputs)
		cli_usage("--mf names %d counts for %d inputs", wish->n_mfs,
			  wish->n_inputs);
	for (int i = 0; i < wish->n_inputs && !wish->n_mfs; i++)
		wish->mfs[i] = wish->n_inputs == 2 ? 5 - i : 3;
}
