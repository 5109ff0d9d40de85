// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A .fis file's rules, and what must come before them; see fis_reader.h.
 *
 * A part of one noun: tests/unit/model/fis.c tests it through its door.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "fis_reader.h"

int incise_fis_check_variables(struct incise_fis_reader *in)
{
	struct incise_model *model = in->model;

	if (!in->system || !model->n_inputs || !in->n_rules)
		return incise_fis_fail(
			in, EINVAL, "[Rules] before NumInputs and NumRules in [System]");
	for (int i = 0; i < model->n_inputs; i++) {
		if (!(in->inputs_seen & 1u << i) || !(in->ranges_seen & 1u << i))
			return incise_fis_fail(in, EINVAL,
					       "[Rules] before [Input%d] with its Range",
					       i + 1);
		if (!model->n_mfs[i] || in->mfs_seen[i] != (1ull << model->n_mfs[i]) - 1)
			return incise_fis_fail(
				in, EINVAL,
				"[Input%d] has not all of its NumMFs=%d functions", i + 1,
				model->n_mfs[i]);
	}
	if (!in->output)
		return incise_fis_fail(in, EINVAL, "[Rules] before [Output1]");
	return 0;
}

int incise_fis_rule(struct incise_fis_reader *in)
{
	struct incise_model *model = in->model;
	struct incise_rule *rule = &model->rule[model->n_rules];
	const char *text = in->text;
	int n_used = 0;
	long v;
	char *end;

	if (model->n_rules == in->n_rules)
		return incise_fis_fail(in, EINVAL, "more rules than NumRules=%d",
				       in->n_rules);
	for (int i = 0; i < model->n_inputs; i++) {
		v = strtol(text, &end, 10);
		if (end == text || v > model->n_mfs[i])
			return incise_fis_fail(
				in, EINVAL,
				"rule %d: input %d: expected a number from 0 to %d",
				model->n_rules + 1, i + 1, model->n_mfs[i]);
		if (v < 0)
			return incise_fis_fail(in, ENOTSUP,
					       "rule %d: 'not' (%ld) is not supported",
					       model->n_rules + 1, v);
		rule->mf[i] = v - 1;
		n_used += v > 0;
		text = end;
	}
	text += strspn(text, " \t");
	if (*text++ != ',')
		return incise_fis_fail(in, EINVAL,
				       "rule %d: expected ',' after %d inputs",
				       model->n_rules + 1, model->n_inputs);
	v = strtol(text, &end, 10);
	if (end == text || v < 1 || v > in->n_out_mfs)
		return incise_fis_fail(in, EINVAL,
				       "rule %d: expected a consequent from 1 to %d",
				       model->n_rules + 1, in->n_out_mfs);
	if (!in->out[v - 1].seen)
		return incise_fis_fail(in, EINVAL, "rule %d: consequent MF%ld is missing",
				       model->n_rules + 1, v);
	memcpy(rule->p, in->out[v - 1].p, sizeof(rule->p));
	rule->constant = in->out[v - 1].constant;
	text = end + strspn(end, " \t");
	if (*text++ != '(')
		return incise_fis_fail(in, EINVAL,
				       "rule %d: expected a weight in parentheses",
				       model->n_rules + 1);
	rule->weight = strtod(text, &end);
	if (end == text || *end != ')' || !(rule->weight >= 0 && rule->weight <= 1))
		return incise_fis_fail(in, EINVAL,
				       "rule %d: expected a weight from 0 to 1",
				       model->n_rules + 1);
	text = end + 1 + strspn(end + 1, " \t");
	if (*text++ != ':')
		return incise_fis_fail(in, EINVAL, "rule %d: expected ': 1' at the end",
				       model->n_rules + 1);
	v = strtol(text, &end, 10);
	if (end == text || *end || (v != 1 && v != 2))
		return incise_fis_fail(in, EINVAL, "rule %d: expected ': 1' at the end",
				       model->n_rules + 1);
	/* Of one input, 'or' and 'and' are the same. */
	if (v == 2 && n_used != 1)
		return incise_fis_fail(in, ENOTSUP,
				       "rule %d: 'or' (: 2) is not supported",
				       model->n_rules + 1);
	model->n_rules++;
	return 0;
}
