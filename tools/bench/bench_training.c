// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error on unseen cuts over the time of training, by method; see bench_training.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/train.h>
#include "bench_training.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"
#include "training_data.h"
#include "training_peer.h"

#define EPOCHS 80
#define REPEATS 9
#define QUICK_REPEATS 1
#define SEEDS 9
#define QUICK_SEEDS 2
#define ROWS_MAX 40

enum kind { KIND_BASELINE, KIND_CLASSIC, KIND_DEFAULT, KIND_PEER, KINDS };
static const char *const kind_titles[KINDS] = {"baselines", "classic ANFIS by epochs",
					       "the default of incise", "scikit-learn"};

/* What is learnt by a method: a model of a grid, or one of the baselines. */
struct method {
	char name[40];
	enum kind kind;
	enum { FIT_MEAN, FIT_LINEAR, FIT_KNN, FIT_MODEL, FIT_CHOSEN } fit;
	int epochs, mfs[2];
};

/* Norms of the error on unseen cuts, N. */
enum norm { NORM_RMSE, NORM_MAX, NORM_MEAN, NORMS };

struct row {
	struct method method;
	double norm[NORMS][SEEDS];
	struct harness_time time;
	char failed[200];
};

struct bench {
	struct row row[ROWS_MAX];
	int n, seeds, repeats;
	struct training_data data[SEEDS];
	double unseen[TRAINING_UNSEEN][3];
	struct machine machine;
};

/* ---- methods ---- */

static void train(const struct method *method, const struct training_data *data,
		  struct incise_model **model)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50}};
	static const struct incise_variable out = {"force_N", 0, 3};
	struct incise_pairs pairs = {data->row[0], TRAINING_PAIRS, 2};
	struct incise_train_options options;
	int mfs[2] = {method->mfs[0], method->mfs[1]};
	struct incise_error err = {0};

	incise_train_options_init(&options);
	options.classic = method->kind == KIND_CLASSIC;
	options.epochs = method->epochs;
	options.groups = data->group;
	if (method->fit == FIT_CHOSEN &&
	    incise_train_choose_grid(&pairs, in, INCISE_MF_GAUSS, &options, mfs, &err))
		cli_fail_with(&err);
	*model = incise_model_new_grid(2, in, mfs, INCISE_MF_GAUSS, &out, &err);
	if (!*model || incise_train(*model, &pairs, NULL, &options, NULL, &err))
		cli_fail_with(&err);
}

/* A plane through the pairs: three normal equations, by Cramer's rule. */
static void fit_linear(const struct training_data *data, double p[3])
{
	double a[3][3] = {0}, b[3] = {0};

	for (int i = 0; i < TRAINING_PAIRS; i++) {
		const double x[3] = {1, data->row[i][0], data->row[i][1]};

		for (int r = 0; r < 3; r++) {
			b[r] += x[r] * data->row[i][2];
			for (int c = 0; c < 3; c++)
				a[r][c] += x[r] * x[c];
		}
	}
	for (int k = -1; k < 3; k++) {
		static double whole;
		double m[3][3], det;

		memcpy(m, a, sizeof(m));
		for (int r = 0; k >= 0 && r < 3; r++)
			m[r][k] = b[r];
		det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
		      m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
		      m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
		if (k < 0)
			whole = det;
		else
			p[k] = det / whole;
	}
}

static int fit_k(const struct training_data *data)
{
	struct incise_pairs pairs = {data->row[0], TRAINING_PAIRS, 2};
	struct incise_baselines baselines;
	struct incise_error err = {0};

	if (incise_baselines(&pairs, data->group, &pairs, &baselines, &err))
		cli_fail_with(&err);
	return baselines.k;
}

/* Mean of the k nearest; both inputs are spread evenly, so their ranges are the scales. */
static double nearest(const struct training_data *data, int k, const double *x)
{
	bool taken[TRAINING_PAIRS] = {false};
	double sum = 0;

	for (int n = 0; n < k; n++) {
		double best = INFINITY;
		int at = 0;

		for (int i = 0; i < TRAINING_PAIRS; i++) {
			double away = hypot((x[0] - data->row[i][0]) / 20,
					    (x[1] - data->row[i][1]) / 50);

			if (!taken[i] && away < best) {
				best = away;
				at = i;
			}
		}
		taken[at] = true;
		sum += data->row[at][2];
	}
	return sum / k;
}

