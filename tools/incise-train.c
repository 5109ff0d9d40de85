// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise train DATA.csv -o MODEL.fis: learn a fuzzy force model, and compare it with simpler
 * predictors.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/dataset.h>
#include <incise/train.h>
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/file_kind.h"
#include "cli/json.h"

struct options {
	const char *data, *model, *initial, *history;
	char *inputs[INCISE_MODEL_INPUTS_MAX];
	int n_inputs;
	const char *target, *group;
	double check;
	int mfs[INCISE_MODEL_INPUTS_MAX];
	int n_mfs;
	bool auto_mfs;
	enum incise_mf_type type;
	bool all_rows, json;
	struct incise_train_options train;
};

static void parse_inputs(void *whole, char *text)
{
	struct options *options = whole;

	options->n_inputs =
		cli_list("inputs", text, options->inputs, INCISE_MODEL_INPUTS_MAX);
}

static void parse_mfs(void *whole, char *text)
{
	struct options *options = whole;
	char *items[INCISE_MODEL_INPUTS_MAX];

	options->n_mfs = 0;
	options->auto_mfs = !strcmp(text, "auto");
	if (options->auto_mfs)
		return;
	options->n_mfs = cli_list("mf", text, items, INCISE_MODEL_INPUTS_MAX);
	for (int i = 0; i < options->n_mfs; i++)
		options->mfs[i] = cli_integer("mf", items[i], 1, INCISE_MODEL_MFS_MAX);
}

static void parse_type(void *type, char *text)
{
	static const enum incise_mf_type types[] = {INCISE_MF_GAUSS, INCISE_MF_GBELL};
	const char *const names[] = {incise_mf_type_name(types[0]),
				     incise_mf_type_name(types[1]), NULL};

	*(enum incise_mf_type *)type = types[cli_choice("mf-type", text, names)];
}

static const struct cli_option option_table[] = {
	{'o', "output", "FILE",
	 "write the model to this file (.fis); - is standard "
	 "output",
	 CLI_OUTPUT(struct options, model), .extensions = ".fis"},
	{0, "inputs", "A,B", "input columns (default: depth_mm,velocity_mm_s)",
	 CLI_PARSED_BY(parse_inputs)},
	{0, "target", "COLUMN", "column to learn (default: force_N)",
	 CLI_TEXT(struct options, target)},
	{0, "group", "COLUMN", "column that names the cut; cuts are held out as a whole",
	 CLI_TEXT(struct options, group)},
	{0, "all-rows", NULL,
	 "also use rows in which the blade did not advance (advancing is 0)",
	 CLI_FLAG(struct options, all_rows)},
	{0, "check", "SHARE",
	 "hold out this share of the data as a test set, for "
	 "example 0.3",
	 CLI_NUMBER(struct options, check, 0.01, 0.99)},
	{0, "seed", "N", "seed of every random choice (default: 1)",
	 CLI_INTEGER(struct options, train.seed, 0, 1L << 53)},
	{0, "mf", "N,M",
	 "membership functions per input (default: 5,4 for two inputs,\n"
	 "else 3 each), or auto: chosen by cross-validation",
	 CLI_PARSED_BY(parse_mfs)},
	{0, "mf-type", "KIND", "gaussmf (default) or gbellmf",
	 CLI_PARSED(struct options, type, parse_type)},
	{0, "epochs", "N", "largest number of epochs (default: 80)",
	 CLI_INTEGER(struct options, train.epochs, 1, 100000)},
	{0, "step", "K",
	 "initial step of the membership functions' parameters\n"
	 "(default: 0.01); only with --classic",
	 CLI_NUMBER(struct options, train.step, 1e-9, 10)},
	{0, "ridge", "R",
	 "one ridge on scaled data (default: an average of fits,\n"
	 "weighted by cross-validation)",
	 CLI_NUMBER(struct options, train.ridge, 0, 1e12)},
	{0, "starts", "N",
	 "number of starting points of the membership functions\n"
	 "(default: 3)",
	 CLI_INTEGER(struct options, train.starts, 1, 100)},
	{0, "classic", NULL,
	 "train as MATLAB's anfis does: no scaling, a ridge of 1e-6;\n"
	 "the held-out data choose the epoch",
	 CLI_FLAG(struct options, train.classic)},
	{0, "initial", "FILE", "also write the initial model, before training",
	 CLI_OUTPUT(struct options, initial), .extensions = ".fis"},
	{0, "history", "FILE", "write the RMSE of each epoch to this CSV file",
	 CLI_OUTPUT(struct options, history), .extensions = ".csv"},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "train",
	.synopsis = "DATA.csv -o MODEL.fis [OPTIONS]",
	.summary = "Learn a Takagi-Sugeno force model from data (ANFIS).",
	.options = option_table,
	.notes =
		"Example:\n  incise train pairs.csv --group cut --check 0.3 -o liver.fis\n\n"
		"Exit: 0 trained, 1 failed, 2 bad usage. See incise-train(1).",
};

