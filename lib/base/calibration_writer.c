// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writes calibration.conf so that a person can read it: what is in force at the top, with
 * unit, uncertainty and date, and the history below. libconfig's own writer knows no
 * comments and rounds numbers to six decimals.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "c_locale.h"
#include "calibration_file.h"

/* The shortest number that reads back the same; libconfig tells floats by their point. */
static void put_number(double value, FILE *out)
{
	char text[40];
	int digits = 6;

	do
		snprintf(text, sizeof(text), "%.*g", digits, value);
	while (digits++ < 17 && strtod(text, NULL) != value);
	fprintf(out, "%s%s", text, strpbrk(text, ".e") ? "" : ".0");
}

static void put_quoted(const char *key, const char *text, FILE *out)
{
	fprintf(out, "%s = \"", key);
	for (; *text; text++)
		fprintf(out, *text == '"' || *text == '\\' ? "\\%c" : "%c", *text);
	fputs("\";", out);
}

static void put_text(const char *key, const char *text, FILE *out)
{
	fputs("  ", out);
	put_quoted(key, text, out);
	fputc('\n', out);
}

/* The last calibration that put a key's value in force; NULL: a person did. */
static const struct incise_calibration_record *origin(const struct calibration_file *file,
						      const struct calibration_key *key,
						      double value, double *u)
{
	for (int i = file->n - 1; i >= 0; i--)
		for (int j = 0; j < file->records[i].n && file->records[i].pass; j++) {
			const struct incise_calibration_value *v =
				&file->records[i].values[j];

			if (strcmp(v->key, key->name))
				continue;
			*u = v->u;
			return v->left == value ? &file->records[i] : NULL;
		}
	return NULL;
}

/* "# mV/N, U = 2.4 (k = 2), 2026-11-21": behind a key. Two signs: it is written anew. */
static void put_origin(const struct calibration_file *file,
		       const struct calibration_key *key, double value, FILE *out)
{
	double u = 0;
	const struct incise_calibration_record *from = origin(file, key, value, &u);

	fprintf(out, " ## %s", key->unit);
	if (from)
		fprintf(out, ", U = %.2g (k = 2), %s, %.10s", 2 * u, from->kind,
			from->date);
	fputc('\n', out);
}

static void put_in_force(const struct calibration_file *file, FILE *out)
{
	const struct calibration_key *key = incise_calibration_keys;
	struct incise_calibration in_force = file->in_force;

	for (; key->name; key++) {
		const double value = *incise_calibration_at(&in_force, key);

		if (!file->present[key - incise_calibration_keys] || !isfinite(value))
			continue;
		if (!key->vector) {
			fprintf(out, "%s = ", key->name);
			put_number(value, out);
			fputc(';', out);
		} else if (key->offset == offsetof(struct incise_calibration, tip_mm)) {
			fprintf(out, "%s = [", key->vector);
			for (int i = 0; i < 3; i++) {
				fputs(i ? ", " : "", out);
				put_number(in_force.tip_mm[i], out);
			}
			fputs("];", out);
		} else {
			continue; /* written with the first of them */
		}
		put_origin(file, key, value, out);
	}
}

static void put_value(const struct incise_calibration_value *value, FILE *out)
{
	fprintf(out, "    { key = \"%s\"; ", value->key);
	if (*value->unit) {
		put_quoted("unit", value->unit, out);
		fputc(' ', out);
	}
	if (isfinite(value->found)) {
		fputs("found = ", out);
		put_number(value->found, out);
		fputs("; ", out);
	}
	fputs("left = ", out);
	put_number(value->left, out);
	fputs("; u = ", out);
	put_number(value->u, out);
	fputs("; }", out);
}

static void put_record(const struct incise_calibration_record *record, FILE *out)
{
	put_text("kind", record->kind, out);
	put_text("date", record->date, out);
	if (*record->device)
		put_text("device", record->device, out);
	if (*record->method)
		put_text("method", record->method, out);
	if (*record->raw) {
		put_text("raw", record->raw, out);
		fprintf(out, "  raw_crc32c = \"%08x\";\n", record->raw_crc);
	}
	fputs("  values = (\n", out);
	for (int i = 0; i < record->n; i++) {
		put_value(&record->values[i], out);
		fputs(i + 1 < record->n ? ",\n" : " );\n", out);
	}
	for (int i = 0; i < record->n_covariance; i++) {
		fputs(i ? ", " : "  covariance = [", out);
		put_number(record->covariance[i], out);
	}
	if (record->n_covariance)
		fputs("];\n", out);
	if (isfinite(record->low)) {
		fputs("  low = ", out);
		put_number(record->low, out);
		fputs(";\n", out);
	}
	if (isfinite(record->high)) {
		fputs("  high = ", out);
		put_number(record->high, out);
		fputs(";\n", out);
	}
	if (*record->range_unit)
		put_text("range_unit", record->range_unit, out);
	fprintf(out, "  pass = %s;\n", record->pass ? "true" : "false");
	if (*record->verdict)
		put_text("verdict", record->verdict, out);
}

void incise_calibration_file_write(const struct calibration_file *file, const char *notes,
				   FILE *out)
{
	struct incise_c_locale locale = incise_c_locale_begin();

	fputs("## Calibration of a haptic cutting rig, kept by 'incise calibrate'; see "
	      "calibration.conf(5).\n",
	      out);
	fputs(notes, out);
	fputs("\n## In force; what is absent is nominal.\n", out);
	put_in_force(file, out);
	fputs("\n## Each calibration, oldest first; u is a standard uncertainty (k = 1).\n"
	      "history = (",
	      out);
	for (int i = 0; i < file->n; i++) {
		fputs(i ? ", {\n" : "\n{\n", out);
		put_record(&file->records[i], out);
		fputs("}", out);
	}
	fputs("\n);\n", out);
	incise_c_locale_end(locale);
}
