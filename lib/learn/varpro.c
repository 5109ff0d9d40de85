// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Variable projection; see varpro.h.
 *
 * With Φ the rows of the consequents' least squares (ridge rows below), p its solution and
 * D = ∂(Φp)/∂u the change of the output by a step u of the premises, p held, Kaufman's
 * approximation of the projected residual's Jacobian is -P⊥D, P⊥ = 1 - ΦΦ⁺. One QR has it
 * all, so neither Q nor normal equations are formed and memory does not grow with rows:
 *
 *        Φ    D    t            n    q    1
 *      ┌────┬────┬───┐        ┌────┬────┬───┐
 *      │    │    │   │  ──▶   │ R₁ │ S  │ z │   R₁ p = z
 *      │    │    │   │        │    │ R₂ │ g │   |P⊥(t - D u)|² = |g - R₂ u|² + ρ²
 *      └────┴────┴───┘        └────┴────┴─ρ─┘
 *
 * A step solves [R₂; √μ c] u = [g; 0], c the largest column of R₂: a ridge on R₂.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "varpro.h"

/* Damping: first, by success and failure, and where a search ends. */
#define MU_FIRST 0.1
#define MU_DOWN 0.3
#define MU_UP 5.0
#define MU_MAX 1e6

/* Longest move of a premise in one step, in spacings or logarithms. */
#define STEP_MAX 0.5

/* A fall of the squared error below this share is the end. */
#define TOLERANCE 1e-7

struct varpro_state {
	const struct incise_pairs *pairs;
	const struct incise_ridge *ridge;
	int n, q;			 /* consequents, premises */
	struct incise_lsq *linear, *all; /* of n and of n + q unknowns */
	struct incise_lsq *damped;	 /* R₂ and g; of q unknowns */
	double *kept;			 /* firing strengths of the last solution */
	double *step;			 /* q */
	double *scale;			 /* q */
};

/* The best consequents for some premises; *error is the penalised squared error. */
static int solve_varpro(struct varpro_state *s, const struct incise_basis *basis,
			double *consequents, double *error)
{
	const double *factor;
	int stride;

	incise_basis_fold(basis, s->pairs, s->linear, s->kept, s->pairs->n);
	factor = incise_lsq_factor(s->linear, s->ridge, &stride);
	if (!factor)
		return -EDOM;
	*error = pow(factor[(size_t)s->n * (stride + 1)], 2);
	return incise_lsq_back(factor, stride, s->n, s->n, consequents);
}

/* ∂output/∂step of all premises, at a pair. */
static void derivative(const struct varpro_state *s, const struct incise_basis *basis,
		       const double *w, const double *x, const double *consequents,
		       double *to)
{
	double shares[INCISE_MODEL_INPUTS_MAX * INCISE_MODEL_MFS_MAX];
	double f[INCISE_MODEL_RULES_MAX];
	const double *share = shares, *scale = s->scale;
	double y = incise_basis_output(basis, w, x, consequents, f);

	incise_basis_slopes(basis, x, to);
	incise_basis_shares(basis, w, f, y, shares);
	for (int i = 0; i < basis->n_inputs; i++)
		for (int k = 0; k < basis->n_mfs[i]; k++, share++)
			for (int j = incise_mf_n_params(basis->type[i][k]); j > 0; j--)
				*to++ *= *share * *scale++;
}

/* R₂ and g for the strengths and consequents of the last solution. False: none. */
static bool project(struct varpro_state *s, const struct incise_basis *basis,
		    const double *consequents)
{
	int d = s->pairs->n_inputs, stride;
	const double *factor;

	incise_premises_scale(basis, s->scale);
	incise_lsq_reset(s->all);
	for (size_t i = 0; i < s->pairs->n; i++) {
		const double *x = s->pairs->rows + i * (d + 1);
		const double *w = s->kept + i * basis->n_rules;
		double *row = incise_lsq_row(s->all);

		incise_basis_row(basis, w, x, row);
		derivative(s, basis, w, x, consequents, row + s->n);
		incise_lsq_add_weighted(s->all, x[d], incise_pairs_weight(s->pairs, i));
	}
	factor = incise_lsq_factor(s->all, s->ridge, &stride);
	for (int i = 0; i < s->q && factor; i++)
		memcpy(incise_lsq_factor_row(s->damped, i) + i,
		       factor + (size_t)(s->n + i) * (stride + 1),
		       (s->q + 1 - i) * sizeof(double));
	return factor;
}

