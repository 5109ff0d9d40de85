// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * MATLAB's .fis file, read and written. Every number read is checked, and an error names
 * file and line; numbers are written with 17 significant digits, so that the same model is
 * read again.
 *
 *   [System]  Type='sugeno' NumInputs=2 NumRules=20 AndMethod='prod' …
 *   [Input1]  Name='depth_mm' Range=[0 20] NumMFs=5 MF1='very_shallow':'gaussmf',[2.1 0]
 *   [Output1] MF1='out1mf1':'linear',[p1 p2 p0]
 *   [Rules]   1 1, 1 (1) : 1
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include "../base/c_locale.h"
#include "../base/lines.h"
#include "model.h"

/* A consequent as the file has it; rules refer to it by number. */
struct consequent {
	bool seen, constant;
	double p[INCISE_MODEL_INPUTS_MAX + 1];
};

/* Keys of a section; MFs are counted on their own. */
enum system_key { NAME, TYPE, NUM_INPUTS, NUM_RULES, NUM_OUTPUTS, AND, DEFUZZ };
static const char *const system_keys[] = {
	"Name",	     "Type",	     "NumInputs", "NumRules",  "NumOutputs",
	"AndMethod", "DefuzzMethod", /* the others do not change the output of a Sugeno model */
	"Version",   "OrMethod",     "ImpMethod", "AggMethod", NULL};
enum variable_key { VARIABLE_NAME, RANGE, NUM_MFS, ENABLED };
static const char *const variable_keys[] = {"Name", "Range", "NumMFs", "Enabled", NULL};

struct fis_reader {
	struct incise_lines lines;
	char *text; /* of the line, without white space at its ends and comment */
	struct incise_model *model;
	/* Sections read so far; bits of their keys, and of MFs by number. */
	bool system, rules;
	unsigned system_seen, input_seen[INCISE_MODEL_INPUTS_MAX], output_seen;
	int n_rules; /* by NumRules */
	int n_out_mfs;
	uint64_t mfs_seen[INCISE_MODEL_INPUTS_MAX];
	struct consequent out[INCISE_MODEL_RULES_MAX];
};

/* --- lines, names and numbers --- */

#define fail(in, ...) incise_lines_error(&(in)->lines, __VA_ARGS__)

#define BLANKS " \t\r\n"

/* End a text at its comment, which begins outside quotes, and at the white space before it. */
static void cut_fis_text(char *text)
{
	bool quoted = false;
	char *end = text;

	for (; *text && (quoted || (*text != '%' && *text != '#')); text++) {
		quoted ^= *text == '\'';
		if (!strchr(BLANKS, *text))
			end = text + 1;
	}
	*end = 0;
}

/* Next line that is not empty or a comment: 1, or 0 at the end of the file. */
static int next_fis_line(struct fis_reader *in)
{
	int rc;

	while ((rc = incise_lines_next(&in->lines, BLANKS)) > 0) {
		in->text = in->lines.text + strspn(in->lines.text, BLANKS);
		cut_fis_text(in->text);
		if (*in->text)
			break;
	}
	return rc;
}

/* 'NAME' at *text, which moves behind it; '' within it is a quote. */
static int read_quoted(struct fis_reader *in, const char **text, char *name)
{
	const char *at = *text;
	int n = 0;

	if (*at != '\'')
		return fail(in, EINVAL, "expected a name in single quotes at '%.20s'",
			    *text);
	while (*++at != '\'' || *++at == '\'') {
		if (!*at)
			return fail(in, EINVAL, "the name at '%.20s' has no end", *text);
		if (n == INCISE_MODEL_NAME_MAX - 1)
			return fail(in, EINVAL, "a name is longer than %d bytes", n);
		name[n++] = *at;
	}
	name[n] = 0;
	*text = at;
	return 0;
}

/* 'NAME', then the end of the line. */
static int read_name(struct fis_reader *in, const char *text, char *name)
{
	int rc = read_quoted(in, &text, name);

	if (!rc && *text)
		rc = fail(in, EINVAL, "expected the end of the line at '%.20s'", text);
	return rc;
}

/*
 * [a b c]: just n finite numbers, then the end of the line; a single number may lack its brackets.
 * @padded: zeros may follow, with which MATLAB once filled the numbers of each function up to four.
 */
