// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise train SOURCE... -o MODEL.fis: learn a fuzzy force model from recordings and CSV files,
 * and compare it with simpler predictors.
 *
 *   sources ─► survey ─► sample ─► search of the premises ─┐
 *      └──────────────────────────► sums of all pairs ─────┴─► model, or a factor
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/corpus.h>
#include <incise/factor.h>
#include <incise/propagation.h>
#include <incise/ranks.h>
#include <incise/train.h>
#include <incise/version.h>
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/json.h"
#include "cli/recording.h"
#include "train/sources.h"

struct options {
	char **paths;
	int n_paths;
	const char *data; /* for messages: the path, or the number of sources */
	const char *model, *initial, *history, *premises, *factor;
	bool damaged;
	double rate;
	long sample; /* pairs; 0: all */
	struct shard {
		long at, of; /* of 0: all sources */
	} shard;
	char *inputs[INCISE_MODEL_INPUTS_MAX];
	int n_inputs;
	const char *target, *group;
	double check;
	int mfs[INCISE_MODEL_INPUTS_MAX];
	int n_mfs;
	bool auto_mfs;
	enum incise_mf_type type;
	bool given_group, all_rows, json, mpi;
	enum uncertainties_wanted uncertainty;
	const struct incise_ranks *ranks; /* NULL: a single process */
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

static void parse_uncertainty(void *wanted, char *text)
{
	static const char *const names[] = {"none", "parts", NULL};

	*(enum uncertainties_wanted *)wanted = cli_choice("uncertainty", text, names)
						       ? UNCERTAINTIES_PARTS
						       : UNCERTAINTIES_NONE;
}

static void parse_shard(void *shard, char *text)
{
	struct shard *to = shard;
	char *slash = strchr(text, '/');

	if (!slash)
		cli_usage("--shard %s: expected I/N, for example 3/16", text);
	*slash = '\0';
	to->of = cli_integer("shard", slash + 1, 1, 1000000);
	to->at = cli_integer("shard", text, 1, to->of);
}

static const struct cli_option option_table[] = {
	{'o', "output", "FILE",
	 "write the model to this file (.fis); - is standard output",
	 CLI_OUTPUT(struct options, model), .extensions = ".fis"},
	{0, "premises", "FILE",
	 "keep the membership functions and ranges of this model (.fis); only the "
	 "consequents are learnt",
	 CLI_INPUT(struct options, premises)},
	{0, "factor", "FILE",
	 "write the sums of these sources (.fac) for incise merge, instead of a "
	 "model; needs --premises",
	 CLI_OUTPUT(struct options, factor), .extensions = ".fac"},
	{0, "inputs", "A,B", "input columns (default: depth_mm,velocity_mm_s)",
	 CLI_PARSED_BY(parse_inputs)},
	{0, "target", "COLUMN", "column to learn (default: force_N)",
	 CLI_TEXT(struct options, target)},
	{0, "group", "GROUP",
	 "hold out whole groups: recording, rig, or a column that names them, such "
	 "as cut (default: cut, where all sources have it), or none",
	 CLI_TEXT(struct options, group)},
	{0, "rate", "HZ",
	 "rows per second of a recording, each the mean of its samples (default: "
	 "all samples)",
	 CLI_NUMBER(struct options, rate, 0.1, 1e6)},
	RECORDING_DAMAGED(struct options, damaged),
	{0, "all-rows", NULL,
	 "also use rows in which the blade did not advance (advancing is 0)",
	 CLI_FLAG(struct options, all_rows)},
	{0, "uncertainty", "WHICH",
	 "uncertainties of the columns, as incise export --uncertainty parts "
	 "writes them: parts, or none (default: parts of files that have them)",
	 CLI_PARSED(struct options, uncertainty, parse_uncertainty)},
	{0, "check", "SHARE",
	 "hold out this share of the data as a test set, for example 0.3",
	 CLI_NUMBER(struct options, check, 0.01, 0.99)},
	{0, "seed", "N", "seed of every random choice (default: 1)",
	 CLI_INTEGER(struct options, train.seed, 0, 1L << 53)},
	{0, "mf", "N,M",
	 "membership functions per input (default: 5,4 for two inputs, else 3 "
	 "each), or auto: chosen by cross-validation",
	 CLI_PARSED_BY(parse_mfs)},
	{0, "mf-type", "KIND", "gaussmf (default) or gbellmf",
	 CLI_PARSED(struct options, type, parse_type)},
	{0, "epochs", "N", "largest number of epochs (default: 80)",
	 CLI_INTEGER(struct options, train.epochs, 1, 100000)},
	{0, "step", "K",
	 "initial step of the membership functions' parameters (default: 0.01); "
	 "only with --classic",
	 CLI_NUMBER(struct options, train.step, 1e-9, 10)},
	{0, "ridge", "R",
	 "one ridge on scaled data (default: an average of fits, weighted by "
	 "cross-validation)",
	 CLI_NUMBER(struct options, train.ridge, 0, 1e12)},
	{0, "starts", "N",
	 "number of starting points of the membership functions (default: 3)",
	 CLI_INTEGER(struct options, train.starts, 1, 100)},
	{0, "sample", "N",
	 "pairs that the search of the membership functions uses, at random; 0: "
	 "all (default: 3000)",
	 CLI_INTEGER(struct options, sample, 0, 1000000000)},
	{0, "classic", NULL,
	 "train as MATLAB's anfis does: no scaling, a ridge of 1e-6; the held-out "
	 "data choose the epoch",
	 CLI_FLAG(struct options, train.classic)},
	{0, "initial", "FILE", "also write the initial model, before training",
	 CLI_OUTPUT(struct options, initial), .extensions = ".fis"},
	{0, "history", "FILE", "write the RMSE of each epoch to this CSV file",
	 CLI_OUTPUT(struct options, history), .extensions = ".csv"},
	{0, "shard", "I/N",
	 "use share I of N of the sources, from 1: for the tasks of a job array; "
	 "needs --factor",
	 CLI_PARSED(struct options, shard, parse_shard)},
	{0, "mpi", NULL, "share the sources among the processes of mpirun",
	 CLI_FLAG(struct options, mpi)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "train",
	.synopsis = "DATA.csv|NAME.rec… -o MODEL.fis [OPTIONS]",
	.summary =
		"Learn a Takagi-Sugeno force model from recordings or CSV files (ANFIS).",
	.options = option_table,
	.examples = "incise train pairs.csv --group cut --check 0.3 -o liver.fis\n"
		    "incise train day1.rec day2.rec --group recording -o liver.fis",
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
		.sample = -1,
	};
	incise_train_options_init(&options->train);
	cli_parse(&command, argc, argv, options);
	options->paths = argv + optind;
	options->n_paths = argc - optind;
	if (!options->n_paths)
		cli_usage("missing DATA.csv or NAME.rec (pairs to learn from)");
	if (options->sample >= 0)
		options->train.tuned =
			options->sample ? (size_t)options->sample : SIZE_MAX;
	if (options->sample >= 0 && (options->premises || options->train.classic))
		cli_usage(
			"--sample: --premises and --classic do not search on a sample; leave "
			"it out");
	if (options->shard.of && !options->factor)
		cli_usage(
			"--shard: missing --factor SHARE.fac; incise merge makes a model of "
			"all shares");
	for (long i = options->shard.at - 1, n = 0;
	     options->shard.of && i < (argc - optind); i += options->shard.of) {
		options->paths[n++] = options->paths[i];
		options->n_paths = (int)n;
	}
	if (options->shard.of > argc - optind)
		cli_usage(
			"--shard: %ld shares of %d sources; give at least one source for "
			"each",
			options->shard.of, argc - optind);
	if (options->factor && !options->premises)
		cli_usage(
			"--factor: missing --premises MODEL.fis, which all factors share");
	if (options->factor && options->model)
		cli_usage(
			"--factor and -o: give one; incise merge makes a model of factors");
	if (options->factor && options->check > 0)
		cli_usage("--factor takes all pairs; leave out --check");
	if (options->premises &&
	    (options->train.classic || options->initial || options->history ||
	     options->n_mfs || options->auto_mfs))
		cli_usage("--premises keeps the membership functions; leave out --mf, "
			  "--classic, --initial and --history");
	if (options->mpi && options->train.classic)
		cli_usage("--classic keeps all pairs in one memory; leave out --mpi");
	if (options->factor && options->json)
		cli_usage("--json reports a model; leave it out with --factor");
	if (options->factor)
		return;
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
	const struct incise_corpus_side *fit;
	const struct incise_corpus_side *check; /* NULL: no pairs were kept back */
	struct incise_train_report report;
	struct incise_baselines baselines;
	struct interval interval;
	struct incise_propagation_report propagated;
	bool weighed;		 /* by uncertainties; propagated says how */
	uint64_t left_out;	 /* rows */
	uint64_t rows, repeated; /* rows; those that are equal to another one */
	uint64_t check_outside;	 /* rows kept back, outside the training ranges */
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

/* On the sample of the pairs kept back. */
static void judge_interval(struct interval *interval, const struct incise_model *model,
			   const struct incise_train_side *check)
{
	size_t inside = 0;

	interval->noise = incise_uncertainty_noise(interval->uncertainty);
	interval->coverage = NAN;
	check = check && check->pairs.n ? check : NULL;
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

/* The reading of all sources, once or twice, with the time left on a terminal. */
struct reading {
	const char *what;
	int64_t start_ns;
	uint64_t done, total; /* rows; total 0: not known */
	int at, n;	      /* sources */
};

static void on_rows(void *user, uint64_t rows)
{
	struct reading *reading = user;
	double past, left;

	reading->done += rows;
	past = 1e-9 * (double)(cli_now_ns() - reading->start_ns);
	left = reading->total ? past * (double)(reading->total - reading->done) /
					(double)reading->done
			      : past * (reading->n - reading->at) / (reading->at + 0.5);
	cli_progress("%s source %d of %d: %.3g million rows, %.0f s left", reading->what,
		     reading->at + 1, reading->n, 1e-6 * (double)reading->done, left);
}

static void begin_reading(struct reading *reading, const char *what, int n,
			  uint64_t total)
{
	*reading = (struct reading){.what = what, .n = n, .total = total};
	reading->start_ns = cli_now_ns();
}

/* The columns, or those of the premises if these are given. */
static void choose_columns(struct options *options, const struct incise_model *premises,
			   const char **columns)
{
	const struct incise_model_info *info =
		premises ? incise_model_info(premises) : NULL;

	for (int i = 0; i < options->n_inputs; i++)
		columns[i] = options->inputs[i];
	columns[options->n_inputs] = options->target;
	if (!info)
		return;
	options->n_inputs = info->n_inputs;
	for (int i = 0; i < info->n_inputs; i++)
		columns[i] = options->inputs[i] = cli_text("%s", info->input[i].name);
	columns[info->n_inputs] = options->target = cli_text("%s", info->output.name);
}

/* The model to start from: an even grid over the ranges of all training pairs. */
static struct incise_model *start_model(struct options *options,
					const struct incise_corpus *corpus,
					const char *const *columns)
{
	const struct incise_corpus_side *fit = incise_corpus_side(corpus, false);
	struct incise_variable ranges[INCISE_MODEL_INPUTS_MAX + 1];
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
	struct incise_error err = {0};
	struct incise_model *model;

	incise_corpus_ranges(corpus, min, max);
	for (int i = 0; i <= options->n_inputs; i++)
		ranges[i] = (struct incise_variable){.min = min[i], .max = max[i]};
	options->train.ranges = ranges;
	if (options->auto_mfs)
		options->mfs[0] = 0;
	model = incise_train_start(&fit->sample.pairs, columns, options->type,
				   options->mfs, &options->train, &err);
	options->train.ranges = NULL;
	if (!model)
		cli_fail("%s: %s", options->data, err.text);
	if (options->initial && incise_model_save(model, options->initial, &err))
		cli_fail_with(&err);
	return model;
}

/* The options that a model depends on, for people: free(3). */
static char *options_text(const struct options *options)
{
	char check[40] = "", sample[40] = "";

	if (options->sample >= 0)
		snprintf(sample, sizeof(sample), ", search on %ld pairs",
			 options->sample);
	if (!options->sample)
		strcpy(sample, ", search on all pairs");
	if (options->check > 0)
		snprintf(check, sizeof(check), ", %g held out with seed %llu",
			 options->check, (unsigned long long)options->train.seed);
	return cli_text("%sgroups: %s%s%s%s%s%s",
			options->train.classic ? "classic, " : "",
			options->group ? options->group : "none",
			options->all_rows ? ", all rows" : "",
			options->rate > 0 ? ", averaged" : "", sample, check,
			options->train.weighted ? ", weighted by uncertainties" : "");
}

static struct incise_factor *new_factor(const struct options *options,
					const struct incise_model *premises)
{
	struct incise_error err = {0};
	struct incise_factor *factor = incise_factor_new(premises, &err);
	char *text = options_text(options);

	if (!factor)
		cli_fail("%s: %s", options->premises ? options->premises : options->data,
			 err.text);
	incise_factor_set_options(factor, text);
	free(text);
	return factor;
}

/* End the program; few different rows may be why. */
static void fail_training(const struct result *result, const struct incise_error *err)
{
	if (result->repeated)
		cli_fail("%s: %s (%llu of %llu rows repeat another row)",
			 result->options->data, err->text,
			 (unsigned long long)result->repeated,
			 (unsigned long long)result->rows);
	cli_fail("%s: %s", result->options->data, err->text);
}

/* The consequents of all pairs at given premises. */
static struct incise_model *solve(const struct options *options,
				  struct incise_factor *fit, struct result *result)
{
	const struct incise_factor_ridge ridge = {options->train.ridge, 1, NAN};
	struct incise_error err = {0};
	struct incise_model *model = incise_factor_solve(
		fit, &ridge, &result->report, &result->interval.uncertainty, &err);

	if (!model)
		fail_training(result, &err);
	return model;
}

/* The notes of a model of --classic, which has no factor. To be freed with free(3). */
static char *classic_notes(const struct incise_corpus *corpus, const char *how)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		cli_fail("no memory");
	fprintf(out, "version: %s\noptions: %s\n", incise_version(), how);
	for (int i = 0; i < incise_corpus_sources(corpus); i++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(corpus, i);

		fprintf(out, "source: %s %llu pairs, %s\n", survey->hash,
			(unsigned long long)survey->rows, survey->text);
	}
	fclose(out);
	return text;
}

/* --- the report ---------------------------------------------------------------------- */

/* A smaller ratio to a baseline's error may be by chance of the split. */
#define WORSE 1.02

/* A smaller share of repeated rows is by chance, and within the estimate of many. */
#define REPEATED 0.05

/* Pairs per parameter below which a model follows noise rather than tissue. */
#define PAIRS_PER_PARAMETER 3

/* The unit of a column, from its name: force_N is in N. */
static const char *unit_of(const char *column)
{
	const char *score = strrchr(column, '_');

	return score ? score + 1 : "";
}

static json_t *error_object(const struct options *options, double rmse, double r2,
			    uint64_t pairs)
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
	json_set_integer(object, "pairs", (json_int_t)pairs);
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
	const uint64_t pairs = result->fit->different;
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

	if (options->given_group && result->fit->n_groups == 1 && !result->check)
		warn(list,
		     "--group %s: all pairs are of one group, so none is held out whole; "
		     "give another column, or none",
		     options->group);
	if (result->repeated > REPEATED * (double)result->rows)
		warn(list,
		     "%llu of %llu rows repeat another row, and count once as pairs",
		     (unsigned long long)result->repeated,
		     (unsigned long long)result->rows);
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
	if (result->check_outside)
		warn(list,
		     "%llu pairs held out are a whole range or more outside the training "
		     "pairs, and are left out of the check",
		     (unsigned long long)result->check_outside);
	if (pairs < (size_t)PAIRS_PER_PARAMETER * report->parameters)
		warn(list,
		     "%llu training pairs for %d parameters: the model may overfit; "
		     "record at least %d pairs for %d rules, or use fewer (--mf)",
		     (unsigned long long)pairs, report->parameters,
		     PAIRS_PER_PARAMETER * report->parameters,
		     incise_model_info(model)->n_rules);
	return list;
}

static json_t *propagated_json(const struct result *result)
{
	const struct incise_propagation_report *r = &result->propagated;
	const char *unit = unit_of(result->options->target);
	const struct {
		const char *name;
		double value;
	} parts[] = {{"own", r->own}, {"calibration", r->calibration}, {"rig", r->rig}};
	json_t *object;
	char key[80];

	if (!result->weighed)
		return json_null();
	object = json_pack("{sf si si}", "least_weight", r->weight, "recordings",
			   r->recordings, "calibrations", r->calibrations);
	for (size_t i = 0; i < sizeof(parts) / sizeof(*parts); i++) {
		snprintf(key, sizeof(key), "%s%s%.60s", parts[i].name, *unit ? "_" : "",
			 unit);
		json_set_number(object, key, parts[i].value);
	}
	return object;
}

static void report_json(const struct result *result, json_t *warned)
{
	const struct options *options = result->options;
	const struct incise_model *model = result->model;
	const struct incise_corpus_side *fit = result->fit, *check = result->check;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const struct interval *interval = &result->interval;
	json_t *object = json_object(), *unfired = json_array(), *mfs = json_array();
	const char *unit = unit_of(options->target);
	char key[80];

	json_set_integer(object, "pairs", fit->rows + (check ? check->rows : 0));
	json_set_integer(object, "left_out", result->left_out);
	json_set_integer(object, "repeated", result->repeated);
	json_object_set_new(object, "group",
			    options->group ? json_text(options->group) : json_null());
	json_object_set_new(object, "train",
			    error_object(options, report->train_rmse, report->train_r2,
					 fit->rows));
	json_object_set_new(object, "check",
			    check ? error_object(options, report->check_rmse,
						 report->check_r2, check->rows)
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
		json_array_append_new(mfs,
				      json_integer(incise_model_info(model)->n_mfs[i]));
	json_object_set_new(object, "mf", mfs);
	json_set_integer(object, "start", report->start);
	json_set_integer(object, "pairs_tuned", report->pairs_tuned);
	snprintf(key, sizeof(key), "crossval_rms_error%s%s", *unit ? "_" : "", unit);
	json_set_number(object, key, report->crossval_rmse);
	snprintf(key, sizeof(key), "noise%s%s", *unit ? "_" : "", unit);
	json_set_number(object, key, interval->noise);
	json_set_number(object, "interval95_coverage", interval->coverage);
	json_object_set_new(object, "uncertainty", propagated_json(result));
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
	const struct incise_corpus_side *fit = result->fit, *check = result->check;
	const struct incise_train_report *report = &result->report;
	const struct incise_baselines *baselines = &result->baselines;
	const struct interval *interval = &result->interval;
	bool cuts = options->group && !strcmp(options->group, "cut");
	const char *group = cuts ? "cut" : "group";
	const char *unseen = options->train.classic ? "check"
			     : cuts		    ? "unseen cuts"
			     : options->group	    ? "unseen groups"
						    : "unseen pairs";
	char knn[40];

	printf("%s: %s to train", options->data, cli_count(fit->rows, "pair"));
	if (options->group)
		printf(" (%s)", cli_count(fit->n_groups, group));
	if (check)
		printf(", %llu to check", (unsigned long long)check->rows);
	if (check && options->group)
		printf(" (%s)", cli_count(check->n_groups, group));
	if (result->left_out)
		printf("\nleft out %llu of %llu rows: the blade did not advance",
		       (unsigned long long)result->left_out,
		       (unsigned long long)(result->left_out + fit->rows +
					    (check ? check->rows : 0)));
	if (options->group && !options->given_group)
		printf("\ngrouped by %s, as no --group is given (none: each pair by itself)",
		       options->group);
	printf("\n%s, %s, %s (kept %d), ",
	       cli_count(incise_model_info(model)->n_rules, "rule"),
	       cli_count(report->parameters, "parameter"),
	       cli_count(report->epochs, "epoch"), report->best_epoch);
	report->averaged ? printf("average of %s", cli_count(report->averaged, "fit"))
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
	if (result->weighed)
		printf("  uncertainties: own parts %.3g %s; calibrations %.3g %s on the "
		       "model, %.3g %s of another rig\n",
		       result->propagated.own, unit_of(options->target),
		       result->propagated.calibration, unit_of(options->target),
		       result->propagated.rig, unit_of(options->target));
	if (report->pairs_tuned && report->pairs_tuned < fit->different)
		printf("  membership functions from a random %zu of the pairs, consequents "
		       "from all\n",
		       report->pairs_tuned);
	cli_written();
}

/* --- many processes ------------------------------------------------------------------ */

static const struct incise_ranks *job; /* that the program leaves at its end */
static bool alone = true; /* a failure is not shared: others would wait for ever */

static void leave_job(void)
{
	/* Rank 0 may fail of the same, and is the one that says so. */
	if (alone && job->rank)
		sleep(2);
	job->close(alone);
}

/* Only rank 0 prints; failures of others are passed on to it. */
static void join_job(struct options *options)
{
	struct incise_error err = {0};

	if (incise_ranks_open(&options->ranks, &err))
		cli_fail_with(&err);
	job = options->ranks;
	atexit(leave_job);
	if (job->rank &&
	    (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr)))
		cli_fail("no /dev/null");
}

static bool is_mine(const struct options *options, int source)
{
	return !options->ranks || source % options->ranks->size == options->ranks->rank;
}

static bool is_first(const struct options *options)
{
	return !options->ranks || !options->ranks->rank;
}

/* Fail if any rank has an error, with the one of the lowest rank; else add up a count of all. */
static void agree(const struct options *options, const struct incise_error *err,
		  uint64_t *count)
{
	struct {
		struct incise_error err;
		uint64_t count;
	} mine = {*err, *count}, *all;
	size_t *sizes;
	void *bytes;

	if (!options->ranks) {
		if (err->code)
			cli_fail_with(err);
		return;
	}
	if (options->ranks->gather(&mine, sizeof(mine), &bytes, &sizes))
		cli_fail("no memory");
	all = bytes;
	*count = 0;
	for (int r = 0; r < options->ranks->size; r++) {
		if (all[r].err.code) {
			alone = false;
			cli_fail_with(&all[r].err);
		}
		*count += all[r].count;
	}
	free(bytes);
	free(sizes);
}

/* The surveys of all ranks at each. */
static void share_surveys(const struct options *options, struct incise_corpus *corpus)
{
	const struct incise_ranks *ranks = options->ranks;
	struct incise_error err = {0};
	size_t n, *sizes;
	void *mine = incise_corpus_encode(corpus, &n), *all;

	if (!mine || ranks->gather(mine, n, &all, &sizes))
		cli_fail("no memory");
	free(mine);
	for (size_t r = 0, at = 0; r < (size_t)ranks->size; at += sizes[r], r++)
		if (r != (size_t)ranks->rank &&
		    incise_corpus_add(corpus, (char *)all + at, sizes[r], &err)) {
			alone = false;
			cli_fail_with(&err);
		}
	free(all);
	free(sizes);
}

/* A factor without pairs at the premises of rank 0. */
static struct incise_factor *share_premises(const struct options *options,
					    struct incise_factor *first)
{
	struct incise_error err = {0};
	size_t n = 0, *sizes;
	void *mine = first ? incise_factor_encode(first, &n) : NULL, *all;
	struct incise_factor *factor;

