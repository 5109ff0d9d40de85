// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench training: error on unseen cuts against the time that training takes.
 *
 * Data are of paper 1's size and made of a known truth: 12 cuts with 10 averaged pairs each,
 * every cut harder or softer as a whole, with noise; unseen cuts have the exact force.
 *
 *   F(d, v) = (0.045 d + 0.0028 d²) (1 + 0.35 v/(v + 15)) N, d in mm, v in mm/s
 */
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>
#include <incise/train.h>
#include "bench.h"
#include "../cli/child.h"
#include "../cli/file.h"
#include "noise.h"

#define EPOCHS 80
#define REPEATS 9
#define QUICK_REPEATS 1
#define SEEDS 9
#define QUICK_SEEDS 2
#define ROWS_MAX 40

/* --- data --- */

#define DEPTH_mm 20
#define SPEED_mm_s 50
#define PAIRS 120
#define PER_CUT 10
#define HARDER 0.05  /* sd of a cut's factor */
#define NOISE_N 0.02 /* sd of a pair */
#define UNSEEN_CUTS 20
#define UNSEEN 1200

struct data {
	double row[PAIRS][3]; /* depth_mm, velocity_mm_s, force_N */
	int group[PAIRS];     /* its cut */
};

static double truth_N(double depth_mm, double speed_mm_s)
{
	return depth_mm * (0.045 + 0.0028 * depth_mm) *
	       (1 + 0.35 * speed_mm_s / (speed_mm_s + 15));
}

/* Near enough to a normal distribution, of sd 1. */
static double spread(uint64_t *state)
{
	double sum = -6;

	for (int i = 0; i < 12; i++)
		sum += lcg_uniform(state);
	return sum;
}

static void make_data(struct data *data, uint64_t seed)
{
	uint64_t state = seed * 0x9e3779b97f4a7c15;
	double harder = 1;

	for (int i = 0; i < PAIRS; i++) {
		double *row = data->row[i];

		if (i % PER_CUT == 0)
			harder = 1 + HARDER * spread(&state);
		row[0] = DEPTH_mm * lcg_uniform(&state);
		row[1] = SPEED_mm_s * lcg_uniform(&state);
		row[2] = harder * truth_N(row[0], row[1]) + NOISE_N * spread(&state);
		data->group[i] = i / PER_CUT;
	}
}

static void make_unseen(double row[UNSEEN][3])
{
	const int points = UNSEEN / UNSEEN_CUTS;

	for (int i = 0; i < UNSEEN; i++) {
		double cut = (i / points + 0.5) / UNSEEN_CUTS,
		       along = (i % points + 0.5) / points;

		/* A hand sinks in a little, and is fast in the middle. */
		row[i][0] = DEPTH_mm * (0.03 + 0.9 * cut + 0.05 * along);
		row[i][1] = SPEED_mm_s * (0.5 - 0.48 * cos(2 * M_PI * (along + cut)));
		row[i][2] = truth_N(row[i][0], row[i][1]);
	}
}

/* --- rows --- */

/* Norms of the error on unseen cuts, N. */
enum norm { NORM_RMSE, NORM_MAX, NORM_MEAN, NORMS };

struct row {
	char name[40];
	bool classic, chosen; /* chosen: the training selects its grid */
	int epochs, mfs[2], rules;
	bool is_baseline, is_reference;
	const struct data *timed;

	double norm[NORMS][SEEDS];
	struct harness_spread spread[NORMS]; /* of these over the data sets */
	struct harness_time time;
	char failed[200];
};

struct training {
	struct row row[ROWS_MAX];
	int n, seeds, repeats;
	struct data data[SEEDS];
	double unseen[UNSEEN][3];
};

static struct row *add(struct training *t, struct row row)
{
	if (t->n == ROWS_MAX)
		cli_fail("training: more than %d rows", ROWS_MAX);
	row.rules = row.mfs[0] * row.mfs[1];
	t->row[t->n] = row;
	return &t->row[t->n++];
}

