// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Models in double: any shape, any parameters, any inputs.
 */
#include <errno.h>
#include <incise/model.h>
#include "extremes.h"
#include "numbers.h"

#define INPUTS_MAX 3
#define POINTS 100

static double number(void)
{
	return any_number(3, -50, 100);
}

static struct incise_model *any_model(struct incise_error *err)
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
		in[i].min = number();
		in[i].max = number();
	}
	return incise_model_new_grid(n, in, mfs, type, &out, err);
}

/* Change parameters: those that cannot be must be refused. */
static void shake(struct extremes_row *row, struct incise_model *model)
{
	int n = incise_model_info(model)->n_inputs;
	double p[INPUTS_MAX + 1];

	for (int k = 0; k < 6; k++) {
		int input = (int)below((uint32_t)n), rc;
		int mf = (int)below((uint32_t)incise_model_info(model)->n_mfs[input]);
		double q[4] = {number(), number(), number(), number()};

		rc = incise_model_set_mf(model, input, mf, q);
		if (rc == -EINVAL)
			extremes_refused_plainly(row);
		else
			extremes_check(row, !rc, "set_mf(%a, %a, %a, %a): %d", q[0], q[1],
				       q[2], q[3], rc);
	}
	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		for (int i = 0; i <= n; i++)
			p[i] = below(2) ? number() : between(-1, 1);
		incise_model_set_consequent(model, r, p); /* refused where not finite */
	}
	incise_model_set_clamp(model, below(2));
}

static void evaluate(struct extremes_row *row, const struct incise_model *model)
{
	const struct incise_mf *mf = incise_model_mf(model, 0, 0);
	double x[INPUTS_MAX] = {0}, y, middle[INPUTS_MAX] = {0};
	bool missing = false, finite = true;

	for (int i = 0; i < incise_model_info(model)->n_inputs; i++) {
		const struct incise_variable *in = &incise_model_info(model)->input[i];

		x[i] = below(2) ? number() : between(in->min, in->max);
		middle[i] = isnan(x[i]) ? in->min + (in->max - in->min) / 2 : x[i];
		missing |= isnan(x[i]);
		finite &= isfinite(middle[i]);
	}
	y = incise_model_eval(model, x, NULL);
	extremes_check(row, isfinite(y),
		       "not finite: y = %a at " V3 ", of %d rules, %s(%a, %a, %a, %a)", y,
		       V3_OF(x), incise_model_info(model)->n_rules,
		       incise_mf_type_name(mf->type), mf->p[0], mf->p[1], mf->p[2],
		       mf->p[3]);
	/* NaN stands for the middle of a range, where that is finite in double. */
	if (missing && finite)
		extremes_check(row,
			       fabs(y - incise_model_eval(model, middle, NULL)) <=
				       1e-6 * fabs(y) + 1e-12,
			       "not as in the middle: y = %a at " V3, y, V3_OF(x));
}

static void try_model(struct extremes_row *row, const struct property *property)
{
	struct incise_error err = {0};
	struct incise_model *model = any_model(&err);

	if (!model) {
		extremes_refused(row, &err);
		return;
	}
	for (int i = 0; i < POINTS; i++) {
		if (i % 10 == 0)
			shake(row, model);
		evaluate(row, model);
	}
	incise_model_free(model);
}

const struct property model_properties[] = {
	{"model_double",
	 "models of all kinds of functions, any parameters, any inputs: finite, and an "
	 "input that is no number counts as the middle",
	 6000, .each = try_model},
	{0},
};
