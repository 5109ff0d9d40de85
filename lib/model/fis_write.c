// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * MATLAB's .fis file as it is written: with 17 significant digits, so that what is read
 * again is the same; see fis_reader.h.
 *
 * A part of one noun: tests/unit/model/fis.c tests it through its door.
 */
#include <errno.h>
#include <stdio.h>
#include <incise/outfile.h>
#include "../base/c_locale.h"
#include "model.h"

/* A name within single quotes: what would end it early or break the line is replaced. */
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
	write_name(out, "Name", model->name);
	fprintf(out,
		"\nType='sugeno'\nVersion=2.0\nNumInputs=%d\nNumOutputs=1\nNumRules=%d\n"
		"AndMethod='%s'\nOrMethod='probor'\nImpMethod='prod'\nAggMethod='sum'\n"
		"DefuzzMethod='wtaver'\n",
		model->n_inputs, model->n_rules,
		model->and_method == INCISE_AND_MIN ? "min" : "prod");
	for (int i = 0; i < model->n_inputs; i++) {
		const struct incise_variable *v = &model->input[i];

		fprintf(out, "\n[Input%d]\n", i + 1);
		write_name(out, "Name", v->name);
		fprintf(out, "\nRange=[%.17g %.17g]\nNumMFs=%d\n", v->min, v->max,
			model->n_mfs[i]);
		for (int k = 0; k < model->n_mfs[i]; k++)
			write_mf(out, &model->mf[i][k], k + 1);
	}
	fputs("\n[Output1]\n", out);
	write_name(out, "Name", model->output.name);
	/* A file need not name the range of its output. */
	if (model->output.min < model->output.max)
		fprintf(out, "\nRange=[%.17g %.17g]", model->output.min,
			model->output.max);
	fprintf(out, "\nNumMFs=%d\n", model->n_rules);
	for (int r = 0; r < model->n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];

		fprintf(out, "MF%d='out1mf%d':'%s',[", r + 1, r + 1,
			rule->constant ? "constant" : "linear");
		for (int i = 0; i < model->n_inputs && !rule->constant; i++)
			fprintf(out, "%.17g ", rule->p[i + 1]);
		fprintf(out, "%.17g]\n", rule->p[0]);
	}
	fputs("\n[Rules]\n", out);
	for (int r = 0; r < model->n_rules; r++) {
		const struct incise_rule *rule = &model->rule[r];

		for (int i = 0; i < model->n_inputs; i++)
			fprintf(out, "%s%d", i ? " " : "", rule->mf[i] + 1);
		fprintf(out, ", %d (%.17g) : 1\n", r + 1, rule->weight);
	}
}

int incise_model_save(const struct incise_model *model, const char *path,
		      struct incise_error *err)
{
	struct incise_outfile *file = incise_outfile_open(path, err);
	struct incise_c_locale locale;

	if (!file)
		return -errno;
	locale = incise_c_locale_begin();
	write_model(model, incise_outfile_stream(file));
	incise_c_locale_end(locale);
	return incise_outfile_commit(file, err);
}
