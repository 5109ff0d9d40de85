// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Uncertainties of training pairs; see incise/propagation.h. φ is that of incise/uncertainty.h.
 *
 *     of a pass    Σ w g φ and Σ w g of each source and origin, Σ w φ and Σ w
 *     at its end   b of each; those of all are the rows of K, those of a source summed are B
 *
 * The fit subtracts the mean of the output before its ridge, so of the mean of g nothing is shrunk:
 * it moves the constants of all rules, and b is that of g less its mean.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "lsq.h"
#include "propagation.h"

/* The smallest share of the noise that is left to the scatter. */
#define SCATTER_LEAST 0.2

/* A source, with its recording or calibration. */
struct origin {
	int source, unit;
	double sum;	  /* Σ w g */
	double *with_row; /* Σ w g φ */
	double *b;	  /* of the pass before, or NULL */
};

/* Names of recordings, or of calibrations. */
struct units {
	char **name;
	int n, at;
};

struct incise_propagation {
	int n_inputs, n_parts;
	struct incise_propagation_part part[INCISE_PROPAGATION_PARTS];
	bool has_source[INCISE_UNCERTAINTY_SOURCES];
	struct units units[2]; /* recordings, calibrations */
	const struct incise_model *model;
	double scatter;
	int n; /* unknowns */
	struct origin *origins;
	int n_origins;
	int of_source[INCISE_UNCERTAINTY_SOURCES]; /* origin of the present row, or -1 */
	double *phi, *with_row;			   /* φ, and Σ w φ */
	double weights, least;			   /* Σ w, smallest w */
	double own2, own2_least, own2_least_before;
	uint64_t rows;
	/* The end of the pass before: K, as a triangle of n rows, and the mean squares. */
	bool has_common;
	double *common;
	int n_common;
	double residual2, calibration2, rig2;
};

struct incise_propagation *incise_propagation_new(
	int n_inputs, const struct incise_propagation_part *parts, int n,
	struct incise_error *err)
{
	struct incise_propagation *p = calloc(1, sizeof(*p));

	if (!p)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for uncertainties");
	p->n_inputs = n_inputs;
	p->n_parts = n < 0 ? 0 : n;
	for (int i = 0; i < n; i++)
		if (n > INCISE_PROPAGATION_PARTS || n_inputs < 1 ||
		    n_inputs > INCISE_MODEL_INPUTS_MAX || parts[i].of < 0 ||
		    parts[i].of > n_inputs ||
		    parts[i].source >= INCISE_UNCERTAINTY_SOURCES) {
			incise_error_set(err, EINVAL,
					 "column %d of the uncertainties is of no column "
					 "of a pair, or there are more than %d",
					 i + 1, INCISE_PROPAGATION_PARTS);
			free(p);
			return NULL;
		}
	for (int i = 0; i < n; i++) {
		p->part[i] = parts[i];
		if (parts[i].source >= 0)
			p->has_source[parts[i].source] = true;
	}
	return p;
}

static void free_origins(struct incise_propagation *p)
{
	for (int i = 0; i < p->n_origins; i++) {
		free(p->origins[i].with_row);
		free(p->origins[i].b);
	}
	free(p->origins);
	p->origins = NULL;
	p->n_origins = 0;
}

void incise_propagation_free(struct incise_propagation *p)
{
	if (!p)
		return;
	free_origins(p);
	for (int k = 0; k < 2; k++) {
		for (int i = 0; i < p->units[k].n; i++)
			free(p->units[k].name[i]);
		free(p->units[k].name);
	}
	free(p->phi);
	free(p->with_row);
	free(p->common);
	free(p);
}

static int no_propagation_memory(struct incise_error *err)
{
	return incise_error_set(err, ENOMEM, "no memory for uncertainties");
}

int incise_propagation_start(struct incise_propagation *p,
			     const struct incise_model *model, double scatter,
			     struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(model);
	int n = info->n_rules * (info->n_inputs + 1);

	if (info->n_inputs != p->n_inputs || !(scatter > 0) || !isfinite(scatter) ||
	    (p->n && p->n != n))
		return incise_error_set(err, EINVAL,
					"uncertainties of pairs need a model of their "
					"inputs and a scatter above 0");
	if (!p->n) {
		p->phi = calloc((size_t)n, sizeof(*p->phi));
		p->with_row = calloc((size_t)n, sizeof(*p->with_row));
		if (!p->phi || !p->with_row)
			return no_propagation_memory(err);
		p->n = n;
	}
	p->model = model;
	p->scatter = scatter;
	memset(p->with_row, 0, (size_t)n * sizeof(*p->with_row));
	for (int i = 0; i < p->n_origins; i++) {
		p->origins[i].sum = 0;
		memset(p->origins[i].with_row, 0, (size_t)n * sizeof(double));
	}
	p->own2_least_before = p->rows ? p->own2_least : 0;
	p->weights = p->own2 = p->residual2 = p->calibration2 = p->rig2 = 0;
	p->own2_least = INFINITY;
	p->least = 1;
	p->rows = 0;
	return 0;
}

