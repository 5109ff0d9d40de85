/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Tables of numbers as CSV, the data of a calibration: a line of column names, then lines of
 * numbers. Blank lines, lines that begin with '#', and other columns are ignored. Every failure
 * ends the program, with the line.
 */
#ifndef INCISE_CALIBRATE_TABLE_H
#define INCISE_CALIBRATE_TABLE_H

#include <stdbool.h>

#define TABLE_COLUMNS 8

struct table {
	const char *path;
	int line;
	int at[TABLE_COLUMNS]; /* index of each column of the form in the file; -1: none */
};

struct table_column {
	const char *name;
	/* Reads a field that is no plain number; NULL: it is one. */
	double (*parse)(const struct table *table, const char *name, const char *text);
};

struct table_form {
	const char *rows;     /* "pairs" */
	const char *needed;   /* "reading_mV, and mass_g or force_N" */
	const char *optional; /* "t_s is" */
	struct table_column columns[TABLE_COLUMNS];
	/* Whether the columns that are needed are there; or NULL, and their number, the first ones. */
	bool (*is_complete)(const struct table *table);
	int n_needed;
};

/* Give each row to @add, NAN where the file has no such column. */
void table_read(const char *path, const struct table_form *form,
		void (*add)(void *context, const struct table *table, const double *row),
		void *context);

/* A finite number. */
double table_number(const struct table *table, const char *name, const char *text);

#endif