static void add_grid(struct training *t, bool classic, int epochs, int a, int b,
		     const char *suffix)
{
	struct row row = {.classic = classic, .epochs = epochs, .mfs = {a, b}};

	snprintf(row.name, sizeof(row.name), "%s%s", classic ? "classic" : "default",
		 suffix);
	add(t, row);
}

static void add_all(struct training *t, bool quick)
{
	static const int epochs[] = {1, 2, 5, 10, 20, 40};
	static const int grids[][2] = {{3, 3}, {2, 2}, {4, 3}};
	char suffix[20];

	add_grid(t, true, EPOCHS, 5, 4, "");
	add_grid(t, false, EPOCHS, 5, 4, "");
	for (int i = 0; i < N(epochs); i++) {
		snprintf(suffix, sizeof(suffix), "_%d", epochs[i]);
		add_grid(t, true, epochs[i], 5, 4, suffix);
	}
	for (int i = 0; i < (quick ? 1 : N(grids)); i++) {
		snprintf(suffix, sizeof(suffix), "_%dx%d", grids[i][0], grids[i][1]);
		add_grid(t, true, EPOCHS, grids[i][0], grids[i][1], suffix);
		add_grid(t, false, EPOCHS, grids[i][0], grids[i][1], suffix);
	}
	add(t, (struct row){.name = "default_chosen", .chosen = true, .epochs = EPOCHS});
}

/* --- methods --- */

static struct incise_model *train(const struct row *row, const struct data *data)
{
	static const struct incise_variable variables[] = {{"depth_mm", 0, DEPTH_mm},
							   {"velocity_mm_s", 0,
							    SPEED_mm_s},
							   {"force_N", 0, 3}};
	static const char *const names[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_pairs pairs = {.rows = data->row[0], .n = PAIRS, .n_inputs = 2};
	struct incise_train_options options;
	int mfs[2] = {row->mfs[0], row->mfs[1]};
	struct incise_error err = {0};
	struct incise_model *model;

	incise_train_options_init(&options);
	options.classic = row->classic;
	options.epochs = row->epochs;
	options.groups = data->group;
	options.ranges = variables;
	if (row->chosen)
		model = incise_train_start(&pairs, names, INCISE_MF_GAUSS, mfs, &options,
					   &err);
	else
		model = incise_model_new_grid(2, variables, mfs, INCISE_MF_GAUSS,
					      &variables[2], &err);
	cli_require(model, &err);
	cli_check(incise_train(model, &pairs, NULL, &options, NULL, &err), &err);
	return model;
}

/* --- measurement --- */

static void measure_error(const struct training *t, struct row *row, int seed)
{
	struct incise_model *model = train(row, &t->data[seed]);
	double square = 0, sum = 0, largest = 0;

	for (int i = 0; i < UNSEEN; i++) {
		const double *pair = t->unseen[i];
		double error = fabs(incise_model_eval(model, pair, NULL) - pair[2]);

		square += error * error;
		sum += error;
		largest = fmax(largest, error);
	}
	incise_model_free(model);
	row->norm[NORM_RMSE][seed] = sqrt(square / UNSEEN);
	row->norm[NORM_MAX][seed] = largest;
	row->norm[NORM_MEAN][seed] = sum / UNSEEN;
}

static void run_timed(void *context)
{
	const struct row *row = context;

	incise_model_free(train(row, row->timed));
}

static void measure(struct training *t)
{
	for (int i = 0; i < t->n; i++) {
		cli_progress("training: %s", t->row[i].name);
		for (int s = 0; s < t->seeds; s++)
			measure_error(t, &t->row[i], s);
		t->row[i].timed = &t->data[0];
	}
}

static struct row *add_baseline(struct training *t, const char *name)
{
	struct row *row = add(t, (struct row){.is_baseline = true});

