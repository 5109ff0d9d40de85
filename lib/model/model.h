/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a model, for the files of this room.
 */
#ifndef INCISE_MODEL_INTERNAL_H
#define INCISE_MODEL_INTERNAL_H

#include <stdint.h>
#include <incise/model.h>

/* Log of a membership degree below which it is held: exp() of it is 0, sums stay finite. */
#define MODEL_LOG_MIN (-1e300)

struct incise_rule {
	int8_t mf[INCISE_MODEL_INPUTS_MAX];    /* -1: this input does not matter */
	bool constant;			       /* zero order, as the file had it */
	double weight;			       /* 0 < weight ≤ 1 */
	double p[INCISE_MODEL_INPUTS_MAX + 1]; /* the constant first */
};

struct incise_model {
	char name[INCISE_MODEL_NAME_MAX];
	int n_inputs, n_rules;
	bool clamp;
	struct incise_variable input[INCISE_MODEL_INPUTS_MAX], output;
	int n_mfs[INCISE_MODEL_INPUTS_MAX];
	struct incise_mf mf[INCISE_MODEL_INPUTS_MAX][INCISE_MODEL_MFS_MAX];
	struct incise_rule rule[INCISE_MODEL_RULES_MAX];
};

/* Whether parameters make a function of this kind. */
bool incise_mf_valid(enum incise_mf_type type, const double *p);

/* The natural log of the degree of membership: finite, ≤ 0. */
double incise_mf_log(const struct incise_mf *mf, double x);

/* The kind a .fis file's word stands for, or -1. */
int incise_mf_type_find(const char *word);

#endif