	if ((first && !mine) || options->ranks->gather(mine, n, &all, &sizes))
		cli_fail("no memory");
	factor = first ? first
		       : cli_require(incise_factor_decode(all, sizes[0], "rank 0", &err),
				     &err);
	free(mine);
	free(all);
	free(sizes);
	return factor;
}

/* The sum of all ranks' factors at rank 0, by a tree: any other gives the same. */
static void add_up(const struct options *options, struct incise_factor *factor)
{
	const struct incise_ranks *ranks = options->ranks;
	struct incise_error err = {0};
	struct incise_factor *other;
	void *bytes;
	size_t n;

	for (int step = 1; step < ranks->size; step *= 2) {
		if (ranks->rank % (2 * step)) {
			bytes = incise_factor_encode(factor, &n);
			if (!bytes)
				cli_fail("no memory");
			ranks->send(ranks->rank - step, bytes, n);
			free(bytes);
			return;
		}
		if (ranks->rank + step >= ranks->size)
			continue;
		bytes = ranks->receive(ranks->rank + step, &n);
		if (!bytes)
			cli_fail("no memory for the sums of another rank");
		other = incise_factor_decode(bytes, n, "another rank", &err);
		if (!other || incise_factor_merge(factor, other, "another rank", &err))
			cli_fail_with(&err);
		incise_factor_free(other);
		free(bytes);
	}
}

/* Values of a source besides its survey, in the progress of a training. */
struct surveyed {
	uint64_t left_out, check_outside;
	char rig[256];
};

static void keep_sources(struct progress *progress, const struct source *sources, int n,
			 uint64_t check_outside)
{
	struct surveyed *all = cli_alloc(n, sizeof(*all));

	for (int i = 0; i < n; i++) {
		all[i].left_out = sources[i].left_out;
		all[i].check_outside = check_outside;
		memcpy(all[i].rig, sources[i].rig, sizeof(all[i].rig));
	}
	progress_set(progress, PROGRESS_SOURCES, all, n * sizeof(*all));
}

/* Take over the surveys of an interrupted training; returns how many of the first sources. */
static int resume_surveys(const struct progress *progress, struct incise_corpus *corpus,
			  struct source *sources, int n)
{
	size_t size, sources_size;
	const void *surveys = progress_part(progress, PROGRESS_SURVEYS, &size);
	const struct surveyed *all =
		progress_part(progress, PROGRESS_SOURCES, &sources_size);
	struct incise_error err = {0};
	int done;

