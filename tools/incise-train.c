// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise train DATA.csv -o MODEL.fis: learn a fuzzy force model, and say whether it is
 * better than simpler predictors.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/dataset.h>
#include <incise/outfile.h>
#include <incise/train.h>
#include "cli.h"
#include "json.h"

/* A model is worse than a baseline when its error is this much larger: below it, another
 * split may turn the order round. */
#define WORSE 1.02

/* Pairs per parameter below which a model follows noise rather than tissue. */
#define PAIRS_PER_PARAMETER 3

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
	{OPT_INPUTS, "inputs", "A,B", "input columns (default depth_mm,velocity_mm_s)"},
	{OPT_OUTPUT, "output", "Y", "output column (default force_N)"},
	{OPT_GROUP, "group", "COLUMN",
	 "column naming the cut; data are split by whole cuts"},
	{OPT_CHECK, "check", "SHARE", "keep this share back as unseen data, e.g. 0.3"},
	{OPT_SEED, "seed", "N", "of every random choice (default 1)"},
	{OPT_MF, "mf", "N,M",
	 "membership functions per input (default 5,4; else 3 each),\n"
	 "or 'auto': chosen by cross-validation"},
	{OPT_MF_TYPE, "mf-type", "KIND", "gaussmf (default) or gbellmf"},
	{OPT_EPOCHS, "epochs", "N", "epochs, at most (default 80)"},
	{OPT_STEP, "step", "K",
	 "initial step of the premises (default 0.01); --classic only"},
	{OPT_RIDGE, "ridge", "R", "ridge on scaled data (default: by cross-validation)"},
	{OPT_STARTS, "starts", "N", "premises to start from (default 3)"},
	{OPT_CLASSIC, "classic", NULL,
	 "as MATLAB's anfis: no scaling, no ridge but 1e-6;\n"
	 "the check data choose the epoch"},
	{OPT_INITIAL, "initial", "FILE",
	 "also write the model as it was before training"},
	{OPT_HISTORY, "history", "FILE", "write RMSE by epoch as CSV"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_verb verb = {
	.name = "train",
	.synopsis = "DATA.csv -o MODEL.fis [OPTIONS]",
	.summary = "Learn a Takagi-Sugeno force model from data (ANFIS).",
	.options = options,
	.notes =
		"Example:\n  incise train pairs.csv --group cut --check 0.3 -o liver.fis\n\n"
		"Exit: 0 trained, 1 failed, 2 bad usage. See incise-train(1).",
};

struct job {
	const char *data, *model, *initial, *history;
	char *inputs[INCISE_MODEL_INPUTS_MAX];
	int n_inputs;
	const char *output, *group;
	double check;
	int mfs[INCISE_MODEL_INPUTS_MAX];
	int n_mfs;
	bool auto_mfs;
	enum incise_mf_type type;
	bool json;
	struct incise_train_options train;
};

/* The pairs of one side of the split; rows and groups are owned. */
struct side {
	struct incise_pairs pairs;
	double *rows;
	int *groups;
	int n_groups; /* distinct */
};

struct history {
	FILE *csv; /* or NULL */
	int epochs;
};

static void parse_mfs(struct job *job, char *text)
{
	char *items[INCISE_MODEL_INPUTS_MAX];

	job->n_mfs = 0;
	job->auto_mfs = !strcmp(text, "auto");
	if (job->auto_mfs)
		return;
	job->n_mfs = cli_list("mf", text, items, INCISE_MODEL_INPUTS_MAX);
	for (int i = 0; i < job->n_mfs; i++)
		job->mfs[i] = cli_integer("mf", items[i], 1, INCISE_MODEL_MFS_MAX);
}

static enum incise_mf_type parse_type(const char *text)
{
	static const enum incise_mf_type types[] = {INCISE_MF_GAUSS, INCISE_MF_GBELL};

	for (size_t i = 0; i < sizeof(types) / sizeof(*types); i++)
		if (!strcmp(text, incise_mf_type_name(types[i])))
			return types[i];
	cli_usage("--mf-type: '%s' is neither gaussmf nor gbellmf", text);
}

static void parse(struct job *job, int argc, char **argv)
{
	int opt;

	*job = (struct job){
		.inputs = {"depth_mm", "velocity_mm_s"},
		.n_inputs = 2,
		.output = "force_N",
	};
	incise_train_options_init(&job->train);
	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case 'o':
			job->model = optarg;
			break;
		case OPT_INPUTS:
			job->n_inputs = cli_list("inputs", optarg, job->inputs,
						 INCISE_MODEL_INPUTS_MAX);
			break;
		case OPT_OUTPUT:
			job->output = optarg;
			break;
		case OPT_GROUP:
			job->group = optarg;
			break;
		case OPT_CHECK:
			job->check = cli_number("check", optarg, 0.01, 0.99);
			break;
		case OPT_SEED:
			job->train.seed = cli_integer("seed", optarg, 0, 1L << 53);
			break;
		case OPT_MF:
			parse_mfs(job, optarg);
			break;
		case OPT_MF_TYPE:
			job->type = parse_type(optarg);
			break;
		case OPT_EPOCHS:
			job->train.epochs = cli_integer("epochs", optarg, 1, 100000);
			break;
		case OPT_STEP:
			job->train.step = cli_number("step", optarg, 1e-9, 10);
			break;
		case OPT_RIDGE:
			job->train.ridge = cli_number("ridge", optarg, 0, 1e12);
			break;
		case OPT_STARTS:
			job->train.starts = cli_integer("starts", optarg, 1, 100);
			break;
		case OPT_CLASSIC:
			job->train.classic = true;
			break;
		case OPT_INITIAL:
			job->initial = optarg;
			break;
		case OPT_HISTORY:
			job->history = optarg;
			break;
		case OPT_JSON:
			job->json = true;
			break;
		}
	if (optind + 1 != argc)
		cli_usage("expected one data file, got %d", argc - optind);
	if (!job->model || !*job->model)
		cli_usage("where should the model go? Give -o MODEL.fis");
	if (job->json && !strcmp(job->model, "-"))
		cli_usage("--json and -o - would both write to standard output");
	job->data = argv[optind];
	if (job->n_mfs && job->n_mfs != job->n_inputs)
		cli_usage("--mf names %d counts for %d inputs", job->n_mfs,
			  job->n_inputs);
	for (int i = 0; i < job->n_inputs && !job->n_mfs; i++)
		job->mfs[i] = job->n_inputs == 2 ? 5 - i : 3;
}

