// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training a model; see incise/train.h. The classic way runs the engine (anfis.c) on the
 * data as they are; the default scales them, chooses ridge and epochs by
 * cross-validation over whole groups, and then learns from all training pairs.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "anfis.h"
#include "lsq.h"
#include "shuffle.h"

/* Folds of the cross-validation. */
#define FOLDS 5

/* MATLAB's recursive least squares starts with S = 1e6 I, which is this ridge. */
#define CLASSIC_RIDGE 1e-6

/* Where there is nothing to cross-validate with; good on real tissue data. */
#define DEFAULT_RIDGE 1.0

/* Epochs without a better cross-validated error after which no more are tried. */
#define PATIENCE 15

/* A rule that never fires stronger than this has learnt nothing from the data. */
#define UNFIRED 0.05

static const double ridges[] = {1e-4, 1e-3, 1e-2, 1e-1, 1, 10, 100};
#define N_RIDGES ((int)(sizeof(ridges) / sizeof(*ridges)))

/* Scaled = (raw - offset) / scale, per column; the output is the last. */
struct scaling {
	int n_inputs;
	double offset[INCISE_MODEL_INPUTS_MAX + 1];
	double scale[INCISE_MODEL_INPUTS_MAX + 1];
};

/* The training pairs in folds: rows of fold f are held out from the fit of fold f. */
struct folds {
	int n;
	struct incise_pairs fit[FOLDS], held[FOLDS];
};

void incise_train_options_init(struct incise_train_options *options)
{
	*options = (struct incise_train_options){
		.epochs = 80, .step = 0.01, .ridge = NAN, .seed = 1};
}

static int check_pairs(const struct incise_model *model, const struct incise_pairs *pairs,
		       const char *what, struct incise_error *err)
{
	int n = pairs->n_inputs + 1;

	if (pairs->n_inputs != incise_model_n_inputs(model))
		return incise_error_set(err, EINVAL,
					"%s pairs have %d inputs, the model has %d", what,
					pairs->n_inputs, incise_model_n_inputs(model));
	if (!pairs->n)
		return incise_error_set(err, EINVAL, "there are no %s pairs", what);
	for (size_t i = 0; i < pairs->n * n; i++)
		if (!isfinite(pairs->rows[i]))
			return incise_error_set(err, EINVAL, "%s pair %zu is not finite",
						what, i / n + 1);
	return 0;
}

/* The gradients and scalings here are those of two kinds, and of a product of degrees. */
static int check_trainable(const struct incise_model *model, struct incise_error *err)
{
	if (incise_model_and_method(model) != INCISE_AND_PROD)
		return incise_error_set(
			err, ENOTSUP,
			"the model joins degrees by min: only models with "
			"the AND method prod can be trained");
	for (int i = 0; i < incise_model_n_inputs(model); i++)
		for (int k = 0; k < incise_model_n_mfs(model, i); k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			if (mf->type != INCISE_MF_GAUSS && mf->type != INCISE_MF_GBELL)
				return incise_error_set(
					err, ENOTSUP,
					"input %s, function %s is a %s: only gaussmf and "
					"gbellmf can be trained",
					incise_model_input(model, i)->name, mf->name,
					incise_mf_type_name(mf->type));
		}
	return 0;
}

static void find_scaling(struct scaling *s, const struct incise_model *model,
			 const struct incise_pairs *pairs)
{
	int d = pairs->n_inputs;
	double mean = 0, sum = 0, largest = 0;

	s->n_inputs = d;
	for (int i = 0; i < d; i++) {
		const struct incise_variable *v = incise_model_input(model, i);

		s->offset[i] = v->min;
		s->scale[i] = v->max - v->min;
	}
	for (size_t n = 0; n < pairs->n; n++)
		largest = fmax(largest, fabs(pairs->rows[n * (d + 1) + d]));
	if (!(largest > 0))
		largest = 1;
	/* Relative to the largest, so that squares neither vanish nor overflow. */
	for (size_t n = 0; n < pairs->n; n++)
		mean += pairs->rows[n * (d + 1) + d] / largest / pairs->n;
	for (size_t n = 0; n < pairs->n; n++) {
		double e = pairs->rows[n * (d + 1) + d] / largest - mean;

		sum += e * e / pairs->n;
	}
	s->offset[d] = mean * largest;
	s->scale[d] = sum > 0 ? sqrt(sum) * largest : largest;
}

static double *scale_rows(const struct scaling *s, const struct incise_pairs *pairs)
{
	int width = s->n_inputs + 1;
	double *rows = malloc(pairs->n * width * sizeof(*rows));

	for (size_t i = 0; rows && i < pairs->n * width; i++)
		rows[i] = (pairs->rows[i] - s->offset[i % width]) / s->scale[i % width];
	return rows;
}

