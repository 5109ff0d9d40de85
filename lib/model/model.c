// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The Takagi–Sugeno model in double: making, reading out and evaluating it; see
 * incise/model.h.
 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"

static bool begins(const char *name, const char *word)
{
	return !strncmp(name, word, strlen(word));
}

/*
 * Name function @k of @n for a reader: "shallow" to "deep" over a depth, "slow" to "fast" over
 * a velocity, "low" to "high" over anything else, and over a range that is partly negative.
 * Five are "very_shallow", "shallow", "medium", "deep", "very_deep"; more than seven are numbers.
 */
static void name_mf(char name[INCISE_MODEL_NAME_MAX], const struct incise_variable *input,
		    int k, int n)
{
	static const char *const degrees[] = {"", "very_", "extremely_"};
	static const char *const words[][2] = {
		{"low", "high"}, {"shallow", "deep"}, {"slow", "fast"}};
	/* Functions between this one and the end of its half, where the word alone stands. */
	int inner = k < n / 2 ? n / 2 - 1 - k : k - (n + 1) / 2;
	int kind = 0;

	if (input->min >= 0 && begins(input->name, "depth"))
		kind = 1;
	else if (input->min >= 0 &&
		 (begins(input->name, "velocity") || begins(input->name, "speed")))
		kind = 2;
	if (n % 2 && k == n / 2 && n < 8)
		snprintf(name, INCISE_MODEL_NAME_MAX, "medium");
	else if (n < 8)
		snprintf(name, INCISE_MODEL_NAME_MAX, "%s%s", degrees[inner],
			 words[kind][k >= n / 2]);
	else
		snprintf(name, INCISE_MODEL_NAME_MAX, "level_%d", k + 1);
}

/*
 * Evenly spaced functions over the range, neighbours crossing at 0.5, shoulders where
 * MATLAB's genfis1 has them: 0.3 of the spacing from the centre.
 */
static void grid_mf(struct incise_mf *mf, enum incise_mf_type type,
		    const struct incise_variable *input, int k, int n)
{
	double range = input->max - input->min;
	double half = n > 1 ? range / (n - 1) / 2 : range / 2;
	double centre = n > 1 ? input->min + range * k / (n - 1) : input->min + range / 2;
	double shoulder = 0.6 * half;

	mf->type = type;
	name_mf(mf->name, input, k, n);
	switch (type) {
	case INCISE_MF_GAUSS:
		mf->p[0] = half / sqrt(2 * M_LN2);
		mf->p[1] = centre;
		break;
	case INCISE_MF_GBELL:
		mf->p[0] = half;
		mf->p[1] = 2;
		mf->p[2] = centre;
		break;
	case INCISE_MF_GAUSS2:
		mf->p[0] = mf->p[2] = (half - shoulder) / sqrt(2 * M_LN2);
		mf->p[1] = centre - shoulder;
		mf->p[3] = centre + shoulder;
		break;
	case INCISE_MF_TRI:
		mf->p[0] = centre - 2 * half;
		mf->p[1] = centre;
		mf->p[2] = centre + 2 * half;
		break;
	case INCISE_MF_TRAP:
		mf->p[0] = centre - (2 * half - shoulder);
		mf->p[1] = centre - shoulder;
		mf->p[2] = centre + shoulder;
		mf->p[3] = centre + (2 * half - shoulder);
		break;
	case INCISE_MF_SIG:
		break;
	}
}

static void grid_rules(struct incise_model *model)
{
	for (int r = 0; r < model->info.n_rules; r++) {
		int rest = r;

		model->rule[r].weight = 1;
		for (int i = model->info.n_inputs - 1; i >= 0; i--) {
			model->rule[r].mf[i] = rest % model->info.n_mfs[i];
			rest /= model->info.n_mfs[i];
		}
	}
}

struct incise_model *incise_model_new_grid(int n_inputs,
					   const struct incise_variable *inputs,
					   const int *n_mfs, enum incise_mf_type type,
					   const struct incise_variable *output,
					   struct incise_error *err)
{
	struct incise_model *model;
	int n_rules = 1;