	if (!surveys || sources_size != n * sizeof(*all))
		return 0;
	if (incise_corpus_add(corpus, surveys, size, &err))
		cli_fail(
			"the progress of an interrupted training is damaged; it is removed, "
			"start again");
	done = incise_corpus_sources(corpus);
	for (int i = 0; i < done && i < n; i++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(corpus, i);

		snprintf(sources[i].hash, sizeof(sources[i].hash), "%s", survey->hash);
		snprintf(sources[i].text, sizeof(sources[i].text), "%s", survey->text);
		snprintf(sources[i].rig, sizeof(sources[i].rig), "%.255s", all[i].rig);
		sources[i].left_out = all[i].left_out;
	}
	cli_error("goes on from an interrupted training: %d of %d sources are surveyed",
		  done, n);
	return done;
}

/* Survey all sources: rows, ranges, groups, and the sample. */
static struct incise_corpus *survey(struct options *options,
				    const struct source_options *how,
				    struct source *sources, struct progress *progress,
				    struct reading *reading)
{
	size_t sample = options->train.classic ? SIZE_MAX : options->train.tuned;
	struct incise_corpus *corpus = incise_corpus_new(
		options->n_inputs, how->group, options->train.seed,
		sample > INCISE_CORPUS_SAMPLE ? sample : INCISE_CORPUS_SAMPLE);
	struct incise_error err = {0};
	uint64_t none = 0;
	int rc = 0;