/* The rows of one side of the split, or all of them. */
static void take_side(struct side *side, const struct incise_dataset *data,
		      const struct job *job, const bool *check, bool want)
{
	size_t n = incise_dataset_rows(data), width = job->n_inputs + 1, taken = 0;
	bool *seen = calloc(incise_dataset_n_groups(data) + 1, sizeof(*seen));

	side->rows = malloc(n * width * sizeof(double));
	side->groups = job->group ? malloc(n * sizeof(int)) : NULL;
	side->n_groups = 0;
	if (!seen || !side->rows || (job->group && !side->groups))
		cli_fail("%s: no memory for its %zu pairs", job->data, n);
	for (size_t i = 0; i < n; i++) {
		int group = incise_dataset_group(data, i);

		if (check && check[i] != want)
			continue;
		memcpy(side->rows + taken * width, incise_dataset_row(data, i),
		       width * sizeof(double));
		if (group >= 0) {
			side->n_groups += !seen[group];
			seen[group] = true;
			side->groups[taken] = group;
		}
		taken++;
	}
	free(seen);
	side->pairs = (struct incise_pairs){side->rows, taken, job->n_inputs};
}

/* Range of a column over the training pairs: unseen ones shape nothing. */
static void variable(struct incise_variable *v, const struct incise_pairs *pairs,
		     int column, const char *name)
{
	size_t width = pairs->n_inputs + 1;

	snprintf(v->name, sizeof(v->name), "%s", name);
	v->min = v->max = pairs->rows[column];
	for (size_t i = 1; i < pairs->n; i++) {
		v->min = fmin(v->min, pairs->rows[i * width + column]);
		v->max = fmax(v->max, pairs->rows[i * width + column]);
	}
}

/* The model as it is before training; with --mf auto its shape is learnt from `fit`. */
static struct incise_model *first_model(struct job *job, const struct side *fit)
{
	struct incise_variable in[INCISE_MODEL_INPUTS_MAX], out;
	struct incise_error err = {0};
	struct incise_model *model;

	for (int i = 0; i < job->n_inputs; i++)
		variable(&in[i], &fit->pairs, i, job->inputs[i]);
	variable(&out, &fit->pairs, job->n_inputs, job->output);
	if (!isfinite(out.max - out.min))
		cli_fail("%s: column %s spans %g to %g: too far for a double; scale it",
			 job->data, out.name, out.min, out.max);
	if (!(out.min < out.max))
		out.max = out.min + fmax(fabs(out.min), 1) * 1e-6;
	job->train.groups = fit->groups;
	if (job->auto_mfs && incise_train_choose_grid(&fit->pairs, in, job->type,
						      &job->train, job->mfs, &err))
		cli_fail("%s: %s", job->data, err.text);
	model = incise_model_new_grid(job->n_inputs, in, job->mfs, job->type, &out, &err);
	if (!model)
		cli_fail("%s: %s", job->data, err.text);
	return model;
}

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