static int find_unit(struct units *units, const char *name)
{
	char **more;

	for (units->at = 0; units->at < units->n; units->at++)
		if (!strcmp(units->name[units->at], name))
			return 0;
	more = realloc(units->name, (size_t)(units->n + 1) * sizeof(*more));
	if (!more)
		return -ENOMEM;
	units->name = more;
	more[units->n] = strdup(name);
	if (!more[units->n])
		return -ENOMEM;
	units->n++;
	return 0;
}

/* Whether a source is common to a calibration, not to a recording. */
static bool is_of_calibration(const struct incise_propagation *p, int source)
{
	for (int i = 0; i < p->n_parts; i++)
		if (p->part[i].source == source)
			return p->part[i].calibration;
	return false;
}

/* The origin of a source at the present unit; -1: no memory. */
static int find_origin(struct incise_propagation *p, int source)
{
	int unit = p->units[is_of_calibration(p, source)].at;
	struct origin *more;

	for (int i = 0; i < p->n_origins; i++)
		if (p->origins[i].source == source && p->origins[i].unit == unit)
			return i;
	more = realloc(p->origins, (size_t)(p->n_origins + 1) * sizeof(*more));
	if (!more)
		return -1;
	p->origins = more;
	more[p->n_origins] = (struct origin){.source = source, .unit = unit};
	more[p->n_origins].with_row = calloc((size_t)p->n, sizeof(double));
	if (!more[p->n_origins].with_row)
		return -1;
	return p->n_origins++;
}

int incise_propagation_origin(struct incise_propagation *p, const char *recording,
			      const char *calibration, struct incise_error *err)
{
	if (find_unit(&p->units[0], recording) || find_unit(&p->units[1], calibration))
		return no_propagation_memory(err);
	for (int s = 0; s < INCISE_UNCERTAINTY_SOURCES; s++) {
		p->of_source[s] = -1;
		if (p->has_source[s] && (p->of_source[s] = find_origin(p, s)) < 0)
			return no_propagation_memory(err);
	}
	return 0;
}

static double product(const double *a, const double *b, int n)
{
	double sum = 0;

	for (int i = 0; i < n; i++)
		sum += a[i] * b[i];
	return sum;
}

/* Σ (K φ)² with the b of the pass before. */
static double common_square(const struct incise_propagation *p)
{
	double sum = 0;

	for (int i = 0; i < p->n_common; i++) {
		double v = product(p->common + (size_t)i * p->n, p->phi, p->n);

		sum += v * v;
	}
	return sum;
}

double incise_propagation_add(struct incise_propagation *p, const double *row)
{
	const double *part = row + p->n_inputs + 1;
	double slope[INCISE_MODEL_INPUTS_MAX + 1], y, own2 = 0, w, others2;
	double g[INCISE_UNCERTAINTY_SOURCES] = {0}, rig2 = 0;

	incise_model_eval_many(p->model, row, 1, &y, slope);
	/* The slopes are of the output less the model. */
	for (int i = 0; i < p->n_inputs; i++)
		slope[i] = -slope[i];
	slope[p->n_inputs] = 1;
	for (int i = 0; i < p->n_parts; i++) {
		double v = slope[p->part[i].of] * part[i];

		if (p->part[i].source < 0)
			own2 += v * v;
		else
			g[p->part[i].source] += v;
	}
	/* Each of alike pairs has the weight 1. */
	w = (p->scatter * p->scatter + fmin(p->own2_least_before, own2)) /
	    (p->scatter * p->scatter + own2);
	incise_uncertainty_row(p->model, row, p->phi);
	others2 = p->has_common ? common_square(p) : 0;
	p->calibration2 += others2;
	for (int s = 0; s < INCISE_UNCERTAINTY_SOURCES; s++) {
		struct origin *o;

		if (!p->has_source[s])
			continue;
		o = &p->origins[p->of_source[s]];
		o->sum += w * g[s];
		rig2 += g[s] * g[s];
		for (int k = 0; k < p->n; k++)
			o->with_row[k] += w * g[s] * p->phi[k];
		if (o->b) {
			double moved = product(o->b, p->phi, p->n);

			/* This rig's error less what the model follows of it, and the others'. */
			p->residual2 += (g[s] - moved) * (g[s] - moved) - moved * moved;
		}
	}
	if (p->has_common)
		p->residual2 += others2;
	for (int k = 0; k < p->n; k++)
		p->with_row[k] += w * p->phi[k];
	p->weights += w;
	p->least = fmin(p->least, w);
	p->own2 += own2;
	p->own2_least = fmin(p->own2_least, own2);
	p->rig2 += rig2;
	p->rows++;
	return w;
}

/* b of one origin. Returns 0 or -EDOM. */
static int solve_propagation(const struct incise_propagation *p,
			     const struct incise_uncertainty *uncertainty,
			     struct origin *o)
{
	double mean = o->sum / p->weights;