	if (!corpus)
		cli_fail("no memory");
	begin_reading(reading, "surveying", options->n_paths, 0);
	reading->at = resume_surveys(progress, corpus, sources, options->n_paths);
	for (; reading->at < options->n_paths && !rc; reading->at++) {
		bool last = reading->at == options->n_paths - 1;

		if (!is_mine(options, reading->at))
			continue;
		rc = source_open(&sources[reading->at], &err);
		if (!rc)
			rc = incise_corpus_survey(corpus, &sources[reading->at].corpus,
						  &err);
		if (!rc && progress && (last || progress_due(progress))) {
			size_t size;
			void *bytes = incise_corpus_encode(corpus, &size);

			progress_set(progress, PROGRESS_SURVEYS, bytes, size);
			keep_sources(progress, sources, options->n_paths, 0);
			progress_write(progress);
		}
	}
	cli_progress_end();
	agree(options, &err, &none);
	if (options->ranks)
		share_surveys(options, corpus);
	alone = false;
	if (incise_corpus_settle(corpus, options->check, &err))
		cli_fail("%s: %s", options->data, err.text);
	alone = true;
	return corpus;
}

/* The second reading, for the sums of all pairs at some premises. */
struct folding {
	const struct options *options;
	const struct incise_corpus *corpus;
	struct source *sources;
	struct progress *progress; /* or NULL */
	struct reading *reading;
	struct result *result;
	struct incise_factor *fit,
		*check; /* made by it; check NULL: nothing is held out */
	struct incise_propagation *propagation; /* NULL: no uncertainties */
};

/* The factor of an interrupted training, if it is of the same premises; else @fresh. */
static struct incise_factor *resume_factor(const struct progress *progress,
					   enum progress_part part,
					   struct incise_factor *fresh)
{
	struct incise_factor_info wanted, found;
	struct incise_factor *factor;
	struct incise_error err;
	size_t size;
	const void *bytes = progress_part(progress, part, &size);

