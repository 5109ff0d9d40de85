// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The keys of a .fis file's sections; see fis_reader.h.
 *
 * A part of one noun: tests/unit/model/fis.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "fis_reader.h"

int incise_fis_system_key(struct incise_fis_reader *in, const char *key,
			  const char *value)
{
	static const struct {
		const char *key, *value;
	} must[] = {
		{"Type", "sugeno"},
		{"DefuzzMethod", "wtaver"},
	};
	struct incise_model *model = in->model;
	char word[INCISE_MODEL_NAME_MAX];
	int n, rc;

	if (!strcmp(key, "Name"))
		return incise_fis_quoted(in, &value, model->name);
	if (!strcmp(key, "NumInputs"))
		return incise_fis_whole(in, key, value, 1, INCISE_MODEL_INPUTS_MAX,
					&model->n_inputs);
	if (!strcmp(key, "NumOutputs"))
		return incise_fis_whole(in, key, value, 1, 1, &n);
	if (!strcmp(key, "NumRules"))
		return incise_fis_whole(in, key, value, 1, INCISE_MODEL_RULES_MAX,
					&in->n_rules);
	if (!strcmp(key, "AndMethod")) {
		rc = incise_fis_quoted(in, &value, word);
		if (!rc && strcmp(word, "prod") && strcmp(word, "min"))
			rc = incise_fis_fail(
				in, ENOTSUP,
				"AndMethod='%s': only 'prod' and 'min' are supported",
				word);
		model->and_method =
			!rc && !strcmp(word, "min") ? INCISE_AND_MIN : INCISE_AND_PROD;
		return rc;
	}
	for (size_t i = 0; i < sizeof(must) / sizeof(*must); i++) {
		if (strcmp(key, must[i].key))
			continue;
		rc = incise_fis_quoted(in, &value, word);
		if (!rc && strcmp(word, must[i].value))
			rc = incise_fis_fail(
				in, ENOTSUP,
				"%s='%s': only '%s' is supported; convert the model to "
				"Sugeno with wtaver",
				key, word, must[i].value);
		return rc;
	}
	return 0;
}

/* MFn='name':'kind',[…]: name and kind; *value moves to the bracket. */
static int mf_head(struct incise_fis_reader *in, const char *key, const char **value,
		   int n_mfs, int *number, char *name, char *kind)
{
	int rc;

	if (!n_mfs)
		return incise_fis_fail(in, EINVAL, "%.20s before NumMFs", key);
	rc = incise_fis_whole(in, "MF", key + 2, 1, n_mfs, number);
	if (!rc)
		rc = incise_fis_quoted(in, value, name);
	if (!rc && *(*value)++ != ':')
		rc = incise_fis_fail(in, EINVAL,
				     "expected ':' after the function's name");
	if (!rc)
		rc = incise_fis_quoted(in, value, kind);
	if (!rc && *(*value)++ != ',')
		rc = incise_fis_fail(in, EINVAL,
				     "expected ',' after the function's kind");
	*value += rc ? 0 : strspn(*value, " \t");
	--*number;
	return rc;
}

static int variable_key(struct incise_fis_reader *in, struct incise_variable *v,
			const char *key, const char *value)
{
	double range[2];
	int rc;

	if (!strcmp(key, "Name"))
		return incise_fis_quoted(in, &value, v->name);
	if (strcmp(key, "Range"))
		return 0;
	rc = incise_fis_numbers(in, value, range, 2);
	if (rc)
		return rc;
	v->min = range[0];
	v->max = range[1];
	if (!(v->min < v->max) || !isfinite(v->max - v->min))
		return incise_fis_fail(in, EINVAL,
				       "Range: the first number must be the smaller one");
	return 0;
}

int incise_fis_input_key(struct incise_fis_reader *in, int i, const char *key,
			 const char *value)
{
	struct incise_model *model = in->model;
	char name[INCISE_MODEL_NAME_MAX], kind[INCISE_MODEL_NAME_MAX];
	struct incise_mf *mf;
	const char *fault;
	int k, type, rc;

	if (!strcmp(key, "Range"))
		in->ranges_seen |= 1u << i;
	if (!strcmp(key, "NumMFs"))
		return incise_fis_whole(in, key, value, 1, INCISE_MODEL_MFS_MAX,
					&model->n_mfs[i]);
	if (strncmp(key, "MF", 2))
		return variable_key(in, &model->input[i], key, value);
	rc = mf_head(in, key, &value, model->n_mfs[i], &k, name, kind);
	if (rc)
		return rc;
	type = incise_mf_type_find(kind);
	if (type < 0)
		return incise_fis_fail(
			in, ENOTSUP,
			"membership function '%s' is not supported; gaussmf, gauss2mf, "
			"gbellmf, trimf, trapmf and sigmf are",
			kind);
	mf = &model->mf[i][k];
	mf->type = type;
	strcpy(mf->name, name);
	rc = incise_fis_numbers(in, value, mf->p, incise_mf_n_params(type));
	fault = rc ? NULL : incise_mf_fault(type, mf->p);
	if (fault)
		rc = incise_fis_fail(in, EINVAL, "function %s, a %s: %s", name, kind,
				     fault);
	in->mfs_seen[i] |= 1ull << k;
	return rc;
}

int incise_fis_output_key(struct incise_fis_reader *in, const char *key,
			  const char *value)
{
	struct incise_model *model = in->model;
	char name[INCISE_MODEL_NAME_MAX], kind[INCISE_MODEL_NAME_MAX];
	double p[INCISE_MODEL_INPUTS_MAX + 1] = {0};
	struct incise_fis_consequent *out;
	int k, rc;

	if (!strcmp(key, "NumMFs"))
		return incise_fis_whole(in, key, value, 1, INCISE_MODEL_RULES_MAX,
					&in->n_out_mfs);
	if (strncmp(key, "MF", 2))
		return variable_key(in, &model->output, key, value);
	rc = mf_head(in, key, &value, in->n_out_mfs, &k, name, kind);
	if (rc)
		return rc;
	out = &in->out[k];
	out->constant = !strcmp(kind, "constant");
	if (!out->constant && strcmp(kind, "linear"))
		return incise_fis_fail(
			in, ENOTSUP,
			"consequent '%s' is not supported; linear and constant are",
			kind);
	/* The file has the constant last. */
	rc = incise_fis_numbers(in, value, p, out->constant ? 1 : model->n_inputs + 1);
	if (rc)
		return rc;
	out->seen = true;
	out->p[0] = out->constant ? p[0] : p[model->n_inputs];
	for (int i = 0; i < model->n_inputs; i++)
		out->p[i + 1] = out->constant ? 0 : p[i];
	return 0;
}
