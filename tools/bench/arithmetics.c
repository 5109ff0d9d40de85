// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The arithmetics that incise bench measures; see arithmetics.h.
 */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "arithmetics.h"
#include "../cli/cli.h"
#include "peer.h"

/* ---- the model as plain numbers, for evaluators that are none of the library's ---- */

#define INPUTS INCISE_FIXED_INPUTS_MAX
#define MFS INCISE_FIXED_MFS_MAX
#define RULES INCISE_FIXED_RULES_MAX

struct plain {
	int n_inputs, n_rules, n_mfs[INPUTS];
	double centre[INPUTS][MFS], width[INPUTS][MFS];
	int mf[RULES][INPUTS];
	double p[RULES][INPUTS + 1];
};

static void *allocate(size_t n, size_t size)
{
	void *p = calloc(n, size);

	if (!p)
		cli_fail("no memory for the points");
	return p;
}

/* The model has a fixed-point form: a grid of Gaussians, last input fastest. */
static struct plain *plain_new(const struct incise_model *model)
{
	struct plain *m = allocate(1, sizeof(*m));

	m->n_inputs = incise_model_n_inputs(model);
	m->n_rules = incise_model_n_rules(model);
	for (int i = 0; i < m->n_inputs; i++) {
		m->n_mfs[i] = incise_model_n_mfs(model, i);
		for (int k = 0; k < m->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			m->width[i][k] = mf->p[0];
			m->centre[i][k] = mf->p[1];
		}
	}
	for (int r = 0; r < m->n_rules; r++) {
		for (int i = 0; i < m->n_inputs; i++)
			m->mf[r][i] = incise_model_rule_mf(model, r, i);
		memcpy(m->p[r], incise_model_consequent(model, r),
		       (m->n_inputs + 1) * sizeof(double));
	}
	return m;
}

#define REAL double
#define EXP exp
#define NAME(x) x##_double
#include "separable.inc"
#undef REAL
#undef EXP
#undef NAME

#define REAL float
#define EXP expf
#define NAME(x) x##_float
#include "separable.inc"
#undef REAL
#undef EXP
#undef NAME

/* Eq. (3) in long double, and apart from the library: the reference. The largest exponent
 * is taken off all, without which narrow functions would leave 0/0. */
static double reference(const struct plain *m, const double *x)
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

void points_init(struct points *p, const struct incise_model *model, size_t n)
{
	struct plain *m = plain_new(model);
	uint64_t seed = 1;
	size_t values = n * m->n_inputs;

	*p = (struct points){
		.n = n,
		.n_inputs = m->n_inputs,
		.x = allocate(values, sizeof(double)),
		.y = allocate(n, sizeof(double)),
		.x_float = allocate(values, sizeof(float)),
		.y_float = allocate(n, sizeof(float)),
		.x_fixed = allocate(values, sizeof(int32_t)),
		.y_fixed = allocate(n, sizeof(int32_t)),
		.truth = allocate(n, sizeof(double)),
	};
	for (size_t k = 0; k < values; k++) {
		const struct incise_variable *v =
			incise_model_input(model, (int)(k % m->n_inputs));

		seed = seed * 6364136223846793005u + 1442695040888963407u;
		p->x[k] = v->min + (v->max - v->min) * (seed >> 11) * 0x1p-53;
		p->x_float[k] = (float)p->x[k];
		p->x_fixed[k] = (int32_t)lrint(p->x[k] * INCISE_FIXED_ONE);
	}
	for (size_t k = 0; k < n; k++)
		p->truth[k] = reference(m, p->x + k * m->n_inputs);
	free(m);
}

/* ---- evaluators ---- */

/* Eq. (1) to (3) as they are printed: an exponential per rule and input. */
static void run_libm(const struct arithmetic *a, const struct points *p)
{
	const struct plain *m = a->context;

	for (size_t k = 0; k < p->n; k++) {
		const double *x = p->x + k * m->n_inputs;
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
		p->y[k] = sum / weights;
	}
}

static void run_double(const struct arithmetic *a, const struct points *p)
{
	for (size_t k = 0; k < p->n; k++)
		p->y[k] = separable_eval_double(a->context, p->x + k * p->n_inputs);
}

