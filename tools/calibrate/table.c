// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tables of numbers as CSV; see table.h.
 */
#include <math.h>
#include <string.h>
#include <incise/infile.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "table.h"

#define FIELDS_MAX 32 /* columns that a file may have */
#define BLANKS " \t\""

double table_number(const struct table *table, const char *name, const char *text)
{
	char *end;
	double value = incise_decimal(text, &end);

	if (end == text || *end || !isfinite(value))
		cli_fail("%s:%d: %s: expected a number, found '%.40s'; correct it",
			 table->path, table->line, name, text);
	return value;
}

static double read_field(const struct table *table, const struct table_column *column,
			 const char *text)
{
	return (column->parse ? column->parse : table_number)(table, column->name, text);
}

/* Cut a line at its commas, in place. Returns the number of fields. */
static int cut_fields(const struct table *table, char *line, char **fields)
{
	int n = 0;

	for (char *field; (field = strsep(&line, ","));) {
		char *end;

		if (n == FIELDS_MAX)
			cli_fail("%s:%d: more than %d columns; leave out those that are "
				 "not needed",
				 table->path, table->line, FIELDS_MAX);
		field += strspn(field, BLANKS);
		for (end = field + strlen(field); end > field && strchr(BLANKS, end[-1]);)
			*--end = 0;
		fields[n++] = field;
	}
	return n;
}

static void find_columns(struct table *table, const struct table_form *form,
			 char **fields, int n)
{
	for (int c = 0; c < TABLE_COLUMNS; c++) {
		const char *name = form->columns[c].name;

		table->at[c] = -1;
		for (int i = 0; i < n && name; i++) {
			if (strcmp(fields[i], name))
				continue;
			if (table->at[c] >= 0)
				cli_fail("%s:%d: two columns are called %s; rename one",
					 table->path, table->line, name);
			table->at[c] = i;
		}
	}
	for (int c = 0; c < form->n_needed; c++)
		if (table->at[c] < 0)
			cli_fail("%s:%d: there is no column '%s'; expected a line of "
				 "column names: %s; %s optional",
				 table->path, table->line, form->columns[c].name,
				 form->needed, form->optional);
	if (form->is_complete && !form->is_complete(table))
		cli_fail("%s:%d: expected a line of column names: %s; %s optional",
			 table->path, table->line, form->needed, form->optional);
}

void table_read(const char *path, const struct table_form *form,
		void (*add)(void *context, const struct table *table, const double *row),
		void *context)
{
	static const struct incise_infile_kind csv = {
		.name = "a CSV file of a calibration",
		.advice = "give a CSV file with a line of column names",
		.size_max = 1 << 30,
	};
	struct table table = {.path = path};
	char *line, *fields[FIELDS_MAX];
	struct incise_error err = {0};
	struct incise_infile *in;
	int columns = 0, rows = 0, rc;

	file_expect(path, FILE_TABLE);
	in = cli_require(incise_infile_open(path, &csv, &err), &err);
	while ((rc = incise_infile_line(in, &line, &err)) > 0) {
		double row[TABLE_COLUMNS];
		int n;

		table.line++;
		line[strcspn(line, "\r\n")] = 0;
		if (strchr("#", line[strspn(line, BLANKS)]))
			continue;
		n = cut_fields(&table, line, fields);
		if (!columns) {
			columns = n;
			find_columns(&table, form, fields, n);
			continue;
		}
		if (n != columns)
			cli_fail("%s:%d: %d fields, but the first line names %d columns; "
				 "correct the line, or remove it",
				 path, table.line, n, columns);
		for (int c = 0; c < TABLE_COLUMNS; c++)
			row[c] = table.at[c] < 0 ? NAN
						 : read_field(&table, &form->columns[c],
							      fields[table.at[c]]);
		add(context, &table, row);
		rows++;
	}
	if (rc < 0)
		cli_fail_with(&err);
	incise_infile_close(in);
	if (!rows)
		cli_fail("%s: no %s; expected a line of column names (%s) and lines of "
			 "numbers",
			 path, form->rows, form->needed);
}
