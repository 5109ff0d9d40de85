// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Rows of JSON as rows for people; see report_table.h.
 *
 *     rows ─▶ those that match ─▶ those that are equal in what is not summed up ─▶ cells
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "report_table.h"

/* Longer tables are for programs: the JSON has them. */
#define MOST_ROWS 80
#define TEXT 400

struct row {
	const char *array;
	const json_t *object;
};

struct rows {
	struct row *row;
	int n;
};

void report_number(double value, int digits, char *text, size_t size)
{
	static const char *const raised[] = {"⁰", "¹", "²", "³", "⁴",
					     "⁵", "⁶", "⁷", "⁸", "⁹"};
	char plain[64], power[64] = "", *e;

	if (!isfinite(value)) {
		snprintf(text, size, "–");
		return;
	}
	snprintf(plain, sizeof(plain), "%.*e", digits - 1, value);
	e = strchr(plain, 'e');
	if (value == 0 || (atoi(e + 1) >= -4 && atoi(e + 1) < 7)) {
		/* As it is, but for digits that it has not. */
		int after = digits - 1 - atoi(e + 1);

		snprintf(text, size, "%.*f", value == 0 || after < 0 ? 0 : after, value);
		if (strchr(text, '.')) {
			size_t n = strlen(text);

			while (text[n - 1] == '0')
				text[--n] = 0;
			if (text[n - 1] == '.')
				text[n - 1] = 0;
		}
		return;
	}
	for (const char *c = e + (e[1] == '-' ? 2 : 1); *c; c++)
		if (*c >= '0' && *c <= '9' && (*c != '0' || *power))
			strcat(power, raised[*c - '0']);
	snprintf(text, size, "%.*s×10%s%s", (int)(e - plain), plain,
		 e[1] == '-' ? "⁻" : "", power);
}

/* ---- what a row holds ---- */

static const json_t *at_path(const json_t *object, const char *path, size_t n)
{
	while (n && object) {
		char key[100];
		size_t length = strcspn(path, ".");

		length = length > n ? n : length;
		snprintf(key, sizeof(key), "%.*s", (int)length, path);
		object = json_object_get(object, key);
		path += length;
		n -= length;
		if (n) {
			path++;
			n--;
		}
	}
	return object;
}

static double number_at(const json_t *object, const char *path, size_t n)
{
	const json_t *value = at_path(object, path, n);

	return json_is_number(value) ? json_number_value(value) : NAN;
}

static double number(const struct row *row, const struct report_column *column)
{
	const char *key = column->key, *by = strchr(key, '/');
	double value = by ? number_at(row->object, key, (size_t)(by - key)) /
				       number_at(row->object, by + 1, strlen(by + 1))
			  : number_at(row->object, key, strlen(key));

	return value * (column->scale != 0 ? column->scale : 1);
}

/* Whether there is something to show. */
static bool has(const struct row *row, const struct report_column *column)
{
	const json_t *value;

	if (column->part == PART_ROWS || *column->key == '@')
		return true;
	if (column->digits)
		return isfinite(number(row, column));
	value = at_path(row->object, column->key, strlen(column->key));
	return value && !json_is_null(value) &&
	       !(json_is_string(value) && !json_string_length(value));
}

/* A text, yes or no; a number that stands among texts. */
static void text_of(const struct row *row, const struct report_column *column, char *text,
		    size_t size)
{
	const json_t *value = at_path(row->object, column->key, strlen(column->key));

	if (*column->key == '@')
		snprintf(text, size, "%s", row->array);
	else if (column->digits)
		report_number(number(row, column), column->digits, text, size);
	else if (json_is_string(value))
		snprintf(text, size, "%s", json_string_value(value));
	else if (json_is_boolean(value))
		snprintf(text, size, "%s", json_is_true(value) ? "yes" : "no");
	else if (json_is_number(value))
		report_number(json_number_value(value), 6, text, size);
	else
		snprintf(text, size, "%s", "");
}

