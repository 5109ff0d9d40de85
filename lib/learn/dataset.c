// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading CSV with named columns; see incise/dataset.h. An error names line and column.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/dataset.h>
#include "../base/lines.h"
#include "pairs.h"

#define FIELDS_MAX 256

struct incise_dataset {
	size_t rows, capacity;
	int columns;
	double *values; /* row by row */
	int *group;	/* per row, or NULL */
	int n_groups, group_capacity;
	char **names; /* of groups */
};

struct reader {
	struct incise_lines lines;
	char *field[FIELDS_MAX]; /* into the line */
	int n_fields;
};

/* The end of the field at *c; a quoted one ("" stands for ") is unquoted in place. */
static int field_end(struct reader *in, char **c)
{
	char *from = *c + 1, *to = *c;

	if (**c != '"') {
		*c += strcspn(*c, ",");
		return 0;
	}
	while (*from && (*from != '"' || from[1] == '"')) {
		if (*from == '"')
			from++;
		*to++ = *from++;
	}
	if (*from != '"')
		return incise_lines_error(&in->lines, EINVAL,
					  "field %d: a quote is not closed",
					  in->n_fields + 1);
	*to = 0;
	*c = from + 1;
	if (**c && **c != ',')
		return incise_lines_error(&in->lines, EINVAL,
					  "field %d: text after the closing quote",
					  in->n_fields + 1);
	return 0;
}

/* Split a row into its fields. */
static int split_row(struct reader *in, char *c)
{
	for (in->n_fields = 0;; c++) {
		int rc;

		if (in->n_fields == FIELDS_MAX)
			return incise_lines_error(&in->lines, E2BIG,
						  "more than %d columns", FIELDS_MAX);
		in->field[in->n_fields] = c;
		rc = field_end(in, &c);
		if (rc)
			return rc;
		in->n_fields++;
		if (!*c)
			return 1;
		*c = 0;
	}
}

/* Next row that is not empty or a comment: 1, or 0 at the end. */
static int next_row(struct reader *in)
{
	int rc;

	while ((rc = incise_lines_next(&in->lines, "\r\n")) > 0) {
		char *c = in->lines.text;

		if (in->lines.line == 1 && !strncmp(c, "\xef\xbb\xbf", 3))
			c += 3;
		if (*c && *c != '#')
			return split_row(in, c);
	}
	return rc;
}

/* -1: there is none. */
static int look_for_column(const struct reader *in, const char *name)
{
	for (int i = 0; name && i < in->n_fields; i++)
		if (!strcmp(in->field[i], name))
			return i;
	return -1;
}

static int find_column(struct reader *in, const char *name)
{
	char list[300] = "";
	size_t used = 0;
	int at = look_for_column(in, name);

	if (at >= 0)
		return at;
	for (int i = 0; i < in->n_fields && used < sizeof(list); i++)
		used += snprintf(list + used, sizeof(list) - used, "%s%s", i ? ", " : "",
				 in->field[i]);
	return incise_lines_error(&in->lines, EINVAL,
				  "there is no column '%s'; the columns are: %s", name,
				  list);
}

static int number(struct reader *in, int field, const char *column, double *value)
{
	const char *text = in->field[field];
	char *end;

	*value = incise_decimal(text, &end);
	if (end == text || end[strspn(end, " \t")])
		return incise_lines_error(&in->lines, EINVAL,
					  "column %d (%s): '%.40s' is not a number",
					  field + 1, column, text);
	if (!isfinite(*value))
		return incise_lines_error(
			&in->lines, EINVAL,
			"column %d (%s): %.40s is not finite; remove the row or mend it",
			field + 1, column, text);
	return 0;
}

/* Most rows belong to the group of the row before, or to the last few. */
static int find_group(struct incise_dataset *data, const char *name)
{
	char **names;

	for (int i = data->n_groups - 1; i >= 0; i--)
		if (!strcmp(data->names[i], name))
			return i;
	if (data->n_groups == data->group_capacity) {
		int capacity = data->group_capacity ? 2 * data->group_capacity : 64;

		names = realloc(data->names, capacity * sizeof(*names));
		if (!names)
			return -ENOMEM;
		data->names = names;
		data->group_capacity = capacity;
	}
	data->names[data->n_groups] = strdup(name);
	return data->names[data->n_groups] ? data->n_groups++ : -ENOMEM;
}

static int grow(struct incise_dataset *data, bool groups)
{
	size_t capacity = data->capacity ? 2 * data->capacity : 1024;
	double *values =
		realloc(data->values, capacity * data->columns * sizeof(*values));
	int *group;

	if (!values)
		return -ENOMEM;
	data->values = values;
	if (groups) {
		group = realloc(data->group, capacity * sizeof(*group));
		if (!group)
			return -ENOMEM;
		data->group = group;
	}
	data->capacity = capacity;
	return 0;
}