static int read_numbers(struct fis_reader *in, const char *text, double *values, int n,
			bool padded)
{
	bool bare = n == 1 && *text != '[';

	if (!bare && *text++ != '[')
		return fail(in, EINVAL, "expected %d numbers in brackets", n);
	for (int i = 0; i < n; i++) {
		char *end;

		values[i] = incise_decimal(text, &end);
		if (end == text)
			return fail(
				in, EINVAL,
				"expected %d numbers in brackets, number %d is '%.20s'",
				n, i + 1, text);
		if (!isfinite(values[i]))
			return fail(in, EINVAL, "number %d is not finite", i + 1);
		text = end + strspn(end, " \t,;");
	}
	while (padded && !bare && *text == '0' && strspn(text + 1, " \t,;]"))
		text += 1 + strspn(text + 1, " \t,;");
	if (strcmp(text, bare ? "" : "]"))
		return fail(in, EINVAL, "expected ']' after %d numbers, found '%.20s'", n,
			    text);
	return 0;
}

/* A whole number from min to max, then the end of the line. */
static int read_whole(struct fis_reader *in, const char *key, const char *text, int min,
		      int max, int *value)
{
	char *end;
	long v = strtol(text, &end, 10);

	if (end == text || *end || v < min || v > max)
		return fail(in, v > max ? E2BIG : EINVAL, "%s=%.20s: expected %d to %d",
			    key, text, min, max);
	*value = v;
	return 0;
}

/* --- keys of the sections --- */

/* The place of a key among @known, each of which is given once at most. */
static int find_key(struct fis_reader *in, const char *key, const char *const known[],
		    unsigned *seen)
{
	const char *near = incise_nearest_name(key, known);
	int i = 0;

	while (known[i] && strcmp(known[i], key))
		i++;
	if (!known[i])
		return fail(in, EINVAL, "unknown key '%.40s'%s%s%s", key,
			    near ? "; did you mean " : "", near ? near : "",
			    near ? "?" : "");
	if (*seen & 1u << i)
		return fail(in, EINVAL, "%s is given twice; remove one", key);
	*seen |= 1u << i;
	return i;
}

static int system_key(struct fis_reader *in, const char *key, const char *value)
{
	struct incise_model *model = in->model;
	int i = find_key(in, key, system_keys, &in->system_seen), n, rc;
	char word[INCISE_MODEL_NAME_MAX];
	const char *must = i == TYPE ? "sugeno" : "wtaver";

	switch (i) {
	case NAME:
		return read_name(in, value, model->info.name);
	case NUM_INPUTS:
		return read_whole(in, key, value, 1, INCISE_MODEL_INPUTS_MAX,
				  &model->info.n_inputs);
	case NUM_OUTPUTS:
		return read_whole(in, key, value, 1, 1, &n);
	case NUM_RULES:
		return read_whole(in, key, value, 1, INCISE_MODEL_RULES_MAX,
				  &in->n_rules);
	case AND:
		rc = read_name(in, value, word);
		if (!rc && strcmp(word, "prod") && strcmp(word, "min"))
			rc = fail(in, ENOTSUP,
				  "AndMethod='%s': only 'prod' and 'min' are supported",
				  word);
		model->info.and_method =
			!rc && !strcmp(word, "min") ? INCISE_AND_MIN : INCISE_AND_PROD;
		return rc;
	case TYPE:
	case DEFUZZ:
		rc = read_name(in, value, word);
		if (!rc && strcmp(word, must))
			rc = fail(in, ENOTSUP,
				  "%s='%s': only '%s' is supported; convert the model to "
				  "Sugeno with wtaver",
				  key, word, must);
		return rc;
	}
	return i < 0 ? i : 0;
}

/* One character between white space; *text moves behind them. */
static bool skip(const char **text, char c)
{
	const char *at = *text + strspn(*text, BLANKS);

	if (*at != c)
		return false;
	*text = at + 1 + strspn(at + 1, BLANKS);
	return true;
}

/* MFn='name':'kind',[…]: name and kind; *value moves to the bracket. */
static int mf_head(struct fis_reader *in, const char *key, const char **value, int n_mfs,
		   int *number, char *name, char *kind)
{
	int rc;

	if (!n_mfs)
		return fail(in, EINVAL, "%.20s before NumMFs", key);
	rc = read_whole(in, "MF", key + 2, 1, n_mfs, number);
	if (!rc)
		rc = read_quoted(in, value, name);
	if (!rc && !skip(value, ':'))
		rc = fail(in, EINVAL, "expected ':' after the function's name");
	if (!rc)
		rc = read_quoted(in, value, kind);
	if (!rc && !skip(value, ','))
		rc = fail(in, EINVAL, "expected ',' after the function's kind");
	--*number;
	return rc;
}