/* What a row is called by: what its first columns hold. */
static void row_name(const struct row *row, const struct report_column *columns,
		     char *name, size_t size)
{
	char text[TEXT];
	size_t n = 0;

	*name = 0;
	for (const struct report_column *c = columns; c->key && c < columns + 3; c++) {
		if (!has(row, c) || n >= size)
			continue;
		text_of(row, c, text, sizeof(text));
		n += (size_t)snprintf(name + n, size - n, "%s%s%s%s", n ? "; " : "",
				      c->digits ? c->heading : "", c->digits ? ": " : "",
				      text);
	}
}

/* ---- which rows ---- */

static bool matches(const struct row *row, const char *where)
{
	char wanted[200], is[TEXT];

	if (!where)
		return true;
	for (const char *c = where; *c; c += strcspn(c, ","), c += *c == ',') {
		struct report_column column = {0};
		char *equals;

		snprintf(wanted, sizeof(wanted), "%.*s", (int)strcspn(c, ","), c);
		equals = strchr(wanted, '=');
		*equals = 0;
		column.key = wanted;
		text_of(row, &column, is, sizeof(is));
		if (strcmp(is, equals + 1))
			return false;
	}
	return true;
}

/* Rows of one array, or of several named with commas. The names live as long as @paths. */
static void find_rows(const json_t *word, const char *paths, const char *where,
		      char *names, size_t size, struct rows *rows)
{
	char *save = NULL;

	*rows = (struct rows){0};
	snprintf(names, size, "%s", paths);
	for (char *path = strtok_r(names, ",", &save); path;
	     path = strtok_r(NULL, ",", &save)) {
		const json_t *list = at_path(word, path, strlen(path)), *object;
		size_t i, n = json_array_size(list);

		rows->row = realloc(rows->row, (rows->n + n + 1) * sizeof(*rows->row));
		if (!rows->row)
			cli_fail("no memory");
		json_array_foreach((json_t *)list, i, object)
		{
			struct row row = {path, object};

			if (json_is_object(object) && matches(&row, where))
				rows->row[rows->n++] = row;
		}
	}
}

static bool same(const struct row *a, const struct row *b,
		 const struct report_column *columns)
{
	char left[TEXT], right[TEXT];

	for (const struct report_column *c = columns; c->key; c++) {
		if (c->part != PART_VALUE)
			continue;
		text_of(a, c, left, sizeof(left));
		text_of(b, c, right, sizeof(right));
		if (strcmp(left, right))
			return false;
	}
	return true;
}

/* ---- cells ---- */

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* One number of those in the rows that are marked as of the group; NaN of none. */
static double summed_up(const struct rows *rows, const int *group, int which,
			const struct report_column *column, enum report_part part)
{
	double *values = malloc(((size_t)rows->n + 1) * sizeof(*values)), value = NAN;
	int n = 0;

	if (!values)
		cli_fail("no memory");
	for (int i = 0; i < rows->n; i++) {
		double v = group[i] == which ? number(&rows->row[i], column) : NAN;

		if (isfinite(v))
			values[n++] = v;
	}
	qsort(values, (size_t)n, sizeof(*values), ascending);
	if (!n)
		value = NAN;
	else if (part == PART_LEAST)
		value = values[0];
	else if (part == PART_LARGEST)
		value = fabs(values[0]) > values[n - 1] ? -values[0] : values[n - 1];
	else if (part == PART_RANGE)
		value = values[n - 1];
	else if (part == PART_MEDIAN)
		value = (values[n / 2] + values[(n - 1) / 2]) / 2;
	else
		for (int i = value = 0; i < n; i++)
			value += values[i];
	free(values);
	return value;
}

static void cell_text(const struct rows *rows, const int *group, int which,
		      const struct report_column *column, char *text, size_t size)
{
	char least[64], largest[64];
	int n = 0, asked = 0, holding = 0, first = -1;

	for (int i = 0; i < rows->n; i++) {
		const json_t *value;

		if (group[i] != which)
			continue;
		n++;
		first = first < 0 ? i : first;
		value = at_path(rows->row[i].object, column->key, strlen(column->key));
		holding += json_is_true(value) || json_is_string(value);
		asked += json_is_boolean(value);
	}
	switch (column->part) {
	case PART_VALUE:
		text_of(&rows->row[first], column, text, size);
		break;
	case PART_ROWS:
		snprintf(text, size, "%d", n);
		break;
	case PART_HOLDING:
		/* Where the answer is yes or no, of those that were asked. */
		snprintf(text, size, "%d of %d", holding, asked ? asked : n);
		break;
	case PART_RANGE:
		if (isnan(summed_up(rows, group, which, column, PART_LEAST))) {
			snprintf(text, size, "–");
			break;
		}
		report_number(summed_up(rows, group, which, column, PART_LEAST),
			      column->digits, least, sizeof(least));
		report_number(summed_up(rows, group, which, column, PART_RANGE),
			      column->digits, largest, sizeof(largest));
		if (strcmp(least, largest))
			snprintf(text, size, "%s to %s", least, largest);
		else
			snprintf(text, size, "%s", least);
		break;
	default:
		report_number(summed_up(rows, group, which, column, column->part),
			      column->digits, text, size);
	}
}

