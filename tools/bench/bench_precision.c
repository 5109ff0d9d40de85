// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench precision: error against run time of the evaluators of one model, the plainest
 * and another project's among them, over the same points.
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include "bench.h"
#include "../cli/json.h"
#include "noise.h"
#include "reference.h"

/* Points for the errors. Times are for the first of them, so few that inputs and outputs stay
 * in the cache and only the arithmetic is measured. */
#define POINTS 20000
#define TIMED_POINTS 2000
#define REPEATS 101
#define QUICK_REPEATS 21 /* 20 resolve the 5th and the 95th percentile */
#define ROWS_MAX 32

/* At random over the model's support, an evaluation's inputs side by side, in the form that
 * each evaluator takes; and buffers for the answers. */
struct points {
	size_t n;
	int n_inputs;
	double *x_double, *y_double;
	int32_t *x_fixed, *y_fixed;
	double *truth; /* eq. (3) in long double */
};

static const char floating[] = "floating point", direct[] = "fixed, direct",
		  table[] = "fixed, tables of weights", force[] = "fixed, force table",
		  batch[] = "batch", other[] = "fuzzylite";

struct row {
	char name[32];
	const char *kind;
	char failed[600]; /* why it cannot be measured, or is wrong; else empty */

	/* Evaluate all points, leaving the answers in the form of its own. */
	void (*run)(const struct row *row, const struct points *points);
	const void *context;
	const struct incise_fixed *fixed; /* whose bound is certified, or NULL */
	const struct points *timed;

	struct harness_time time; /* of an evaluation */
	double max_error, rms_error, bound, times_reference;
	int size_bytes;
	bool is_reference;
};

struct evaluators {
	struct row row[ROWS_MAX];
	int n;
	const char *reference_version; /* of fuzzylite, or NULL */
};

/* --- the model as plain numbers, for evaluators outside the library --- */

#define INPUTS INCISE_FIXED_INPUTS_MAX
#define MFS INCISE_FIXED_MFS_MAX
#define RULES INCISE_FIXED_RULES_MAX

struct plain {
	int n_inputs, n_rules, n_mfs[INPUTS];
	double centre[INPUTS][MFS], width[INPUTS][MFS];
	double factor[INPUTS][MFS]; /* -1/(2 width²) */
	int mf[RULES][INPUTS];
	double p[RULES][INPUTS + 1];
};

/* The model has a fixed-point form: a grid of Gaussians, last input fastest. */
static struct plain *plain_new(const struct incise_model *model)
{
	const struct incise_model_info *info = incise_model_info(model);
	struct plain *m = cli_alloc(1, sizeof(*m));

	m->n_inputs = info->n_inputs;
	m->n_rules = info->n_rules;
	for (int i = 0; i < m->n_inputs; i++) {
		m->n_mfs[i] = info->n_mfs[i];
		for (int k = 0; k < m->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			m->width[i][k] = mf->p[0];
			m->factor[i][k] = -0.5 / (mf->p[0] * mf->p[0]);
			m->centre[i][k] = mf->p[1];
		}
	}
	for (int r = 0; r < m->n_rules; r++) {
		for (int i = 0; i < m->n_inputs; i++)
			m->mf[r][i] = incise_model_rule(model, r)->mf[i];
		memcpy(m->p[r], incise_model_rule(model, r)->p,
		       (m->n_inputs + 1) * sizeof(double));
	}
	return m;
}

/* separable_eval(): the model with an exponential per membership function rather than per rule, each
 * input normalised by its largest degree. */

/* Degrees of one input, the largest about 1; returns their sum. */
static double degrees(const struct plain *m, int i, double x, double *mu)
{
	double largest = -HUGE_VAL, sum = 0;

	for (int k = 0; k < m->n_mfs[i]; k++) {
		double d = x - m->centre[i][k];

		mu[k] = d * d * m->factor[i][k];
		largest = mu[k] > largest ? mu[k] : largest;
	}
	/* A bit more than the largest, which cancels: exp(0) would take a way of its own, that
	 * the processor cannot foresee. */
	largest += 0x1p-10;
	for (int k = 0; k < m->n_mfs[i]; k++) {
		mu[k] = exp(mu[k] - largest);
		sum += mu[k];
	}
	return sum;
}