static void run_float(const struct arithmetic *a, const struct points *p)
{
	for (size_t k = 0; k < p->n; k++)
		p->y_float[k] =
			separable_eval_float(a->context, p->x_float + k * p->n_inputs);
}

/* The library's: any kind and shape of model, any input, and its flags. */
static void run_library(const struct arithmetic *a, const struct points *p)
{
	unsigned int flags;

	for (size_t k = 0; k < p->n; k++)
		p->y[k] = incise_model_eval(a->context, p->x + k * p->n_inputs, &flags);
}

static void run_fixed(const struct arithmetic *a, const struct points *p)
{
	const int32_t *x = p->x_fixed;
	int32_t *y = p->y_fixed;
	int n_inputs = p->n_inputs;

	for (size_t k = 0; k < p->n; k++, x += n_inputs)
		y[k] = incise_fixed_eval(a->context, x);
}

static void run_batch(const struct arithmetic *a, const struct points *p)
{
	incise_fixed_eval_batch(a->context, p->x_fixed, p->y_fixed, p->n);
}

struct open_peer {
	const struct peer *peer;
	void *handle;
};

static void run_peer(const struct arithmetic *a, const struct points *p)
{
	const struct open_peer *open = a->context;

	open->peer->run(open->handle, p->x, p->y, p->n);
}

static double answer(const struct arithmetic *a, const struct points *p, size_t k)
{
	if (a->fixed)
		return p->y_fixed[k] / (double)INCISE_FIXED_ONE;
	return a->run == run_float ? p->y_float[k] : p->y[k];
}

void arithmetic_errors(const struct arithmetic *a, const struct points *p, double *max,
		       double *rms)
{
	double sum = 0, largest = 0;

	a->run(a, p);
	for (size_t k = 0; k < p->n; k++) {
		double e = fabs(answer(a, p, k) - p->truth[k]);

		/* Not fmax: a NaN must not be lost. */
		if (!(e <= largest))
			largest = e;
		sum += e * e / p->n;
	}
	*max = largest;
	*rms = sqrt(sum);
}

/* ---- the list ---- */

static struct arithmetic *add(struct arithmetics *all, enum arithmetic_kind kind,
			      void (*run)(const struct arithmetic *,
					  const struct points *),
			      const void *context, const char *fmt, ...)
	INCISE_PRINTF(5, 6);
static struct arithmetic *add(struct arithmetics *all, enum arithmetic_kind kind,
			      void (*run)(const struct arithmetic *,
					  const struct points *),
			      const void *context, const char *fmt, ...)
{
	struct arithmetic *a = &all->row[all->n++];
	va_list args;

	if (all->n > ARITHMETICS_MAX)
		abort();
	*a = (struct arithmetic){.kind = kind, .run = run, .context = context};
	va_start(args, fmt);
	vsnprintf(a->name, sizeof(a->name), fmt, args);
	va_end(args);
	return a;
}

/* A compiled model, or why there is none: a row in any case. */
static const struct incise_fixed *add_fixed(struct arithmetics *all,
					    const struct incise_model *model,
					    enum incise_fixed_arithmetic arithmetic,
					    int cells, double budget, const char *name)
{
	static const enum arithmetic_kind kinds[] = {
		[INCISE_FIXED_DIRECT] = ARITHMETIC_DIRECT,
		[INCISE_FIXED_TABLE] = ARITHMETIC_TABLE,
		[INCISE_FIXED_FORCE] = ARITHMETIC_FORCE,
	};
	struct incise_fixed_options o = {budget, arithmetic, cells};
	struct incise_error err = {0};
	const struct incise_fixed *fx = incise_fixed_compile(model, &o, &err);
	struct arithmetic *a = add(all, kinds[arithmetic], run_fixed, fx, "%s", name);

	if (cells)
		snprintf(a->name, sizeof(a->name), "%s_%d", name, cells);
	a->fixed = fx;
	if (!fx)
		snprintf(a->failed, sizeof(a->failed), "%s", err.text);
	return fx;
}