/* What a method has learnt. */
struct learnt {
	struct incise_model *model;
	double p[3]; /* of a plane */
	int k;
};

static void learn(const struct method *method, const struct training_data *data,
		  struct learnt *learnt)
{
	*learnt = (struct learnt){0};
	switch (method->fit) {
	case FIT_MEAN:
		for (int i = 0; i < TRAINING_PAIRS; i++)
			learnt->p[0] += data->row[i][2] / TRAINING_PAIRS;
		break;
	case FIT_LINEAR:
		fit_linear(data, learnt->p);
		break;
	case FIT_KNN:
		learnt->k = fit_k(data);
		break;
	default:
		train(method, data, &learnt->model);
	}
}

static double predict(const struct learnt *learnt, const struct training_data *data,
		      const double *x)
{
	if (learnt->model)
		return incise_model_eval(learnt->model, x, NULL);
	if (learnt->k)
		return nearest(data, learnt->k, x);
	return learnt->p[0] + learnt->p[1] * x[0] + learnt->p[2] * x[1];
}

static void measure_errors(const struct bench *b, struct row *row, int seed)
{
	const struct training_data *data = &b->data[seed];
	double square = 0, sum = 0, largest = 0;
	struct learnt learnt;

	learn(&row->method, data, &learnt);
	for (int i = 0; i < TRAINING_UNSEEN; i++) {
		double error =
			fabs(predict(&learnt, data, b->unseen[i]) - b->unseen[i][2]);

		square += error * error;
		sum += error;
		largest = fmax(largest, error);
	}
	incise_model_free(learnt.model);
	row->norm[NORM_RMSE][seed] = sqrt(square / TRAINING_UNSEEN);
	row->norm[NORM_MAX][seed] = largest;
	row->norm[NORM_MEAN][seed] = sum / TRAINING_UNSEEN;
}

/* ---- the rows ---- */

static void add(struct bench *b, struct method method)
{
	if (b->n == ROWS_MAX)
		cli_fail("training: more than %d rows", ROWS_MAX);
	b->row[b->n++].method = method;
}

static void add_all(struct bench *b, bool quick)
{
	static const int epochs[] = {1, 2, 5, 10, 20, 40};
	static const int grids[][2] = {{3, 3}, {2, 2}, {4, 3}};

	add(b, (struct method){.name = "classic",
			       .kind = KIND_CLASSIC,
			       .fit = FIT_MODEL,
			       .epochs = EPOCHS,
			       .mfs = {5, 4}});
	add(b, (struct method){.name = "default",
			       .kind = KIND_DEFAULT,
			       .fit = FIT_MODEL,
			       .epochs = EPOCHS,
			       .mfs = {5, 4}});
	add(b, (struct method){.name = "mean", .fit = FIT_MEAN});
	add(b, (struct method){.name = "linear", .fit = FIT_LINEAR});
	add(b, (struct method){.name = "knn", .fit = FIT_KNN});
	for (size_t i = 0; i < sizeof(epochs) / sizeof(*epochs); i++) {
		struct method m = {.kind = KIND_CLASSIC,
				   .fit = FIT_MODEL,
				   .epochs = epochs[i],
				   .mfs = {5, 4}};

		snprintf(m.name, sizeof(m.name), "classic_%d", epochs[i]);
		add(b, m);
	}
	for (size_t i = 0; i < (quick ? 1 : sizeof(grids) / sizeof(*grids)); i++)
		for (int kind = KIND_CLASSIC; kind <= KIND_DEFAULT; kind++) {
			struct method m = {.kind = (enum kind)kind,
					   .fit = FIT_MODEL,
					   .epochs = EPOCHS,
					   .mfs = {grids[i][0], grids[i][1]}};

			snprintf(m.name, sizeof(m.name), "%s_%dx%d",
				 kind == KIND_CLASSIC ? "classic" : "default",
				 grids[i][0], grids[i][1]);
			add(b, m);
		}
	add(b, (struct method){.name = "default_chosen",
			       .kind = KIND_DEFAULT,
			       .fit = FIT_CHOSEN,
			       .epochs = EPOCHS});
}

/* What a way of the harness does. */
struct timed {
	const struct bench *bench;
	const struct method *method;
};

static void run_timed(void *context)
{
	const struct timed *t = context;
	struct learnt learnt;

	learn(t->method, &t->bench->data[0], &learnt);
	incise_model_free(learnt.model);
}

