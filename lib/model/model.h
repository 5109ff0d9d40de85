/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The inside of a model, for the files of this folder.
 */
#ifndef INCISE_MODEL_INTERNAL_H
#define INCISE_MODEL_INTERNAL_H

#include <incise/model.h>

/* No log of a degree is below this: the sum over all inputs stays finite. */
#define MODEL_LOG_MIN (-2e306)

/* exp() of less than this is 0: a rule whose strength has this log does not fire. */
#define MODEL_LOG_FIRES (-745.0)

struct incise_model {
	struct incise_model_info info;
	bool clamp;
	/*
	 * The shape of the rules, which decides how they are evaluated; see
	 * incise_model_classify(). Rules, weights and kinds never change afterwards.
	 */
	bool is_grid; /* each combination once, prod, weights 1 */
	bool in_all
		[INCISE_MODEL_INPUTS_MAX]; /* prod, and no rule leaves this input out */
	struct incise_mf mf[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	struct incise_rule rule[INCISE_MODEL_RULES_MAX];
	double log_weight[INCISE_MODEL_RULES_MAX]; /* by incise_model_classify() */
	bool constant[INCISE_MODEL_RULES_MAX];	   /* zero order, as the file had it */
};

/* The reason, in words, why parameters make no function of this kind, or NULL. */
const char *incise_mf_fault(enum incise_mf_type type, const double *p);

/*
 * The natural log of the degree of membership: MODEL_LOG_MIN … 0. Where a triangle or
 * trapezoid is zero, its log is given as 0 and *gap is the distance to its nearer foot in
 * widths (foot to foot), above 0; everywhere else *gap is 0. x is not NaN.
 */
double incise_mf_log(const struct incise_mf *mf, double x, double *gap) INCISE_REALTIME;

/* The slope of that log, finite; 0 at a kink and where the degree is 0. x is finite. */
double incise_mf_log_slope(const struct incise_mf *mf, double x);

bool incise_mf_type_known(enum incise_mf_type type);

/* The kind that a .fis file names so, or -1. */
int incise_mf_type_find(const char *word);

/* Find is_grid, in_all and the logs of weights; to be called once all rules are there. */
void incise_model_classify(struct incise_model *model);

/*
 * Firing strengths in two ways, the second for is_grid only; x without NaN. Both return
 * whether a rule fires at all, rather than the nearest one standing in.
 */
bool incise_model_firing_rules(const struct incise_model *model, const double *x,
			       double *w);
bool incise_model_firing_grid(const struct incise_model *model, const double *x,
			      double *w) INCISE_REALTIME;

#endif