	factor = bytes && fresh ? incise_factor_decode(bytes, size, "progress", &err)
				: NULL;
	if (!factor)
		return fresh;
	incise_factor_info(fresh, &wanted);
	incise_factor_info(factor, &found);
	if (strcmp(wanted.premises, found.premises)) {
		incise_factor_free(factor);
		return fresh;
	}
	incise_factor_free(fresh);
	return factor;
}

static bool has_source(const struct incise_factor *factor, const char *hash)
{
	struct incise_factor_info info;
	bool found = false;

	incise_factor_info(factor, &info);
	for (int i = 0; i < info.n_sources; i++)
		found |= !strcmp(info.sources[i].hash, hash);
	return found;
}

static void keep_factors(const struct folding *folding)
{
	size_t size;
	void *bytes = incise_factor_encode(folding->fit, &size);

	progress_set(folding->progress, PROGRESS_FIT, bytes, size);
	if (folding->check) {
		bytes = incise_factor_encode(folding->check, &size);
		progress_set(folding->progress, PROGRESS_CHECK, bytes, size);
	}
	keep_sources(folding->progress, folding->sources, folding->options->n_paths,
		     folding->result->check_outside);
	progress_write(folding->progress);
}

static void resume_factors(struct folding *folding)
{
	size_t size;
	const struct surveyed *all =
		progress_part(folding->progress, PROGRESS_SOURCES, &size);
	struct incise_factor *fresh = folding->fit;

	folding->fit = resume_factor(folding->progress, PROGRESS_FIT, folding->fit);
	if (folding->fit == fresh)
		return;
	fresh = folding->check;
	folding->check = resume_factor(folding->progress, PROGRESS_CHECK, fresh);
	if (fresh && folding->check == fresh)
		cli_fail(
			"the progress of an interrupted training is damaged; it is removed, "
			"start again");
	folding->result->check_outside = all ? all[0].check_outside : 0;
}

/* Premises are those of rank 0, and the sums are complete there. */
static void fold(struct folding *folding, const struct incise_model *premises)
{
	const struct options *options = folding->options;
	struct result *result = folding->result;
	struct reading *reading = folding->reading;
	struct incise_error err = {0};
	int rc = 0;

	folding->fit = premises ? new_factor(options, premises) : NULL;
	folding->check = premises && result->check ? new_factor(options, premises) : NULL;
	if (options->ranks) {
		folding->fit = share_premises(options, folding->fit);
		if (result->check)
			folding->check = share_premises(options, folding->check);
	}
	if (folding->progress)
		resume_factors(folding);
	begin_reading(reading, "adding", options->n_paths,
		      incise_corpus_side(folding->corpus, false)->rows +
			      incise_corpus_side(folding->corpus, true)->rows);
	for (; reading->at < options->n_paths && !rc; reading->at++) {
		struct source *source = &folding->sources[reading->at];

		if (!is_mine(options, reading->at))
			continue;
		if (has_source(folding->fit, source->hash)) {
			result->left_out += source->left_out;
			continue;
		}
		rc = incise_corpus_fold(folding->corpus, &source->corpus, folding->fit,
					folding->check, &result->check_outside, &err);
		result->left_out += source->left_out;
		if (!rc && progress_due(folding->progress))
			keep_factors(folding);
	}
	cli_progress_end();
	agree(options, &err, &result->check_outside);
	agree(options, &err, &result->left_out);
	if (!options->ranks)
		return;
	add_up(options, folding->fit);
	if (folding->check)
		add_up(options, folding->check);
	/* The others are at their end. */
	alone = false;
}

/* --- uncertainties ------------------------------------------------------------------- */

/* The weights follow from a model, and the model from the weights; they have settled by then. */
#define PASSES 3

/* Root mean square error of a model on a sample; never 0. */
static double sample_rmse(const struct incise_model *model,
			  const struct incise_pairs *pairs)
{
	int d = pairs->n_inputs;
	double sum = 0, least = 0;

	for (size_t i = 0; i < pairs->n; i++) {
		const double *x = pairs->rows + i * (size_t)(d + 1);
		double e = incise_model_eval(model, x, NULL) - x[d];

		sum += e * e;
		least = fmax(least, fabs(x[d]));
	}
	return fmax(sqrt(sum / (double)pairs->n), 1e-9 * fmax(least, 1e-9));
}

/* The sums of all pairs with their weights, passed over several times. */
static void fold_weighted(struct folding *folding, const struct incise_model *premises)
{
	const struct incise_factor_ridge ridge = {1e-3, 1, 1};
	const struct incise_pairs *sample =
		&incise_corpus_side(folding->corpus, false)->sample.pairs;
	double scatter = sample_rmse(premises, sample);
	struct incise_uncertainty *uncertainty;
	struct incise_model *model = NULL, *next;
	struct incise_error err = {0};

	for (int pass = 0; pass < PASSES; pass++) {
		if (incise_propagation_start(folding->propagation,
					     model ? model : premises, scatter, &err))
			cli_fail_with(&err);
		incise_factor_free(folding->fit);
		incise_factor_free(folding->check);
		folding->result->left_out = folding->result->check_outside = 0;
		fold(folding, premises);
		next = incise_factor_solve(folding->fit, &ridge, NULL, &uncertainty,
					   &err);
		if (!next ||
		    incise_propagation_end(folding->propagation, next, uncertainty,
					   incise_factor_rmse(folding->fit, next, NULL),
					   &scatter, &err))
			cli_fail("%s: %s", folding->options->data, err.text);
		incise_uncertainty_free(uncertainty);
		incise_model_free(model);
		model = next;
	}
	incise_model_free(model);
}

static void fold_all(struct folding *folding, const struct incise_model *premises)
{
	if (folding->propagation)
		fold_weighted(folding, premises);
	else
		fold(folding, premises);
}

/* Put the calibrations into the standard deviation of the model. */
static void finish_weighted(struct folding *folding, const struct incise_model *model)
{
	struct result *result = folding->result;
	struct incise_error err = {0};
	double scatter;

	if (!folding->propagation)
		return;
	if (incise_propagation_end(folding->propagation, model,
				   result->interval.uncertainty,
				   result->report.train_rmse, &scatter, &err) ||
	    incise_propagation_finish(folding->propagation, result->interval.uncertainty,
				      &result->propagated, &err))
		cli_fail("%s: %s", folding->options->data, err.text);
	result->weighed = true;
}

/* Ways that cannot carry uncertainties are refused. */
static void check_weighed(const struct options *options)
{
	const char *way = options->factor	   ? "--factor"
			  : options->mpi	   ? "--mpi"
			  : options->train.classic ? "--classic"
						   : NULL;

	/* All processes find the same. */
	alone = alone && !options->mpi;
	if (way)
		cli_usage(
			"%s cannot take uncertainties, which %s has; give --uncertainty "
			"none",
			way, options->data);
}

/* The search of premises from the sample, which then asks for the sums. */
struct searching {
	struct history history;
	struct folding *folding;
};

static void on_search_epoch(void *user, int epoch, double train_rmse, double check_rmse)
{
	struct searching *searching = user;

	on_epoch(&searching->history, epoch, train_rmse, check_rmse);
}

static struct incise_factor *on_premises(void *user, const struct incise_model *premises)
{
	struct searching *searching = user;