	snprintf(row->name, sizeof(row->name), "%s", name);
	harness_time_of(NULL, 0, &row->time);
	return row;
}

/* The library's, which incise train prints next to each model. */
static void add_baselines(struct training *t)
{
	struct row *mean = add_baseline(t, "mean"), *linear = add_baseline(t, "linear"),
		   *knn = add_baseline(t, "knn");
	const struct incise_pairs unseen = {
		.rows = t->unseen[0], .n = UNSEEN, .n_inputs = 2};

	for (int s = 0; s < t->seeds; s++) {
		const struct incise_pairs pairs = {
			.rows = t->data[s].row[0], .n = PAIRS, .n_inputs = 2};
		struct incise_baselines found;
		struct incise_error err = {0};

		cli_check(incise_baselines(&pairs, t->data[s].group, &unseen, NULL, NULL,
					   &found, &err),
			  &err);
		mean->norm[NORM_RMSE][s] = found.mean;
		linear->norm[NORM_RMSE][s] = found.linear;
		knn->norm[NORM_RMSE][s] = found.knn;
	}
}

/* --- scikit-learn on the same data, in a process of its own; it is not installed --- */

#define WAIT_S 120
#define ABSENT 3 /* exit status of the script where there is no scikit-learn */

static json_t *rows_json(const double (*row)[3], int n)
{
	json_t *list = json_array();

	for (int i = 0; i < n; i++)
		json_array_append_new(list, json_pack("[fff]", row[i][0], row[i][1],
						      row[i][2]));
	return list;
}

/* Run the script by one Python; its answer, or NULL with the reason. */
static json_t *ask(const char *python, const char *script, const char *question,
		   char *why, size_t size)
{
	char *argv[] = {(char *)python, (char *)script, (char *)question, NULL};
	struct memory_file answer = memory_file_begin("answer");
	json_t *got = NULL;
	int status;

	if (!child_possible(python)) {
		snprintf(why, size, "%s is not installed", python);
	} else if (access(script, R_OK)) {
		snprintf(why, size, "runs from the build tree only");
	} else {
		status = child_end(child_start(argv, fileno(answer.file), -1), WAIT_S);
		rewind(answer.file);
		if (WIFEXITED(status) && WEXITSTATUS(status) == ABSENT)
			snprintf(why, size,
				 "scikit-learn is not installed: apt-get install "
				 "python3-sklearn");
		else if (status)
			snprintf(why, size, "scikit-learn failed: status %d", status);
		else if (!(got = json_loadf(answer.file, 0, NULL)))
			snprintf(why, size, "scikit-learn's answer is no JSON");
	}
	fclose(answer.file);
	return got;
}

/* The answer for all data sets, or NULL with the reason. */
static json_t *ask_all(const struct training *t, char *why, size_t size)
{
	/* The first in PATH may be another than the system's, which has its packages. */
	static const char *const pythons[] = {"python3", "/usr/bin/python3"};
	struct memory_file question = memory_file_begin("question");
	json_t *all = json_object(), *sets = json_array(), *answer = NULL;
	char *script = cli_text("%s/../lib/incise/peer_scikit_learn.py", cli_folder());

	for (int s = 0; s < t->seeds; s++)
		json_array_append_new(sets, rows_json(t->data[s].row, PAIRS));
	json_object_set_new(all, "train", sets);
	json_object_set_new(all, "unseen", rows_json(t->unseen, UNSEEN));
	if (json_dumpf(all, question.file, 0))
		cli_fail("no memory");
	memory_file_written(&question);
	for (int i = 0; i < N(pythons) && !answer; i++)
		answer = ask(pythons[i], script, question.path, why, size);
	/* A Python that failed is no failure if another one answered. */
	if (answer)
		*why = 0;
	json_decref(all);
	free(script);
	fclose(question.file);
	return answer;
}

static void add_references(struct training *t)
{
	static const char *const names[] = {"gaussian_process", "neural_network",
					    "kernel_ridge"};
	static const char *const norms[NORMS] = {"rmse", "max", "mean"};
	char why[sizeof(t->row->failed)] = "";
	json_t *answer = ask_all(t, why, sizeof(why));

	for (int i = 0; i < N(names); i++) {
		struct row *row = add(t, (struct row){.is_reference = true});
		double ns[SEEDS];

		snprintf(row->name, sizeof(row->name), "%s", names[i]);
		snprintf(row->failed, sizeof(row->failed), "%s", why);
		for (int s = 0; answer && s < t->seeds; s++) {
			const json_t *one = json_array_get(
				json_object_get(answer, row->name), (size_t)s);

			ns[s] = json_number_value(json_object_get(one, "seconds")) * 1e9;
			for (int k = 0; k < NORMS; k++)
				row->norm[k][s] =
					json_number_value(json_object_get(one, norms[k]));
			if (!(row->norm[NORM_RMSE][s] > 0))
				snprintf(row->failed, sizeof(row->failed),
					 "scikit-learn gave no figure");
		}
		harness_time_of(ns, *row->failed ? 0 : t->seeds, &row->time);
	}
	json_decref(answer);
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name),
		    COLUMN(row, "epochs", epochs, .optional = true),
		    COLUMN(row, "rules", rules, .optional = true),
		    COLUMN(row, "ms", time.ns.median, .scale = 1e-6),
		    COLUMN(row, "ms_min", time.ns.min, .scale = 1e-6),
		    COLUMN(row, "ms_max", time.ns.max, .scale = 1e-6),
		    COLUMN(row, "seconds", time.ns.median, .scale = 1e-9),
		    COLUMN(row, "rms_error_N", spread[NORM_RMSE].median),
		    COLUMN(row, "rms_error_N_min", spread[NORM_RMSE].min),
		    COLUMN(row, "rms_error_N_max", spread[NORM_RMSE].max),
		    COLUMN(row, "max_error_N", spread[NORM_MAX].median),
		    COLUMN(row, "max_error_N_max", spread[NORM_MAX].max),
		    COLUMN(row, "mean_abs_error_N", spread[NORM_MEAN].median),
		    COLUMN(row, "peer", is_reference), COLUMN(row, "failed", failed)},
	.metrics = {METRIC(TIME, row, time, "ms", "{name}", "peer=0"),
		    METRIC(EXACT, row, spread[NORM_RMSE].median, "N",
			   "{name} error on unseen cuts", "peer=0")},
};