	for (int k = 0; k < p->n; k++)
		o->b[k] = o->with_row[k] - mean * p->with_row[k];
	if (incise_uncertainty_solve(uncertainty, o->b))
		return -EDOM;
	/* The constants of the rules come first of each. */
	for (int k = 0; k < p->n; k += p->n_inputs + 1)
		o->b[k] += mean;
	return 0;
}

/* K of all origins: their rows, or as few as there are unknowns. */
static int join(struct incise_propagation *p)
{
	int rows = p->n_origins < p->n ? p->n_origins : p->n, stride;
	double *common = realloc(p->common, (size_t)(rows + 1) * p->n * sizeof(double));
	struct incise_lsq *lsq;
	const double *factor;

	if (!common)
		return -ENOMEM;
	p->common = common;
	p->n_common = rows;
	if (rows == p->n_origins) {
		for (int i = 0; i < rows; i++)
			memcpy(common + (size_t)i * p->n, p->origins[i].b,
			       (size_t)p->n * sizeof(double));
		return 0;
	}
	lsq = incise_lsq_new(p->n, NULL);
	if (!lsq)
		return -ENOMEM;
	for (int i = 0; i < p->n_origins; i++) {
		memcpy(incise_lsq_row(lsq), p->origins[i].b,
		       (size_t)p->n * sizeof(double));
		incise_lsq_add(lsq, 0);
	}
	factor = incise_lsq_factor(lsq, NULL, &stride);
	for (int i = 0; factor && i < p->n; i++)
		for (int k = 0; k < p->n; k++)
			common[(size_t)i * p->n + k] =
				k < i ? 0 : factor[(size_t)i * stride + k];
	incise_lsq_free(lsq);
	return factor ? 0 : -EDOM;
}

int incise_propagation_end(struct incise_propagation *p, const struct incise_model *model,
			   const struct incise_uncertainty *uncertainty, double rmse,
			   double *scatter, struct incise_error *err)
{
	double own2;
	int rc = 0;

	if (!p->rows)
		return incise_error_set(err, ENODATA, "there are no pairs");
	if (incise_uncertainty_unknowns(uncertainty) != p->n ||
	    incise_model_info(model)->n_inputs != p->n_inputs)
		return incise_error_set(err, EINVAL,
					"uncertainties of another model than that of the "
					"pairs");
	for (int i = 0; i < p->n_origins && !rc; i++) {
		struct origin *o = &p->origins[i];

		if (!o->b)
			o->b = malloc((size_t)p->n * sizeof(*o->b));
		rc = o->b ? solve_propagation(p, uncertainty, o) : -ENOMEM;
	}
	if (!rc)
		rc = join(p);
	if (rc == -ENOMEM)
		return no_propagation_memory(err);
	if (rc)
		return incise_error_set(err, EDOM,
					"the uncertainties have no finite effect on the "
					"model; are they in the units of their columns?");
	p->has_common = true;
	own2 = p->own2 / (double)p->rows;
	*scatter = sqrt(
		fmax(rmse * rmse - own2, rmse * rmse * SCATTER_LEAST * SCATTER_LEAST));
	if (!(*scatter > 0))
		*scatter = p->scatter;
	return 0;
}

/* B: the errors of a source if all rigs had the same one. */
static double *sum_of_sources(const struct incise_propagation *p, int *n)
{
	double *rows = calloc((size_t)INCISE_UNCERTAINTY_SOURCES * p->n, sizeof(*rows));

	*n = 0;
	for (int s = 0; s < INCISE_UNCERTAINTY_SOURCES && rows; s++) {
		double *to = rows + (size_t)*n * p->n;

		if (!p->has_source[s])
			continue;
		for (int i = 0; i < p->n_origins; i++)
			for (int k = 0; k < p->n && p->origins[i].source == s; k++)
				to[k] += p->origins[i].b[k];
		++*n;
	}
	return rows;
}

int incise_propagation_finish(const struct incise_propagation *p,
			      struct incise_uncertainty *uncertainty,
			      struct incise_propagation_report *report,
			      struct incise_error *err)
{
	double noise = incise_uncertainty_noise(uncertainty), scatter, rows, *rig;
	int n_rig, rc;

	if (!p->has_common || !p->rows ||
	    incise_uncertainty_unknowns(uncertainty) != p->n)
		return incise_error_set(err, EINVAL,
					"uncertainties of pairs need a whole pass over "
					"them");
	rows = (double)p->rows;
	scatter = sqrt(fmax(noise * noise - fmax(p->residual2 / rows, 0),
			    noise * noise * SCATTER_LEAST * SCATTER_LEAST));
	rig = sum_of_sources(p, &n_rig);
	if (!rig)
		return no_propagation_memory(err);
	rc = incise_uncertainty_set_calibration(uncertainty, scatter, p->common,
						p->n_common, rig, n_rig, err);
	free(rig);
	if (!rc && report)
		*report = (struct incise_propagation_report){
			.own = sqrt(p->own2 / rows),
			.calibration = sqrt(p->calibration2 / rows),
			.rig = sqrt(p->rig2 / rows),
			.weight = p->least,
			.recordings = p->units[0].n,
			.calibrations = p->units[1].n,
		};
	return rc;
}
