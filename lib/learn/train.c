// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Training a model; see incise/train.h.
 *
 *   classic:  anfis.c on the data as they are ─────────┐
 *   default:  scaling ─▶ ridge by cross-validation ──┐  │
 *             └ of a random part of very many pairs   ▼  ▼
 *        report, and the standard deviation ◀── the exact Gram matrix of all pairs
 *
 * Memory: the tuned part and its folds, and triangular factors; the pairs are read in order.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "anfis.h"
#include "design.h"
#include "interval.h"
#include "pairs.h"
#include "train.h"

/* MATLAB's recursive least squares starts with S = 1e6 I, which is this ridge. */
#define CLASSIC_RIDGE 1e-6

/* The ridge where no pairs can be held out. */
#define DEFAULT_RIDGE 1.0

/* Just enough that the standard deviation is finite where the user wants no ridge. */
#define LEAST_RIDGE 1e-9

struct learner {
	struct incise_model *model; /* the one at work */
	const struct incise_pairs *train, *check;
	const struct incise_train_options *options;
	const struct incise_train_sums *sums; /* NULL: of the pairs given */
	struct incise_watch watch;
	struct incise_train_report *report;
	struct incise_scaling scaling;
	struct incise_basis basis; /* scaled */
	double *consequents;
	struct incise_lsq *lsq;
	struct incise_design design; /* of all pairs, or those of a sample's factor: */
	double heaviest; /* weight of a pair, by which those of the design are divided */
	struct incise_factor *all;
	bool failed; /* to find that */
	struct incise_sample tuned;
	struct incise_folds folds; /* of that */
	struct incise_ridge ridge;
	double *quadratic; /* or NULL */
};

void incise_train_options_init(struct incise_train_options *options)
{
	*options = (struct incise_train_options){
		.epochs = 80, .step = 0.01, .ridge = NAN, .seed = 1};
}

static int check_pairs(const struct incise_model *model, const struct incise_pairs *pairs,
		       const char *what, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(model);

	if (pairs->n_inputs != info->n_inputs)
		return incise_error_set(err, EINVAL,
					"%s pairs have %d inputs, the model has %d", what,
					pairs->n_inputs, info->n_inputs);
	return incise_pairs_check(pairs, what, err);
}

static int check_all(const struct incise_model *model,
		     const struct incise_variable *inputs,
		     const struct incise_pairs *train, const struct incise_pairs *check,
		     const struct incise_train_options *options, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(model);
	size_t n_linear = (size_t)info->n_rules * (info->n_inputs + 1);
	int rc = check_pairs(model, train, "training", err);

	if (!rc && check)
		rc = check_pairs(model, check, "check", err);
	if (rc)
		return rc;
	if (options->classic && train->weights)
		return incise_error_set(err, EINVAL,
					"the classic method takes no weights; leave "
					"classic out");
	if (options->epochs < 1 || !(options->step > 0) || !isfinite(options->step) ||
	    options->ridge < 0 || isinf(options->ridge))
		return incise_error_set(
			err, EINVAL,
			"training needs at least 1 epoch, a positive step and a ridge that "
			"is not negative");
	if (train->n < n_linear)
		return incise_error_set(
			err, ENODATA,
			"%zu training pairs cannot determine the %zu consequent "
			"parameters of %d rules; give fewer membership functions or "
			"record more",
			train->n, n_linear, info->n_rules);
	return incise_pairs_check_inputs(train, inputs, err);
}

/* The gradients and scalings here are those of two kinds, and of a product of degrees. */
static int check_trainable(const struct incise_model *model, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(model);

	if (info->and_method != INCISE_AND_PROD)
		return incise_error_set(
			err, ENOTSUP,
			"the AND method of the model is min: only models with prod can "
			"be trained");
	for (int i = 0; i < info->n_inputs; i++)
		for (int k = 0; k < info->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			if (mf->type != INCISE_MF_GAUSS && mf->type != INCISE_MF_GBELL)
				return incise_error_set(
					err, ENOTSUP,
					"input %s, function %s is a %s: only gaussmf and "
					"gbellmf can be trained",
					info->input[i].name, mf->name,
					incise_mf_type_name(mf->type));
		}
	return 0;
}