static void run_training(struct bench_run *run)
{
	struct training *t = cli_alloc(1, sizeof(*t));

	t->seeds = run->quick ? QUICK_SEEDS : SEEDS;
	t->repeats = run->quick ? QUICK_REPEATS : REPEATS;
	for (int s = 0; s < t->seeds; s++)
		make_data(&t->data[s], (uint64_t)s + 1);
	make_unseen(t->unseen);
	add_all(t, run->quick);
	measure(t);
	bench_times(&rows_table, t->row, t->n, run_timed, 1, t->repeats);
	add_baselines(t);
	add_references(t);
	for (int i = 0; i < t->n; i++) {
		struct row *row = &t->row[i];
		int n = *row->failed ? 0 : t->seeds;

		for (int k = 0; k < NORMS; k++)
			harness_spread(row->norm[k],
				       row->is_baseline && k != NORM_RMSE ? 0 : n,
				       &row->spread[k]);
	}
	bench_values(run, "{si si si si}", "pairs", PAIRS, "epochs", EPOCHS, "repeats",
		     t->repeats, "seeds", t->seeds);
	bench_rows(run, &rows_table, t->row, t->n);
}

const struct bench bench_training = {
	.name = "training",
	.summary = "error on unseen cuts over the training time",
	.run = run_training,
};