/* MODEL.fis.sd, if the model is a regular file or will be one: free(3); else NULL. */
static char *uncertainty_path(const char *model)
{
	struct stat st;

	if (!strcmp(model, "-") || (!stat(model, &st) && !S_ISREG(st.st_mode)))
		return NULL;
	return cli_text("%s.sd", model);
}

static void parse(struct options *options, int argc, char **argv)
{
	char *sd;

	*options = (struct options){
		.inputs = {"depth_mm", "velocity_mm_s"},
		.n_inputs = 2,
		.target = "force_N",
	};
	incise_train_options_init(&options->train);
	cli_parse(&command, argc, argv, options);
	options->data = file_operand(
		cli_operand(argc, argv, "DATA.csv", "pairs to learn from"), FILE_TABLE);
	if (!options->model || !*options->model)
		cli_usage("missing -o MODEL.fis (output model)");
	/* Neither a file nor a folder is there, nor is one meant: a column, of the old --output. */
	if (strcmp(options->model, "-") && !strpbrk(options->model, "./") &&
	    access(options->model, F_OK))
		cli_usage("--output %s: expected a .fis file; name the column to learn "
			  "with --target",
			  options->model);
	if (options->json && !strcmp(options->model, "-"))
		cli_usage("--json and -o - would both write to standard output");
	sd = uncertainty_path(options->model);
	if (sd)
		cli_output_once(sd);
	free(sd);
	if (options->n_mfs && options->n_mfs != options->n_inputs)
		cli_usage("--mf: expected %d counts, one for each of --inputs, found %d",
			  options->n_inputs, options->n_mfs);
	for (int i = 0; i < options->n_inputs && !options->n_mfs; i++)
		options->mfs[i] = options->n_inputs == 2 ? 5 - i : 3;
}

/* The standard deviation of an unseen value, and how often it holds. */
struct interval {
	struct incise_uncertainty *uncertainty;
	double noise;
	double coverage; /* NAN without check pairs */
};

struct result {
	const struct options *options;
	const struct incise_model *model;
	const struct incise_train_side *fit;
	const struct incise_train_side *check; /* NULL: no pairs were kept back */
	struct incise_train_report report;
	struct incise_baselines baselines;
	struct interval interval;
	size_t left_out; /* rows */
};

/* --- training ------------------------------------------------------------------------ */

struct history {
	FILE *csv; /* or NULL */
	int epochs;
};

static void on_epoch(void *user, int epoch, double train_rmse, double check_rmse)
{
	struct history *history = user;

	cli_progress("epoch %d of %d: training error %.6g", epoch, history->epochs,
		     train_rmse);
	if (!history->csv)
		return;
	fprintf(history->csv, "%d,%.17g,", epoch, train_rmse);
	if (!isnan(check_rmse))
		fprintf(history->csv, "%.17g", check_rmse);
	fputc('\n', history->csv);
}

/* Fail before the training, not after it, if the output cannot be written. */
static void check_writable(const char *path)
{
	struct incise_outfile *file;
	struct stat out;

	if (!path)
		return;
	/* Not a pipe: its reader would see an end of file. */
	if (!stat(path, &out) && !S_ISREG(out.st_mode) && !S_ISDIR(out.st_mode))
		return;
	whole_file_begin(path, &file);
	incise_outfile_abort(file);
}