/* The design of the pairs given, which are all. */
static int design_pairs(struct learner *l)
{
	int d = l->train->n_inputs, rc;
	const double *y = l->train->rows + d;
	double min = *y, max = *y;

	l->heaviest = incise_pairs_weight(l->train, 0);
	for (size_t i = 1; i < l->train->n; i++) {
		min = fmin(min, y[i * (d + 1)]);
		max = fmax(max, y[i * (d + 1)]);
		l->heaviest = fmax(l->heaviest, incise_pairs_weight(l->train, i));
	}
	rc = incise_design_init(&l->design, l->model, min, max);
	for (size_t i = 0; i < l->train->n && !rc; i++)
		rc = incise_watch_count(&l->watch, pow(l->basis.n_rules * (d + 1), 2))
			     ? -ECANCELED
			     : incise_design_add_to(&l->design, l->design.gram,
						    l->train->rows + i * (d + 1),
						    incise_pairs_weight(l->train, i) /
							    l->heaviest);
	return rc;
}

/*
 * The least squares of all pairs at the premises of the model, and which rules they fire. The
 * basis is taken from the model, so that a model that was read again leads to the same numbers.
 */
static int fold_all(struct learner *l)
{
	struct incise_design *design = &l->design;
	int d = l->train->n_inputs, rc = 0;
	double unit, mean, scale;

	if (l->sums) {
		rc = l->sums->find(l->sums->user, l->model, &l->all);
		l->failed = rc;
		if (!rc)
			design = incise_factor_design(l->all);
	} else {
		rc = design_pairs(l);
	}
	if (rc)
		return rc;
	l->watch.step.phase = INCISE_TRAIN_SOLVE;
	for (int r = 0; r < l->basis.n_rules; r++) {
		l->report->unfired[r] = design->largest[r] < DESIGN_UNFIRED;
		l->report->rules_unfired += l->report->unfired[r];
	}
	l->basis = design->basis;
	unit = design->scaling.scale[d];
	mean = (l->scaling.offset[d] - design->scaling.offset[d]) / unit;
	scale = l->scaling.scale[d] / unit;
	rc = incise_gram_factor(design->gram, mean, scale, l->lsq);
	for (int i = 0, n = l->basis.n_rules * (d + 1); !l->sums && i <= n; i++)
		for (int k = i; k <= n; k++)
			incise_lsq_factor_row(l->lsq, i)[k] *= sqrt(l->heaviest);
	return rc;
}

static int train_classic(struct learner *l)
{
	struct incise_anfis anfis = {
		.train = l->train,
		.check = l->check,
		.ridge = CLASSIC_RIDGE,
		.step = l->options->step,
		.epochs = l->options->epochs,
		.watch = &l->watch,
	};
	int rc = incise_anfis_run(l->model, &anfis);

	if (!rc)
		rc = incise_basis_init(&l->basis, l->model);
	if (rc)
		return rc;
	rc = fold_all(l);
	if (rc)
		return rc;
	l->ridge = (struct incise_ridge){.ridge = CLASSIC_RIDGE,
					 .n = l->basis.n_rules * (l->basis.n_inputs + 1)};
	l->report->epochs = anfis.epochs;
	l->report->best_epoch = anfis.best_epoch;
	return 0;
}

/* Set the model's consequents from scaled ones, which become raw. */
static int set_consequents(struct learner *l, double *consequents)
{
	int rc = incise_scaling_consequents(&l->scaling, l->basis.n_rules, consequents);

	return rc ? rc : incise_basis_set_consequents(l->model, consequents);
}