	if (n_inputs < 1 || n_inputs > INCISE_MODEL_INPUTS_MAX)
		return INCISE_ERROR_NULL(err, EINVAL, "%d inputs: a model has 1 to %d",
					 n_inputs, INCISE_MODEL_INPUTS_MAX);
	if (!incise_mf_type_known(type) || type == INCISE_MF_SIG)
		return INCISE_ERROR_NULL(
			err, EINVAL, "%s does not make a grid: it has no centre",
			type == INCISE_MF_SIG ? "sigmf" : "an unknown function");
	for (int i = 0; i < n_inputs; i++) {
		const struct incise_variable *in = &inputs[i];

		if (!isfinite(in->max - in->min) || !(in->min < in->max))
			return INCISE_ERROR_NULL(
				err, EINVAL,
				"input %s: its range is %g to %g: it must be finite "
				"and not empty; check whether the column is constant",
				in->name, in->min, in->max);
		if (n_mfs[i] < 1 || n_mfs[i] > INCISE_MODEL_MFS_MAX)
			return INCISE_ERROR_NULL(
				err, EINVAL,
				"input %s: %d membership functions: it can have 1 to %d",
				in->name, n_mfs[i], INCISE_MODEL_MFS_MAX);
		n_rules *= n_mfs[i];
		if (n_rules > INCISE_MODEL_RULES_MAX)
			return INCISE_ERROR_NULL(
				err, E2BIG,
				"the grid has %d rules or more: at most %d; give fewer "
				"membership functions",
				n_rules, INCISE_MODEL_RULES_MAX);
	}
	model = calloc(1, sizeof(*model));
	if (!model)
		return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a model");
	snprintf(model->info.name, sizeof(model->info.name), "incise");
	model->info.n_inputs = n_inputs;
	model->info.n_rules = n_rules;
	model->clamp = true;
	model->info.output = *output;
	for (int i = 0; i < n_inputs; i++) {
		model->info.input[i] = inputs[i];
		model->info.n_mfs[i] = n_mfs[i];
		for (int k = 0; k < n_mfs[i]; k++) {
			grid_mf(&model->mf[i][k], type, &inputs[i], k, n_mfs[i]);
			if (!incise_mf_fault(type, model->mf[i][k].p))
				continue;
			incise_error_set(err, EINVAL,
					 "input %s: functions over its range, %g to %g, "
					 "cannot be held in a double",
					 inputs[i].name, inputs[i].min, inputs[i].max);
			free(model);
			return NULL;
		}
	}
	grid_rules(model);
	incise_model_classify(model);
	return model;
}

static bool is_grid(const struct incise_model *model)
{
	bool seen[INCISE_MODEL_RULES_MAX] = {0};
	int n_rules = 1;

	for (int i = 0; i < model->info.n_inputs && n_rules <= model->info.n_rules; i++)
		n_rules *= model->info.n_mfs[i];
	if (model->info.n_rules != n_rules || model->info.and_method != INCISE_AND_PROD)
		return false;
	for (int r = 0; r < n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];
		int place = 0;

		for (int i = 0; i < model->info.n_inputs; i++) {
			if (rule->mf[i] < 0)
				return false;
			place = place * model->info.n_mfs[i] + rule->mf[i];
		}
		if (seen[place] || rule->weight != 1)
			return false;
		seen[place] = true;
	}
	return true;
}

void incise_model_classify(struct incise_model *model)
{
	model->is_grid = is_grid(model);
	for (int r = 0; r < model->info.n_rules; r++)
		model->log_weight[r] = log(model->rule[r].weight);
	for (int i = 0; i < model->info.n_inputs; i++) {
		model->in_all[i] = model->info.and_method == INCISE_AND_PROD;
		for (int r = 0; r < model->info.n_rules; r++)
			model->in_all[i] &= model->rule[r].mf[i] >= 0;
	}
}