/* Into scaled units, or back with to_raw. Centre and width of both kinds are lengths. */
static void scale_premises(struct incise_model *model, const struct scaling *s,
			   bool to_raw)
{
	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(model, i); k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);
			int c = mf->type == INCISE_MF_GBELL ? 2 : 1;
			double p[4];

			memcpy(p, mf->p, sizeof(p));
			if (to_raw) {
				p[0] *= s->scale[i];
				p[c] = s->offset[i] + p[c] * s->scale[i];
			} else {
				p[0] /= s->scale[i];
				p[c] = (p[c] - s->offset[i]) / s->scale[i];
			}
			incise_model_set_mf(model, i, k, p);
		}
}

static int unscale_consequents(struct incise_model *model, const struct scaling *s)
{
	int d = s->n_inputs;

	for (int r = 0; r < incise_model_n_rules(model); r++) {
		const double *p = incise_model_consequent(model, r);
		double raw[INCISE_MODEL_INPUTS_MAX + 1];

		raw[0] = s->offset[d] + p[0] * s->scale[d];
		for (int i = 0; i < d; i++) {
			raw[i + 1] = p[i + 1] * s->scale[d] / s->scale[i];
			raw[0] -= raw[i + 1] * s->offset[i];
		}
		if (incise_model_set_consequent(model, r, raw))
			return -EDOM;
	}
	return 0;
}

/* Which fold each row is in: by group where there are at least two. */
static int *assign_folds(size_t n, const int *groups, uint64_t seed, int *n_folds)
{
	size_t n_units = 0;
	size_t *order;
	int *fold;

	for (size_t i = 0; groups && i < n; i++)
		if ((size_t)groups[i] + 1 > n_units)
			n_units = (size_t)groups[i] + 1;
	if (n_units < 2) {
		groups = NULL;
		n_units = n;
	}
	*n_folds = n_units < FOLDS ? (int)n_units : FOLDS;
	order = malloc(n_units * sizeof(*order));
	fold = malloc(n * sizeof(*fold));
	if (order && fold) {
		/* order[u] is unit u's place in the shuffled line. */
		incise_shuffle(order, n_units, seed);
		for (size_t i = 0; i < n; i++)
			fold[i] = (int)(order[groups ? (size_t)groups[i] : i] % *n_folds);
	} else {
		free(fold);
		fold = NULL;
	}
	free(order);
	return fold;
}

static void free_folds(struct folds *folds)
{
	for (int f = 0; f < FOLDS; f++) {
		free((void *)folds->fit[f].rows);
		free((void *)folds->held[f].rows);
	}
}

static int make_folds(struct folds *folds, const struct incise_pairs *pairs,
		      const int *groups, uint64_t seed)
{
	size_t width = pairs->n_inputs + 1;
	int *fold = assign_folds(pairs->n, groups, seed, &folds->n);
	int rc = fold ? 0 : -ENOMEM;

	for (int f = 0; f < folds->n && !rc; f++) {
		double *fit = malloc(pairs->n * width * sizeof(*fit));
		double *held = malloc(pairs->n * width * sizeof(*held));
		size_t n_fit = 0, n_held = 0;

		folds->fit[f].rows = fit;
		folds->held[f].rows = held;
		if (!fit || !held) {
			rc = -ENOMEM;
			break;
		}
		for (size_t i = 0; i < pairs->n; i++)
			memcpy(fold[i] == f ? held + width * n_held++
					    : fit + width * n_fit++,
			       pairs->rows + width * i, width * sizeof(*fit));
		folds->fit[f] = (struct incise_pairs){fit, n_fit, pairs->n_inputs};
		folds->held[f] = (struct incise_pairs){held, n_held, pairs->n_inputs};
	}
	free(fold);
	return rc;
}

/* The ridge with the least held-out error at the first premises. */
static int choose_ridge(struct incise_model *model, const struct folds *folds,
			double *ridge)
{
	int n = incise_model_n_rules(model) * (incise_model_n_inputs(model) + 1);
	struct incise_lsq *lsq = incise_lsq_new(n);
	double *x = malloc(n * sizeof(*x));
	double error[N_RIDGES] = {0};
	int best = 0, rc = lsq && x ? 0 : -ENOMEM;

	for (int f = 0; f < folds->n && !rc; f++) {
		incise_lsq_reset(lsq);
		rc = incise_anfis_fold(model, &folds->fit[f], lsq);
		for (int i = 0; i < N_RIDGES && !rc; i++) {
			double e;

			rc = incise_lsq_solve(lsq, ridges[i], x);
			if (rc)
				break;
			incise_anfis_set_consequents(model, x);
			e = incise_train_rmse(model, &folds->held[f]);
			error[i] += e * e * folds->held[f].n;
		}
	}
	for (int i = 1; i < N_RIDGES; i++)
		if (error[i] < error[best])
			best = i;
	*ridge = ridges[best];
	incise_lsq_free(lsq);
	free(x);
	return rc;
}

