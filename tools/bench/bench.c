// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reports of benchmarks from their declarations; see bench.h.
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "bench.h"
#include "../cli/json.h"
#include "../cli/machine.h"
#include "../cli/plot.h"
#include "../cli/report_script.h"

#define TEXT_BYTES 600

/* --- members of a row --- */

/* NaN without a value, and for text. */
static double number_of_bench(const struct bench_column *c, const void *row)
{
	const char *member = (const char *)row + c->offset;
	double value = NAN;

	switch (c->type) {
	case BENCH_NUMBER:
		value = *(const double *)member;
		break;
	case BENCH_INT:
		value = *(const int *)member;
		break;
	case BENCH_INT64:
		value = (double)*(const long *)member;
		break;
	case BENCH_UINT64:
		value = (double)*(const unsigned long *)member;
		break;
	case BENCH_BOOL:
		value = *(const bool *)member;
		break;
	default:
		break;
	}
	if (c->optional && value == 0)
		return NAN;
	return value * (c->scale != 0 ? c->scale : 1);
}

/* NULL without a text, and for numbers. */
static const char *text_of_bench(const struct bench_column *c, const void *row)
{
	const char *member = (const char *)row + c->offset, *text = NULL;

	if (c->type == BENCH_TEXT)
		text = *(const char *const *)member;
	else if (c->type == BENCH_CHARS)
		text = member;
	return text && *text ? text : NULL;
}

static json_t *json_of(const struct bench_column *c, const void *row)
{
	json_t *value = NULL;

	switch (c->type) {
	case BENCH_JSON:
		value = *(json_t *const *)((const char *)row + c->offset);
		return value ? json_incref(value) : json_null();
	case BENCH_TEXT:
	case BENCH_CHARS:
		return text_of_bench(c, row) ? json_text(text_of_bench(c, row))
					     : json_null();
	case BENCH_BOOL:
		return json_boolean(number_of_bench(c, row) != 0);
	case BENCH_NUMBER:
		if (c->whole && number_of_bench(c, row) == round(number_of_bench(c, row)))
			return json_integer((json_int_t)number_of_bench(c, row));
		return json_number(number_of_bench(c, row));
	default:
		if (c->scale != 0 || isnan(number_of_bench(c, row)))
			return json_number(number_of_bench(c, row));
		return json_integer((json_int_t)number_of_bench(c, row));
	}
}

/* As a word: a text, or a number in a format. */
static void word_of(const struct bench_column *c, const void *row, const char *format,
		    char *word, size_t size)
{
	if (c->type == BENCH_TEXT || c->type == BENCH_CHARS)
		snprintf(word, size, "%s",
			 text_of_bench(c, row) ? text_of_bench(c, row) : "");
	else
		snprintf(word, size, format, number_of_bench(c, row));
}

static const struct bench_column *column_of(const struct bench_table *table,
					    const char *key, size_t length)
{
	for (const struct bench_column *c = table->columns; c->key; c++)
		if (c->key && strlen(c->key) == length && !strncmp(c->key, key, length))
			return c;
	cli_fail("%.*s: no such column", (int)length, key);
}

/* NULL of a table in which no row fails. */
static const char *failed_of(const struct bench_table *table, const void *row)
{
	for (const struct bench_column *c = table->columns; c->key; c++)
		if (c->key && !strcmp(c->key, "failed"))
			return text_of_bench(c, row);
	return NULL;
}

/* "KEY=TEXT,KEY!=TEXT|TEXT" */
static bool matches(const struct bench_table *table, const char *where, const void *row)
{
	for (const char *c = where; c && *c; c += *c == ',') {
		size_t key = strcspn(c, "!=");
		bool wanted = c[key] == '=', any = false;
		char word[TEXT_BYTES] = "";

		word_of(column_of(table, c, key), row, "%g", word, sizeof(word));
		for (c += key + !wanted; *c && *c != ',';) {
			size_t n = strcspn(++c, "|,");

			any |= strlen(word) == n && !strncmp(word, c, n);
			c += n;
		}
		if (any != wanted)
			return false;
	}
	return true;
}

static const void *row_at(const struct bench_table *table, const void *rows, int i)
{
	return (const char *)rows + (size_t)i * table->row_bytes;
}

/* "{name}, {rate_hz:%g} Hz" of a row's columns. */
static void expand(const struct bench_table *table, const void *row, const char *template,
		   char *text, size_t size)
{
	size_t n = 0;

	while (*template && n + 1 < size) {
		size_t length = strcspn(template + 1, ":}");
		char format[16] = "%g";

		if (*template != '{') {
			text[n++] = *template ++;
			continue;
		}
		if (template[1 + length] == ':')
			sscanf(template + 2 + length, "%15[^}]", format);
		word_of(column_of(table, template + 1, length), row, format, text + n,
			size - n);
		n += strlen(text + n);
		template += strcspn(template, "}") + 1;
	}
	text[n] = 0;
}