static double separable_eval(const struct plain *m, const double *x)
{
	double mu_a[MFS], mu_b[MFS] = {1}, sum = 0, weights;
	const double(*r)[INPUTS + 1] = m->p;

	weights = degrees(m, 0, x[0], mu_a);
	if (m->n_inputs == 1) {
		for (int i = 0; i < m->n_mfs[0]; i++, r++)
			sum += mu_a[i] * ((*r)[0] + (*r)[1] * x[0]);
		return sum / weights;
	}
	weights *= degrees(m, 1, x[1], mu_b);
	for (int i = 0; i < m->n_mfs[0]; i++) {
		double part = 0;

		for (int j = 0; j < m->n_mfs[1]; j++, r++)
			part += mu_b[j] * ((*r)[0] + (*r)[1] * x[0] + (*r)[2] * x[1]);
		sum += mu_a[i] * part;
	}
	return sum / weights;
}

/* Eq. (3) in long double, and apart from the library: the truth. The largest exponent is
 * taken off all, without which narrow functions would leave 0/0. */
static double true_output(const struct plain *m, const double *x)
{
	long double exponent[RULES], largest = -HUGE_VALL, sum = 0, weights = 0;

	for (int r = 0; r < m->n_rules; r++) {
		exponent[r] = 0;
		for (int i = 0; i < m->n_inputs; i++) {
			int k = m->mf[r][i];
			long double z =
				(x[i] - (long double)m->centre[i][k]) / m->width[i][k];

			exponent[r] -= z * z / 2;
		}
		largest = fmaxl(largest, exponent[r]);
	}
	for (int r = 0; r < m->n_rules; r++) {
		long double y = m->p[r][0], w = expl(exponent[r] - largest);

		for (int i = 0; i < m->n_inputs; i++)
			y += (long double)m->p[r][i + 1] * x[i];
		sum += w * y;
		weights += w;
	}
	return (double)(sum / weights);
}

static void points_init(struct points *p, const struct incise_model *model,
			const struct plain *m, size_t n)
{
	size_t values = n * m->n_inputs;
	uint64_t seed = 1;

	*p = (struct points){
		.n = n,
		.n_inputs = m->n_inputs,
		.x_double = cli_alloc(values, sizeof(double)),
		.y_double = cli_alloc(n, sizeof(double)),
		.x_fixed = cli_alloc(values, sizeof(int32_t)),
		.y_fixed = cli_alloc(n, sizeof(int32_t)),
		.truth = cli_alloc(n, sizeof(double)),
	};
	for (size_t k = 0; k < values; k++) {
		const struct incise_variable *v =
			&incise_model_info(model)->input[(int)(k % m->n_inputs)];

		p->x_double[k] = v->min + (v->max - v->min) * lcg_uniform(&seed);
		p->x_fixed[k] = (int32_t)lrint(p->x_double[k] * INCISE_FIXED_ONE);
	}
	for (size_t k = 0; k < n; k++)
		p->truth[k] = true_output(m, p->x_double + k * m->n_inputs);
}

/* --- evaluators --- */

/* Eq. (1) to (3) as they are printed: an exponential per rule and input. */
static void run_libm(const struct row *row, const struct points *p)
{
	const struct plain *m = row->context;

	for (size_t k = 0; k < p->n; k++) {
		const double *x = p->x_double + k * m->n_inputs;
		double sum = 0, weights = 0;

		for (int r = 0; r < m->n_rules; r++) {
			double w = 1, y = m->p[r][0];

			for (int i = 0; i < m->n_inputs; i++) {
				double z = (x[i] - m->centre[i][m->mf[r][i]]) /
					   m->width[i][m->mf[r][i]];

				w *= exp(-0.5 * z * z);
				y += m->p[r][i + 1] * x[i];
			}
			sum += w * y;
			weights += w;
		}
		p->y_double[k] = sum / weights;
	}
}

static void run_separable(const struct row *row, const struct points *p)
{
	for (size_t k = 0; k < p->n; k++)
		p->y_double[k] =
			separable_eval(row->context, p->x_double + k * p->n_inputs);
}

/* The library's: any kind and shape of model, any input, and its flags. */
static void run_library(const struct row *row, const struct points *p)
{
	unsigned int flags;

	for (size_t k = 0; k < p->n; k++)
		p->y_double[k] = incise_model_eval(row->context,
						   p->x_double + k * p->n_inputs, &flags);
}

static void run_fixed(const struct row *row, const struct points *p)
{
	const int32_t *x = p->x_fixed;
	int32_t *y = p->y_fixed;
	int n_inputs = p->n_inputs;

	for (size_t k = 0; k < p->n; k++, x += n_inputs)
		y[k] = incise_fixed_eval(row->context, x);
}

static void run_batch(const struct row *row, const struct points *p)
{
	incise_fixed_eval_batch(row->context, p->x_fixed, p->y_fixed, p->n);
}

struct opened {
	const struct reference *reference;
	void *handle;
};

static void run_reference(const struct row *row, const struct points *p)
{
	const struct opened *opened = row->context;

	opened->reference->run(opened->handle, p->x_double, p->y_double, p->n);
}