/*
 * Training takes time: a place that cannot be written is told before, not after. The data
 * themselves are no such place.
 */
static void check_writable(const struct job *job, const char *path)
{
	struct incise_error err = {0};
	struct incise_outfile *file;
	struct stat data, out;

	if (!path)
		return;
	if (!stat(job->data, &data) && !stat(path, &out) && data.st_dev == out.st_dev &&
	    data.st_ino == out.st_ino && S_ISREG(out.st_mode))
		cli_fail("%s: is the data to train from; give another file to write",
			 path);
	/* A pipe's reader would take the trial for the end. */
	if (!stat(path, &out) && !S_ISREG(out.st_mode) && !S_ISDIR(out.st_mode))
		return;
	file = incise_outfile_open(path, &err);
	if (!file)
		cli_fail_with(&err);
	incise_outfile_abort(file);
}

/* What the standard deviation says, and how often it is right on the pairs kept back. */
struct interval {
	struct incise_uncertainty *uncertainty;
	double noise;
	double coverage; /* NAN without check pairs */
};

static void judge_interval(struct interval *interval, const struct incise_model *model,
			   const struct side *check)
{
	size_t inside = 0;

	interval->noise = incise_uncertainty_noise(interval->uncertainty);
	interval->coverage = NAN;
	for (size_t i = 0; check && i < check->pairs.n; i++) {
		const double *x = check->rows + i * (check->pairs.n_inputs + 1);
		double e = incise_model_eval(model, x, NULL) - x[check->pairs.n_inputs];
		double sd = incise_uncertainty_sd(interval->uncertainty, model, x);

		inside += fabs(e) <= INCISE_INTERVAL95 * sd;
	}
	if (check)
		interval->coverage = (double)inside / check->pairs.n;
}

/* Beside the model, unless that is no file; a name of its own would be a surprise there. */
static void save_uncertainty(const struct interval *interval, const char *model)
{
	struct incise_error err = {0};
	struct stat st;
	char *path;

	if (!strcmp(model, "-") || stat(model, &st) || !S_ISREG(st.st_mode))
		return;
	if (asprintf(&path, "%s.sd", model) < 0)
		cli_fail("%s: no memory for its standard deviation", model);
	if (incise_uncertainty_save(interval->uncertainty, path, &err))
		cli_fail_with(&err);
	free(path);
}

static void train(struct job *job, struct incise_model *model, const struct side *fit,
		  const struct side *check, struct incise_train_report *report,
		  struct interval *interval)
{
	struct incise_error err = {0};
	struct incise_outfile *file = NULL;
	struct history history = {.epochs = job->train.epochs};

	if (job->history) {
		file = incise_outfile_open(job->history, &err);
		if (!file)
			cli_fail_with(&err);
		history.csv = incise_outfile_stream(file);
		fprintf(history.csv, "epoch,train_rmse,check_rmse\n");
	}
	job->train.progress = on_epoch;
	job->train.user = &history;
	job->train.uncertainty = &interval->uncertainty;
	if (incise_train(model, &fit->pairs, check ? &check->pairs : NULL, &job->train,
			 report, &err)) {
		incise_outfile_abort(file);
		cli_fail("%s: %s", job->data, err.text);
	}
	cli_progress_end();
	judge_interval(interval, model, check);
	if (file && incise_outfile_commit(file, &err))
		cli_fail_with(&err);
}

/* The unit of a column, from its name: force_N is in N. */
static const char *unit_of(const char *column)
{
	const char *score = strrchr(column, '_');

	return score ? score + 1 : "";
}

static json_t *error_object(const struct job *job, double rmse, double r2, size_t pairs)
{
	const char *unit = unit_of(job->output);
	json_t *object = json_object();
	char key[80];

	snprintf(key, sizeof(key), "rmse%s%s", *unit ? "_" : "", unit);
	json_object_set_new(object, key, json_number(rmse));
	if (!pairs)
		return object;
	snprintf(key, sizeof(key), "mse%s%s%s", *unit ? "_" : "", unit, *unit ? "2" : "");
	json_object_set_new(object, key, json_number(rmse * rmse));
	json_object_set_new(object, "r2", json_number(r2));
	json_object_set_new(object, "pairs", json_integer(pairs));
	return object;
}