static double largest_column(struct incise_lsq *triangle, int q)
{
	double largest = 0;

	for (int k = 0; k < q; k++) {
		double sum = 0;

		for (int i = 0; i <= k; i++)
			sum += pow(incise_lsq_factor_row(triangle, i)[k], 2);
		largest = fmax(largest, sqrt(sum));
	}
	return largest;
}

/* The damped step into s->step. */
static int find_step(struct varpro_state *s, double damping)
{
	struct incise_ridge ridge = {damping, 1, s->q, 1};
	int rc = incise_lsq_solve(s->damped, &ridge, s->step);

	for (int k = 0; k < s->q && !rc; k++)
		s->step[k] = fmax(-STEP_MAX, fmin(STEP_MAX, s->step[k]));
	return rc;
}

/* One step downhill; false where there is none. */
static bool improve(struct varpro_state *s, struct incise_basis *basis,
		    double *consequents, double *trial_consequents, double *error,
		    double *mu)
{
	double norm =
		project(s, basis, consequents) ? largest_column(s->damped, s->q) : 0;

	if (!(norm > 0))
		return false;
	for (; *mu < MU_MAX; *mu *= MU_UP) {
		struct incise_basis trial = *basis;
		double trial_error;

		if (find_step(s, *mu * norm * norm))
			continue;
		incise_premises_step(&trial, s->step);
		if (solve_varpro(s, &trial, trial_consequents, &trial_error) ||
		    !(trial_error < *error * (1 - TOLERANCE)))
			continue;
		*basis = trial;
		*error = trial_error;
		memcpy(consequents, trial_consequents, s->n * sizeof(double));
		*mu *= MU_DOWN;
		return true;
	}
	return false;
}

static void state_free(struct varpro_state *s)
{
	incise_lsq_free(s->linear);
	incise_lsq_free(s->all);
	incise_lsq_free(s->damped);
	free(s->kept);
	free(s->step);
	free(s->scale);
}

int incise_varpro_run(struct incise_basis *basis, double *consequents,
		      struct incise_varpro *varpro)
{
	int q = basis->n_premises, n = basis->n_rules * (basis->n_inputs + 1);
	struct varpro_state s = {
		.pairs = varpro->pairs, .ridge = varpro->ridge, .n = n, .q = q};
	double *trial = malloc(n * sizeof(double)), error, mu = MU_FIRST;
	int rc = -ENOMEM;

	s.linear = incise_lsq_new(n, varpro->watch);
	s.all = incise_lsq_new(n + q, varpro->watch);
	s.damped = incise_lsq_new(q, varpro->watch);
	s.kept = malloc((varpro->pairs->n + 1) * basis->n_rules * sizeof(double));
	s.step = malloc(q * sizeof(double));
	s.scale = malloc(q * sizeof(double));
	if (!trial || !s.linear || !s.all || !s.damped || !s.kept || !s.step || !s.scale)
		goto out;
	rc = solve_varpro(&s, basis, consequents, &error);
	if (rc)
		goto out;
	for (varpro->run = 1;; varpro->run++) {
		if (varpro->each &&
		    !varpro->each(varpro->user, varpro->run, basis, consequents))
			break;
		if (varpro->run == varpro->epochs ||
		    !improve(&s, basis, consequents, trial, &error, &mu))
			break;
	}
out:
	state_free(&s);
	free(trial);
	return rc;
}