/* @n_min and @n_max of @n functions; the ends of an output's range may be equal. */
static int variable_key(struct fis_reader *in, struct incise_variable *v, const char *key,
			const char *value, unsigned *seen, int n_min, int n_max, int *n)
{
	bool output = v == &in->model->info.output;
	double range[2];
	int rc = find_key(in, key, variable_keys, seen);

	if (rc == VARIABLE_NAME)
		return read_name(in, value, v->name);
	if (rc == NUM_MFS)
		return read_whole(in, key, value, n_min, n_max, n);
	if (rc == ENABLED && strcmp(value, "1") != 0) /* fuzzylite's */
		return fail(in, EINVAL, "Enabled=%.20s: only 1 is supported", value);
	if (rc == ENABLED)
		return 0;
	if (rc == RANGE)
		rc = read_numbers(in, value, range, 2, false);
	if (rc)
		return rc;
	v->min = range[0];
	v->max = range[1];
	if ((!(v->min < v->max) && !(output && v->min == v->max)) ||
	    !isfinite(v->max - v->min))
		return fail(in, EINVAL,
			    "Range: the first number must be the smaller one");
	return 0;
}

/* MATLAB's anfis() writes widths of either sign: only their squares count. */
static void take_widths(struct incise_mf *mf)
{
	if (mf->type == INCISE_MF_GAUSS || mf->type == INCISE_MF_GAUSS2 ||
	    mf->type == INCISE_MF_GBELL)
		mf->p[0] = fabs(mf->p[0]);
	if (mf->type == INCISE_MF_GAUSS2)
		mf->p[2] = fabs(mf->p[2]);
}

/* A key of an input's section, i from 0 on. */
static int input_key(struct fis_reader *in, int i, const char *key, const char *value)
{
	struct incise_model *model = in->model;
	char name[INCISE_MODEL_NAME_MAX], kind[INCISE_MODEL_NAME_MAX];
	struct incise_mf *mf;
	const char *fault;
	int k, type, rc;

	if (strncmp(key, "MF", 2))
		return variable_key(in, &model->info.input[i], key, value,
				    &in->input_seen[i], 0, INCISE_MODEL_MFS_MAX,
				    &model->info.n_mfs[i]);
	rc = mf_head(in, key, &value, model->info.n_mfs[i], &k, name, kind);
	if (rc)
		return rc;
	if (in->mfs_seen[i] & 1ull << k)
		return fail(in, EINVAL, "%s is given twice; remove one", key);
	type = incise_mf_type_find(kind);
	if (type < 0)
		return fail(
			in, ENOTSUP,
			"membership function '%s' is not supported; gaussmf, gauss2mf, "
			"gbellmf, trimf, trapmf and sigmf are",
			kind);
	mf = &model->mf[i][k];
	mf->type = type;
	strcpy(mf->name, name);
	rc = read_numbers(in, value, mf->p, incise_mf_n_params(type), true);
	take_widths(mf);
	fault = rc ? NULL : incise_mf_fault(type, mf->p);
	if (fault)
		rc = fail(in, EINVAL, "function %s, a %s: %s", name, kind, fault);
	in->mfs_seen[i] |= 1ull << k;
	return rc;
}

static int output_key(struct fis_reader *in, const char *key, const char *value)
{
	struct incise_model *model = in->model;
	char name[INCISE_MODEL_NAME_MAX], kind[INCISE_MODEL_NAME_MAX];
	double p[INCISE_MODEL_INPUTS_MAX + 1] = {0};
	struct consequent *out;
	int k, rc;

	if (strncmp(key, "MF", 2))
		return variable_key(in, &model->info.output, key, value, &in->output_seen,
				    1, INCISE_MODEL_RULES_MAX, &in->n_out_mfs);
	rc = mf_head(in, key, &value, in->n_out_mfs, &k, name, kind);
	if (rc)
		return rc;
	out = &in->out[k];
	if (out->seen)
		return fail(in, EINVAL, "%s is given twice; remove one", key);
	out->constant = !strcmp(kind, "constant");
	if (!out->constant && strcmp(kind, "linear"))
		return fail(in, ENOTSUP,
			    "consequent '%s' is not supported; linear and constant are",
			    kind);
	/* The file has the constant last. */
	rc = read_numbers(in, value, p, out->constant ? 1 : model->info.n_inputs + 1,
			  out->constant);
	if (rc)
		return rc;
	out->seen = true;
	out->p[0] = out->constant ? p[0] : p[model->info.n_inputs];
	for (int i = 0; i < model->info.n_inputs; i++)
		out->p[i + 1] = out->constant ? 0 : p[i];
	return 0;
}

