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
#include "lsq.h"

#define PARAMS_MAX 3

/* Per membership function: its parameters' count, first values and gradient. */
struct premise {
	int n_params;
	double first[4];
	double gradient[PARAMS_MAX];
	double share; /* Σ over its rules, within one pair */
};

struct state {
	struct incise_model *model;
	struct incise_lsq *lsq;
	int n_inputs, n_rules;
	double *x;	/* solution of the consequents */
	double *w;	/* firing strengths */
	double *output; /* of each rule */
	struct premise premise[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	double step;
	/* The last five RMSEs, newest first, and when the step last changed. */
	double rmse[5];
	int raised, lowered;
};

int incise_anfis_n_premises(const struct incise_model *model)
{
	int n = 0;

	for (int i = 0; i < incise_model_n_inputs(model); i++)
		for (int k = 0; k < incise_model_n_mfs(model, i); k++)
			n += incise_mf_n_params(incise_model_mf(model, i, k)->type);
	return n;
}

/* ∂log A/∂p */
static void log_gradient(const struct incise_mf *mf, double x, double *g)
{
	const double *p = mf->p;
	double d, z, off;

	switch (mf->type) {
	case INCISE_MF_GAUSS:
		d = x - p[1];
		g[0] = d * d / (p[0] * p[0] * p[0]);
		g[1] = d / (p[0] * p[0]);
		break;
	case INCISE_MF_GBELL:
		d = x - p[2];
		z = fabs(d / p[0]);
		off = 1 - incise_mf_eval(mf, x);
		g[0] = 2 * p[1] / p[0] * off;
		g[1] = z > 0 ? -2 * log(z) * off : 0;
		g[2] = d != 0 ? 2 * p[1] / d * off : 0;
		break;
	default: /* incise_train() has refused it */
		memset(g, 0, PARAMS_MAX * sizeof(*g));
		break;
	}
}

int incise_anfis_fold(const struct incise_model *model, const struct incise_pairs *pairs,
		      struct incise_lsq *lsq)
{
	int n_inputs = pairs->n_inputs, n_rules = incise_model_n_rules(model);
	double w[INCISE_MODEL_RULES_MAX];

	for (size_t n = 0; n < pairs->n; n++) {
		const double *x = pairs->rows + n * (n_inputs + 1);
		double *row = incise_lsq_row(lsq);

		incise_model_firing(model, x, w);
		for (int r = 0; r < n_rules; r++) {
			*row++ = w[r];
			for (int i = 0; i < n_inputs; i++)
				*row++ = w[r] * x[i];
		}
		if (incise_lsq_add(lsq, x[n_inputs]))
			return -EDOM;
	}
	return 0;
}

void incise_anfis_set_consequents(struct incise_model *model, const double *x)
{
	int n = incise_model_n_inputs(model) + 1;

	for (int r = 0; r < incise_model_n_rules(model); r++)
		incise_model_set_consequent(model, r, x + r * n);
}

/* Output of the model at x without clamping; leaves w and the rules' outputs in s. */
static double predict(struct state *s, const double *x)
{
	double y = 0;

	incise_model_firing(s->model, x, s->w);
	for (int r = 0; r < s->n_rules; r++) {
		const double *p = incise_model_consequent(s->model, r);

		s->output[r] = p[0];
		for (int i = 0; i < s->n_inputs; i++)
			s->output[r] += p[i + 1] * x[i];
		y += s->w[r] * s->output[r];
	}
	return y;
}

static double rmse(struct state *s, const struct incise_pairs *pairs)
{
	double sum = 0;

	for (size_t n = 0; n < pairs->n; n++) {
		const double *x = pairs->rows + n * (s->n_inputs + 1);
		double e = predict(s, x) - x[s->n_inputs];

		sum += e * e;
	}
	return pairs->n ? sqrt(sum / pairs->n) : NAN;
}

/* One pair's part in the gradient. */
static void add_gradient(struct state *s, const double *x, double y)
{
	double g[PARAMS_MAX], e = y - x[s->n_inputs];

	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(s->model, i); k++)
			s->premise[i][k].share = 0;
	for (int r = 0; r < s->n_rules; r++)
		for (int i = 0; i < s->n_inputs; i++) {
			int k = incise_model_rule_mf(s->model, r, i);

			if (k >= 0)
				s->premise[i][k].share += s->w[r] * (s->output[r] - y);
		}
	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(s->model, i); k++) {
			struct premise *p = &s->premise[i][k];

			log_gradient(incise_model_mf(s->model, i, k), x[i], g);
			for (int j = 0; j < p->n_params; j++)
				p->gradient[j] += 2 * e * p->share * g[j];
		}
}

/* Training RMSE, and the gradient on the way. */
static double gradient(struct state *s, const struct incise_pairs *pairs)
{
	double sum = 0;

	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(s->model, i); k++)
			memset(s->premise[i][k].gradient, 0,
			       sizeof(s->premise[i][k].gradient));
	for (size_t n = 0; n < pairs->n; n++) {
		const double *x = pairs->rows + n * (s->n_inputs + 1);
		double y = predict(s, x);
		double e = y - x[s->n_inputs];

		sum += e * e;
		add_gradient(s, x, y);
	}
	return sqrt(sum / pairs->n);
}