/* The ridge given, or the best on held-out pairs. */
static int choose_ridge(struct learner *l)
{
	double unit = l->scaling.scale[l->basis.n_inputs] / sqrt(l->folds.n_held);
	struct incise_ridge given = {.n = l->basis.n_rules * (l->basis.n_inputs + 1)};
	struct incise_choice choice;
	int rc;

	given.ridge = isnan(l->options->ridge) ? DEFAULT_RIDGE : l->options->ridge;
	l->ridge = given;
	if (l->folds.n < 2)
		return 0;
	l->quadratic = incise_quadratic(&l->basis, l->scaling.offset, l->scaling.scale);
	rc = incise_crossval_choose(&l->basis, &l->folds, l->quadratic, &choice);
	if (rc)
		return rc;
	if (isnan(l->options->ridge))
		l->ridge = choice.ridge;
	else
		rc = incise_crossval_ridges(&l->basis, &l->folds, &given, 1,
					    choice.error);
	l->report->crossval_rmse =
		unit * sqrt(incise_crossval_total(&l->folds, choice.error));
	l->report->crossval_plane = unit * sqrt(choice.plane);
	l->report->crossval_mean = unit * sqrt(choice.mean);
	l->report->crossval_quadratic = unit * sqrt(choice.quadratic);
	if (l->sums && l->sums->choice)
		*l->sums->choice = choice;
	else
		free(choice.error);
	return rc;
}

/* Consequents of the tuned pairs, from which weights follow. */
static int solve_sample(struct learner *l)
{
	int rc;

	incise_basis_fold(&l->basis, &l->tuned.pairs, l->lsq);
	rc = incise_lsq_solve(l->lsq, &l->ridge, l->consequents);
	return rc ? rc : set_consequents(l, l->consequents);
}

static int train_default(struct learner *l)
{
	int rc = choose_ridge(l);

	if (!rc && l->sums && !l->sums->find)
		return -EALREADY;
	if (!rc && l->sums && l->sums->weighted)
		rc = solve_sample(l);
	if (!rc)
		rc = fold_all(l);
	if (!rc)
		rc = incise_lsq_solve(l->lsq, &l->ridge, l->consequents);
	if (!rc)
		rc = set_consequents(l, l->consequents);
	l->report->epochs = l->report->best_epoch = 1;
	l->report->pairs_tuned = l->tuned.pairs.n;
	return rc;
}

/* The standard deviation, from the factor of all pairs and the noise of held-out ones. */
static int find_uncertainty(struct learner *l)
{
	struct incise_ridge ridge = l->ridge;
	struct incise_interval interval;
	int stride, rc;
	const double *factor;

	ridge.ridge = fmax(ridge.ridge, LEAST_RIDGE);
	rc = incise_interval_noise(&l->basis, &l->folds, &ridge, &interval);
	if (rc)
		return rc;
	factor = incise_lsq_factor(l->lsq, &ridge, &stride);
	if (!factor)
		return -errno;
	*l->options->uncertainty = incise_uncertainty_new(
		l->model, interval.noise * l->scaling.scale[l->basis.n_inputs], factor,
		stride, NULL);
	rc = *l->options->uncertainty ? 0 : errno == ENOMEM ? -ENOMEM : -EDOM;
	for (int i = 0; i < l->basis.n_inputs; i++) {
		double offset = l->scaling.offset[i], scale = l->scaling.scale[i];

		interval.shape.low[i] = offset + scale * interval.shape.low[i];
		interval.shape.high[i] = offset + scale * interval.shape.high[i];
	}
	return rc ? rc
		  : incise_uncertainty_set_shape(*l->options->uncertainty,
						 &interval.shape, NULL);
}

