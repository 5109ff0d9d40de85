// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Jang's hybrid learning; see anfis.h.
 *
 * With y = Σ w̄(r) f(r), w̄ the normalised firing strengths, the gradient of the sum of
 * squared errors by a parameter α of membership function A is
 *
 *     Σ_pairs 2 (y - t) Σ_{r uses A} w̄(r) (f(r) - y) ∂log A/∂α
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "anfis.h"
#include "basis.h"

struct anfis_state {
	struct incise_basis basis, best;
	struct incise_lsq *lsq;
	int n_linear;
	double *x, *best_x; /* consequents */
	double *gradient;   /* of the premises */
	double step;
	/* The last five RMSEs, newest first, and when the step last changed. */
	double rmse[5];
	int raised, lowered;
};

static int solve_anfis(struct anfis_state *s, const struct incise_pairs *pairs,
		       double ridge)
{
	struct incise_ridge plain = {.ridge = ridge, .n = s->n_linear};

	incise_basis_fold(&s->basis, pairs, s->lsq);
	return incise_lsq_solve(s->lsq, &plain, s->x);
}

static double check_rmse(const struct anfis_state *s, const struct incise_pairs *pairs,
			 struct incise_watch *watch)
{
	double sum = 0;

	for (size_t n = 0; n < pairs->n && !incise_watch_count(watch, s->n_linear); n++) {
		const double *x = pairs->rows + n * (pairs->n_inputs + 1);
		double e = incise_basis_error(&s->basis, x, s->x);

		sum += e * e;
	}
	return sqrt(sum / pairs->n);
}

/* One pair's part in the gradient. */
static void add_gradient(struct anfis_state *s, const double *x, const double *w,
			 const double *f, double y, double error)
{
	double slopes[INCISE_MODEL_INPUTS_MAX * INCISE_MODEL_MFS_MAX * BASIS_PARAMS_MAX];
	double shares[INCISE_MODEL_INPUTS_MAX * INCISE_MODEL_MFS_MAX];
	const double *slope = slopes, *share = shares;
	double *g = s->gradient;

	incise_basis_slopes(&s->basis, x, slopes);
	incise_basis_shares(&s->basis, w, f, y, shares);
	for (int i = 0; i < s->basis.n_inputs; i++)
		for (int k = 0; k < s->basis.n_mfs[i]; k++, share++)
			for (int j = incise_mf_n_params(s->basis.type[i][k]); j > 0; j--)
				*g++ += 2 * error * *share * *slope++;
}

/* Training RMSE, and the gradient on the way. */
static double gradient(struct anfis_state *s, const struct incise_pairs *pairs,
		       struct incise_watch *watch)
{
	double w[INCISE_MODEL_RULES_MAX], f[INCISE_MODEL_RULES_MAX], sum = 0;
	int d = pairs->n_inputs;

	memset(s->gradient, 0, s->basis.n_premises * sizeof(double));
	for (size_t n = 0; n < pairs->n && !incise_watch_count(watch, 10 * s->n_linear);
	     n++) {
		const double *x = pairs->rows + n * (d + 1);
		double y;

		incise_basis_firing(&s->basis, x, w);
		y = incise_basis_output(&s->basis, w, x, s->x, f);
		sum += (y - x[d]) * (y - x[d]);
		add_gradient(s, x, w, f, y, y - x[d]);
	}
	return sqrt(sum / pairs->n);
}

/* A step of length s->step down the gradient. */
static void move_premises(struct anfis_state *s)
{
	double norm = 0, p[BASIS_PARAMS_MAX];

	for (int i = 0; i < s->basis.n_premises; i++)
		norm = hypot(norm, s->gradient[i]);
	if (!(norm > 0) || !isfinite(norm))
		return;
	for (int i = 0; i < s->basis.n_inputs; i++)
		for (int k = 0; k < s->basis.n_mfs[i]; k++) {
			int at = s->basis.at[i][k];
			int n = incise_mf_n_params(s->basis.type[i][k]);

			for (int j = 0; j < n; j++)
				p[j] = s->basis.p[at + j] -
				       s->step * s->gradient[at + j] / norm;
			/* A step that would turn a width or slope negative is not taken. */
			if (p[0] > 0 && (n == 2 || p[1] > 0))
				memcpy(s->basis.p + at, p, n * sizeof(*p));
		}
}

/*
 * Jang's rule: after four falls in a row the step grows, after up and down twice it
 * shrinks; each at most every fourth epoch, counted from 0.
 */
static void adapt_step(struct anfis_state *s, int epoch)
{
	const double *e = s->rmse;

	if (epoch - s->lowered >= 4 && e[0] < e[1] && e[1] > e[2] && e[2] < e[3] &&
	    e[3] > e[4]) {
		s->step *= 0.9;
		s->lowered = epoch;
	}
	if (epoch - s->raised >= 4 && e[0] < e[1] && e[1] < e[2] && e[2] < e[3] &&
	    e[3] < e[4]) {
		s->step *= 1.1;
		s->raised = epoch;
	}
}

static int epoch(struct anfis_state *s, struct incise_anfis *anfis, int number)
{
	double train, check, score;
	int rc = solve_anfis(s, anfis->train, anfis->ridge);

	if (rc)
		return rc;
	train = gradient(s, anfis->train, anfis->watch);
	check = anfis->check ? check_rmse(s, anfis->check, anfis->watch) : NAN;
	score = anfis->check ? check : train;
	if (incise_watch_epoch(anfis->watch, number + 1, train, check))
		return -ECANCELED;
	if (!anfis->best_epoch ||
	    score < (anfis->check ? anfis->check_rmse : anfis->train_rmse)) {
		anfis->best_epoch = number + 1;
		anfis->train_rmse = train;
		anfis->check_rmse = check;
		s->best = s->basis;
		memcpy(s->best_x, s->x, s->n_linear * sizeof(double));
	}
	memmove(s->rmse + 1, s->rmse, 4 * sizeof(*s->rmse));
	s->rmse[0] = train;
	move_premises(s);
	adapt_step(s, number);
	return 0;
}

static void state_free(struct anfis_state *s)
{
	if (!s)
		return;
	incise_lsq_free(s->lsq);
	free(s->x);
	free(s->best_x);
	free(s->gradient);
	free(s);
}

int incise_anfis_run(struct incise_model *model, struct incise_anfis *anfis)
{
	struct anfis_state *s = calloc(1, sizeof(*s));
	int rc = s ? incise_basis_init(&s->basis, model) : -ENOMEM;

	if (rc)
		goto out;
	s->step = anfis->step;
	s->n_linear = s->basis.n_rules * (s->basis.n_inputs + 1);
	rc = -ENOMEM;
	s->lsq = incise_lsq_new(s->n_linear, anfis->watch);
	s->x = malloc(s->n_linear * sizeof(double));
	s->best_x = malloc(s->n_linear * sizeof(double));
	s->gradient = malloc(s->basis.n_premises * sizeof(double));
	if (!s->lsq || !s->x || !s->best_x || !s->gradient)
		goto out;
	anfis->best_epoch = 0;
	rc = 0;
	for (int e = 0; e < anfis->epochs && !rc; e++)
		rc = epoch(s, anfis, e);
	if (rc)
		goto out;
	incise_basis_store(&s->best, model);
	rc = incise_basis_set_consequents(model, s->best_x);
out:
	state_free(s);
	return rc;
}