/* --- rules --- */

/* Rules refer to the variables: all of them must come before. */
static int check_variables(struct fis_reader *in)
{
	struct incise_model *model = in->model;

	if (!in->system || !model->info.n_inputs || !in->n_rules)
		return fail(in, EINVAL,
			    "[Rules] before NumInputs and NumRules in [System]");
	if (!(in->system_seen & 1u << TYPE))
		return fail(in, EINVAL,
			    "[System] lacks its Type; write Type='sugeno' if it is one");
	for (int i = 0; i < model->info.n_inputs; i++) {
		if (!(in->input_seen[i] & 1u << RANGE))
			return fail(in, EINVAL, "[Rules] before [Input%d] with its Range",
				    i + 1);
		if (!(in->input_seen[i] & 1u << NUM_MFS) ||
		    in->mfs_seen[i] != (1ull << model->info.n_mfs[i]) - 1)
			return fail(in, EINVAL,
				    "[Input%d] lacks some of its NumMFs=%d functions",
				    i + 1, model->info.n_mfs[i]);
	}
	if (!in->n_out_mfs)
		return fail(in, EINVAL, "[Rules] before [Output1] with its NumMFs");
	return 0;
}

/* A whole number, which fuzzylite writes as 1.000; *text moves behind it. */
static bool read_index(const char **text, long *index)
{
	char *end;
	double value = incise_decimal(*text, &end);

	if (end == *text || !(fabs(value) <= 1000) || value != rint(value))
		return false;
	*text = end;
	*index = lrint(value);
	return true;
}

/* "1 2, 3 (1) : 1" */
static int read_rule(struct fis_reader *in)
{
	struct incise_model *model = in->model;
	struct incise_rule *rule = &model->rule[model->info.n_rules];
	const char *text = in->text;
	int n_used = 0, number = model->info.n_rules + 1;
	long v;
	char *end;

	if (model->info.n_rules == in->n_rules)
		return fail(in, EINVAL, "more rules than NumRules=%d", in->n_rules);
	for (int i = 0; i < model->info.n_inputs; i++) {
		if (!read_index(&text, &v) || v > model->info.n_mfs[i])
			return fail(in, EINVAL,
				    "rule %d: input %d: expected a number from 0 to %d",
				    number, i + 1, model->info.n_mfs[i]);
		if (v < 0)
			return fail(in, ENOTSUP, "rule %d: 'not' (%ld) is not supported",
				    number, v);
		rule->mf[i] = v - 1;
		n_used += v > 0;
	}
	if (!skip(&text, ','))
		return fail(in, EINVAL, "rule %d: expected ',' after %d inputs", number,
			    model->info.n_inputs);
	if (!read_index(&text, &v) || v < 1 || v > in->n_out_mfs)
		return fail(in, EINVAL, "rule %d: expected a consequent from 1 to %d",
			    number, in->n_out_mfs);
	if (!in->out[v - 1].seen)
		return fail(in, EINVAL, "rule %d: consequent MF%ld is missing", number,
			    v);
	memcpy(rule->p, in->out[v - 1].p, sizeof(rule->p));
	model->constant[model->info.n_rules] = in->out[v - 1].constant;
	if (!skip(&text, '('))
		return fail(in, EINVAL, "rule %d: expected a weight in parentheses",
			    number);
	rule->weight = incise_decimal(text, &end);
	if (end == text || !(rule->weight >= 0 && rule->weight <= 1))
		return fail(in, EINVAL, "rule %d: expected a weight from 0 to 1", number);
	text = end;
	if (!skip(&text, ')') || !skip(&text, ':') || !read_index(&text, &v) || *text ||
	    (v != 1 && v != 2))
		return fail(in, EINVAL, "rule %d: expected ') : 1' behind the weight",
			    number);
	/* 'or' and 'and' of a single input are the same. */
	if (v == 2 && n_used != 1)
		return fail(in, ENOTSUP, "rule %d: 'or' (: 2) is not supported", number);
	model->info.n_rules++;
	return 0;
}