	cli_progress_end();
	fold_all(searching->folding, premises);
	return searching->folding->fit;
}

static void search(struct options *options, struct incise_model *model,
		   struct folding *folding, struct result *result)
{
	const struct incise_pairs *check =
		result->check ? &result->check->sample.pairs : NULL;
	struct searching searching = {.history.epochs = options->train.epochs,
				      .folding = folding};
	struct incise_error err = {0};
	struct incise_outfile *file = NULL;

	if (options->history) {
		searching.history.csv = whole_file_begin(options->history, &file);
		fprintf(searching.history.csv, "epoch,train_rmse,check_rmse\n");
	}
	options->train.progress = on_search_epoch;
	options->train.user = &searching;
	options->train.all = options->train.classic ? NULL : on_premises;
	options->train.uncertainty = &result->interval.uncertainty;
	if (incise_train(model, &result->fit->sample.pairs,
			 check && check->n ? check : NULL, &options->train,
			 &result->report, &err)) {
		incise_outfile_abort(file);
		fail_training(result, &err);
	}
	cli_progress_end();
	whole_file_end(file);
}

static void save_factor(const struct options *options, struct incise_factor *factor)
{
	struct incise_factor_info info;
	struct incise_error err = {0};

	if (incise_factor_save(factor, options->factor, &err))
		cli_fail_with(&err);
	incise_factor_info(factor, &info);
	if (!strcmp(options->factor, "-"))
		return;
	printf("%s: %s of %s, premises %.12s\n", options->data,
	       cli_count(info.rows, "pair"), cli_count(info.groups, "group"),
	       info.premises);
	if (info.parts < INCISE_FACTOR_FOLDS)
		printf("%d of %d parts, as small ones would reveal their pairs: a merge "
		       "cross-validates over these\n",
		       info.parts, INCISE_FACTOR_FOLDS);
	cli_written();
}

static void save_model(const struct options *options, const struct incise_corpus *corpus,
		       const struct incise_factor *factor,
		       const struct incise_model *model, struct result *result)
{
	struct incise_error err = {0};
	char *how = options_text(options);
	char *notes = factor ? incise_factor_notes(factor) : classic_notes(corpus, how);
	json_t *warned;

	result->model = model;
	judge_interval(&result->interval, model,
		       result->check ? &result->check->sample : NULL);
	if (incise_baselines(&result->fit->sample.pairs, result->fit->sample.groups,
			     &(result->check && result->check->sample.pairs.n
				       ? result->check
				       : result->fit)
				      ->sample.pairs,
			     &result->baselines, &err))
		cli_fail("%s: %s", options->data, err.text);
	if (incise_model_save_notes(model, options->model, notes, &err))
		cli_fail_with(&err);
	free(notes);
	free(how);
	save_uncertainty(&result->interval, options->model);
	warned = warnings(result);
	if (options->json)
		report_json(result, warned);
	else if (strcmp(options->model, "-"))
		report_text(result);
	if (!options->json)
		json_decref(warned);
}

/* All options that the surveys and sums depend on: free(3). */
static char *progress_key(const struct options *options)
{
	char *how = options_text(options), *key;
	char columns[1000] = "";
	size_t used = 0;

	for (int i = 0; i < options->n_inputs && used < sizeof(columns); i++)
		used += (size_t)snprintf(columns + used, sizeof(columns) - used, "%s,",
					 options->inputs[i]);
	key = cli_text("%s; seed %llu; rate %.17g; damaged %d; %s%s; %s", how,
		       (unsigned long long)options->train.seed, options->rate,
		       options->damaged, columns, options->target,
		       options->premises ? options->premises : "");
	free(how);
	return key;
}

int main(int argc, char **argv)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1 + INCISE_BUDGET_PARTS];
	struct incise_model *premises = NULL, *model;
	struct uncertainties uncertainties;
	struct progress *progress = NULL;
	struct folding folding;
	struct source_options how;
	struct incise_corpus *corpus;
	struct reading reading;
	struct source *sources;
	struct options options;
	char *data;
	struct result result = {.options = &options};
	struct incise_error err = {0};

	parse(&options, argc, argv);
	if (options.mpi)
		join_job(&options);
	if (is_first(&options)) {
		check_writable(options.model);
		check_writable(options.factor);
		check_writable(options.initial);
		check_writable(options.history);
	}
	if (options.premises)
		premises = cli_require(incise_model_load(options.premises, &err), &err);
	choose_columns(&options, premises, columns);
	options.data = options.paths[0];
	uncertainties_find(&uncertainties, options.uncertainty, columns, options.n_inputs,
			   options.paths, options.n_paths);
	options.train.weighted = uncertainties.n > 0;
	if (uncertainties.n)
		check_weighed(&options);
	for (int i = 0; i < uncertainties.n; i++)
		columns[options.n_inputs + 1 + i] = uncertainties.columns[i];
	how = (struct source_options){
		.columns = columns,
		.n_columns = options.n_inputs + 1 + uncertainties.n,
		.uncertainty = uncertainties.n > 0,
		.group = options.group,
		.all_rows = options.all_rows,
		.damaged = options.damaged,
		.rate_hz = options.rate,
		.progress = on_rows,
		.user = &reading,
	};
	if (options.ranks && options.ranks->size == 1)
		cli_warn("--mpi: a single process; start several by 'mpirun -n N incise "
			 "train …'");
	sources = sources_new(options.paths, options.n_paths, &how);
	options.given_group = options.group;
	options.group = how.group;
	data = cli_text("%d sources", options.n_paths);
	options.data = options.n_paths == 1 ? sources[0].path : data;
	/* Weights are not kept in the progress. */
	if (!options.mpi && !options.train.classic && !uncertainties.n) {
		char *key = progress_key(&options);

		progress = progress_new(options.factor ? options.factor : options.model,
					key, sources, options.n_paths);
		free(key);
	}
	corpus = survey(&options, &how, sources, progress, &reading);
	result.fit = incise_corpus_side(corpus, false);
	result.check = options.check > 0 ? incise_corpus_side(corpus, true) : NULL;
	options.train.groups = result.fit->sample.groups;
	result.rows = result.fit->rows + (result.check ? result.check->rows : 0);
	result.repeated = result.rows - result.fit->different -
			  (result.check ? result.check->different : 0);
	folding = (struct folding){.options = &options,
				   .corpus = corpus,
				   .sources = sources,
				   .progress = progress,
				   .reading = &reading,
				   .result = &result};
	if (uncertainties.n) {
		folding.propagation = cli_require(
			incise_propagation_new(options.n_inputs, uncertainties.parts,
					       uncertainties.n, &err),
			&err);
		incise_corpus_weigh(corpus, folding.propagation);
	}
	if (!is_first(&options)) {
		fold(&folding, NULL);
		exit(0);
	}
	if (!premises) {
		model = start_model(&options, corpus, columns);
		search(&options, model, &folding, &result);
	} else {
		fold_all(&folding, premises);
		model = options.factor ? NULL : solve(&options, folding.fit, &result);
	}
	if (model)
		finish_weighted(&folding, model);
	if (folding.check)
		result.report.check_rmse =
			incise_factor_rmse(folding.check, model, &result.report.check_r2);
	for (int i = 0; i < options.n_paths && options.train.classic; i++)
		result.left_out += sources[i].left_out;
	if (options.factor)
		save_factor(&options, folding.fit);
	else
		save_model(&options, corpus, folding.fit, model, &result);
	cli_finish();
	incise_factor_free(folding.fit);
	incise_factor_free(folding.check);
	incise_propagation_free(folding.propagation);
	incise_model_free(model);
	incise_model_free(premises);
	incise_uncertainty_free(result.interval.uncertainty);
	incise_corpus_free(corpus);
	sources_free(sources, options.n_paths);
	free(data);
	for (int i = 0; i <= options.n_inputs && options.premises; i++)
		free((char *)columns[i]);
	return 0;
}