static int learn_train(struct learner *l)
{
	struct incise_train_report *report = l->report;
	bool classic = l->options->classic;
	int rc = incise_basis_init(&l->basis, l->model), n;
	size_t most;

	if (rc)
		return rc;
	n = l->basis.n_rules * (l->basis.n_inputs + 1);
	most = l->options->tuned ? l->options->tuned : TUNED_PAIRS;
	if (most < (size_t)3 * n)
		most = (size_t)3 * n;
	l->consequents = malloc(n * sizeof(*l->consequents));
	l->lsq = incise_lsq_new(n, &l->watch);
	if (!l->consequents || !l->lsq)
		return -ENOMEM;
	incise_scaling_premises(&l->scaling, &l->basis, false);
	if (!classic || l->options->uncertainty)
		rc = incise_sample_take(&l->tuned, &l->scaling, l->train,
					l->options->groups, most, l->options->seed);
	if (!rc && l->tuned.rows)
		rc = incise_folds_init(&l->folds, &l->tuned.pairs, l->tuned.groups,
				       l->options->seed);
	l->folds.watch = &l->watch;
	report->crossval_rmse = report->crossval_plane = report->crossval_mean =
		report->crossval_quadratic = NAN;
	if (!rc)
		rc = classic ? train_classic(l) : train_default(l);
	if (!rc)
		rc = incise_lsq_condition(l->lsq, &report->condition);
	if (rc)
		return rc;
	report->ridge = l->ridge.ridge;
	report->parameters = n + l->basis.n_premises;
	report->train_rmse = incise_pairs_rmse(l->model, l->train, !classic);
	report->train_r2 = incise_pairs_r2(l->train, report->train_rmse);
	if (l->all)
		report->train_rmse =
			incise_factor_rmse(l->all, l->model, &report->train_r2);
	report->check_rmse = report->check_r2 = NAN;
	if (l->check) {
		report->check_rmse = incise_pairs_rmse(l->model, l->check, !classic);
		report->check_r2 = incise_pairs_r2(l->check, report->check_rmse);
	}
	if (!classic &&
	    incise_watch_epoch(&l->watch, 1, report->train_rmse, report->check_rmse))
		return -ECANCELED;
	return l->options->uncertainty ? find_uncertainty(l) : 0;
}

static int fail_train(struct incise_error *err, int rc)
{
	return incise_error_set(
		err, -rc,
		rc == -ENOMEM	   ? "no memory to train"
		: rc == -ECANCELED ? "training was stopped"
		: rc == -ENOTSUP
			? "only models whose rules are the full grid of Gaussians or "
			  "bells, all with weight 1, can be trained"
			: "least squares failed: the values are too extreme; scale "
			  "them or give fewer membership functions");
}

int incise_train_sample(struct incise_model *model, const struct incise_pairs *train,
			const struct incise_pairs *check,
			const struct incise_train_options *options,
			const struct incise_train_sums *sums,
			struct incise_train_report *report, struct incise_error *err)
{
	const struct incise_model_info *info = incise_model_info(model);
	struct incise_variable inputs[INCISE_MODEL_INPUTS_MAX];
	struct incise_train_report own;
	struct learner *l;
	bool failed;
	int rc;

	for (int i = 0; i < info->n_inputs; i++)
		inputs[i] = info->input[i];
	rc = check_trainable(model, err);
	if (!rc)
		rc = check_all(model, inputs, train, check, options, err);
	if (rc)
		return rc;
	l = calloc(1, sizeof(*l));
	if (!l)
		return fail_train(err, -ENOMEM);
	l->train = train;
	l->check = check;
	l->options = options;
	l->sums = sums;
	l->watch = incise_watch_of(options);
	l->report = report ? report : &own;
	memset(l->report, 0, sizeof(*l->report));
	incise_scaling_find(&l->scaling, inputs, train);
	l->model = incise_model_copy(model);
	rc = l->model ? 0 : -ENOMEM;
	if (!rc && !incise_watch_ask(&l->watch))
		rc = learn_train(l);
	if (l->watch.stopped)
		rc = -ECANCELED;
	if (!rc)
		incise_model_assign(model, l->model);
	incise_model_free(l->model);
	incise_lsq_free(l->lsq);
	incise_design_free(&l->design);
	incise_folds_free(&l->folds);
	free(l->consequents);
	free(l->quadratic);
	incise_sample_free(&l->tuned);
	failed = l->failed;
	free(l);
	return rc && !failed ? fail_train(err, rc) : rc;
}

int incise_train(struct incise_model *model, const struct incise_pairs *train,
		 const struct incise_pairs *check,
		 const struct incise_train_options *options,
		 struct incise_train_report *report, struct incise_error *err)
{
	return incise_train_sample(model, train, check, options, NULL, report, err);
}