/* --- the list of them --- */

static struct row *add(struct evaluators *all, const char *kind,
		       void (*run)(const struct row *, const struct points *),
		       const void *context, const char *name)
{
	struct row *row = &all->row[all->n++];

	if (all->n > ROWS_MAX)
		abort();
	*row = (struct row){.kind = kind, .run = run, .context = context};
	snprintf(row->name, sizeof(row->name), "%s", name);
	return row;
}

/* The row of a compiled model; without one it says why. */
static struct row *add_compiled(struct evaluators *all, const char *kind,
				const struct incise_fixed *fixed, const char *name,
				const char *why)
{
	struct row *row =
		add(all, kind, kind == batch ? run_batch : run_fixed, fixed, name);

	row->fixed = fixed;
	if (fixed)
		row->size_bytes = (int)fixed->size;
	else
		snprintf(row->failed, sizeof(row->failed), "%s", why);
	return row;
}

static const struct incise_fixed *add_fixed(struct evaluators *all,
					    const struct incise_model *model,
					    enum incise_fixed_arithmetic arithmetic,
					    int cells, double budget, const char *name)
{
	static const char *const kinds[] = {
		[INCISE_FIXED_DIRECT] = direct,
		[INCISE_FIXED_TABLE] = table,
		[INCISE_FIXED_FORCE] = force,
	};
	struct incise_fixed_options o = {budget, arithmetic, cells};
	struct incise_error err = {0};
	const struct incise_fixed *fixed = incise_fixed_compile(model, &o, &err);
	struct row *row = add_compiled(all, kinds[arithmetic], fixed, name, err.text);

	if (cells)
		snprintf(row->name, sizeof(row->name), "%s_%d", name, cells);
	return fixed;
}

/* Beside this program, in the build tree; it is not installed. */
static const struct reference *load_reference(const char **why)
{
	const struct reference *found = NULL;
	char *path = cli_text("%s/../lib/incise/peer_fuzzylite.so", cli_folder());
	void *object;

	*why = "not built in: libfuzzylite-dev was absent";
	if (!access(path, F_OK)) {
		object = dlopen(path, RTLD_NOW | RTLD_LOCAL);
		*why = object ? "no peer in its file" : dlerror();
		found = object ? dlsym(object, "incise_reference") : NULL;
	}
	free(path);
	return found;
}

static void add_reference(struct evaluators *all, const struct incise_model *model)
{
	static struct opened opened;
	struct row *row = add(all, other, run_reference, &opened, "fuzzylite");
	const char *why;

	row->is_reference = true;
	opened.reference = load_reference(&why);
	if (!opened.reference) {
		snprintf(row->failed, sizeof(row->failed), "%s", why);
		return;
	}
	all->reference_version = opened.reference->version;
	opened.handle = opened.reference->open(model, row->failed, sizeof(row->failed));
}

static void add_all(struct evaluators *all, const struct incise_model *model,
		    const struct plain *plain)
{
	static const int table_cells[] = {64, 128, 256, 512, 1024};
	static const int force_cells[] = {32, 64, 128, 256, 512, 1024, 2048, 4096};
	const struct incise_fixed *fixed_table, *finest = NULL, *finer;
	struct incise_fixed_options any = {.arithmetic = -1};
	struct incise_error err = {0};
	struct incise_fixed *fixed;

	/* Without a budget only the model's kind or shape can stand against it. */
	fixed = cli_require(incise_fixed_compile(model, &any, &err), &err);
	incise_fixed_free(fixed);
	add(all, floating, run_libm, plain, "double_libm");
	add(all, floating, run_separable, plain, "double_separable");
	add(all, floating, run_library, model, "double_library");
	add_fixed(all, model, INCISE_FIXED_DIRECT, 0, 0, "fixed_direct");
	for (int i = 0; i < N(table_cells); i++)
		add_fixed(all, model, INCISE_FIXED_TABLE, table_cells[i], 0,
			  "fixed_table");
	incise_fixed_options_init(&any);
	fixed_table =
		add_fixed(all, model, INCISE_FIXED_TABLE, 0, any.budget, "fixed_table");
	/* Up to the first that does not fit; that one is listed as well. */
	for (int i = 0; i < N(force_cells); i++) {
		finer = add_fixed(all, model, INCISE_FIXED_FORCE, force_cells[i], 0,
				  "force_table");
		if (!finer)
			break;
		finest = finer;
	}
	/* The finest that fits stands under its own name, too. */
	add_compiled(all, force, finest, "force_table", "no size of it fits");
	add_compiled(all, batch, fixed_table, "batch", "fixed_table failed");
	add_compiled(all, batch, finest, "batch_force", "force_table failed");
	add_reference(all, model);
}

