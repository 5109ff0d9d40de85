// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise train SOURCE... -o MODEL.fis: learn a fuzzy force model from recordings and CSV files,
 * and compare it with simpler predictors. incise_train_sources() has the method.
 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/ranks.h>
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/json.h"
#include "cli/recording.h"
#include "cli/texture_report.h"
#include "train/sources.h"

struct train_options {
	char **paths;
	int n_paths;
	char *typed;	  /* the arguments, or NULL */
	const char *data; /* for messages: the path, or the number of sources */
	const char *model, *initial, *history, *premises, *factor, *tex;
	struct recording_rows rows;
	long sample; /* pairs; 0: all */
	struct shard {
		long at, of; /* of 0: all sources */
	} shard;
	char *inputs[INCISE_MODEL_INPUTS_MAX];
	const char *target;
	int n_mfs;
	bool auto_mfs, json, mpi, texture, wanted; /* the latter of the inputs */
	enum uncertainties_wanted uncertainty;
	struct incise_sources_options how;
};

static void parse_inputs(void *whole, char *text)
{
	struct train_options *options = whole;

	options->how.n_inputs =
		cli_list("inputs", text, options->inputs, INCISE_MODEL_INPUTS_MAX);
	options->wanted = true;
}

static void parse_mfs(void *whole, char *text)
{
	struct train_options *options = whole;
	char *items[INCISE_MODEL_INPUTS_MAX];

	options->n_mfs = 0;
	options->auto_mfs = !strcmp(text, "auto");
	if (options->auto_mfs)
		return;
	options->n_mfs = cli_list("mf", text, items, INCISE_MODEL_INPUTS_MAX);
	for (int i = 0; i < options->n_mfs; i++)
		options->how.n_mfs[i] =
			cli_integer("mf", items[i], 1, INCISE_MODEL_MFS_MAX);
}

static void parse_type(void *type, char *text)
{
	static const enum incise_mf_type types[] = {INCISE_MF_GAUSS, INCISE_MF_GBELL};
	const char *const names[] = {incise_mf_type_name(types[0]),
				     incise_mf_type_name(types[1]), NULL};

	*(enum incise_mf_type *)type = types[cli_choice("search type", text, names)];
}

static void parse_uncertainty(void *wanted, char *text)
{
	static const char *const names[] = {"none", "parts", NULL};

	*(enum uncertainties_wanted *)wanted = cli_choice("uncertainty", text, names)
						       ? UNCERTAINTIES_PARTS
						       : UNCERTAINTIES_NONE;
}

static void parse_share(void *whole, char *text)
{
	struct train_options *options = whole;
	char *slash = strchr(text, '/');

	options->mpi = !strcmp(text, "mpi");
	if (options->mpi)
		return;
	if (!slash)
		cli_usage("--share %s: expected I/N, for example 3/16, or mpi", text);
	*slash = '\0';
	options->shard.of = cli_integer("share", slash + 1, 1, 1000000);
	options->shard.at = cli_integer("share", text, 1, options->shard.of);
}

static void parse_part(void *whole, char *text)
{
	struct recording_rows *rows = &((struct train_options *)whole)->rows;

	cli_time_range("range", text, &rows->from_s, &rows->to_s);
	if (isinf(rows->to_s))
		rows->to_s = 0;
}

static void parse_search(void *whole, char *text)
{
	static const struct cli_option keys[] = {
		{0, "search type", "KIND", NULL,
		 CLI_PARSED(struct train_options, how.type, parse_type)},
		{0, "search sample", "N", NULL,
		 CLI_INTEGER(struct train_options, sample, 0, 1000000000)},
		{0, "search classic", NULL, NULL,
		 CLI_FLAG(struct train_options, how.train.classic)},
		{0, "search step", "K", NULL,
		 CLI_NUMBER(struct train_options, how.train.step, 1e-9, 10)},
		{0},
	};

	cli_keys(text, keys, whole);
}