struct epoch_errors {
	double *sum; /* held-out squared error by epoch */
	size_t held;
	int epochs;
};

static void add_epoch_error(void *user, int epoch, double train_rmse, double check_rmse)
{
	struct epoch_errors *errors = user;

	(void)train_rmse; /* callbacks share one form */
	errors->sum[epoch - 1] += check_rmse * check_rmse * errors->held;
}

/* The number of epochs with the least held-out error. */
static int choose_epochs(const struct incise_model *model, const struct folds *folds,
			 const struct incise_anfis *like, int *epochs)
{
	struct epoch_errors errors = {.sum = calloc(like->epochs, sizeof(double)),
				      .epochs = like->epochs};
	int best = 0, rc = errors.sum ? 0 : -ENOMEM;

	for (int f = 0; f < folds->n && !rc; f++) {
		struct incise_model *copy = incise_model_copy(model);
		struct incise_anfis anfis = *like;

		anfis.train = &folds->fit[f];
		anfis.check = &folds->held[f];
		anfis.progress = add_epoch_error;
		anfis.user = &errors;
		errors.held = folds->held[f].n;
		rc = copy ? incise_anfis_run(copy, &anfis) : -ENOMEM;
		incise_model_free(copy);
	}
	for (int e = 1; e < like->epochs && !rc && e - best <= PATIENCE; e++)
		if (errors.sum[e] < errors.sum[best])
			best = e;
	*epochs = best + 1;
	free(errors.sum);
	return rc;
}

static int train_classic(struct incise_model *model, const struct incise_pairs *train,
			 const struct incise_pairs *check,
			 const struct incise_train_options *options,
			 struct incise_train_report *report)
{
	struct incise_anfis anfis = {
		.train = train,
		.check = check,
		.ridge = CLASSIC_RIDGE,
		.step = options->step,
		.epochs = options->epochs,
		.keep_best = true,
		.progress = options->progress,
		.user = options->user,
	};
	int rc = incise_anfis_run(model, &anfis);

	report->epochs = anfis.epochs;
	report->best_epoch = anfis.best_epoch;
	report->ridge = CLASSIC_RIDGE;
	return rc;
}

/* Progress of the final run in raw units. */
struct unscaled {
	const struct incise_train_options *options;
	double scale;
};

static void report_unscaled(void *user, int epoch, double train_rmse, double check_rmse)
{
	const struct unscaled *u = user;

	u->options->progress(u->options->user, epoch, train_rmse * u->scale,
			     check_rmse * u->scale);
}

static int train_scaled(struct incise_model *model, const struct incise_pairs *train,
			const struct incise_pairs *check, const struct scaling *scaling,
			const struct incise_train_options *options,
			struct incise_train_report *report)
{
	struct unscaled unscaled = {options, scaling->scale[scaling->n_inputs]};
	struct incise_anfis anfis = {
		.ridge = options->ridge,
		.step = options->step,
		.epochs = options->epochs,
		.keep_shape = true,
	};
	struct folds folds = {0};
	int rc = make_folds(&folds, train, options->groups, options->seed);

	if (!rc && folds.n < 2) {
		anfis.ridge = isnan(options->ridge) ? DEFAULT_RIDGE : options->ridge;
	} else if (!rc) {
		if (isnan(options->ridge))
			rc = choose_ridge(model, &folds, &anfis.ridge);
		if (!rc)
			rc = choose_epochs(model, &folds, &anfis, &anfis.epochs);
	}
	free_folds(&folds);
	anfis.train = train;
	anfis.check = check;
	anfis.progress = options->progress ? report_unscaled : NULL;
	anfis.user = &unscaled;
	if (!rc)
		rc = incise_anfis_run(model, &anfis);
	report->epochs = report->best_epoch = anfis.epochs;
	report->ridge = anfis.ridge;
	return rc;
}

static int train_default(struct incise_model *model, const struct incise_pairs *train,
			 const struct incise_pairs *check, const struct scaling *scaling,
			 const struct incise_train_options *options,
			 struct incise_train_report *report)
{
	struct incise_pairs scaled = *train, scaled_check = {0};
	double *rows = scale_rows(scaling, train);
	double *check_rows = check ? scale_rows(scaling, check) : NULL;
	int rc = -ENOMEM;

	if (!rows || (check && !check_rows))
		goto out;
	scaled.rows = rows;
	if (check)
		scaled_check =
			(struct incise_pairs){check_rows, check->n, check->n_inputs};
	scale_premises(model, scaling, false);
	rc = train_scaled(model, &scaled, check ? &scaled_check : NULL, scaling, options,
			  report);
	scale_premises(model, scaling, true);
	if (!rc)
		rc = unscale_consequents(model, scaling);
out:
	free(rows);
	free(check_rows);
	return rc;
}