static void measure(struct bench *b)
{
	struct harness_variant ways[ROWS_MAX];
	struct timed timed[ROWS_MAX];
	struct harness_time times[ROWS_MAX];

	for (int i = 0; i < b->n; i++) {
		for (int s = 0; s < b->seeds; s++)
			measure_errors(b, &b->row[i], s);
		timed[i] = (struct timed){b, &b->row[i].method};
		ways[i] = (struct harness_variant){
			.run = run_timed, .context = &timed[i], .units = 1};
		cli_progress("training: %s", b->row[i].method.name);
	}
	harness_times(ways, b->n, b->repeats, times);
	for (int i = 0; i < b->n; i++)
		b->row[i].time = times[i];
}

static void add_peers(struct bench *b)
{
	struct training_peer peers[TRAINING_PEERS];

	training_peers(peers, b->data, b->seeds, b->unseen);
	for (int p = 0; p < TRAINING_PEERS; p++) {
		struct method m = {.kind = KIND_PEER};
		struct row *row = &b->row[b->n];

		snprintf(m.name, sizeof(m.name), "%s", peers[p].name);
		add(b, m);
		snprintf(row->failed, sizeof(row->failed), "%s", peers[p].failed);
		for (int s = 0; s < b->seeds; s++) {
			row->norm[NORM_RMSE][s] = peers[p].rmse[s];
			row->norm[NORM_MAX][s] = peers[p].max[s];
			row->norm[NORM_MEAN][s] = peers[p].mean[s];
		}
		harness_time_of(peers[p].ns, *row->failed ? 0 : b->seeds, &row->time);
	}
}

/* ---- report ---- */

static struct harness_spread norm(const struct bench *b, const struct row *row,
				  enum norm norm)
{
	struct harness_spread spread;

	harness_spread(row->norm[norm], *row->failed ? 0 : b->seeds, &spread);
	return spread;
}

static void print_table(const struct bench *b)
{
	printf("%s\n%d pairs of 12 cuts, 20 unseen cuts whose force is exact; errors: median "
	       "of %d data sets (5 to 95 %%), times: of %d runs in turn\n"
	       "%-16s %6s %10s %9s %9s %10s %20s %10s %10s\n",
	       b->machine.cpu, TRAINING_PAIRS, b->seeds, b->repeats, "method", "epochs",
	       "median ms", "5 %", "95 %", "rmse / N", "", "largest/N", "mean |.|/N");
	for (int i = 0; i < b->n; i++) {
		const struct row *r = &b->row[i];
		struct harness_spread rmse = norm(b, r, NORM_RMSE);
		char epochs[12] = "-";

		if (*r->failed) {
			printf("%-16s %s\n", r->method.name, r->failed);
			continue;
		}
		if (r->method.epochs)
			snprintf(epochs, sizeof(epochs), "%d", r->method.epochs);
		printf("%-16s %6s %10.3g %9.3g %9.3g %10.4f   (%.4f to %.4f) %10.4f %10.4f\n",
		       r->method.name, epochs, r->time.ns.median * 1e-6,
		       r->time.ns.p5 * 1e-6, r->time.ns.p95 * 1e-6, rmse.median, rmse.p5,
		       rmse.p95, norm(b, r, NORM_MAX).median,
		       norm(b, r, NORM_MEAN).median);
	}
}

static json_t *row_json(const struct bench *b, const struct row *r)
{
	struct harness_spread rmse = norm(b, r, NORM_RMSE), max = norm(b, r, NORM_MAX);
	bool grid = r->method.mfs[0] > 0;

	return json_pack(
		"{ss so so so so so so so so so so so so sb so}", "name", r->method.name,
		"epochs", r->method.epochs ? json_integer(r->method.epochs) : json_null(),
		"rules",
		grid ? json_integer(r->method.mfs[0] * r->method.mfs[1]) : json_null(),
		"ms", json_number(r->time.ns.median * 1e-6), "ms_min",
		json_number(r->time.ns.p5 * 1e-6), "ms_max",
		json_number(r->time.ns.p95 * 1e-6), "seconds",
		json_number(r->time.ns.median * 1e-9), "rmse_unseen_N",
		json_number(rmse.median), "rmse_unseen_N_p5", json_number(rmse.p5),
		"rmse_unseen_N_p95", json_number(rmse.p95), "max_unseen_N",
		json_number(max.median), "max_unseen_N_p95", json_number(max.p95),
		"mean_abs_unseen_N", json_number(norm(b, r, NORM_MEAN).median), "peer",
		r->method.kind == KIND_PEER, "failed",
		*r->failed ? json_string(r->failed) : json_null());
}