/* --- the whole file --- */

static int read_fis_file(struct fis_reader *in)
{
	enum { NONE, SYSTEM, INPUT, OUTPUT, RULES } section = NONE;
	int input = 0, rc;

	while ((rc = next_fis_line(in)) > 0) {
		char *equals, *value;
		int end = 0;

		if (*in->text == '[') {
			/* Rules refer to the sections before them, which must not change any more. */
			if (section == RULES)
				return fail(in, EINVAL, "%.40s after [Rules]", in->text);
			if (!strcmp(in->text, "[System]")) {
				section = SYSTEM;
				in->system = true;
			} else if (sscanf(in->text, "[Input%d]%n", &input, &end) == 1 &&
				   end) {
				if (input < 1 || input > in->model->info.n_inputs)
					return fail(in, EINVAL, "%.20s: NumInputs is %d",
						    in->text, in->model->info.n_inputs);
				input--;
				section = INPUT;
			} else if (!strcmp(in->text, "[Output1]")) {
				section = OUTPUT;
			} else if (!strcmp(in->text, "[Rules]")) {
				section = RULES;
				in->rules = true;
				rc = check_variables(in);
				if (rc)
					return rc;
			} else {
				return fail(in, ENOTSUP, "unknown section %.40s",
					    in->text);
			}
			continue;
		}
		if (section == RULES) {
			rc = read_rule(in);
			if (rc)
				return rc;
			continue;
		}
		equals = strchr(in->text, '=');
		if (!equals || section == NONE)
			return fail(
				in, EINVAL,
				"expected [System] or KEY=VALUE, found '%.40s': not a "
				".fis file",
				in->text);
		*equals = 0;
		cut_fis_text(in->text);
		value = equals + 1 + strspn(equals + 1, BLANKS);
		rc = section == SYSTEM	? system_key(in, in->text, value)
		     : section == INPUT ? input_key(in, input, in->text, value)
					: output_key(in, in->text, value);
		if (rc)
			return rc;
	}
	if (rc)
		return rc;
	if (!in->system)
		return fail(in, EINVAL,
			    "the file is empty or has no [System]: not a .fis file");
	if (!in->rules || in->model->info.n_rules != in->n_rules)
		return fail(
			in, EINVAL,
			"the file ends after %d of %d rules: it is truncated; write it again",
			in->model->info.n_rules, in->n_rules);
	for (int r = 0; r < in->n_rules; r++)
		if (in->model->rule[r].weight > 0)
			return 0;
	return fail(in, EINVAL, "all rules have weight 0, so no rule fires");
}

/* 256 rules and 512 functions are less than 100 kB; comments may be longer. */
static const struct incise_infile_kind fis = {
	.name = "a .fis file",
	.advice = "give a .fis file",
	.size_max = 64 << 20,
};

struct incise_model *incise_model_load(const char *path, struct incise_error *err)
{
	struct fis_reader *in = calloc(1, sizeof(*in));
	struct incise_model *model = calloc(1, sizeof(*model));
	int rc;