/* Condition of the least squares on scaled data, and the rules they never fire. */
static int examine(const struct incise_model *model, const struct incise_pairs *train,
		   const struct scaling *scaling, struct incise_train_report *report)
{
	int d = train->n_inputs, n_rules = incise_model_n_rules(model);
	struct incise_lsq *lsq = incise_lsq_new(n_rules * (d + 1));
	double w[INCISE_MODEL_RULES_MAX], largest[INCISE_MODEL_RULES_MAX] = {0};
	int rc = lsq ? 0 : -ENOMEM;

	for (size_t n = 0; n < train->n && !rc; n++) {
		const double *x = train->rows + n * (d + 1);
		double *row = incise_lsq_row(lsq);

		incise_model_firing(model, x, w);
		for (int r = 0; r < n_rules; r++) {
			largest[r] = fmax(largest[r], w[r]);
			*row++ = w[r];
			for (int i = 0; i < d; i++)
				*row++ = w[r] * (x[i] - scaling->offset[i]) /
					 scaling->scale[i];
		}
		rc = incise_lsq_add(lsq, 0);
	}
	if (!rc)
		rc = incise_lsq_condition(lsq, &report->condition);
	for (int r = 0; r < n_rules; r++)
		report->rules_unfired += largest[r] < UNFIRED;
	incise_lsq_free(lsq);
	return rc;
}

int incise_train(struct incise_model *model, const struct incise_pairs *train,
		 const struct incise_pairs *check,
		 const struct incise_train_options *options,
		 struct incise_train_report *report, struct incise_error *err)
{
	struct incise_train_report own;
	struct incise_model *work;
	struct scaling scaling;
	size_t n_linear;
	int rc = check_trainable(model, err);

	if (!rc)
		rc = check_pairs(model, train, "training", err);
	if (!rc && check)
		rc = check_pairs(model, check, "check", err);
	if (rc)
		return rc;
	if (options->epochs < 1 || !(options->step > 0) || !isfinite(options->step) ||
	    options->ridge < 0)
		return incise_error_set(
			err, EINVAL,
			"training needs at least 1 epoch, a positive step and a "
			"ridge that is not negative");
	n_linear = (size_t)incise_model_n_rules(model) * (train->n_inputs + 1);
	if (train->n < n_linear)
		return incise_error_set(
			err, ENODATA,
			"%zu training pairs cannot settle the %zu consequent parameters of "
			"%d rules; ask for fewer membership functions or record more",
			train->n, n_linear, incise_model_n_rules(model));
	if (!report)
		report = &own;
	memset(report, 0, sizeof(*report));
	work = incise_model_copy(model);
	if (!work)
		return incise_error_set(err, ENOMEM, "no memory to train");
	find_scaling(&scaling, model, train);
	if (options->classic)
		rc = train_classic(work, train, check, options, report);
	else
		rc = train_default(work, train, check, &scaling, options, report);
	if (!rc)
		rc = examine(work, train, &scaling, report);
	if (rc) {
		incise_model_free(work);
		return incise_error_set(
			err, -rc,
			rc == -ENOMEM ? "no memory to train"
				      : "least squares failed: the data are too "
					"extreme for a solution; scale them or "
					"ask for fewer membership functions");
	}
	report->train_rmse = incise_train_rmse(work, train);
	report->check_rmse = check ? incise_train_rmse(work, check) : NAN;
	report->parameters = (int)n_linear + incise_anfis_n_premises(work);
	incise_model_assign(model, work);
	incise_model_free(work);
	return 0;
}

double incise_train_rmse(const struct incise_model *model,
			 const struct incise_pairs *pairs)
{
	double w[INCISE_MODEL_RULES_MAX], sum = 0, largest = 0;

	for (size_t n = 0; n < pairs->n; n++) {
		const double *x = pairs->rows + n * (pairs->n_inputs + 1);
		double e = -x[pairs->n_inputs];

		incise_model_firing(model, x, w);
		for (int r = 0; r < incise_model_n_rules(model); r++) {
			const double *p = incise_model_consequent(model, r);

			e += w[r] * p[0];
			for (int i = 0; i < pairs->n_inputs; i++)
				e += w[r] * p[i + 1] * x[i];
		}
		/* Σe² as largest²·sum, which neither vanishes nor overflows. */
		e = fabs(e);
		if (e > largest) {
			sum *= (largest / e) * (largest / e);
			largest = e;
		}
		if (largest > 0)
			sum += (e / largest) * (e / largest);
	}
	return pairs->n ? largest * sqrt(sum / pairs->n) : NAN;
}