static const struct cli_option option_table[] = {
	{'o', "output", "FILE.fis",
	 "write the model; - is standard output (default: NAME.fis of one source "
	 "NAME.rec or NAME.csv)",
	 CLI_OUTPUT(struct train_options, model), .extensions = ".fis"},
	{'o', "output", "FILE.initial.fis",
	 "also write the initial model, before training",
	 CLI_OUTPUT(struct train_options, initial), .extensions = ".initial.fis"},
	{'o', "output", "FILE.csv", "write the RMSE of each epoch",
	 CLI_OUTPUT(struct train_options, history), .extensions = ".csv"},
	{'o', "output", "FILE.fac",
	 "write the sums of these sources for incise merge, instead of a "
	 "model; needs --premises",
	 CLI_OUTPUT(struct train_options, factor), .extensions = ".fac"},
	{'o', "output", "FILE.fis.tex",
	 "write only the texture, of the model FILE.fis that is there, for example of "
	 "averaged pairs",
	 CLI_OUTPUT(struct train_options, tex), .extensions = ".fis.tex"},
	{0, "premises", "FILE",
	 "keep the membership functions and ranges of this model (.fis); only the "
	 "consequents are learnt",
	 CLI_INPUT(struct train_options, premises)},
	{0, "inputs", "A,B", "input columns (default: depth_mm,velocity_mm_s)",
	 CLI_PARSED_BY(parse_inputs)},
	{0, "target", "COLUMN", "column to learn (default: force_N)",
	 CLI_TEXT(struct train_options, target)},
	{0, "group", "GROUP",
	 "hold out whole groups: recording, rig, or a column that names them, such "
	 "as cut (default: cut, where all sources have it), or none",
	 CLI_TEXT(struct train_options, how.group)},
	{0, "rate", "HZ",
	 "rows per second of a recording, each the mean of its samples (default: "
	 "all samples)",
	 CLI_NUMBER(struct train_options, rows.rate_hz, 0.1, 1e6)},
	{0, "range", "TIME..TIME",
	 "of each recording: the part to use, such as 90s.., from its first sample "
	 "(default: all)",
	 CLI_PARSED_BY(parse_part)},
	{0, "cut", "N", "of each recording: only this cut, from 1",
	 CLI_INTEGER(struct train_options, rows.cut, 1, 1000000000)},
	RECORDING_DAMAGED(struct train_options, rows.damaged),
	{0, "all-rows", NULL,
	 "also use rows in which the blade did not advance (advancing is 0)",
	 CLI_FLAG(struct train_options, how.all_rows)},
	{0, "uncertainty", "WHICH",
	 "uncertainties of the columns, as incise export --uncertainty parts "
	 "writes them: parts, or none (default: parts of files that have them)",
	 CLI_PARSED(struct train_options, uncertainty, parse_uncertainty)},
	{0, "check", "SHARE",
	 "hold out this share of the data as a test set, for example 0.3",
	 CLI_NUMBER(struct train_options, how.check, 0.01, 0.99)},
	{0, "seed", "N", "seed of every random choice (default: 1)",
	 CLI_INTEGER(struct train_options, how.train.seed, 0, 1L << 53)},
	{0, "mf", "N,M",
	 "membership functions per input (default: 5,4 for two inputs, else 3 "
	 "each; with --texture 3,2 unless these are better by 5 %), or "
	 "auto: chosen by cross-validation",
	 CLI_PARSED_BY(parse_mfs)},
	{0, "epochs", "N", "of classic: largest number of epochs (default: 80)",
	 CLI_INTEGER(struct train_options, how.train.epochs, 1, 100000)},
	{0, "search", "KEY[=VALUE],...",
	 "of the membership functions: type=gaussmf (default) or gbellmf; sample=N, "
	 "pairs at random that select the penalty, 0 for all (default: 3000); "
	 "classic: train as MATLAB's anfis does, with no scaling and a ridge of "
	 "1e-6, and the held-out data choose the epoch; step=K, with classic: "
	 "initial step (default: 0.01)",
	 CLI_PARSED_BY(parse_search)},
	{0, "ridge", "R",
	 "ridge on scaled data (default: a penalty on the differences of neighbouring "
	 "rules, by cross-validation)",
	 CLI_NUMBER(struct train_options, how.train.ridge, 0, 1e12)},
	{0, "share", "I/N|mpi",
	 "use share I of N of the sources, from 1, for the tasks of a job array, "
	 "with -o FILE.fac; or share the sources among the processes of mpirun",
	 CLI_PARSED_BY(parse_share)},
	{0, "texture", NULL,
	 "also learn the saw-tooth of cutting and the variation from cut to cut, "
	 "into MODEL.fis.tex",
	 CLI_FLAG(struct train_options, texture)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct train_options, json)},
	{0},
};

static const struct cli_command command = {
	.name = "train",
	.synopsis = "DATA.csv|NAME.rec… [-o MODEL.fis] [OPTIONS]",
	.summary =
		"Learn a Takagi-Sugeno force model from recordings or CSV files (ANFIS).",
	.options = option_table,
	.examples = "incise train pairs.csv --group cut --check 0.3 -o liver.fis\n"
		    "incise train day1.rec day2.rec --group recording -o liver.fis",
};

/* A file next to an output that is a regular file or will be one: free(3); else NULL. */
static char *path_beside(const char *output, const char *end)
{
	struct stat st;

	if (!strcmp(output, "-") || (!stat(output, &st) && !S_ISREG(st.st_mode)))
		return NULL;
	return cli_text("%s%s", output, end);
}

/* The model of one source NAME.rec: NAME.fis in this folder; NULL: none. */
static const char *default_model(const struct train_options *options)
{
	const char *name = strrchr(options->paths[0], '/'), *end;
	char *path;

	name = name ? name + 1 : options->paths[0];
	end = strrchr(name, '.');
	if (options->n_paths > 1 || !end || end == name)
		return NULL;
	path = cli_text("%.*s.fis", (int)(end - name), name);
	cli_output_once(path);
	return path;
}

/* Put a word as a shell reads it. */
static void put_word(FILE *out, const char *word)
{
	static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
				    "0123456789_./:=,@%+-";

	if (*word && !word[strspn(word, plain)]) {
		fprintf(out, " %s", word);
		return;
	}
	fputs(" '", out);
	for (; *word; word++)
		fputs(*word == '\'' ? "'\\''" : (char[]){*word, '\0'}, out);
	putc('\'', out);
}

/* The arguments as a shell reads them, to be freed with free(3). NULL: they cannot be typed again. */
static char *spell_arguments(char **argv)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);
	bool again = out;

	while (out && *++argv) {
		again &= strcmp(*argv, "-") != 0;
		for (const char *c = *argv; *c; c++)
			again &= (unsigned char)*c >= ' ' && *c != 0x7f;
		put_word(out, *argv);
	}
	if (out && fclose(out))
		again = false;
	if (again)
		return text;
	free(text);
	return NULL;
}