void bench_times(const struct bench_table *table, void *rows, int n,
		 void (*run)(void *row), double units, int turns)
{
	struct harness_variant *variants = cli_alloc(n, sizeof(*variants));

	for (int i = 0; i < n; i++) {
		char *row = (char *)rows + (size_t)i * table->row_bytes;

		variants[i] = (struct harness_variant){
			.run = run,
			.context = row,
			.units = failed_of(table, row) ? 0 : units,
			.time = (void *)(row + table->metrics[0].offset)};
	}
	harness_times(variants, n, turns);
	free(variants);
}

/* --- JSON and metrics --- */

/* "a.b" is b of the object a, which is made where it is missing. */
static void set_bench(json_t *object, const char *path, json_t *value)
{
	const char *dot = strchr(path, '.');
	char first[64];
	json_t *inner;

	if (!dot) {
		json_object_set_new(object, path, value);
		return;
	}
	snprintf(first, sizeof(first), "%.*s", (int)(dot - path), path);
	inner = json_object_get(object, first);
	if (!inner) {
		inner = json_object();
		json_object_set_new(object, first, inner);
	}
	set_bench(inner, dot + 1, value);
}

void bench_value(struct bench_run *run, const char *key, json_t *value)
{
	set_bench(run->report, key, value);
}

void bench_values(struct bench_run *run, const char *fmt, ...)
{
	json_error_t err;
	json_t *members;
	va_list args;

	va_start(args, fmt);
	members = json_vpack_ex(&err, 0, fmt, args);
	va_end(args);
	if (!members)
		cli_fail("%s: %s", fmt, err.text);
	json_object_update(run->report, members);
	json_decref(members);
}

static json_t *row_json(const struct bench_table *table, const void *row)
{
	json_t *object = json_object();

	for (const struct bench_column *c = table->columns; c->key; c++)
		if (c->key && !c->data)
			set_bench(object, c->key, json_of(c, row));
	return object;
}

static void add_metric(json_t *metrics, const struct bench_table *table,
		       const struct bench_metric *metric, const void *row)
{
	const void *member = (const char *)row + metric->offset;
	char name[TEXT_BYTES];

	expand(table, row, metric->name, name, sizeof(name));
	metrics_add(metrics, metric->kind, member, metric->unit, "%s", name);
}

static void write_line(FILE *out, const struct bench_table *table, const void *row)
{
	char word[TEXT_BYTES];

	for (const struct bench_column *c = table->columns; c->key; c++)
		if (c->key) {
			if (row)
				word_of(c, row, "%.10g", word, sizeof(word));
			fprintf(out, "%s%s", c == table->columns ? "" : "\t",
				row ? word : c->key);
		}
	fputc('\n', out);
}

void bench_rows(struct bench_run *run, const struct bench_table *table, const void *rows,
		int n)
{
	json_t *list = json_array();

	if (run->n_rows == BENCH_TABLES)
		cli_fail("more than %d tables", BENCH_TABLES);
	run->rows[run->n_rows++] = (struct bench_rows){table, rows, n};
	for (int i = 0; i < n; i++) {
		const void *row = row_at(table, rows, i);

		json_array_append_new(list, row_json(table, row));
		for (const struct bench_metric *m = table->metrics; m->name; m++)
			if (matches(table, m->where, row))
				add_metric(run->metrics, table, m, row);
	}
	if (table->key)
		bench_value(run, table->key, list);
	else
		json_decref(list);
}

/* --- plots --- */

/* px, for a title; so all figures have about the same scale on a page. */
#define WIDTH_LEAST 900

const struct bench_table bench_points = {
	.row_bytes = sizeof(struct bench_point),
	.columns = {COLUMN(bench_point, "block", block), COLUMN(bench_point, "x", x),
		    COLUMN(bench_point, "y", y)},
};

static const struct bench_rows *rows_of(const struct bench_run *run,
					const struct bench_table *table)
{
	for (int i = 0; i < run->n_rows; i++)
		if (run->rows[i].table == table && run->rows[i].n)
			return &run->rows[i];
	return NULL;
}

static void write_data(const struct bench_run *run, const char *file,
		       const struct bench_rows *rows)
{
	FILE *out = plot_data(run->folder, file);

	write_line(out, rows->table, NULL);
	for (int i = 0; i < rows->n; i++)
		write_line(out, rows->table, row_at(rows->table, rows->rows, i));
	plot_data_end(out, run->folder);
}

