// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pairs of loads and readings as CSV; see calibrate_pairs.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "calibrate_pairs.h"
#include "../cli/cli.h"
#include "../cli/file.h"

#define COLUMNS_MAX 32

enum { MASS, FORCE, READING, SERIES, DIRECTION, COLUMNS };
static const char *const names[COLUMNS] = {"mass_g", "force_N", "reading_mV", "series",
					   "direction"};

struct table {
	const char *path;
	FILE *in;
	int line;
	int column[COLUMNS]; /* where each stands; -1: nowhere */
};

void calibrate_pairs_add(struct calibrate_pairs *pairs,
			 const struct incise_calibrate_force_pair *pair)
{
	if (pairs->n == CALIBRATE_PAIRS_MAX)
		cli_fail("more than %d pairs: average what is read under one load",
			 CALIBRATE_PAIRS_MAX);
	/* grown in steps: 64, 128, … */
	if (!(pairs->n & (pairs->n - 1)) && (pairs->n >= 64 || !pairs->n))
		pairs->pair = realloc(pairs->pair, (pairs->n ? 2 * pairs->n : 64) *
							   sizeof(*pairs->pair));
	if (!pairs->pair)
		cli_fail("no memory");
	pairs->pair[pairs->n++] = *pair;
}

/* Cut a line at its commas, in place, blanks and quotes around a field off. */
static int cut(char *line, char **fields)
{
	int n = 0;
	char *at = line;

	line[strcspn(line, "\r\n")] = 0;
	while (at && n < COLUMNS_MAX) {
		char *comma = strchr(at, ','), *end;

		if (comma)
			*comma = 0;
		at += strspn(at, " \t\"");
		end = at + strlen(at);
		while (end > at && strchr(" \t\"", end[-1]))
			*--end = 0;
		fields[n++] = at;
		at = comma ? comma + 1 : NULL;
	}
	return n;
}

static void read_header(struct table *table, char **fields, int n)
{
	for (int c = 0; c < COLUMNS; c++) {
		table->column[c] = -1;
		for (int i = 0; i < n; i++)
			if (!strcmp(fields[i], names[c]))
				table->column[c] = i;
	}
	if (table->column[READING] < 0 ||
	    (table->column[MASS] < 0) == (table->column[FORCE] < 0))
		cli_fail(
			"%s:%d: expected a line that names the columns, with reading_mV and "
			"either mass_g or force_N (and series, direction: up or down)",
			table->path, table->line);
}

static double number_of(const struct table *table, int column, char **fields, int n)
{
	const int i = table->column[column];
	const char *text = i < n ? fields[i] : "";
	char *end;
	double value = strtod(text, &end);

	if (end == text || *end || !isfinite(value))
		cli_fail("%s:%d: %s: expected a number, found '%s'; correct it",
			 table->path, table->line, names[column], text);
	return value;
}

static bool descends(const struct table *table, char **fields, int n)
{
	const int i = table->column[DIRECTION];
	const char *text = i < n ? fields[i] : "";

	if (!strcmp(text, "down") || !strcmp(text, "descending"))
		return true;
	if (!strcmp(text, "up") || !strcmp(text, "ascending"))
		return false;
	cli_fail("%s:%d: direction: expected up or down, found '%s'; correct it",
		 table->path, table->line, text);
}

static struct incise_calibrate_force_pair read_pair(const struct table *table,
						    char **fields, int n)
{
	struct incise_calibrate_force_pair pair = {.mass_g = NAN};
	double series;

	if (table->column[MASS] >= 0)
		pair.mass_g = number_of(table, MASS, fields, n);
	else
		pair.force_N = number_of(table, FORCE, fields, n);
	pair.reading_mV = number_of(table, READING, fields, n);
	if (table->column[SERIES] >= 0) {
		series = number_of(table, SERIES, fields, n);
		if (series != floor(series) || fabs(series) > 1e6)
			cli_fail("%s:%d: series: expected a whole number; correct it",
				 table->path, table->line);
		pair.series = (int)series;
	}
	if (table->column[DIRECTION] >= 0)
		pair.descending = descends(table, fields, n);
	return pair;
}

void calibrate_pairs_read(struct calibrate_pairs *pairs, const char *path)
{
	struct table table = {.path = path, .in = fopen(path, "re")};
	char *line = NULL, *fields[COLUMNS_MAX];
	bool header = false;
	size_t size = 0;

	*pairs = (struct calibrate_pairs){0};
	if (!table.in)
		cli_fail("%s: cannot be read: %s", path, strerror(errno));
	while (getline(&line, &size, table.in) >= 0) {
		struct incise_calibrate_force_pair pair;
		int n;

		table.line++;
		n = cut(line, fields);
		if (fields[0][0] == '#' || (n == 1 && !*fields[0]))
			continue;
		if (!header) {
			read_header(&table, fields, n);
			header = true;
			continue;
		}
		pair = read_pair(&table, fields, n);
		calibrate_pairs_add(pairs, &pair);
	}
	if (ferror(table.in))
		cli_fail("%s: cannot be read: %s", path, strerror(errno));
	if (!pairs->n)
		cli_fail(
			"%s: no pairs in it: expected a line of names and lines of numbers",
			path);
	free(line);
	fclose(table.in);
}

void calibrate_pairs_write(const struct calibrate_pairs *pairs, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);
	bool masses = false;

	for (int i = 0; i < pairs->n; i++)
		masses |= !isnan(pairs->pair[i].mass_g);
	fprintf(out, "%s,reading_mV,series,direction\n", names[masses ? MASS : FORCE]);
	for (int i = 0; i < pairs->n; i++) {
		const struct incise_calibrate_force_pair *pair = &pairs->pair[i];

		fprintf(out, "%.10g,%.6f,%d,%s\n", masses ? pair->mass_g : pair->force_N,
			pair->reading_mV, pair->series, pair->descending ? "down" : "up");
	}
	whole_file_end(file);
}