/* Numbers of groups by their rows; returns how many. */
static int make_groups(const struct rows *rows, const struct report_column *columns,
		       int *group)
{
	bool grouped = false;
	int n = 0;

	for (const struct report_column *c = columns; c->key; c++)
		grouped |= c->part != PART_VALUE;
	for (int i = 0; i < rows->n; i++) {
		int like = 0;

		while (grouped && like < i &&
		       !same(&rows->row[i], &rows->row[like], columns))
			like++;
		group[i] = grouped && like < i ? group[like] : n++;
	}
	return n;
}

static void put_columns(struct document *d, const struct rows *rows,
			const struct report_column *columns, bool *shown)
{
	for (int k = 0; columns[k].key; k++) {
		shown[k] = columns[k].part == PART_HOLDING;
		for (int i = 0; i < rows->n && !shown[k]; i++)
			shown[k] = has(&rows->row[i], &columns[k]);
		if (shown[k])
			document_column(d, columns[k].heading,
					columns[k].digits ||
						columns[k].part != PART_VALUE);
	}
}

/* In a cell a reason would make a table wide, in which nearly all others are empty. */
static void put_reasons(struct document *d, const struct rows *rows,
			const struct report_column *columns)
{
	char name[TEXT];

	for (int i = 0; i < rows->n; i++) {
		const char *why =
			json_string_value(json_object_get(rows->row[i].object, "failed"));

		if (!why)
			continue;
		row_name(&rows->row[i], columns, name, sizeof(name));
		document_text(d, "Failed: %s. Why: %s", name, why);
	}
}

void report_table_put(struct document *d, const struct report_table *table,
		      const json_t *word)
{
	bool shown[REPORT_COLUMNS];
	char names[200], text[TEXT];
	struct rows rows;
	int *group, n;

	find_rows(word, table->rows, table->where, names, sizeof(names), &rows);
	if (!rows.n) {
		free(rows.row);
		return;
	}
	group = malloc((size_t)rows.n * sizeof(*group));
	if (!group)
		cli_fail("no memory");
	n = make_groups(&rows, table->columns, group);
	document_table(d, table->caption);
	put_columns(d, &rows, table->columns, shown);
	for (int i = 0; i < n && i < MOST_ROWS; i++)
		for (int k = 0; table->columns[k].key; k++)
			if (shown[k]) {
				cell_text(&rows, group, i, &table->columns[k], text,
					  sizeof(text));
				document_cell(d, "%s", text);
			}
	/* Those of groups are counted in them. */
	if (n == rows.n)
		put_reasons(d, &rows, table->columns);
	if (n > MOST_ROWS)
		document_text(d, "The first %d of %d rows.", MOST_ROWS, n);
	free(group);
	free(rows.row);
}

bool report_fact_text(const struct report_fact *fact, const json_t *word, char *text,
		      size_t size)
{
	char names[200];
	struct rows rows;
	int *group;
	bool there = false;

	find_rows(word, fact->rows, fact->where, names, sizeof(names), &rows);
	group = calloc((size_t)rows.n + 1, sizeof(*group));
	if (!group)
		cli_fail("no memory");
	for (int i = 0; i < rows.n; i++)
		there |= has(&rows.row[i], &fact->column) ||
			 fact->column.part == PART_HOLDING;
	if (there)
		cell_text(&rows, group, 0, &fact->column, text, size);
	free(group);
	free(rows.row);
	return there;
}