struct incise_model *incise_model_copy(const struct incise_model *model)
{
	struct incise_model *copy = malloc(sizeof(*copy));

	if (copy)
		*copy = *model;
	return copy;
}

void incise_model_assign(struct incise_model *to, const struct incise_model *from)
{
	*to = *from;
}

void incise_model_free(struct incise_model *model)
{
	free(model);
}

const struct incise_model_info *incise_model_info(const struct incise_model *model)
{
	return &model->info;
}

const struct incise_mf *incise_model_mf(const struct incise_model *model, int input,
					int mf)
{
	return &model->mf[input][mf];
}

int incise_model_set_mf(struct incise_model *model, int input, int mf, const double p[4])
{
	struct incise_mf *f = &model->mf[input][mf];

	if (incise_mf_fault(f->type, p))
		return -EINVAL;
	memcpy(f->p, p, incise_mf_n_params(f->type) * sizeof(*p));
	return 0;
}

const struct incise_rule *incise_model_rule(const struct incise_model *model, int rule)
{
	return &model->rule[rule];
}

int incise_model_set_consequent(struct incise_model *model, int rule, const double *p)
{
	for (int i = 0; i <= model->info.n_inputs; i++)
		if (!isfinite(p[i]))
			return -EINVAL;
	memcpy(model->rule[rule].p, p, (model->info.n_inputs + 1) * sizeof(*p));
	/* The file has no slopes of a rule that is still called constant. */
	for (int i = 1; i <= model->info.n_inputs; i++)
		model->constant[rule] &= p[i] == 0;
	return 0;
}

void incise_model_set_clamp(struct incise_model *model, bool clamp)
{
	model->clamp = clamp;
}

/* Logs of the degrees of one input's functions, and gaps; see incise_mf_log(). */
struct degrees {
	double log[INCISE_MODEL_MFS_MAX], gap[INCISE_MODEL_MFS_MAX];
	double log_max, gap_min; /* the log of those with the least gap */
};

static void degrees(const struct incise_model *model, int i, double x, struct degrees *d)
{
	int n = model->info.n_mfs[i];

	/* Comparisons, not fmax(): without NaN they agree, and they need no call. */
	d->gap_min = INFINITY;
	for (int k = 0; k < n; k++) {
		d->log[k] = incise_mf_log(&model->mf[i][k], x, &d->gap[k]);
		d->gap_min = d->gap[k] < d->gap_min ? d->gap[k] : d->gap_min;
	}
	d->log_max = -INFINITY;
	for (int k = 0; k < n; k++)
		if (d->gap[k] == d->gap_min && d->log[k] > d->log_max)
			d->log_max = d->log[k];
}

/*
 * A grid has Σ w = Π(i) Σ(k) A(i,k): normalising each input's degrees alone normalises
 * all products of them, with an exp() per function rather than per rule.
 */