static void add_batch(struct arithmetics *all, const struct incise_fixed *fx,
		      const char *name, const char *of)
{
	struct arithmetic *a = add(all, ARITHMETIC_BATCH, run_batch, fx, "%s", name);

	a->fixed = fx;
	if (!fx)
		snprintf(a->failed, sizeof(a->failed), "%s failed", of);
}

/* Beside this program, in the build tree; it is not installed. */
static const struct peer *load_peer(const char **why)
{
	void *object;
	char *path;

	if (asprintf(&path, "%s/../lib/incise/peer_fuzzylite.so", cli_folder()) < 0)
		cli_fail("no memory");
	*why = "not built in: libfuzzylite-dev was absent";
	if (access(path, F_OK)) {
		free(path);
		return NULL;
	}
	object = dlopen(path, RTLD_NOW | RTLD_LOCAL);
	*why = object ? "no peer in its file" : dlerror();
	free(path);
	return object ? dlsym(object, "incise_peer") : NULL;
}

static void add_peer(struct arithmetics *all, const struct incise_model *model)
{
	static struct open_peer open;
	struct arithmetic *a =
		add(all, ARITHMETIC_PEER, run_peer, &open, "%s", "fuzzylite");
	const char *why;

	open.peer = load_peer(&why);
	if (!open.peer) {
		snprintf(a->failed, sizeof(a->failed), "%s", why);
		return;
	}
	snprintf(all->peer_version, sizeof(all->peer_version), "%s", open.peer->version);
	open.handle = open.peer->open(model, a->failed, sizeof(a->failed));
}

void arithmetics_init(struct arithmetics *all, const struct incise_model *model)
{
	static const int table_cells[] = {64, 128, 256, 512, 1024};
	static const int force_cells[] = {32, 64, 128, 256, 512, 1024, 2048, 4096};
	const struct incise_fixed *table, *force = NULL;
	struct incise_fixed_options any = {.arithmetic = -1};
	struct incise_error err = {0};
	struct incise_fixed *fx;
	struct plain *plain;

	all->n = 0;
	all->peer_version[0] = 0;
	/* Without a budget only the model's kind or shape can stand against it. */
	fx = incise_fixed_compile(model, &any, &err);
	if (!fx)
		cli_fail_with(&err);
	incise_fixed_free(fx);
	plain = plain_new(model);
	add(all, ARITHMETIC_FLOATING, run_libm, plain, "double_libm");
	add(all, ARITHMETIC_FLOATING, run_double, separable_new_double(plain),
	    "double_separable");
	add(all, ARITHMETIC_FLOATING, run_library, model, "double_library");
	add(all, ARITHMETIC_FLOATING, run_float, separable_new_float(plain), "float");
	add_fixed(all, model, INCISE_FIXED_DIRECT, 0, 0, "fixed_direct");
	for (size_t i = 0; i < sizeof(table_cells) / sizeof(*table_cells); i++)
		add_fixed(all, model, INCISE_FIXED_TABLE, table_cells[i], 0,
			  "fixed_table");
	incise_fixed_options_init(&any);
	table = add_fixed(all, model, INCISE_FIXED_TABLE, 0, any.budget, "fixed_table");
	/* Up to the first that does not fit; that one is listed as well. */
	for (size_t i = 0; i < sizeof(force_cells) / sizeof(*force_cells); i++) {
		const struct incise_fixed *finer = add_fixed(
			all, model, INCISE_FIXED_FORCE, force_cells[i], 0, "force_table");

		if (!finer)
			break;
		force = finer;
	}
	/* The finest that fits stands under its own name, too. */
	if (force) {
		add(all, ARITHMETIC_FORCE, run_fixed, force, "force_table")->fixed =
			force;
	} else {
		struct arithmetic *a =
			add(all, ARITHMETIC_FORCE, run_fixed, NULL, "force_table");

		snprintf(a->failed, sizeof(a->failed), "no size of it fits");
	}
	add_batch(all, table, "batch", "fixed_table");
	add_batch(all, force, "batch_force", "force_table");
	add_peer(all, model);
}