static int read_rows(struct reader *in, const char *const *columns, const char *group,
		     const char *where, struct incise_dataset *data, size_t *left_out)
{
	int at[FIELDS_MAX], group_at = -1, where_at, rc;

	rc = next_row(in);
	if (rc < 0)
		return rc;
	if (!rc)
		return incise_lines_error(&in->lines, ENODATA,
					  "the file is empty: expected a header row with "
					  "column names");
	for (int i = 0; i < data->columns; i++) {
		at[i] = find_column(in, columns[i]);
		if (at[i] < 0)
			return at[i];
	}
	if (group) {
		group_at = find_column(in, group);
		if (group_at < 0)
			return group_at;
	}
	where_at = look_for_column(in, where);
	rc = in->n_fields;
	for (int header = rc; (rc = next_row(in)) > 0;) {
		double wanted = 1;

		if (in->n_fields != header)
			return incise_lines_error(
				&in->lines, EINVAL,
				"column %d: the row has %d fields, the header has %d",
				in->n_fields < header ? in->n_fields + 1 : header + 1,
				in->n_fields, header);
		rc = where_at >= 0 ? number(in, where_at, where, &wanted) : 0;
		if (rc)
			return rc;
		if (wanted == 0) {
			++*left_out;
			continue;
		}
		if (data->rows == data->capacity && grow(data, group))
			return incise_lines_error(&in->lines, ENOMEM,
						  "no memory for more rows");
		for (int i = 0; i < data->columns; i++) {
			rc = number(in, at[i], columns[i],
				    &data->values[data->rows * data->columns + i]);
			if (rc)
				return rc;
		}
		if (group) {
			rc = find_group(data, in->field[group_at]);
			if (rc < 0)
				return incise_lines_error(&in->lines, ENOMEM,
							  "no memory for more groups");
			data->group[data->rows] = rc;
		}
		data->rows++;
	}
	if (!rc && !data->rows && *left_out)
		rc = incise_lines_error(&in->lines, ENODATA,
					"all %zu rows have 0 in the column '%s'",
					*left_out, where);
	else if (!rc && !data->rows)
		rc = incise_lines_error(&in->lines, ENODATA,
					"there are no rows below the header");
	return rc;
}

struct incise_dataset *incise_dataset_read_where(const char *path,
						 const char *const *columns, int n,
						 const char *group, const char *where,
						 size_t *left_out,
						 struct incise_error *err)
{
	/* Of any size: only the columns that are asked for are kept. */
	static const struct incise_infile_kind csv = {
		.name = "a CSV file",
		.advice = "give a CSV file with a header row",
	};
	struct incise_dataset *data = calloc(1, sizeof(*data));
	struct reader in;
	int rc;

	if (!data || n < 1 || n > FIELDS_MAX) {
		incise_error_set(err, data ? EINVAL : ENOMEM,
				 "%s: cannot read %d columns", path, n);
		free(data);
		return NULL;
	}
	data->columns = n;
	*left_out = 0;
	rc = incise_lines_open(&in.lines, path, &csv, err);
	if (!rc) {
		rc = read_rows(&in, columns, group, where, data, left_out);
		incise_lines_close(&in.lines);
	}
	if (rc < 0) {
		incise_dataset_free(data);
		errno = -rc;
		return NULL;
	}
	return data;
}

struct incise_dataset *incise_dataset_read(const char *path, const char *const *columns,
					   int n, const char *group,
					   struct incise_error *err)
{
	size_t left_out;

	return incise_dataset_read_where(path, columns, n, group, NULL, &left_out, err);
}

void incise_dataset_free(struct incise_dataset *data)
{
	if (!data)
		return;
	for (int i = 0; i < data->n_groups; i++)
		free(data->names[i]);
	free(data->names);
	free(data->group);
	free(data->values);
	free(data);
}

size_t incise_dataset_rows(const struct incise_dataset *data)
{
	return data->rows;
}

const double *incise_dataset_row(const struct incise_dataset *data, size_t row)
{
	return data->values + row * data->columns;
}

int incise_dataset_group(const struct incise_dataset *data, size_t row)
{
	return data->group ? data->group[row] : -1;
}

/* The rows of one side of a split, or all of them where @check is NULL. */
static int take_side(struct incise_train_side *side, const struct incise_dataset *data,
		     const bool *check, bool want)
{
	bool *seen = calloc(data->n_groups + 1, sizeof(*seen));
	size_t width = data->columns, taken = 0;
	double *rows = malloc(data->rows * width * sizeof(*rows));

	*side = (struct incise_train_side){.pairs = {rows, 0, data->columns - 1}};
	if (data->group)
		side->groups = malloc(data->rows * sizeof(*side->groups));
	if (!seen || !rows || (data->group && !side->groups)) {
		free(seen);
		return -ENOMEM;
	}
	for (size_t i = 0; i < data->rows; i++) {
		int group = incise_dataset_group(data, i);

		if (check && check[i] != want)
			continue;
		memcpy(rows + taken * width, incise_dataset_row(data, i),
		       width * sizeof(*rows));
		if (group >= 0) {
			side->n_groups += !seen[group];
			seen[group] = true;
			side->groups[taken] = group;
		}
		taken++;
	}
	free(seen);
	side->pairs.n = taken;
	return 0;
}

int incise_train_split(const struct incise_dataset *data, double share, uint64_t seed,
		       struct incise_train_side *fit, struct incise_train_side *check,
		       struct incise_error *err)
{
	bool *split = share != 0 ? malloc(data->rows * sizeof(*split)) : NULL;
	int rc = share != 0 && !split ? -ENOMEM : 0;

	*fit = (struct incise_train_side){0};
	if (split) {
		rc = incise_split(data->rows, data->group, share, seed, split, err);
		if (rc) {
			free(split);
			return rc;
		}
		rc = take_side(check, data, split, true);
	}
	if (!rc)
		rc = take_side(fit, data, split, false);
	free(split);
	if (rc)
		return incise_error_set(err, -rc, "no memory for its %zu pairs",
					data->rows);
	return 0;
}

void incise_train_side_free(struct incise_train_side *side)
{
	free((void *)side->pairs.rows);
	free(side->groups);
}
