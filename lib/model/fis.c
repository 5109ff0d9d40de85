// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * MATLAB's .fis file: a model is read from it section by section; see fis_reader.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/c_locale.h"
#include "fis_reader.h"

static int read_file(struct incise_fis_reader *in)
{
	enum { NONE, SYSTEM, INPUT, OUTPUT, RULES } section = NONE;
	int input = 0, rc;

	while ((rc = incise_fis_next_line(in)) > 0) {
		char *equals, *value;
		int end = 0;

		if (*in->text == '[') {
			/* Nothing that rules refer to may change behind them. */
			if (section == RULES)
				return incise_fis_fail(in, EINVAL, "%.40s after [Rules]",
						       in->text);
			if (!strcmp(in->text, "[System]")) {
				section = SYSTEM;
				in->system = true;
			} else if (sscanf(in->text, "[Input%d]%n", &input, &end) == 1 &&
				   end) {
				if (input < 1 || input > in->model->n_inputs)
					return incise_fis_fail(in, EINVAL,
							       "%.20s: NumInputs is %d",
							       in->text,
							       in->model->n_inputs);
				in->inputs_seen |= 1u << --input;
				section = INPUT;
			} else if (!strcmp(in->text, "[Output1]")) {
				section = OUTPUT;
				in->output = true;
			} else if (!strcmp(in->text, "[Rules]")) {
				section = RULES;
				in->rules = true;
				rc = incise_fis_check_variables(in);
				if (rc)
					return rc;
			} else {
				return incise_fis_fail(in, ENOTSUP,
						       "unknown section %.40s", in->text);
			}
			continue;
		}
		if (section == RULES) {
			rc = incise_fis_rule(in);
			if (rc)
				return rc;
			continue;
		}
		equals = strchr(in->text, '=');
		if (!equals || section == NONE)
			return incise_fis_fail(
				in, EINVAL,
				"expected [System] or KEY=VALUE, found '%.40s': is this a "
				".fis file?",
				in->text);
		*equals = 0;
		value = equals + 1;
		rc = section == SYSTEM	? incise_fis_system_key(in, in->text, value)
		     : section == INPUT ? incise_fis_input_key(in, input, in->text, value)
					: incise_fis_output_key(in, in->text, value);
		if (rc)
			return rc;
	}
	if (rc)
		return rc;
	if (!in->system)
		return incise_fis_fail(
			in, EINVAL,
			"the file is empty or has no [System]: is it a .fis file?");
	if (!in->rules || in->model->n_rules != in->n_rules)
		return incise_fis_fail(
			in, EINVAL,
			"the file ends after %d of %d rules: it is truncated; write it again",
			in->model->n_rules, in->n_rules);
	for (int r = 0; r < in->n_rules; r++)
		if (in->model->rule[r].weight > 0)
			return 0;
	return incise_fis_fail(in, EINVAL, "all rules have weight 0: none ever fires");
}

struct incise_model *incise_model_load(const char *path, struct incise_error *err)
{
	struct incise_c_locale locale;
	struct incise_fis_reader *in = calloc(1, sizeof(*in));
	struct incise_model *model = calloc(1, sizeof(*model));
	int rc = -ENOMEM;

	if (!in || !model) {
		rc = incise_error_set(err, ENOMEM, "%s: no memory to read it", path);
		goto out;
	}
	*in = (struct incise_fis_reader){.path = path, .err = err, .model = model};
	model->clamp = true;
	in->file = strcmp(path, "-") ? fopen(path, "re") : stdin;
	if (!in->file) {
		rc = incise_error_set(err, errno, "%s: %s; give a .fis file", path,
				      strerror(errno));
		goto out;
	}
	locale = incise_c_locale_begin();
	rc = read_file(in);
	incise_c_locale_end(locale);
	if (in->file != stdin)
		fclose(in->file);
	free(in->text);
out:
	free(in);
	if (rc) {
		free(model);
		errno = -rc;
		return NULL;
	}
	incise_model_classify(model);
	return model;
}