static void parse_train(struct train_options *options, int argc, char **argv)
{
	*options = (struct train_options){
		.typed = spell_arguments(argv),
		.inputs = {"depth_mm", "velocity_mm_s"},
		.how.n_inputs = 2,
		.target = "force_N",
		.sample = -1,
	};
	incise_train_options_init(&options->how.train);
	cli_parse(&command, argc, argv, options);
	options->paths = argv + optind;
	options->n_paths = argc - optind;
	if (!options->n_paths)
		cli_usage("missing DATA.csv or NAME.rec (pairs to learn from)");
	if (options->sample >= 0)
		options->how.train.tuned =
			options->sample ? (size_t)options->sample : SIZE_MAX;
	if (options->sample >= 0 && (options->premises || options->how.train.classic))
		cli_usage(
			"--search sample: --premises and classic do not search on a sample; "
			"leave it out");
	if (options->shard.of && !options->factor)
		cli_usage(
			"--share: missing -o FILE.fac; incise merge makes a model of all "
			"shares");
	for (long i = options->shard.at - 1, n = 0;
	     options->shard.of && i < (argc - optind); i += options->shard.of) {
		options->paths[n++] = options->paths[i];
		options->n_paths = (int)n;
	}
	if (options->shard.of > argc - optind)
		cli_usage(
			"--share: %ld shares of %d sources; give at least one source for "
			"each",
			options->shard.of, argc - optind);
	if (options->factor && !options->premises)
		cli_usage("-o %s: missing --premises MODEL.fis, which all factors share",
			  options->factor);
	if (options->factor && options->model)
		cli_usage("-o %s -o %s: give one; incise merge makes a model of factors",
			  options->factor, options->model);
	if (options->factor && options->how.check > 0)
		cli_usage("-o %s takes all pairs; leave out --check", options->factor);
	if (options->premises &&
	    (options->how.train.classic || options->initial || options->history ||
	     options->n_mfs || options->auto_mfs))
		cli_usage("--premises keeps the membership functions; leave out --mf, "
			  "classic and files of a training (.initial.fis, .csv)");
	if (options->mpi && options->how.train.classic)
		cli_usage("--search classic keeps all pairs in one memory; leave out "
			  "--share mpi");
	if (options->factor && options->json)
		cli_usage("--json reports a model; leave it out with -o %s",
			  options->factor);
	if (options->tex &&
	    (options->model || options->factor || options->initial || options->history ||
	     options->premises || options->how.check > 0 || options->mpi ||
	     options->n_mfs || options->auto_mfs || options->wanted))
		cli_usage(
			"-o %s writes the texture of a model that is there; leave out "
			"other outputs, --inputs, --mf, --premises, --check and --share",
			options->tex);
	options->texture |= options->tex != NULL;
	if (options->texture && (options->factor || options->mpi))
		cli_usage("--texture needs a model and all sources in one process; leave "
			  "out %s",
			  options->factor ? "-o FILE.fac" : "--share mpi");
	if (options->texture && options->rows.rate_hz > 0)
		cli_usage("--texture needs each sample; leave out --rate");
	if (options->factor)
		options->how.end = INCISE_TRAIN_TO_FACTOR;
	if (options->factor || options->tex)
		return;
	if (!options->model)
		options->model = default_model(options);
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
	for (int i = 0; i <= options->texture; i++) {
		char *beside = path_beside(options->model, i ? ".tex" : ".sd");

		if (beside)
			cli_output_once(beside);
		else if (i)
			cli_usage("--texture needs -o MODEL.fis, next to which it is "
				  "written");
		free(beside);
	}
	if (options->n_mfs && options->n_mfs != options->how.n_inputs)
		cli_usage("--mf: expected %d counts, one for each of --inputs, found %d",
			  options->how.n_inputs, options->n_mfs);
	options->how.smooth = options->texture && !options->n_mfs && !options->auto_mfs &&
			      !options->how.train.classic;
	for (int i = 0;
	     i < options->how.n_inputs && !options->n_mfs && !options->auto_mfs; i++)
		options->how.n_mfs[i] =
			options->how.n_inputs == 2 ? 5 - i : INCISE_TRAIN_MFS;
}

/* --- progress ------------------------------------------------------------------------ */

#define REDRAWN_NS 100000000

struct show {
	const struct train_options *options;
	FILE *history; /* or NULL */
	enum incise_train_phase phase;
	int64_t start_ns, drawn_ns; /* of the phase, and the last time */
	bool resumed;
};

static void show_reading(const struct show *show, const struct incise_train_step *step)
{
	double past = 1e-9 * (double)(show->drawn_ns - show->start_ns);
	double left = step->total ? past * (double)(step->total - step->rows) /
					    (double)(step->rows + 1)
				  : past * (step->sources - step->source) /
					    (step->source + 0.5);

	cli_progress("%s source %d of %d: %.3g million rows, %.0f s left",
		     step->phase == INCISE_TRAIN_ADD ? "adding" : "surveying",
		     step->source + 1, step->sources, 1e-6 * (double)step->rows, left);
}

static void show_epoch(const struct show *show, const struct incise_train_step *step)
{
	cli_progress("epoch %d of %d: training error %.6g", step->epoch,
		     show->options->how.train.epochs, step->train_rmse);
	if (!show->history)
		return;
	fprintf(show->history, "%d,%.17g,", step->epoch, step->train_rmse);
	if (!isnan(step->check_rmse))
		fprintf(show->history, "%.17g", step->check_rmse);
	fputc('\n', show->history);
}

static int show_step(void *user, const struct incise_train_step *step)
{
	struct show *show = user;
	int64_t now = cli_now_ns();

	if (step->resumed && !show->resumed)
		cli_error("goes on from an interrupted training: %d of %d sources are "
			  "surveyed",
			  step->resumed, step->sources);
	if (step->phase != show->phase || !show->start_ns)
		show->start_ns = now;
	show->phase = step->phase;
	show->resumed |= step->resumed;
	if (step->epoch)
		show_epoch(show, step);
	else if (step->sources && now - show->drawn_ns > REDRAWN_NS) {
		show->drawn_ns = now;
		show_reading(show, step);
	}
	return 0;
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
static void join_job(void)
{
	struct incise_error err = {0};

	cli_check(incise_ranks_open(&job, &err), &err);
	atexit(leave_job);
	if (job->rank &&
	    (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr)))
		cli_fail("no /dev/null");
}