/* What a person should know before using the model; printed, and kept for JSON. */
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

static json_t *warnings(const struct job *job, const struct incise_model *model,
			const struct side *fit, const struct incise_train_report *report,
			double rmse, const struct incise_baselines *baselines)
{
	const struct {
		const char *name;
		double rmse;
	} others[] = {
		{"the mean", baselines->mean},
		{"linear regression", baselines->linear},
		{"k nearest neighbours", baselines->knn},
	};
	/* In the classic way the check data have chosen the epoch: they were seen. */
	const char *data = !job->check		? "its own"
			   : job->train.classic ? "the check"
						: "unseen";
	const struct incise_variable *out = incise_model_output(model);
	/* Rounding of a double, some hundred times over, is no error worth a word. */
	double rounding = 1e-13 * fmax(fabs(out->min), fabs(out->max));
	json_t *list = json_array();

	for (size_t i = 0; i < sizeof(others) / sizeof(*others); i++)
		if (rmse > WORSE * others[i].rmse && rmse > rounding)
			warn(list,
			     "%s predicts %s data better than this model: RMSE %.4g against "
			     "%.4g; try fewer rules or more data",
			     others[i].name, data, others[i].rmse, rmse);
	if (report->rules_unfired)
		warn(list,
		     "%d of %d rules never fire in the data: the model is a guess there; "
		     "ask for fewer membership functions or record more",
		     report->rules_unfired, incise_model_n_rules(model));
	if (fit->pairs.n < (size_t)PAIRS_PER_PARAMETER * report->parameters)
		warn(list,
		     "%zu training pairs for %d parameters: the model can follow noise; at "
		     "least %d pairs support %d rules",
		     fit->pairs.n, report->parameters,
		     PAIRS_PER_PARAMETER * report->parameters,
		     incise_model_n_rules(model));
	return list;
}

static void print_json(const struct job *job, const struct incise_model *model,
		       const struct side *fit, const struct side *check,
		       const struct incise_train_report *report,
		       const struct incise_baselines *baselines,
		       const struct interval *interval, json_t *warned)
{
	json_t *object = json_object(), *unfired = json_array(), *mfs = json_array();
	const char *unit = unit_of(job->output);
	char key[80];

	json_object_set_new(object, "pairs",
			    json_integer(fit->pairs.n + (check ? check->pairs.n : 0)));
	json_object_set_new(object, "train",
			    error_object(job, report->train_rmse, report->train_r2,
					 fit->pairs.n));
	json_object_set_new(object, "check",
			    check ? error_object(job, report->check_rmse,
						 report->check_r2, check->pairs.n)
				  : json_null());
	json_object_set_new(object, "baselines",
			    json_pack("{sososo}", "mean",
				      error_object(job, baselines->mean, 0, 0), "linear",
				      error_object(job, baselines->linear, 0, 0), "knn",
				      error_object(job, baselines->knn, 0, 0)));
	json_object_set_new(object, "knn_k", json_integer(baselines->k));
	json_object_set_new(object, "train_groups", json_integer(fit->n_groups));
	json_object_set_new(object, "check_groups",
			    json_integer(check ? check->n_groups : 0));
	json_object_set_new(object, "rules", json_integer(incise_model_n_rules(model)));
	json_object_set_new(object, "parameters", json_integer(report->parameters));
	json_object_set_new(object, "epochs", json_integer(report->epochs));
	json_object_set_new(object, "best_epoch", json_integer(report->best_epoch));
	json_object_set_new(object, "ridge", json_number(report->ridge));
	json_object_set_new(object, "condition", json_number(report->condition));
	json_object_set_new(object, "rules_unfired", json_integer(report->rules_unfired));
	for (int r = 0; r < incise_model_n_rules(model); r++)
		if (report->unfired[r])
			json_array_append_new(unfired, json_integer(r + 1));
	json_object_set_new(object, "unfired_rules", unfired);
	for (int i = 0; i < job->n_inputs; i++)
		json_array_append_new(mfs, json_integer(job->mfs[i]));
	json_object_set_new(object, "mf", mfs);
	json_object_set_new(object, "start", json_integer(report->start));
	json_object_set_new(object, "pairs_tuned", json_integer(report->pairs_tuned));
	snprintf(key, sizeof(key), "crossval_rmse%s%s", *unit ? "_" : "", unit);
	json_object_set_new(object, key, json_number(report->crossval_rmse));
	snprintf(key, sizeof(key), "noise%s%s", *unit ? "_" : "", unit);
	json_object_set_new(object, key, json_number(interval->noise));
	json_object_set_new(object, "interval95_coverage",
			    json_number(interval->coverage));
	json_object_set_new(object, "warnings", warned);
	json_object_set_new(object, "model", json_string(job->model));
	json_print(object);
}