static double clamp(double x, double min, double max)
{
	return fmax(min, fmin(max, x));
}

/* Hold widths and slopes near where they began, and centres in order. */
static void hold_shape(struct state *s, int i, int k, double *p)
{
	const struct premise *m = &s->premise[i][k];
	int c = m->n_params - 1; /* the centre is the last parameter of both kinds */
	int n = incise_model_n_mfs(s->model, i);

	p[0] = clamp(p[0], m->first[0] / 2, m->first[0] * 2);
	if (m->n_params == 3)
		p[1] = clamp(p[1], m->first[1] / 2, m->first[1] * 4);
	if (k > 0) {
		double least = 0.25 * (m->first[c] - s->premise[i][k - 1].first[c]);

		p[c] = fmax(p[c], incise_model_mf(s->model, i, k - 1)->p[c] + least);
	}
	if (k + 1 < n) {
		double least = 0.25 * (s->premise[i][k + 1].first[c] - m->first[c]);

		p[c] = fmin(p[c], incise_model_mf(s->model, i, k + 1)->p[c] - least);
	}
}

/* A step of length s->step down the gradient. */
static void move_premises(struct state *s, bool keep_shape)
{
	double norm = 0;

	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(s->model, i); k++)
			for (int j = 0; j < s->premise[i][k].n_params; j++)
				norm = hypot(norm, s->premise[i][k].gradient[j]);
	if (!(norm > 0) || !isfinite(norm))
		return;
	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(s->model, i); k++) {
			const struct incise_mf *mf = incise_model_mf(s->model, i, k);
			double p[4];

			memcpy(p, mf->p, sizeof(p));
			for (int j = 0; j < s->premise[i][k].n_params; j++)
				p[j] -= s->step * s->premise[i][k].gradient[j] / norm;
			if (keep_shape)
				hold_shape(s, i, k, p);
			/* A step that would turn a width negative is not taken. */
			incise_model_set_mf(s->model, i, k, p);
		}
}

/*
 * Jang's rule: after four falls in a row the step grows, after up and down twice it
 * shrinks; each at most every fourth epoch, counted from 0.
 */
static void adapt_step(struct state *s, int epoch)
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

static int epoch(struct state *s, struct incise_anfis *anfis, int number,
		 struct incise_model *best)
{
	double train, check, score;
	int rc;

	incise_lsq_reset(s->lsq);
	rc = incise_anfis_fold(s->model, anfis->train, s->lsq);
	if (!rc)
		rc = incise_lsq_solve(s->lsq, anfis->ridge, s->x);
	if (rc)
		return rc;
	incise_anfis_set_consequents(s->model, s->x);
	train = gradient(s, anfis->train);
	check = anfis->check ? rmse(s, anfis->check) : NAN;
	score = anfis->check ? check : train;
	if (anfis->progress)
		anfis->progress(anfis->user, number + 1, train, check);
	if (!anfis->best_epoch || !anfis->keep_best ||
	    score < (anfis->check ? anfis->check_rmse : anfis->train_rmse)) {
		anfis->best_epoch = number + 1;
		anfis->train_rmse = train;
		anfis->check_rmse = check;
		incise_model_assign(best, s->model);
	}
	memmove(s->rmse + 1, s->rmse, 4 * sizeof(*s->rmse));
	s->rmse[0] = train;
	move_premises(s, anfis->keep_shape);
	adapt_step(s, number);
	return 0;
}

int incise_anfis_run(struct incise_model *model, struct incise_anfis *anfis)
{
	int n_rules = incise_model_n_rules(model);
	int n = n_rules * (incise_model_n_inputs(model) + 1);
	struct incise_model *best = incise_model_copy(model);
	struct state *s = calloc(1, sizeof(*s));
	int rc = -ENOMEM;

	if (!s || !best)
		goto out;
	s->model = model;
	s->n_inputs = incise_model_n_inputs(model);
	s->n_rules = n_rules;
	s->step = anfis->step;
	s->lsq = incise_lsq_new(n);
	s->x = malloc(n * sizeof(double));
	s->w = malloc(n_rules * sizeof(double));
	s->output = malloc(n_rules * sizeof(double));
	if (!s->lsq || !s->x || !s->w || !s->output)
		goto out;
	for (int i = 0; i < s->n_inputs; i++)
		for (int k = 0; k < incise_model_n_mfs(model, i); k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);

			s->premise[i][k].n_params = incise_mf_n_params(mf->type);
			memcpy(s->premise[i][k].first, mf->p, sizeof(mf->p));
		}
	anfis->best_epoch = 0;
	rc = 0;
	for (int e = 0; e < anfis->epochs && !rc; e++)
		rc = epoch(s, anfis, e, best);
	if (!rc)
		incise_model_assign(model, best);
out:
	if (s) {
		incise_lsq_free(s->lsq);
		free(s->x);
		free(s->w);
		free(s->output);
	}
	free(s);
	incise_model_free(best);
	return rc;
}