static void judge_interval(struct interval *interval, const struct incise_model *model,
			   const struct incise_train_side *check)
{
	size_t inside = 0;

	interval->noise = incise_uncertainty_noise(interval->uncertainty);
	interval->coverage = NAN;
	for (size_t i = 0; check && i < check->pairs.n; i++) {
		const double *x = check->pairs.rows + i * (check->pairs.n_inputs + 1);
		double e = incise_model_eval(model, x, NULL) - x[check->pairs.n_inputs];
		double sd = incise_uncertainty_sd(interval->uncertainty, model, x);

		inside += fabs(e) <= INCISE_INTERVAL95 * sd;
	}
	if (check)
		interval->coverage = (double)inside / check->pairs.n;
}

static void save_uncertainty(const struct interval *interval, const char *model)
{
	struct incise_error err = {0};
	char *path = uncertainty_path(model);

	if (!path)
		return;
	if (incise_uncertainty_save(interval->uncertainty, path, &err))
		cli_fail_with(&err);
	free(path);
}

static void train(struct options *options, struct incise_model *model,
		  struct result *result)
{
	const struct incise_train_side *check = result->check;
	struct incise_error err = {0};
	struct incise_outfile *file = NULL;
	struct history history = {.epochs = options->train.epochs};

	if (options->history) {
		history.csv = whole_file_begin(options->history, &file);
		fprintf(history.csv, "epoch,train_rmse,check_rmse\n");
	}
	options->train.progress = on_epoch;
	options->train.user = &history;
	options->train.uncertainty = &result->interval.uncertainty;
	if (incise_train(model, &result->fit->pairs, check ? &check->pairs : NULL,
			 &options->train, &result->report, &err)) {
		incise_outfile_abort(file);
		cli_fail("%s: %s", options->data, err.text);
	}
	cli_progress_end();
	judge_interval(&result->interval, model, check);
	whole_file_end(file);
}

/* --- the report ---------------------------------------------------------------------- */

/* A smaller ratio to a baseline's error may be by chance of the split. */
#define WORSE 1.02

/* Pairs per parameter below which a model follows noise rather than tissue. */
#define PAIRS_PER_PARAMETER 3

/* The unit of a column, from its name: force_N is in N. */
static const char *unit_of(const char *column)
{
	const char *score = strrchr(column, '_');

	return score ? score + 1 : "";
}

static json_t *error_object(const struct options *options, double rmse, double r2,
			    size_t pairs)
{
	const char *unit = unit_of(options->target);
	json_t *object = json_object();
	char key[80];

	snprintf(key, sizeof(key), "rms_error%s%s", *unit ? "_" : "", unit);
	json_set_number(object, key, rmse);
	/* The name up to 0.1, on which scripts lean. */
	snprintf(key, sizeof(key), "rmse%s%s", *unit ? "_" : "", unit);
	json_set_number(object, key, rmse);
	if (!pairs)
		return object;
	snprintf(key, sizeof(key), "mse%s%s%s", *unit ? "_" : "", unit, *unit ? "2" : "");
	json_set_number(object, key, rmse * rmse);
	json_set_number(object, "r2", r2);
	json_set_integer(object, "pairs", pairs);
	return object;
}

/* Print a warning, and keep it for JSON. */
static void warn(json_t *list, const char *fmt, ...) INCISE_PRINTF(2, 3);
static void warn(json_t *list, const char *fmt, ...)
{
	char text[300];
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	cli_warn("%s", text);
	json_array_append_new(list, json_string(text));
}

/* Warn on stderr; the same as a list for JSON. */
static json_t *warnings(const struct result *result)
{
	const struct options *options = result->options;
	const struct incise_model *model = result->model;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const size_t pairs = result->fit->pairs.n;
	const double rmse = result->check ? report->check_rmse : report->train_rmse;
	const struct {
		const char *name;
		double rmse;
	} others[] = {
		{"the mean", baselines->mean},
		{"linear regression", baselines->linear},
		{"k nearest neighbours", baselines->knn},
	};
	/* With --classic the check data chose the epoch: they were seen. */
	const char *data = !options->check	    ? "its own"
			   : options->train.classic ? "the check"
						    : "unseen";
	const struct incise_variable *out = (&incise_model_info(model)->output);
	/* Some hundred roundings of a double. */
	double rounding = 1e-13 * fmax(fabs(out->min), fabs(out->max));
	json_t *list = json_array();

	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++)
		if (rmse > WORSE * others[i].rmse && rmse > rounding)
			warn(list,
			     "%s predicts %s data better than this model: RMSE %.4g "
			     "compared with %.4g; try fewer rules or more data",
			     others[i].name, data, others[i].rmse, rmse);
	if (report->rules_unfired)
		warn(list,
		     "%d of %d rules never fire in the data, so the model extrapolates "
		     "there; use fewer membership functions (--mf) or record more data",
		     report->rules_unfired, incise_model_info(model)->n_rules);
	if (pairs < (size_t)PAIRS_PER_PARAMETER * report->parameters)
		warn(list,
		     "%zu training pairs for %d parameters: the model may overfit; "
		     "record at least %d pairs for %d rules, or use fewer (--mf)",
		     pairs, report->parameters, PAIRS_PER_PARAMETER * report->parameters,
		     incise_model_info(model)->n_rules);
	return list;
}