/* --- columns and files --------------------------------------------------------------- */

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

/* Load a model, and fail unless sums can be found at its premises. */
static struct incise_model *load_premises(const char *path)
{
	struct incise_error err = {0};
	struct incise_model *model = cli_require(incise_model_load(path, &err), &err);
	struct incise_factor *factor = incise_factor_new(model, &err);

	if (!factor)
		cli_fail("%s: %s", path, err.text);
	incise_factor_free(factor);
	return model;
}

/* Take the columns of the options, or of the premises if these are given. */
static void choose_columns(struct train_options *options, const char **columns)
{
	const struct incise_model_info *info =
		options->how.premises ? incise_model_info(options->how.premises) : NULL;
	int n = info ? info->n_inputs : options->how.n_inputs;

	for (int i = 0; i < n; i++)
		columns[i] = info ? info->input[i].name : options->inputs[i];
	if (info)
		options->target = info->output.name;
	columns[n] = options->target;
	options->how.n_inputs = n;
	options->how.columns = columns;
}

/* Ways that cannot carry uncertainties are refused. */
static void check_weighed(const struct train_options *options)
{
	const char *way = options->factor	       ? "-o FILE.fac"
			  : options->mpi	       ? "--share mpi"
			  : options->how.train.classic ? "--search classic"
						       : NULL;

	/* All processes find the same. */
	alone = !options->mpi;
	if (way)
		cli_usage(
			"%s cannot take uncertainties, which %s has; give --uncertainty "
			"none",
			way, options->paths[0]);
}

static void choose_uncertainties(struct train_options *options,
				 struct uncertainties *found)
{
	const char **columns = (const char **)options->how.columns;

	uncertainties_find(found, options->uncertainty, columns, options->how.n_inputs,
			   options->paths, options->n_paths);
	if (found->n)
		check_weighed(options);
	for (int i = 0; i < found->n; i++)
		columns[options->how.n_inputs + 1 + i] = found->columns[i];
	options->how.averaged = options->rows.rate_hz > 0;
	options->how.parts = found->parts;
	options->how.n_parts = found->n;
	options->rows.uncertainty = found->n > 0;
}

/* The inputs that a haptic loop has besides the default ones, history first. */
static const char *const further[] = {"time_in_tissue_s", "mean_speed_mm_s", "deepest_mm",
				      "acceleration_mm_s2", "tilt_deg"};
#define HISTORY 3
#define FURTHER 5

/* They are tried for a model of the default search. */
static void choose_further(struct train_options *options)
{
	const char **columns = (const char **)options->how.columns +
			       options->how.n_inputs + 1 + options->how.n_parts;

	if (options->wanted || options->premises || options->mpi || options->n_mfs ||
	    options->auto_mfs || options->how.train.classic || options->sample >= 0 ||
	    !isnan(options->how.train.ridge) || !strcmp(options->model, "-"))
		return;
	memcpy(columns, further, sizeof(further));
	options->how.n_further = FURTHER;
}

/* --- the report ---------------------------------------------------------------------- */

/* A smaller ratio to a baseline's error may be by chance of the split. */
#define WORSE 1.02

/* A smaller share of repeated rows is by chance, and within the estimate of many. */
#define REPEATED 0.05

/* Pairs per parameter below which a model follows noise rather than tissue. */
#define PAIRS_PER_PARAMETER 3

/* Groups up to which Student's t makes an interval more than half as wide again. */
#define WIDE 4

/* Groups held out up to which the text has the error of each. */
#define NAMED 12

/* The unit of a column, from its name: force_N is in N. */
static const char *unit_of_train(const char *column)
{
	const char *score = strrchr(column, '_');

	return score ? score + 1 : "";
}

/* The root-mean-square error on the pairs of a group that are in the sample held out. */
static double group_rmse(const struct incise_trained *trained, int number)
{
	const struct incise_train_side *held =
		&incise_corpus_side(trained->corpus, true)->sample;
	size_t width = (size_t)held->pairs.n_inputs + 1;
	double sum = 0, n = 0;

	for (size_t i = 0; i < held->pairs.n; i++) {
		const double *x = held->pairs.rows + i * width;

		if (held->groups[i] != number)
			continue;
		sum += pow(incise_model_eval(trained->model, x, NULL) - x[width - 1], 2);
		n++;
	}
	return sqrt(sum / n);
}

/* The names of the groups that are held out, in the order of the sources, and the errors on them. */
static void find_held(const struct incise_trained *trained, json_t *names, json_t *errors)
{
	int n = incise_corpus_sources(trained->corpus), last = -1;
	const char *of = trained->group ? trained->group : "";

	for (int i = 0; i < n; i++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(trained->corpus, i);
		bool cut = n > 1 && !strcmp(of, "cut");

		for (int g = 0; g < survey->n_groups; g++) {
			const struct incise_corpus_group *group = &survey->groups[g];
			bool whole = !strcmp(of, "recording"); /* its text is a hash */
			char *name;

			/* Namesakes in other sources have the number of the first one. */
			if (!group->check || group->number <= last)
				continue;
			last = group->number;
			name = cli_text("%s %s%s%s", of,
					whole ? survey->name : group->name,
					cut ? " of " : "", cut ? survey->name : "");
			json_array_append_new(names, json_text(name));
			json_array_append_new(errors,
					      json_number(group_rmse(trained, last)));
			free(name);
		}
	}
}

