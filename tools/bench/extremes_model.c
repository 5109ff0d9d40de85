// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Models in double: any shape, any parameters, any inputs.
 */
#include <errno.h>
#include <stdio.h>
#include <incise/model.h>
#include "any_pose.h"
#include "../cli/cli.h"
#include "extremes.h"

#define INPUTS_MAX 3
#define MODELS 6000
#define POINTS 100

static double any_number(void)
{
	switch (below(3)) {
	case 0:
		return special();
	case 1:
		return any_bits();
	default:
		return between(-50, 100);
	}
}

static void make(struct incise_model **model, struct incise_error *err)
{
	struct incise_variable in[INPUTS_MAX] = {
		{"a", 0, 20}, {"b", 0, 50}, {"c", -1, 1}};
	struct incise_variable out = {"y", 0, 3};
	enum incise_mf_type type = (enum incise_mf_type)below(7);
	int n = 1 + (int)below(INPUTS_MAX), mfs[INPUTS_MAX];

	for (int i = 0; i < n; i++) {
		mfs[i] = below(20) ? 1 + (int)below(5) : (int)below(40);
		if (below(3))
			continue;
		in[i].min = any_number();
		in[i].max = any_number();
	}
	*model = incise_model_new_grid(n, in, mfs, type, &out, err);
}

/* Parameters that cannot be must be said to be so. */
static void shake(struct extremes_row *row, struct incise_model *model)
{
	const struct incise_model_info *info = incise_model_info(model);
	int n = info->n_inputs;
	double p[INPUTS_MAX + 1];

	for (int k = 0; k < 6; k++) {
		int input = (int)below((uint32_t)n), rc;
		int mf = (int)below((uint32_t)info->n_mfs[input]);
		double q[4] = {any_number(), any_number(), any_number(), any_number()};

		rc = incise_model_set_mf(model, input, mf, q);
		row->tried += rc == -EINVAL;
		row->refused += rc == -EINVAL;
		if (rc != -EINVAL && extremes_first_wrong(row, !rc))
			extremes_tell(row, "set_mf(%a, %a, %a, %a): %d", q[0], q[1], q[2],
				      q[3], rc);
	}
	for (int r = 0; r < info->n_rules; r++) {
		for (int i = 0; i <= n; i++)
			p[i] = below(2) ? any_number() : between(-1, 1);
		incise_model_set_consequent(model, r, p); /* refused where not finite */
	}
	incise_model_set_clamp(model, below(2));
}

static void tell(struct extremes_row *row, const struct incise_model *model,
		 const double *x, double y, const char *what)
{
	const struct incise_model_info *info = incise_model_info(model);
	const struct incise_mf *mf = incise_model_mf(model, 0, 0);

	extremes_tell(row, "%s: y = %a at (", what, y);
	for (int i = 0; i < info->n_inputs; i++)
		extremes_tell(row, "%s%a", i ? ", " : "", x[i]);
	extremes_tell(row, "), case %ld, of %d rules, %s(%a, %a, %a, %a)", row->tried,
		      info->n_rules, incise_mf_type_name(mf->type), mf->p[0], mf->p[1],
		      mf->p[2], mf->p[3]);
}

static void ask(struct extremes_row *row, const struct incise_model *model)
{
	const struct incise_model_info *info = incise_model_info(model);
	int n = info->n_inputs;
	double x[INPUTS_MAX], y, middle[INPUTS_MAX];
	bool missing = false;

	for (int i = 0; i < n; i++) {
		const struct incise_variable *in = &info->input[i];

		x[i] = below(2) ? any_number() : between(in->min, in->max);
		middle[i] = isnan(x[i]) ? in->min + (in->max - in->min) / 2 : x[i];
		missing |= isnan(x[i]);
	}
	y = incise_model_eval(model, x, NULL);
	if (extremes_first_wrong(row, isfinite(y)))
		tell(row, model, x, y, "not finite");
	/* What is no number is the middle: of a range that has one in double. */
	if (missing && isfinite(middle[0]) && (n < 2 || isfinite(middle[1])) &&
	    (n < 3 || isfinite(middle[2])) &&
	    extremes_first_wrong(row, fabs(y - incise_model_eval(model, middle, NULL)) <=
					      1e-6 * fabs(y) + 1e-12))
		tell(row, model, x, y, "not as in the middle");
}

void extremes_model(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "model_double",
		"models of all kinds of functions, any parameters, any inputs: finite, and an "
		"input that is no number counts as the middle");

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, MODELS); k; k--) {
		struct incise_error err = {0};
		struct incise_model *model;

		make(&model, &err);
		if (!model) {
			extremes_refused(row, &err);
			continue;
		}
		for (int i = 0; i < POINTS; i++) {
			if (i % 10 == 0)
				shake(row, model);
			ask(row, model);
		}
		incise_model_free(model);
	}
}