static void report_json(const struct result *result, json_t *warned)
{
	const struct options *options = result->options;
	const struct incise_model *model = result->model;
	const struct incise_train_side *fit = result->fit, *check = result->check;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const struct interval *interval = &result->interval;
	json_t *object = json_object(), *unfired = json_array(), *mfs = json_array();
	const char *unit = unit_of(options->target);
	char key[80];

	json_set_integer(object, "pairs", fit->pairs.n + (check ? check->pairs.n : 0));
	json_set_integer(object, "left_out", result->left_out);
	json_object_set_new(object, "train",
			    error_object(options, report->train_rmse, report->train_r2,
					 fit->pairs.n));
	json_object_set_new(object, "check",
			    check ? error_object(options, report->check_rmse,
						 report->check_r2, check->pairs.n)
				  : json_null());
	json_object_set_new(
		object, "baselines",
		json_pack("{sososo}", "mean",
			  error_object(options, baselines->mean, 0, 0), "linear",
			  error_object(options, baselines->linear, 0, 0), "knn",
			  error_object(options, baselines->knn, 0, 0)));
	json_set_integer(object, "knn_k", baselines->k);
	json_set_integer(object, "train_groups", fit->n_groups);
	json_set_integer(object, "check_groups", check ? check->n_groups : 0);
	json_set_integer(object, "rules", incise_model_info(model)->n_rules);
	json_set_integer(object, "parameters", report->parameters);
	json_set_integer(object, "epochs", report->epochs);
	json_set_integer(object, "best_epoch", report->best_epoch);
	json_set_number(object, "ridge", report->ridge);
	json_set_integer(object, "averaged", report->averaged);
	json_set_number(object, "plane_weight", report->plane_weight);
	json_set_number(object, "mean_weight", report->mean_weight);
	json_set_number(object, "cut_weight", report->cut_weight);
	json_set_number(object, "condition", report->condition);
	json_set_integer(object, "rules_unfired", report->rules_unfired);
	for (int r = 0; r < incise_model_info(model)->n_rules; r++)
		if (report->unfired[r])
			json_array_append_new(unfired, json_integer(r + 1));
	json_object_set_new(object, "unfired_rules", unfired);
	for (int i = 0; i < options->n_inputs; i++)
		json_array_append_new(mfs, json_integer(options->mfs[i]));
	json_object_set_new(object, "mf", mfs);
	json_set_integer(object, "start", report->start);
	json_set_integer(object, "pairs_tuned", report->pairs_tuned);
	snprintf(key, sizeof(key), "crossval_rms_error%s%s", *unit ? "_" : "", unit);
	json_set_number(object, key, report->crossval_rmse);
	snprintf(key, sizeof(key), "noise%s%s", *unit ? "_" : "", unit);
	json_set_number(object, key, interval->noise);
	json_set_number(object, "interval95_coverage", interval->coverage);
	json_object_set_new(object, "warnings", warned);
	json_object_set_new(object, "model", json_string(options->model));
	json_print(object);
}

static void print_row(const char *name, double train, double check)
{
	printf("  %-22s", name);
	isnan(train) ? printf("%12s", "") : printf("%12.5g", train);
	isnan(check) ? printf("\n") : printf("%14.5g\n", check);
}