static void print_row(const char *name, double train, double check)
{
	printf("  %-22s", name);
	isnan(train) ? printf("%12s", "") : printf("%12.5g", train);
	isnan(check) ? printf("\n") : printf("%14.5g\n", check);
}

static void print_text(const struct job *job, const struct incise_model *model,
		       const struct side *fit, const struct side *check,
		       const struct incise_train_report *report,
		       const struct incise_baselines *baselines,
		       const struct interval *interval)
{
	const char *unseen = job->train.classic ? "check"
			     : job->group	? "unseen cuts"
						: "unseen pairs";
	char knn[40];

	printf("%s: %zu pairs to train", job->data, fit->pairs.n);
	if (job->group)
		printf(" (%d cuts)", fit->n_groups);
	if (check)
		printf(", %zu to check", check->pairs.n);
	if (check && job->group)
		printf(" (%d cuts)", check->n_groups);
	printf("\n%d rules, %d parameters, %d epochs (kept %d), ridge %g, condition %.2g\n",
	       incise_model_n_rules(model), report->parameters, report->epochs,
	       report->best_epoch, report->ridge, report->condition);
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
	printf("  95 %% interval: noise %.4g %s", interval->noise, unit_of(job->output));
	if (check)
		printf(", holds %.1f %% of the %s", 100 * interval->coverage, unseen);
	printf("\n");
	if (report->pairs_tuned && report->pairs_tuned < fit->pairs.n)
		printf("  membership functions from a random %zu of the pairs, consequents "
		       "from all\n",
		       report->pairs_tuned);
	if (strcmp(job->model, "-"))
		printf("wrote %s\n", job->model);
}

int main(int argc, char **argv)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1];
	struct side fit = {0}, check = {0};
	struct incise_train_report report;
	struct incise_baselines baselines;
	struct interval interval = {0};
	struct incise_error err = {0};
	struct incise_dataset *data;
	struct incise_model *model;
	json_t *warned;
	bool *split = NULL;
	struct job job;
	size_t n;

	parse(&job, argc, argv);
	for (int i = 0; i < job.n_inputs; i++)
		columns[i] = job.inputs[i];
	columns[job.n_inputs] = job.output;
	check_writable(&job, job.model);
	check_writable(&job, job.initial);
	check_writable(&job, job.history);
	data = incise_dataset_read(job.data, columns, job.n_inputs + 1, job.group, &err);
	if (!data)
		cli_fail_with(&err);
	n = incise_dataset_rows(data);
	if (job.check > 0) {
		int *groups = job.group ? malloc(n * sizeof(*groups)) : NULL;

		split = malloc(n * sizeof(*split));
		if (!split || (job.group && !groups))
			cli_fail("%s: no memory for its %zu pairs", job.data, n);
		for (size_t i = 0; i < n && groups; i++)
			groups[i] = incise_dataset_group(data, i);
		if (incise_split(n, groups, job.check, job.train.seed, split, &err))
			cli_fail("%s: %s", job.data, err.text);
		free(groups);
		take_side(&check, data, &job, split, true);
	}
	take_side(&fit, data, &job, split, false);
	model = first_model(&job, &fit);
	if (job.initial && incise_model_save(model, job.initial, &err))
		cli_fail_with(&err);
	train(&job, model, &fit, split ? &check : NULL, &report, &interval);
	if (incise_baselines(&fit.pairs, fit.groups, split ? &check.pairs : &fit.pairs,
			     &baselines, &err))
		cli_fail("%s: %s", job.data, err.text);
	if (incise_model_save(model, job.model, &err))
		cli_fail_with(&err);
	save_uncertainty(&interval, job.model);
	warned = warnings(&job, model, &fit, &report,
			  split ? report.check_rmse : report.train_rmse, &baselines);
	if (job.json)
		print_json(&job, model, &fit, split ? &check : NULL, &report, &baselines,
			   &interval, warned);
	else if (strcmp(job.model, "-"))
		print_text(&job, model, &fit, split ? &check : NULL, &report, &baselines,
			   &interval);
	if (!job.json)
		json_decref(warned);
	cli_finish();
	incise_model_free(model);
	incise_uncertainty_free(interval.uncertainty);
	incise_dataset_free(data);
	free(split);
	free(fit.rows);
	free(fit.groups);
	free(check.rows);
	free(check.groups);
	return 0;
}