static void print_json(const struct bench *b, bool quick)
{
	json_t *rows = json_array(), *figures = json_array();

	for (int i = 0; i < b->n; i++) {
		const struct row *r = &b->row[i];

		json_array_append_new(rows, row_json(b, r));
		/* A peer's answers are those of its version. */
		if (r->method.kind == KIND_PEER)
			continue;
		metrics_time(figures, &r->time, "ms", "%s", r->method.name);
		metrics_exact(figures, norm(b, r, NORM_RMSE).median, "N",
			      "%s error on unseen cuts", r->method.name);
	}
	json_print(json_pack("{so sb si si si si so so}", "machine",
			     machine_json(&b->machine), "quick", quick, "pairs",
			     TRAINING_PAIRS, "epochs", EPOCHS, "repeats", b->repeats,
			     "seeds", b->seeds, "rows", rows, "figures", figures));
}

/* ---- the work-precision chart ---- */

static void draw(const struct bench *b, const char *folder, const char *name)
{
	double fast = INFINITY, slow = 0;
	char *data;
	FILE *out;

	for (int i = 0; i < b->n; i++) {
		fast = fmin(fast, b->row[i].time.ns.median * 1e-9);
		slow = fmax(slow, b->row[i].time.ns.median * 1e-9);
	}
	if (asprintf(&data, "%s.dat", name) < 0)
		cli_fail("no memory");
	out = plot_data(folder, data);
	free(data);
	for (int kind = 0; kind < KINDS; kind++) {
		fputs("none NaN NaN NaN NaN\n", out);
		for (int i = 0; i < b->n; i++) {
			const struct row *r = &b->row[i];
			struct harness_spread rmse = norm(b, r, NORM_RMSE);

			if (r->method.kind == (enum kind)kind && !*r->failed)
				fprintf(out, "%s %g %g %g %g\n", r->method.name,
					r->time.ns.median * 1e-9, rmse.median, rmse.p5,
					rmse.p95);
		}
		fputs("\n\n", out);
	}
	plot_data_end(out, folder);
	out = plot_begin(folder, name, 1100, 800);
	fprintf(out,
		"set title \"Error on unseen cuts over the time of training, %d pairs\\n%s, "
		"%s\"\nset xlabel 'time of training / s'\n"
		"set ylabel 'rms error on unseen cuts / N (bars: 5 to 95 %% of %d data sets)'\n"
		"set logscale xy\nset format x '%%.0e'\nset format y '%%g'\n"
		"set yrange [*:*] extend\nset xrange [%g:%g]\n"
		"set key outside bottom center horizontal maxcols 2\ndata = '%s.dat'\nplot \\\n",
		TRAINING_PAIRS, b->machine.cpu, b->machine.kernel, b->seeds, fast / 2,
		slow * 6, name);
	for (int kind = 0; kind < KINDS; kind++)
		fprintf(out,
			"  data index %d using 2:3:4:5 with yerrorbars ls %d pt 7 ps 0.8 title "
			"'%s', \\\n  '' index %d using 2:3:1 with labels left rotate by 20 "
			"offset 0.6,0.3 font ',8' notitle, \\\n",
			kind, kind + 1, kind_titles[kind], kind);
	fputs("  NaN notitle\n", out);
	if (!plot_draw(out, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}

void bench_training(bool json, bool quick, const char *plot)
{
	struct bench *b = calloc(1, sizeof(*b));
	const char *folder, *name;

	if (!b)
		cli_fail("no memory");
	if (plot)
		plot_place("plot", plot, &folder, &name);
	b->seeds = quick ? QUICK_SEEDS : SEEDS;
	b->repeats = quick ? QUICK_REPEATS : REPEATS;
	machine_init(&b->machine);
	for (int s = 0; s < b->seeds; s++)
		training_data_make(&b->data[s], (uint64_t)s + 1);
	training_data_unseen(b->unseen);
	add_all(b, quick);
	measure(b);
	add_peers(b);
	cli_progress_end();
	if (json)
		print_json(b, quick);
	else
		print_table(b);
	cli_finish();
	if (plot)
		draw(b, folder, name);
	free(b);
}