static void report_text(const struct result *result)
{
	const struct options *options = result->options;
	const struct incise_model *model = result->model;
	const struct incise_train_side *fit = result->fit, *check = result->check;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const struct interval *interval = &result->interval;
	const char *unseen = options->train.classic ? "check"
			     : options->group	    ? "unseen cuts"
						    : "unseen pairs";
	char knn[40];

	printf("%s: %zu pairs to train", options->data, fit->pairs.n);
	if (options->group)
		printf(" (%d cuts)", fit->n_groups);
	if (check)
		printf(", %zu to check", check->pairs.n);
	if (check && options->group)
		printf(" (%d cuts)", check->n_groups);
	if (result->left_out)
		printf("\nleft out %zu of %zu rows: the blade did not advance",
		       result->left_out,
		       result->left_out + fit->pairs.n + (check ? check->pairs.n : 0));
	printf("\n%d rules, %d parameters, %d epochs (kept %d), ",
	       incise_model_info(model)->n_rules, report->parameters, report->epochs,
	       report->best_epoch);
	report->averaged ? printf("average of %d fits", report->averaged)
			 : printf("ridge %g", report->ridge);
	printf(", condition %.2g\n", report->condition);
	printf("  %-22s%12s%14s\n", "RMSE", "training", check ? unseen : "");
	print_row("this model", report->train_rmse, report->check_rmse);
	snprintf(knn, sizeof(knn), "%d nearest", baselines->k);
	print_row("mean", check ? NAN : baselines->mean, check ? baselines->mean : NAN);
	print_row("linear regression", check ? NAN : baselines->linear,
		  check ? baselines->linear : NAN);
	print_row(knn, check ? NAN : baselines->knn, check ? baselines->knn : NAN);
	printf("  %-22s%12.5g", "MSE of this model",
	       report->train_rmse * report->train_rmse);
	check ? printf("%14.5g\n", report->check_rmse * report->check_rmse)
	      : printf("\n");
	print_row("R² of this model", report->train_r2, report->check_r2);
	printf("  95 %% interval: noise %.4g %s", interval->noise,
	       unit_of(options->target));
	if (check)
		printf(", holds %.1f %% of the %s", 100 * interval->coverage, unseen);
	printf("\n");
	if (report->pairs_tuned && report->pairs_tuned < fit->pairs.n)
		printf("  membership functions from a random %zu of the pairs, consequents "
		       "from all\n",
		       report->pairs_tuned);
	cli_written();
}

int main(int argc, char **argv)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1];
	struct incise_train_side fit = {0}, check = {0};
	struct options options;
	struct result result = {.options = &options, .fit = &fit};
	struct incise_error err = {0};
	struct incise_dataset *data;
	struct incise_model *model;
	json_t *warned;

	parse(&options, argc, argv);
	for (int i = 0; i < options.n_inputs; i++)
		columns[i] = options.inputs[i];
	columns[options.n_inputs] = options.target;
	check_writable(options.model);
	check_writable(options.initial);
	check_writable(options.history);
	data = cli_require(incise_dataset_read_where(
				   options.data, columns, options.n_inputs + 1,
				   options.group, options.all_rows ? NULL : "advancing",
				   &result.left_out, &err),
			   &err);
	if (incise_train_split(data, options.check, options.train.seed, &fit, &check,
			       &err))
		cli_fail("%s: %s", options.data, err.text);
	result.check = options.check > 0 ? &check : NULL;
	options.train.groups = fit.groups;
	if (options.auto_mfs)
		options.mfs[0] = 0;
	result.model = model = incise_train_start(&fit.pairs, columns, options.type,
						  options.mfs, &options.train, &err);
	if (!model)
		cli_fail("%s: %s", options.data, err.text);
	if (options.initial && incise_model_save(model, options.initial, &err))
		cli_fail_with(&err);
	train(&options, model, &result);
	if (incise_baselines(&fit.pairs, fit.groups,
			     &(result.check ? &check : &fit)->pairs, &result.baselines,
			     &err))
		cli_fail("%s: %s", options.data, err.text);
	if (incise_model_save(model, options.model, &err))
		cli_fail_with(&err);
	save_uncertainty(&result.interval, options.model);
	warned = warnings(&result);
	if (options.json)
		report_json(&result, warned);
	else if (strcmp(options.model, "-"))
		report_text(&result);
	if (!options.json)
		json_decref(warned);
	cli_finish();
	incise_model_free(model);
	incise_uncertainty_free(result.interval.uncertainty);
	incise_dataset_free(data);
	incise_train_side_free(&fit);
	incise_train_side_free(&check);
	return 0;
}