bool incise_model_firing_grid(const struct incise_model *model, const double *x,
			      double *w)
{
	double share[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	double log = 0, gap = 0;
	int n_inputs = model->info.n_inputs;

	for (int i = 0; i < n_inputs; i++) {
		struct degrees d;
		double sum = 0;

		degrees(model, i, x[i], &d);
		log += d.log_max;
		gap += d.gap_min;
		for (int k = 0; k < model->info.n_mfs[i]; k++) {
			share[i][k] =
				d.gap[k] > d.gap_min ? 0 : exp(d.log[k] - d.log_max);
			sum += share[i][k];
		}
		/* The largest is exp(0): sum ≥ 1. One division, for it takes as long as exp(). */
		sum = 1 / sum;
		for (int k = 0; k < model->info.n_mfs[i]; k++)
			share[i][k] *= sum;
	}
	for (int r = 0; r < model->info.n_rules; r++) {
		const int8_t *mf = model->rule[r].mf;
		double product = share[0][mf[0]];

		for (int i = 1; i < n_inputs; i++)
			product *= share[i][mf[i]];
		w[r] = product;
	}
	return gap == 0 && log >= MODEL_LOG_FIRES;
}

/* Log strength and gap of rule r, by the AND method and its weight. */
static double rule_log(const struct incise_model *model, int r, const struct degrees *d,
		       double *gap)
{
	double sum = 0;

	*gap = 0;
	for (int i = 0; i < model->info.n_inputs; i++) {
		int k = model->rule[r].mf[i];

		if (k < 0)
			continue;
		if (model->info.and_method == INCISE_AND_MIN) {
			sum = fmin(sum, d[i].log[k]);
			*gap = fmax(*gap, d[i].gap[k]);
		} else {
			sum += d[i].log[k];
			*gap += d[i].gap[k];
		}
	}
	return sum + model->log_weight[r];
}

bool incise_model_firing_rules(const struct incise_model *model, const double *x,
			       double *w)
{
	struct degrees d[INCISE_MODEL_INPUTS_MAX];
	double gap[INCISE_MODEL_RULES_MAX];
	double largest = -INFINITY, nearest = INFINITY, log = 0, gaps = 0, sum = 0;

	for (int i = 0; i < model->info.n_inputs; i++) {
		degrees(model, i, x[i], &d[i]);
		if (!model->in_all[i])
			continue;
		/*
		 * A number common to all rules cancels; left in, a far input's large
		 * one would swallow the digits of the others.
		 */
		log += d[i].log_max;
		gaps += d[i].gap_min;
		for (int k = 0; k < model->info.n_mfs[i]; k++) {
			d[i].log[k] -= d[i].log_max;
			d[i].gap[k] -= d[i].gap_min;
		}
	}
	for (int r = 0; r < model->info.n_rules; r++) {
		w[r] = rule_log(model, r, d, &gap[r]);
		/* A rule of weight 0 does not even stand in. */
		if (model->rule[r].weight > 0)
			nearest = fmin(nearest, gap[r]);
	}
	for (int r = 0; r < model->info.n_rules; r++)
		if (gap[r] == nearest)
			largest = fmax(largest, w[r]);
	for (int r = 0; r < model->info.n_rules; r++) {
		w[r] = gap[r] > nearest ? 0 : exp(w[r] - largest);
		sum += w[r];
	}
	/* The largest is exp(0): sum ≥ 1. */
	for (int r = 0; r < model->info.n_rules; r++)
		w[r] /= sum;
	return gaps + nearest == 0 && log + largest >= MODEL_LOG_FIRES;
}

static bool firing(const struct incise_model *model, const double *x, double *w)
{
	return model->is_grid ? incise_model_firing_grid(model, x, w)
			      : incise_model_firing_rules(model, x, w);
}

static double middle(const struct incise_variable *v)
{
	return v->min + (v->max - v->min) / 2;
}

void incise_model_firing(const struct incise_model *model, const double *x, double *w)
{
	double in[INCISE_MODEL_INPUTS_MAX];

	for (int i = 0; i < model->info.n_inputs; i++)
		in[i] = isnan(x[i]) ? middle(&model->info.input[i]) : x[i];
	firing(model, in, w);
}

/* The inputs that count: clamped, or finite. Returns incise_model_flag bits. */
static unsigned int take_inputs(const struct incise_model *model, const double *x,
				double *in)
{
	unsigned int seen = 0;

	for (int i = 0; i < model->info.n_inputs; i++) {
		const struct incise_variable *v = &model->info.input[i];

		in[i] = x[i];
		if (x[i] >= v->min && x[i] <= v->max)
			continue;
		seen |= INCISE_MODEL_EXTRAPOLATED;
		if (isnan(x[i]))
			in[i] = middle(v);
		else if (model->clamp)
			in[i] = x[i] < v->min ? v->min : v->max;
		else
			in[i] = fmax(-DBL_MAX, fmin(DBL_MAX, x[i]));
	}
	return seen;
}

static double rule_output(const struct incise_model *model, int r, const double *in)
{
	const double *p = model->rule[r].p;
	double y = p[0];

	for (int i = 0; i < model->info.n_inputs; i++)
		y += p[i + 1] * in[i];
	return y;
}

/* The output from strengths; a rule that does not fire adds nothing, not even an overflow. */
static double output(const struct incise_model *model, const double *in, const double *w)
{
	double y = 0;

	for (int r = 0; r < model->info.n_rules; r++) {
		double yr = rule_output(model, r, in);

		if (w[r] > 0)
			y += w[r] * yr;
	}
	/* Only linear extrapolation can overflow, and then there is no right answer. */
	return isnan(y) ? 0 : fmax(-DBL_MAX, fmin(DBL_MAX, y));
}

int incise_inputs_check(const struct incise_variable *inputs, int n_inputs,
			const double *x, size_t n, size_t *outside,
			struct incise_error *err)
{
	char point[60] = "";
	bool out;

	*outside = 0;
	for (size_t k = 0; k < n; k++, *outside += out) {
		out = false;
		for (int i = 0; i < n_inputs; i++, x++) {
			out |= !(*x >= inputs[i].min && *x <= inputs[i].max);
			if (isfinite(*x))
				continue;
			if (n > 1)
				snprintf(point, sizeof(point),
					 "point %zu of %zu: ", k + 1, n);
			return incise_error_set(
				err, EINVAL,
				"%scolumn %d (%s): %g is not finite; remove the "
				"point",
				point, i + 1, inputs[i].name, *x);
		}
	}
	return 0;
}

double incise_model_eval(const struct incise_model *model, const double *x,
			 unsigned int *flags)
{
	double in[INCISE_MODEL_INPUTS_MAX], w[INCISE_MODEL_RULES_MAX];
	unsigned int seen = take_inputs(model, x, in);

	if (!firing(model, in, w))
		seen |= INCISE_MODEL_EXTRAPOLATED;
	if (flags)
		*flags = seen;
	return output(model, in, w);
}

/* Whether the log strength of a rule changes with an input. */
static bool depends_on(const struct incise_model *model, const struct incise_rule *rule,
		       int input, const double *in)
{
	double gap, least;

	if (rule->mf[input] < 0)
		return false;
	if (model->info.and_method != INCISE_AND_MIN)
		return true;
	least = incise_mf_log(&model->mf[input][rule->mf[input]], in[input], &gap);
	for (int i = 0; i < model->info.n_inputs; i++) {
		double log = rule->mf[i] < 0 ? 0
					     : incise_mf_log(&model->mf[i][rule->mf[i]],
							     in[i], &gap);

		if (log < least || (log == least && i < input))
			return false;
	}
	return true;
}

/* ∂y/∂x(i) = Σ w(r) (p(r,i) + (y(r) - y) ∂ log w(r)/∂x(i)), with normalised w. */
static double slope_by(const struct incise_model *model, int i, const double *in,
		       const double *w, double y)
{
	double sum = 0;

	for (int r = 0; r < model->info.n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];
		double slope = rule->p[i + 1];

		if (!(w[r] > 0))
			continue;
		if (depends_on(model, rule, i, in))
			slope += (rule_output(model, r, in) - y) *
				 incise_mf_log_slope(&model->mf[i][rule->mf[i]], in[i]);
		sum += w[r] * slope;
	}
	return isnan(sum) ? 0 : fmax(-DBL_MAX, fmin(DBL_MAX, sum));
}

void incise_model_eval_many(const struct incise_model *model, const double *x, size_t n,
			    double *y, double *gradient)
{
	int inputs = model->info.n_inputs;

	for (size_t k = 0; k < n; k++, x += inputs) {
		double in[INCISE_MODEL_INPUTS_MAX], w[INCISE_MODEL_RULES_MAX];

		take_inputs(model, x, in);
		firing(model, in, w);
		y[k] = output(model, in, w);
		for (int i = 0; gradient && i < inputs; i++)
			gradient[k * (size_t)inputs + (size_t)i] =
				in[i] == x[i] ? slope_by(model, i, in, w, y[k]) : 0;
	}
}