/* A number in the unit of the target, which ends its key. */
static void set_in_unit(json_t *object, const char *name,
			const struct train_options *options, double value)
{
	const char *unit = unit_of_train(options->target);
	char key[80];

	snprintf(key, sizeof(key), "%s%s%.50s", name, *unit ? "_" : "", unit);
	json_set_number(object, key, value);
}

static json_t *error_object(const struct train_options *options, double rmse, double r2,
			    uint64_t pairs)
{
	const char *unit = unit_of_train(options->target);
	json_t *object = json_object();
	char key[80];

	set_in_unit(object, "rms_error", options, rmse);
	/* The name up to 0.1, on which scripts lean. */
	set_in_unit(object, "rmse", options, rmse);
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
static json_t *warnings(const struct train_options *options,
			const struct incise_trained *trained)
{
	const struct incise_corpus_side *fit = incise_corpus_side(trained->corpus, false);
	const struct incise_model *model = trained->model;
	const struct incise_train_report *report = &trained->report;
	const struct incise_baselines *baselines = &trained->baselines;
	const uint64_t rows = trained->pairs + trained->check_pairs;
	const uint64_t pairs = fit->different;
	const double rmse = options->how.check ? report->check_rmse : report->train_rmse;
	const struct {
		const char *name;
		double rmse;
	} others[] = {
		{"the mean", baselines->mean},
		{"linear regression", baselines->linear},
		{"k nearest neighbours", baselines->knn},
	};
	/* With classic the check data chose the epoch: they were seen. */
	const char *data = !options->how.check		? "its own"
			   : options->how.train.classic ? "the check"
							: "unseen";
	const struct incise_variable *out = (&incise_model_info(model)->output);
	/* Some hundred roundings of a double. */
	double rounding = 1e-13 * fmax(fabs(out->min), fabs(out->max));
	json_t *list = json_array();

	if (options->how.group && fit->n_groups == 1 && !options->how.check)
		warn(list,
		     "--group %s: all pairs are of one group, so none is held out whole; "
		     "give another column, or none",
		     trained->group);
	if (trained->repeated > REPEATED * (double)rows)
		warn(list,
		     "%llu of %llu rows repeat another row, and count once as pairs",
		     (unsigned long long)trained->repeated, (unsigned long long)rows);
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
	if (trained->check_outside)
		warn(list,
		     "%llu pairs held out are a whole range or more outside the training "
		     "pairs, and are left out of the check",
		     (unsigned long long)trained->check_outside);
	if (pairs < (size_t)PAIRS_PER_PARAMETER * report->parameters)
		warn(list,
		     "%llu training pairs for %d parameters: the model may overfit; "
		     "record at least %d pairs for %d rules, or use fewer (--mf)",
		     (unsigned long long)pairs, report->parameters,
		     PAIRS_PER_PARAMETER * report->parameters,
		     incise_model_info(model)->n_rules);
	return list;
}

static json_t *propagated_json(const struct train_options *options,
			       const struct incise_propagation_report *r)
{
	json_t *object;

	if (!options->how.n_parts)
		return json_null();
	object = json_pack("{sf si si}", "least_weight", r->weight, "recordings",
			   r->recordings, "calibrations", r->calibrations);
	set_in_unit(object, "own", options, r->own);
	set_in_unit(object, "calibration", options, r->calibration);
	set_in_unit(object, "rig", options, r->rig);
	return object;
}

static void report_train_json(const struct train_options *options,
			      const struct incise_trained *trained,
			      const struct incise_texture *texture, json_t *warned)
{
	const struct incise_model *model = trained->model;
	const struct incise_train_report *report = &trained->report;
	const struct incise_baselines *baselines = &trained->baselines;
	json_t *object = json_object(), *unfired = json_array(), *mfs = json_array();
	json_t *names = json_array(), *errors = json_array();
	const char *unit = unit_of_train(options->target);
	char key[80];

	snprintf(key, sizeof(key), "check_names_rms_error%s%.50s", *unit ? "_" : "",
		 unit);
	json_set_integer(object, "pairs", trained->pairs + trained->check_pairs);
	json_set_integer(object, "left_out", trained->left_out);
	json_set_integer(object, "repeated", trained->repeated);
	json_object_set_new(object, "group",
			    trained->group ? json_text(trained->group) : json_null());
	json_object_set_new(object, "train",
			    error_object(options, report->train_rmse, report->train_r2,
					 trained->pairs));
	json_object_set_new(object, "check",
			    options->how.check
				    ? error_object(options, report->check_rmse,
						   report->check_r2, trained->check_pairs)
				    : json_null());
	json_object_set_new(
		object, "baselines",
		json_pack("{sososo}", "mean",
			  error_object(options, baselines->mean, 0, 0), "linear",
			  error_object(options, baselines->linear, 0, 0), "knn",
			  error_object(options, baselines->knn, 0, 0)));
	json_set_integer(object, "knn_k", baselines->k);
	json_set_integer(object, "train_groups",
			 incise_corpus_side(trained->corpus, false)->n_groups);
	json_set_integer(object, "check_groups",
			 incise_corpus_side(trained->corpus, true)->n_groups);
	find_held(trained, names, errors);
	json_object_set_new(object, "check_names", names);
	json_object_set_new(object, key, errors);
	json_set_integer(object, "rules", incise_model_info(model)->n_rules);
	json_set_integer(object, "parameters", report->parameters);
	json_set_integer(object, "epochs", report->epochs);
	json_set_integer(object, "best_epoch", report->best_epoch);
	json_set_number(object, "ridge", report->ridge);
	json_set_number(object, "condition", report->condition);
	json_set_integer(object, "rules_unfired", report->rules_unfired);
	for (int r = 0; r < incise_model_info(model)->n_rules; r++)
		if (report->unfired[r])
			json_array_append_new(unfired, json_integer(r + 1));
	json_object_set_new(object, "unfired_rules", unfired);
	for (int i = 0; i < options->how.n_inputs; i++)
		json_array_append_new(mfs,
				      json_integer(incise_model_info(model)->n_mfs[i]));
	json_object_set_new(object, "mf", mfs);
	json_set_integer(object, "pairs_tuned", report->pairs_tuned);
	json_set_integer(object, "clamped", trained->clamped);
	set_in_unit(object, "crossval_rms_error", options, report->crossval_rmse);
	set_in_unit(object, "crossval_plane_rms_error", options, report->crossval_plane);
	set_in_unit(object, "crossval_mean_rms_error", options, report->crossval_mean);
	set_in_unit(object, "crossval_quadratic_rms_error", options,
		    report->crossval_quadratic);
	json_object_set_new(object, "better_inputs",
			    trained->better
				    ? json_pack("[sss]", options->inputs[0],
						options->inputs[1], trained->better)
				    : json_null());
	set_in_unit(object, "better_inputs_rms_error", options,
		    trained->better ? trained->better_rmse : NAN);
	set_in_unit(object, "noise", options, trained->noise);
	json_set_number(object, "interval95_coverage", trained->coverage);
	json_object_set_new(object, "interval95_thirds",
			    json_numbers(trained->thirds, 3));
	json_set_number(object, "interval95_least_group", trained->least);
	json_set_number(object, "low_end", trained->end[0]);
	json_set_number(object, "low_end_bias", trained->end_bias[0]);
	json_set_number(object, "high_end", trained->end[1]);
	json_set_number(object, "high_end_bias", trained->end_bias[1]);
	json_object_set_new(object, "uncertainty",
			    propagated_json(options, &trained->propagated));
	json_object_set_new(object, "texture", texture_json(texture));
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

/* The error of each group that is held out, unless they are many. */
static void print_held(const struct incise_trained *trained, const char *unit)
{
	json_t *names = json_array(), *errors = json_array(), *name;
	size_t i;

	find_held(trained, names, errors);
	json_array_foreach(names, i, name) if (json_array_size(names) <= NAMED &&
					       json_is_real(json_array_get(errors, i)))
		printf("  %-36s%12.5g %s\n", json_string_value(name),
		       json_number_value(json_array_get(errors, i)), unit);
	json_decref(names);
	json_decref(errors);
}

/* The law that the model is, or the kind of its penalty. */
static const char *name_penalty(const struct train_options *options,
				const struct incise_train_report *report)
{
	if (options->how.train.classic || !isnan(options->how.train.ridge))
		return "ridge";
	return report->crossval_rmse == report->crossval_quadratic
		       ? "near a quadratic, penalty"
	       : report->crossval_rmse == report->crossval_plane ? "plane, penalty"
	       : report->crossval_rmse == report->crossval_mean	 ? "mean, penalty"
								 : "penalty";
}

/* Print the gain with a further input, and the command that replaces this model. */
static void print_better(const struct train_options *options,
			 const struct incise_trained *trained)
{
	bool history = true;

	if (!trained->better)
		return;
	for (int i = HISTORY; i < FURTHER; i++)
		history &= trained->better != further[i];
	printf("with %s the cross-validated error is %.4g %s, %.0f %% less%s: "
	       "%s --inputs %s,%s,%s%s%s\n",
	       trained->better, trained->better_rmse, unit_of_train(options->target),
	       100 * (1 - trained->better_rmse / trained->report.crossval_rmse),
	       history ? " (it may only reflect how the hand moved in these cuts)" : "",
	       options->typed ? "incise train" : "give", options->inputs[0],
	       options->inputs[1], trained->better,
	       cli_overwrite() || !options->typed ? "" : " --overwrite",
	       options->typed ? options->typed : "");
}

static void print_clamped(const struct incise_trained *trained)
{
	size_t n = incise_corpus_side(trained->corpus, false)->sample.pairs.n;

	if (trained->clamped)
		printf("%llu of %zu pairs are outside the ranges of the model, and count "
		       "as their nearest ends\n",
		       (unsigned long long)trained->clamped, n);
}

static void report_train_text(const struct train_options *options,
			      const struct incise_trained *trained,
			      const struct incise_texture *texture)
{
	const struct incise_model *model = trained->model;
	const struct incise_corpus_side *fit = incise_corpus_side(trained->corpus, false);
	const struct incise_corpus_side *held = incise_corpus_side(trained->corpus, true);
	const struct incise_train_report *report = &trained->report;
	const struct incise_baselines *baselines = &trained->baselines;
	const char *first = incise_model_info(model)->input[0].name;
	const double *third = trained->thirds;
	bool check = options->how.check > 0;
	bool cuts = trained->group && !strcmp(trained->group, "cut");
	const char *group = cuts ? "cut" : "group";
	const char *unseen = options->how.train.classic ? "check"
			     : cuts			? "unseen cuts"
			     : trained->group		? "unseen groups"
							: "unseen pairs";
	const char *unit = unit_of_train(options->target);
	char knn[40], head[30];

	printf("%s: %s to train", options->data, cli_count(trained->pairs, "pair"));
	if (trained->group)
		printf(" (%s)", cli_count(fit->n_groups, group));
	if (check)
		printf(", %llu to check", (unsigned long long)trained->check_pairs);
	if (check && trained->group)
		printf(" (%s)", cli_count(held->n_groups, group));
	if (trained->left_out)
		printf("\nleft out %llu of %llu rows: the blade did not advance",
		       (unsigned long long)trained->left_out,
		       (unsigned long long)(trained->left_out + trained->pairs +
					    trained->check_pairs));
	if (trained->group && !options->how.group)
		printf("\ngrouped by %s, as no --group is given (none: each pair by itself)",
		       trained->group);
	printf("\n");
	print_clamped(trained);
	printf("%s, %s, ", cli_count(incise_model_info(model)->n_rules, "rule"),
	       cli_count(report->parameters, "parameter"));
	if (options->how.train.classic)
		printf("%s (kept %d), ", cli_count(report->epochs, "epoch"),
		       report->best_epoch);
	printf("%s %g", name_penalty(options, report), report->ridge);
	if (isfinite(report->condition))
		printf(", condition %.2g", report->condition);
	printf("\n");
	snprintf(head, sizeof(head), "RMSE%s%.20s", *unit ? ", " : "", unit);
	printf("  %-22s%12s%14s\n", head, "training", check ? unseen : "");
	print_row("this model", report->train_rmse, report->check_rmse);
	snprintf(knn, sizeof(knn), "%d nearest", baselines->k);
	print_row("mean", check ? NAN : baselines->mean, check ? baselines->mean : NAN);
	print_row("linear regression", check ? NAN : baselines->linear,
		  check ? baselines->linear : NAN);
	print_row(knn, check ? NAN : baselines->knn, check ? baselines->knn : NAN);
	print_row("MSE of this model", pow(report->train_rmse, 2),
		  pow(report->check_rmse, 2));
	print_row("R² of this model", report->train_r2, report->check_r2);
	print_held(trained, unit);
	if (isfinite(report->crossval_rmse))
		printf("  cross-validated: %.5g", report->crossval_rmse);
	if (isfinite(report->crossval_quadratic))
		printf(", quadratic %.5g", report->crossval_quadratic);
	if (isfinite(report->crossval_plane))
		printf(", linear %.5g, mean %.5g", report->crossval_plane,
		       report->crossval_mean);
	if (isfinite(report->crossval_rmse))
		printf("%s%s\n", *unit ? " " : "", unit);
	printf("  95 %% interval: noise %.4g %s", trained->noise, unit);
	if (trained->group && fit->n_groups <= WIDE)
		printf(" (wide: only %s)", cli_count(fit->n_groups, group));
	if (check)
		printf(", holds %.1f %% of the %s", 100 * trained->coverage, unseen);
	if (check && isfinite(third[0] + third[1] + third[2]))
		printf(" (%.0f, %.0f and %.0f %% of the thirds by %s)", 100 * third[0],
		       100 * third[1], 100 * third[2], first);
	if (check && isfinite(trained->least))
		printf(", %.0f %% of the worst %s", 100 * trained->least, trained->group);
	printf("\n");
	for (int high = 0; high < 2; high++)
		if (isfinite(trained->end_bias[high]))
			printf("  bias where %s is %s %.3g: %+.2g %% of the mean\n",
			       first, high ? "above" : "below", trained->end[high],
			       100 * trained->end_bias[high]);
	if (options->how.n_parts)
		printf("  uncertainties: own parts %.3g %s; calibrations %.3g %s on the "
		       "model, %.3g %s of another rig\n",
		       trained->propagated.own, unit_of_train(options->target),
		       trained->propagated.calibration, unit_of_train(options->target),
		       trained->propagated.rig, unit_of_train(options->target));
	if (report->pairs_tuned && report->pairs_tuned < fit->different)
		printf("  penalty from a random %zu of the pairs, consequents from all\n",
		       report->pairs_tuned);
	print_better(options, trained);
	if (options->how.smooth && incise_model_info(model)->n_mfs[1] == 2)
		printf("few membership functions, as a smooth model leaves more to the "
		       "texture; --mf sets others\n");
	if (texture)
		texture_print(texture);
	cli_written();
}

/* --- all of it ----------------------------------------------------------------------- */

/* A signal ends the program at once but while its outputs, which belong together, get their names. */
static void hold_signals(int how)
{
	sigset_t set;

	sigemptyset(&set);
	sigaddset(&set, SIGINT);
	sigaddset(&set, SIGTERM);
	sigaddset(&set, SIGHUP);
	sigprocmask(how, &set, NULL);
}

static void run_training(struct train_options *options,
			 struct incise_train_source *sources,
			 struct incise_trained *trained, struct incise_outfile **history)
{
	const char *output = options->factor ? options->factor : options->model;
	static struct show show; /* the texture is learned with it, too */
	struct incise_error err = {0};
	bool pipe = false;
	char *progress;
	int rc;

	show.options = options;
	for (int i = 0; i < options->n_paths; i++)
		pipe |= source_is_pipe(&sources[i]);
	progress = pipe ? NULL : path_beside(output, ".progress");
	if (options->history) {
		show.history = whole_file_begin(options->history, history);
		fprintf(show.history, "epoch,train_rmse,check_rmse\n");
	}
	options->how.progress = progress;
	options->how.ranks = job;
	options->how.train.progress = show_step;
	options->how.train.user = &show;
	rc = incise_train_sources(sources, options->n_paths, &options->how, trained,
				  &err);
	cli_progress_end();
	free(progress);
	alone = !trained->shared;
	if (!rc)
		return;
	incise_outfile_abort(*history);
	cli_fail_with(&err);
}

static void save_factor(const struct train_options *options,
			const struct incise_trained *trained)
{
	struct incise_factor *factor = trained->factor;
	struct incise_factor_info info;
	struct incise_error err = {0};

	cli_check(incise_factor_save(factor, options->factor, &err), &err);
	incise_factor_info(factor, &info);
	if (!strcmp(options->factor, "-"))
		return;
	printf("%s: %s of %s, premises %.12s\n", options->data,
	       cli_count(info.rows, "pair"), cli_count(info.groups, "group"),
	       info.premises);
	print_clamped(trained);
	if (info.parts < INCISE_FACTOR_FOLDS)
		printf("%d of %d parts, as small ones would reveal their pairs: a merge "
		       "%s\n",
		       info.parts, INCISE_FACTOR_FOLDS,
		       info.parts > 1 ? "cross-validates over these"
				      : "with it cannot cross-validate; add sources, or "
					"give incise merge --ridge");
	cli_written();
}

/* Learn the texture, if one is asked for; NULL also where the model alone is as good. */
static struct incise_texture *train_texture(const struct train_options *options,
					    struct incise_train_source *sources,
					    const struct incise_trained *trained)
{
	struct incise_texture *texture;
	struct incise_error err = {0};

	if (!options->texture)
		return NULL;
	texture = incise_train_texture(sources, options->n_paths, trained,
				       &options->how.train, NULL, &err);
	cli_progress_end();
	if (!texture && err.code == EDOM) {
		cli_warn("%s", err.text);
		return NULL;
	}
	return cli_require(texture, &err);
}

/* Learn and save the texture of the model that its path names. */
static void train_texture_alone(const struct train_options *options)
{
	char *path = cli_text("%.*s", (int)strlen(options->tex) - 4, options->tex);
	struct incise_train_source *sources =
		sources_new(options->paths, options->n_paths, &options->rows);
	struct incise_error err = {0};
	struct incise_trained trained = {
		.model = cli_require(incise_model_load(path, &err), &err)};
	struct incise_texture *texture = train_texture(options, sources, &trained);

	if (texture)
		cli_check(incise_texture_save(texture, options->tex, &err), &err);
	if (options->json) {
		json_print(json_pack("{so ss?}", "texture", texture_json(texture),
				     "texture_file", texture ? options->tex : NULL));
	} else if (texture) {
		texture_print(texture);
		cli_written();
	}
	incise_texture_free(texture);
	incise_trained_free(&trained);
	sources_free(sources, options->n_paths);
	free(path);
}

static void save_model(const struct train_options *options,
		       const struct incise_trained *trained,
		       const struct incise_texture *texture,
		       struct incise_outfile *history)
{
	char *sd = path_beside(options->model, ".sd");
	char *tex = path_beside(options->model, ".tex");
	struct incise_texture *old = NULL;
	struct incise_error err = {0};

	hold_signals(SIG_BLOCK);
	if ((options->initial &&
	     incise_model_save(trained->initial, options->initial, &err)) ||
	    incise_model_save_notes(trained->model, options->model, trained->notes,
				    &err) ||
	    (sd && incise_uncertainty_save(trained->uncertainty, sd, &err)) ||
	    (texture && incise_texture_save(texture, tex, &err)))
		cli_fail_with(&err);
	whole_file_end(history);
	hold_signals(SIG_UNBLOCK);
	if (tex && !texture && !access(tex, F_OK) &&
	    !(old = incise_texture_load(tex, trained->model, &err)))
		cli_warn(
			"%s is not of this model, and is refused with it; learn it again "
			"with --texture, or remove it",
			tex);
	incise_texture_free(old);
	free(sd);
	free(tex);
}

static void report_model(const struct train_options *options,
			 const struct incise_trained *trained,
			 const struct incise_texture *texture)
{
	json_t *warned = warnings(options, trained);

	if (options->json)
		report_train_json(options, trained, texture, warned);
	else if (strcmp(options->model, "-"))
		report_train_text(options, trained, texture);
	if (!options->json)
		json_decref(warned);
}

int main(int argc, char **argv)
{
	const char *columns[INCISE_MODEL_INPUTS_MAX + 1 + INCISE_BUDGET_PARTS + FURTHER];
	struct incise_model *premises = NULL;
	struct incise_train_source *sources;
	struct incise_texture *texture = NULL;
	struct incise_outfile *history = NULL;
	struct uncertainties uncertainties;
	struct incise_trained trained;
	struct train_options options;
	char *data;

	parse_train(&options, argc, argv);
	if (options.tex) {
		check_writable(options.tex);
		train_texture_alone(&options);
		cli_finish();
		return 0;
	}
	if (options.mpi)
		join_job();
	if (!job || !job->rank) {
		check_writable(options.model);
		check_writable(options.factor);
		check_writable(options.initial);
		check_writable(options.history);
	}
	if (options.premises)
		options.how.premises = premises = load_premises(options.premises);
	choose_columns(&options, columns);
	choose_uncertainties(&options, &uncertainties);
	choose_further(&options);
	if (job && job->size == 1)
		cli_warn(
			"--share mpi: a single process; start several by 'mpirun -n N incise "
			"train …'");
	sources = sources_new(options.paths, options.n_paths, &options.rows);
	data = cli_text("%d sources", options.n_paths);
	options.data = options.n_paths > 1	 ? data
		       : source_is_pipe(sources) ? options.paths[0]
						 : sources[0].name;
	run_training(&options, sources, &trained, &history);
	if (options.factor && trained.factor && (!job || !job->rank)) {
		save_factor(&options, &trained);
	} else if (trained.model) {
		texture = train_texture(&options, sources, &trained);
		save_model(&options, &trained, texture, history);
		report_model(&options, &trained, texture);
	}
	cli_finish();
	incise_texture_free(texture);
	incise_trained_free(&trained);
	incise_model_free(premises);
	sources_free(sources, options.n_paths);
	free(data);
	free(options.typed);
	return 0;
}