/* --- measurement --- */

static double answer(const struct row *row, const struct points *p, size_t k)
{
	if (row->fixed)
		return p->y_fixed[k] / (double)INCISE_FIXED_ONE;
	return p->y_double[k];
}

static void measure_error(struct row *row, const struct points *p)
{
	double sum = 0, largest = 0;

	row->max_error = row->rms_error = row->bound = NAN;
	if (*row->failed)
		return;
	row->run(row, p);
	for (size_t k = 0; k < p->n; k++) {
		double e = fabs(answer(row, p, k) - p->truth[k]);

		/* Not fmax: a NaN must not be lost. */
		if (!(e <= largest))
			largest = e;
		sum += e * e / p->n;
	}
	row->max_error = largest;
	row->rms_error = sqrt(sum);
	if (row->fixed)
		row->bound = incise_fixed_bound(row->fixed);
	if (largest > row->bound)
		snprintf(row->failed, sizeof(row->failed),
			 "its error of %.3g exceeds its certified bound of %.3g: a "
			 "fault of incise, please report it with the model",
			 largest, row->bound);
	else if (!isfinite(largest))
		snprintf(row->failed, sizeof(row->failed), "an answer is not a number");
}

static void run_timed(void *context)
{
	const struct row *row = context;

	row->run(row, row->timed);
}

/* Paper 1's shape with a force surface of its kind. */
static struct incise_model *own_model(struct incise_error *err)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50}};
	static const struct incise_variable out = {"force_N", 0, 3};
	static const int mfs[] = {5, 4};
	struct incise_model *model =
		incise_model_new_grid(2, in, mfs, INCISE_MF_GAUSS, &out, err);

	for (int r = 0; model && r < incise_model_info(model)->n_rules; r++) {
		double d = r / 4 * 5.0, v = r % 4 * 50.0 / 3;
		double p[] = {0.05 * d + 0.01 * v - 0.3, 0.05 + 0.002 * d,
			      0.01 - 0.0001 * v};

		incise_model_set_consequent(model, r, p);
	}
	return model;
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name), QUANTILES(row, "ns", time),
		    COLUMN(row, "max_error_N", max_error),
		    COLUMN(row, "rms_error_N", rms_error), COLUMN(row, "bound_N", bound),
		    COLUMN(row, "size_bytes", size_bytes, .optional = true),
		    COLUMN(row, "times_fuzzylite", times_reference),
		    COLUMN(row, "peer", is_reference), COLUMN(row, "failed", failed),
		    COLUMN(row, "kind", kind, .data = true)},
	/* The reference's time hangs on where its heap lies: of one build and model it was from 1.7
	 * to 3.5 us, by the process. */
	.metrics = {METRIC(TIME, row, time, "ns", "{name}", "peer=0"),
		    METRIC(EXACT, row, max_error, "N", "{name} largest error")},
};

static void run_precision(struct bench_run *run)
{
	struct evaluators *all = cli_alloc(1, sizeof(*all));
	struct incise_error err = {0};
	struct incise_model *model =
		cli_require(run->n_operands ? incise_model_load(run->operands[0], &err)
					    : own_model(&err),
			    &err);
	int repeats = run->quick ? QUICK_REPEATS : REPEATS;
	struct plain *plain = plain_new(model);
	struct points points, timed;

	add_all(all, model, plain);
	points_init(&points, model, plain, run->quick ? TIMED_POINTS : POINTS);
	for (int i = 0; i < all->n; i++)
		measure_error(&all->row[i], &points);
	timed = points;
	timed.n = TIMED_POINTS;
	for (int i = 0; i < all->n; i++)
		all->row[i].timed = &timed;
	bench_times(&rows_table, all->row, all->n, run_timed, TIMED_POINTS, repeats);
	/* The reference is the last one. */
	for (struct row *row = all->row; row < all->row + all->n; row++)
		row->times_reference =
			all->row[all->n - 1].time.ns.median / row->time.ns.median;

	bench_values(run, "{so si si si ss?}", "model",
		     json_text(incise_model_info(model)->name), "rules",
		     incise_model_info(model)->n_rules, "points", (int)points.n,
		     "repeats", repeats, "fuzzylite_version", all->reference_version);
	bench_rows(run, &rows_table, all->row, all->n);
}

const struct bench bench_precision = {
	.name = "precision",
	.operands = "[MODEL.fis]",
	.summary = "error and run time of a model's evaluators",
	.n_operands = 1,
	.run = run_precision,
	.plot = {.script = text_precision_gp,
		 .width = 1000,
		 .height = 720,
		 .data = &rows_table},
};