	if (!in || !model) {
		rc = incise_error_set(err, ENOMEM, "%s: no memory to read it", path);
		goto out;
	}
	in->model = model;
	model->clamp = true;
	rc = incise_lines_open(&in->lines, path, &fis, err);
	if (rc)
		goto out;
	rc = read_fis_file(in);
	incise_lines_close(&in->lines);
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

/* --- writing --- */

/* A name within single quotes; characters that would end it early or break the line are replaced. */
static void write_name(FILE *out, const char *key, const char *name)
{
	fprintf(out, "%s='", key);
	for (; *name; name++)
		fputc(*name == '\'' || (unsigned char)*name < ' ' ? '_' : *name, out);
	fputc('\'', out);
}

static void write_mf(FILE *out, const struct incise_mf *mf, int number)
{
	char key[16];

	snprintf(key, sizeof(key), "MF%d", number);
	write_name(out, key, mf->name);
	fprintf(out, ":'%s',[", incise_mf_type_name(mf->type));
	for (int i = 0; i < incise_mf_n_params(mf->type); i++)
		fprintf(out, "%s%.17g", i ? " " : "", mf->p[i]);
	fputs("]\n", out);
}

static void write_model(const struct incise_model *model, FILE *out)
{
	fputs("[System]\n", out);
	write_name(out, "Name", model->info.name);
	fprintf(out,
		"\nType='sugeno'\nVersion=2.0\nNumInputs=%d\nNumOutputs=1\nNumRules=%d\n"
		"AndMethod='%s'\nOrMethod='probor'\nImpMethod='prod'\nAggMethod='sum'\n"
		"DefuzzMethod='wtaver'\n",
		model->info.n_inputs, model->info.n_rules,
		model->info.and_method == INCISE_AND_MIN ? "min" : "prod");
	for (int i = 0; i < model->info.n_inputs; i++) {
		const struct incise_variable *v = &model->info.input[i];

		fprintf(out, "\n[Input%d]\n", i + 1);
		write_name(out, "Name", v->name);
		fprintf(out, "\nRange=[%.17g %.17g]\nNumMFs=%d\n", v->min, v->max,
			model->info.n_mfs[i]);
		for (int k = 0; k < model->info.n_mfs[i]; k++)
			write_mf(out, &model->mf[i][k], k + 1);
	}
	fputs("\n[Output1]\n", out);
	write_name(out, "Name", model->info.output.name);
	/* A file need not name the range of its output. */
	if (model->info.output.min < model->info.output.max)
		fprintf(out, "\nRange=[%.17g %.17g]", model->info.output.min,
			model->info.output.max);
	fprintf(out, "\nNumMFs=%d\n", model->info.n_rules);
	for (int r = 0; r < model->info.n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];

		fprintf(out, "MF%d='out1mf%d':'%s',[", r + 1, r + 1,
			model->constant[r] ? "constant" : "linear");
		for (int i = 0; i < model->info.n_inputs && !model->constant[r]; i++)
			fprintf(out, "%.17g ", rule->p[i + 1]);
		fprintf(out, "%.17g]\n", rule->p[0]);
	}
	fputs("\n[Rules]\n", out);
	for (int r = 0; r < model->info.n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];

		for (int i = 0; i < model->info.n_inputs; i++)
			fprintf(out, "%s%d", i ? " " : "", rule->mf[i] + 1);
		fprintf(out, ", %d (%.17g) : 1\n", r + 1, rule->weight);
	}
}

/* A comment, which MATLAB and the reader above skip, for each line of the notes. */
#define NOTE "% incise: "

static void write_notes(const char *notes, FILE *out)
{
	while (*notes) {
		int n = (int)strcspn(notes, "\n");

		fputs(NOTE, out);
		for (int i = 0; i < n; i++)
			fputc((unsigned char)notes[i] < ' ' ? ' ' : notes[i], out);
		fputc('\n', out);
		notes += n + (notes[n] == '\n');
	}
}

int incise_model_save(const struct incise_model *model, const char *path,
		      struct incise_error *err)
{
	return incise_model_save_notes(model, path, "", err);
}

int incise_model_save_notes(const struct incise_model *model, const char *path,
			    const char *notes, struct incise_error *err)
{
	struct incise_outfile *file = incise_outfile_open(path, err);
	struct incise_c_locale locale;

	if (!file)
		return -errno;
	locale = incise_c_locale_begin();
	write_notes(notes, incise_outfile_stream(file));
	write_model(model, incise_outfile_stream(file));
	incise_c_locale_end(locale);
	return incise_outfile_commit(file, err);
}

char *incise_model_notes(const char *path, struct incise_error *err)
{
	struct incise_lines lines;
	char *notes = NULL;
	size_t size;
	FILE *out;
	int rc = incise_lines_open(&lines, path, &fis, err);

	if (rc) {
		errno = -rc;
		return NULL;
	}
	out = open_memstream(&notes, &size);
	while (out && (rc = incise_lines_next(&lines, " \t\r\n")) > 0)
		if (!strncmp(lines.text, NOTE, strlen(NOTE)))
			fprintf(out, "%s\n", lines.text + strlen(NOTE));
	incise_lines_close(&lines);
	if (!out || fclose(out))
		rc = incise_error_set(err, ENOMEM, "%s: no memory to read it", path);
	if (rc >= 0)
		return notes;
	free(notes);
	errno = -rc;
	return NULL;
}