static void write_scalars(FILE *script, const json_t *object)
{
	const json_t *value;
	const char *key;

	json_object_foreach((json_t *)object, key, value)
	{
		if (json_is_number(value))
			fprintf(script, "%s = %.10g\n", key, json_number_value(value));
		else if (json_is_string(value) &&
			 !strpbrk(json_string_value(value), "\"\\`"))
			fprintf(script, "%s = \"%s\"\n", key, json_string_value(value));
	}
}

/* Different values of a column. NULL: 1. */
static int count_values(const struct bench_rows *rows, const char *key)
{
	const struct bench_column *column =
		key ? column_of(rows->table, key, strlen(key)) : NULL;
	char word[TEXT_BYTES], first[TEXT_BYTES];
	int n = key ? 0 : 1;

	for (int i = 0, k; key && i < rows->n; i++) {
		word_of(column, row_at(rows->table, rows->rows, i), "%g", word,
			sizeof(word));
		for (k = 0; k < i; k++) {
			word_of(column, row_at(rows->table, rows->rows, k), "%g", first,
				sizeof(first));
			if (!strcmp(word, first))
				break;
		}
		n += k == i;
	}
	return n;
}

/* Fail before the measurement if the plot may not be drawn. */
static void reserve(struct bench_run *run)
{
	const char *suffix = run->bench->plot.suffix;

	plot_place("output", run->plot, &run->folder, &run->name);
	if (suffix)
		run->name = cli_text("%s-%s", run->name, suffix);
	plot_reserve(run->folder, run->name);
}

static void draw_bench(const struct bench_run *run)
{
	const struct bench_plot *plot = &run->bench->plot;
	const struct bench_rows *rows = rows_of(run, plot->data),
				*more = rows_of(run, plot->more);
	char *file = cli_text("%s.dat", run->name),
	     *more_file = cli_text("%s-more.dat", run->name);
	FILE *script;
	int width;

	if (!rows)
		return;
	write_data(run, file, rows);
	width = plot->width * count_values(rows, plot->across);
	script = plot_begin(run->folder, run->name,
			    width > WIDTH_LEAST ? width : WIDTH_LEAST, plot->height);
	fputs("set datafile columnheaders separator tab\n", script);
	write_scalars(script, run->machine);
	write_scalars(script, run->report);
	fprintf(script, "data = '%s'\n", file);
	if (more) {
		write_data(run, more_file, more);
		fprintf(script, "more = '%s'\n", more_file);
	}
	fputs(plot->script, script);
	if (!plot_draw(script, run->folder, run->name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", run->folder,
			 run->name);
}

/* --- a run --- */

void bench_fail(struct bench_run *run, const char *fmt, ...)
{
	va_list args;

	if (*run->failed)
		return;
	va_start(args, fmt);
	vsnprintf(run->failed, sizeof(run->failed), fmt, args);
	va_end(args);
}

/* With --against the comparison takes the place of the text, and goes into the JSON. Returns the
 * number of metrics that are worse or gone. */
static int print_comparison(const struct bench_run *run, const json_t *old)
{
	struct incise_error err = {0};
	json_t *comparison = cli_require(
		compare_reports(old, run->against, run->report, "this run", &err), &err);

	if (!run->json)
		return compare_print(comparison, false);
	json_object_del(comparison, "text");
	json_object_set_new(run->report, "against", comparison);
	json_print(json_incref(run->report));
	return compare_worse(comparison);
}

void bench_measure(struct bench_run *run)
{
	json_t *old = run->against ? compare_load(run->against) : NULL;
	struct incise_error err = {0};
	char command[40];
	int worse = 0;

	/* A wrong name fails before the work, not after. */
	if (!run->json && access(REPORT_PYTHON, X_OK))
		cli_fail("%s prints the tables and is missing; give --json",
			 REPORT_PYTHON);
	if (run->plot)
		reserve(run);
	run->machine = machine_json();
	run->metrics = json_array();
	snprintf(command, sizeof(command), "bench %s", run->bench->name);
	run->report = json_with_schema(json_pack("{sO sb}", "machine", run->machine,
						 "quick", run->quick),
				       command);
	run->bench->run(run);
	cli_progress_end();
	json_object_set_new(run->report, "figures", run->metrics);
	if (!old && run->json)
		json_print(json_incref(run->report));
	else if (!old)
		cli_check(report_script("tables", NULL, run->report, stdout, &err), &err);
	cli_finish();
	if (run->plot)
		draw_bench(run);
	if (old) {
		worse = print_comparison(run, old);
	} else if (!run->json) {
		cli_written();
		cli_finish();
	}
	if (*run->failed)
		cli_fail("%s", run->failed);
	if (worse)
		compare_fail(worse);
	json_decref(old);
	json_decref(run->report);
	json_decref(run->machine);
}
