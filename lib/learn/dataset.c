// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading named columns of CSV and of Arrow streams; see incise/dataset.h and incise/arrow.h. An
 * error names line and column.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/arrow.h>
#include "../base/grow.h"
#include "../base/lines.h"
#include "pairs.h"

#define FIELDS_MAX 256

struct incise_dataset {
	size_t rows, capacity, group_capacity;
	int columns;
	double *values; /* row by row */
	int *group;	/* per row, or NULL */
	int n_groups;
	char **names; /* of groups */
};

struct dataset_reader {
	struct incise_lines lines;
	char *field[FIELDS_MAX]; /* into the line */
	int n_fields;
};

/* The end of the field at *c; a quoted one ("" stands for ") is unquoted in place. */
static int field_end(struct dataset_reader *in, char **c)
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
					  "field %d: a quote is not closed in its line",
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
static int split_row(struct dataset_reader *in, char *c)
{
	for (in->n_fields = 0;; c++) {
		int rc;

		if (in->n_fields == FIELDS_MAX)
			return incise_lines_error(
				&in->lines, E2BIG,
				"more than %d columns, or lines that do not end in LF",
				FIELDS_MAX);
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
static int next_dataset_row(struct dataset_reader *in)
{
	int rc;

	while ((rc = incise_lines_next(&in->lines, "\r\n")) > 0) {
		char *text = in->lines.text;

		if (text[strspn(text, " \t")] && *text != '#')
			return split_row(in, text);
	}
	return rc;
}

/* -ENOENT: there is none. */
static int look_for_column(struct dataset_reader *in, const char *name)
{
	int at = -ENOENT;

	for (int i = 0; name && i < in->n_fields; i++) {
		if (strcmp(in->field[i], name))
			continue;
		if (at >= 0)
			return incise_lines_error(&in->lines, EINVAL,
						  "two columns are called %s; rename one",
						  name);
		at = i;
	}
	return at;
}

static int find_column(struct dataset_reader *in, const char *name)
{
	const char *names[FIELDS_MAX + 1] = {NULL}, *nearest;
	char list[260] = "";
	size_t used = 0;
	int at = look_for_column(in, name);

	if (at != -ENOENT)
		return at;
	for (int i = 0; i < in->n_fields; i++)
		names[i] = in->field[i];
	nearest = incise_nearest_name(name, names);
	/* "depth_mm [mm]" */
	for (int i = 0; i < in->n_fields && !nearest; i++)
		if (!strncmp(in->field[i], name, strlen(name)))
			nearest = in->field[i];
	for (int i = 0; i < in->n_fields && used < sizeof(list); i++)
		used += snprintf(list + used, sizeof(list) - used, "%s%s", i ? ", " : "",
				 in->field[i]);
	if (in->n_fields == 1 && strpbrk(in->field[0], ";\t"))
		return incise_lines_error(
			&in->lines, EINVAL,
			"expected commas between the columns, and decimal "
			"points, found: %s",
			list);
	return incise_lines_error(
		&in->lines, EINVAL, "no column '%s'; the columns are: %s; %s%s%s", name,
		list, nearest ? "did you mean '" : "rename one, or name another",
		nearest ? nearest : "", nearest ? "'?" : "");
}

static int read_dataset_number(struct dataset_reader *in, int field, const char *column,
			       double *value)
{
	const char *text = in->field[field];
	char *end;

	*value = incise_decimal(text, &end);
	if (end == text || end[strspn(end, " \t")])
		return incise_lines_error(
			&in->lines, EINVAL, "column %d (%s): '%.40s' is not a number; %s",
			field + 1, column, text,
			!strchr(text, ',')  ? "correct it, or remove the row"
			: strchr(text, '.') ? "leave out the commas of thousands"
					    : "write a decimal point, not a comma");
	if (!isfinite(*value))
		return incise_lines_error(
			&in->lines, EINVAL,
			"column %d (%s): %.40s is not finite; correct it, or remove the row",
			field + 1, column, text);
	return 0;
}

/* Most rows belong to the group of the row before, or to the last few. */
static int find_group(struct incise_dataset *data, const char *name)
{
	for (int i = data->n_groups - 1; i >= 0; i--)
		if (!strcmp(data->names[i], name))
			return i;
	if (!grow_array(&data->names, (size_t)data->n_groups, &data->group_capacity, 64,
			sizeof(*data->names)))
		return -ENOMEM;
	data->names[data->n_groups] = strdup(name);
	return data->names[data->n_groups] ? data->n_groups++ : -ENOMEM;
}

static int grow_dataset(struct incise_dataset *data, bool groups)
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

/* The columns that are read, and the taker of the rows. */
struct sink {
	const char *const *columns;
	int n, n_required;
	const char *group, *where;
	incise_row_taker take;
	void *user;
	uint64_t rows, left_out;
};

/* The row that is appended to a dataset. */
static int keep_row(void *user, const double *row, const char *group,
		    struct incise_error *err)
{
	struct incise_dataset *data = user;
	int at = 0;

	if (data->rows == data->capacity && grow_dataset(data, group))
		return incise_error_set(err, ENOMEM, "no memory for more than %zu rows",
					data->rows);
	if (group) {
		at = find_group(data, group);
		if (at < 0)
			return incise_error_set(err, ENOMEM, "no memory for more groups");
		data->group[data->rows] = at;
	}
	memcpy(&data->values[data->rows * data->columns], row,
	       data->columns * sizeof(*row));
	data->rows++;
	return 0;
}

static int read_rows(struct dataset_reader *in, struct sink *sink)
{
	int at[FIELDS_MAX], group_at = -1, where_at, rc;
	double row[FIELDS_MAX];

	rc = next_dataset_row(in);
	if (rc < 0)
		return rc;
	if (!rc)
		return incise_lines_error(&in->lines, ENODATA,
					  "the file is empty; expected a header row with "
					  "column names, and rows of numbers");
	for (int i = 0; i < sink->n; i++) {
		at[i] = i < sink->n_required ? find_column(in, sink->columns[i])
					     : look_for_column(in, sink->columns[i]);
		if (at[i] < 0 && i < sink->n_required)
			return at[i];
	}
	if (sink->group) {
		group_at = find_column(in, sink->group);
		if (group_at < 0)
			return group_at;
	}
	where_at = look_for_column(in, sink->where);
	if (where_at == -EINVAL)
		return where_at;
	rc = in->n_fields;
	for (int header = rc; (rc = next_dataset_row(in)) > 0;) {
		double wanted = 1;

		if (in->n_fields != header)
			return incise_lines_error(
				&in->lines, EINVAL,
				"column %d: the row has %d fields, the header has %d; %s",
				in->n_fields < header ? in->n_fields + 1 : header + 1,
				in->n_fields, header,
				in->n_fields < header
					? "add the missing fields, or remove the row"
					: "end it with its last field, and write decimal "
					  "points, not commas");
		rc = where_at >= 0
			     ? read_dataset_number(in, where_at, sink->where, &wanted)
			     : 0;
		if (rc)
			return rc;
		if (wanted == 0) {
			sink->left_out++;
			continue;
		}
		for (int i = 0; i < sink->n; i++) {
			rc = at[i] < 0 ? -ENOENT
				       : read_dataset_number(in, at[i], sink->columns[i],
							     &row[i]);
			if (rc && i < sink->n_required)
				return rc;
			row[i] = rc ? NAN : row[i];
		}
		rc = sink->take(sink->user, row, sink->group ? in->field[group_at] : NULL,
				in->lines.err);
		if (rc)
			return rc;
		sink->rows++;
	}
	if (!rc && !sink->rows && sink->left_out)
		rc = incise_lines_error(&in->lines, ENODATA,
					"all %llu rows have 0 in the column '%s'",
					(unsigned long long)sink->left_out, sink->where);
	else if (!rc && !sink->rows)
		rc = incise_lines_error(
			&in->lines, ENODATA,
			"there are no rows below the header; add rows of numbers");
	return rc;
}

/* It may have any size: only the columns that are asked for are kept. */
static const struct incise_infile_kind csv = {
	.name = "a CSV file",
	.advice = "give a CSV file with a header row",
};

static int read_dataset_file(const char *path, struct sink *sink,
			     struct incise_error *err)
{
	struct dataset_reader in;
	int rc = incise_lines_open(&in.lines, path, &csv, err);

	if (rc)
		return rc;
	rc = read_rows(&in, sink);
	incise_lines_close(&in.lines);
	return rc < 0 ? rc : 0;
}

bool incise_dataset_has(const char *path, const char *column, bool *stated)
{
	struct dataset_reader in;
	double value;
	int at = -ENOENT;

	if (incise_lines_open(&in.lines, path, &csv, NULL))
		return false;
	if (next_dataset_row(&in) > 0)
		at = look_for_column(&in, column);
	if (at >= 0 && stated && next_dataset_row(&in) > 0 &&
	    (at >= in.n_fields || read_dataset_number(&in, at, column, &value)))
		*stated = false;
	incise_lines_close(&in.lines);
	return at >= 0;
}

int incise_dataset_each(const char *path, const char *const *columns, int n,
			int n_required, const char *group, const char *where,
			incise_row_taker take, void *user, uint64_t *left_out,
			struct incise_error *err)
{
	struct sink sink = {columns, n, n_required, group, where, take, user, 0, 0};
	int rc = n < 1 || n > FIELDS_MAX
			 ? incise_error_set(err, EINVAL, "%s: cannot read %d columns",
					    path, n)
			 : read_dataset_file(path, &sink, err);

	if (left_out)
		*left_out = sink.left_out;
	return rc;
}

/* Columns that a dataset may have. NULL with errno. */
static struct incise_dataset *new_dataset(const char *from, int columns,
					  struct incise_error *err)
{
	struct incise_dataset *data = calloc(1, sizeof(*data));

	if (!data || columns < 1 || columns > FIELDS_MAX) {
		incise_error_set(err, data ? EINVAL : ENOMEM,
				 "%s: cannot read %d columns", from, columns);
		free(data);
		return NULL;
	}
	data->columns = columns;
	return data;
}

struct incise_dataset *incise_dataset_read_where(const char *path,
						 const char *const *columns, int n,
						 const char *group, const char *where,
						 size_t *left_out,
						 struct incise_error *err)
{
	struct incise_dataset *data = new_dataset(path, n, err);
	uint64_t omitted;
	int rc;

	if (!data)
		return NULL;
	rc = incise_dataset_each(path, columns, n, n, group, where, keep_row, data,
				 &omitted, err);
	*left_out = (size_t)omitted;
	if (rc) {
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

/* --- from an Arrow stream --------------------------------------------------------- */

/* One column of a stream that is read. */
struct arrow_column {
	const char *name;
	int at;				   /* of the stream's columns; -1: none */
	const char *format, *index_format; /* the latter of a dictionary's numbers */
};

struct arrow_reader {
	struct sink *sink;
	struct arrow_column columns[FIELDS_MAX], group, where;
	uint64_t row; /* of the stream, from 0 */
	struct incise_error *err;
};

static int arrow_fail(const struct arrow_reader *in, const struct arrow_column *column,
		      const char *what)
{
	return incise_error_set(in->err, EINVAL, "Arrow stream, row %llu, column %s: %s",
				(unsigned long long)in->row, column->name, what);
}

static bool is_number(const char *format)
{
	return *format && !format[1] && strchr("cCsSiIlLfgb", *format);
}

static bool is_text(const char *format)
{
	return !strcmp(format, "u") || !strcmp(format, "U");
}

/* Find a column by name. Returns 0, or -EINVAL if it is missing, unless it is optional. */
static int arrow_find(struct arrow_reader *in, const struct ArrowSchema *schema,
		      const char *name, bool optional, struct arrow_column *column)
{
	char list[300] = "";
	size_t used = 0;

	*column = (struct arrow_column){.name = name, .at = -1};
	for (int64_t i = 0; name && i < schema->n_children; i++) {
		const struct ArrowSchema *child = schema->children[i];

		if (strcmp(child->name ? child->name : "", name))
			continue;
		if (column->at >= 0)
			return arrow_fail(in, column, "is there twice; rename one");
		column->at = (int)i;
		column->format =
			child->dictionary ? child->dictionary->format : child->format;
		column->index_format = child->dictionary ? child->format : NULL;
	}
	if (optional || column->at >= 0)
		return 0;
	for (int64_t i = 0; i < schema->n_children && used < sizeof(list); i++)
		used += snprintf(list + used, sizeof(list) - used, "%s%s", i ? ", " : "",
				 schema->children[i]->name ? schema->children[i]->name
							   : "");
	return incise_error_set(in->err, EINVAL,
				"Arrow stream: no column '%s'; the columns are: %s", name,
				list);
}

static int arrow_columns(struct arrow_reader *in, const struct ArrowSchema *schema)
{
	const char *group = in->sink->group, *where = in->sink->where;
	int rc = 0;

	if (strcmp(schema->format, "+s"))
		return incise_error_set(in->err, EINVAL,
					"Arrow stream: is of type '%s', not a table",
					schema->format);
	for (int i = 0; i < in->sink->n && !rc; i++) {
		struct arrow_column *column = &in->columns[i];

		rc = arrow_find(in, schema, in->sink->columns[i],
				i >= in->sink->n_required, column);
		if (!rc && column->at >= 0 &&
		    (column->index_format || !is_number(column->format)))
			rc = arrow_fail(in, column, "is not a column of numbers");
	}
	if (!rc)
		rc = arrow_find(in, schema, group, !group, &in->group);
	if (!rc && in->group.at >= 0 &&
	    ((!is_text(in->group.format) && !is_number(in->group.format)) ||
	     strchr("fg", *in->group.format) ||
	     (in->group.index_format && !is_number(in->group.index_format))))
		rc = arrow_fail(in, &in->group, "is neither text nor a whole number");
	if (!rc)
		rc = arrow_find(in, schema, where, true, &in->where);
	if (!rc && in->where.at >= 0 &&
	    (in->where.index_format || !is_number(in->where.format)))
		rc = arrow_fail(in, &in->where, "is not a column of numbers");
	return rc;
}

static bool arrow_bit(const void *bits, int64_t at)
{
	return ((const uint8_t *)bits)[at / 8] >> at % 8 & 1;
}

/* False: it is null. */
static bool arrow_valid(const struct ArrowArray *array, int64_t at)
{
	return !array->null_count || !array->buffers[0] ||
	       arrow_bit(array->buffers[0], at);
}

/* A number at an index that has the array's offset. */
static double arrow_real(const struct ArrowArray *array, char format, int64_t at)
{
	const void *values = array->buffers[1];

	switch (format) {
	case 'c':
		return ((const int8_t *)values)[at];
	case 'C':
		return ((const uint8_t *)values)[at];
	case 's':
		return ((const int16_t *)values)[at];
	case 'S':
		return ((const uint16_t *)values)[at];
	case 'i':
		return ((const int32_t *)values)[at];
	case 'I':
		return ((const uint32_t *)values)[at];
	case 'l':
		return (double)((const int64_t *)values)[at];
	case 'L':
		return (double)((const uint64_t *)values)[at];
	case 'f':
		return ((const float *)values)[at];
	case 'g':
		return ((const double *)values)[at];
	default:
		return arrow_bit(values, at);
	}
}

static int arrow_number(const struct arrow_reader *in, const struct ArrowArray *batch,
			const struct arrow_column *column, int64_t row, double *value)
{
	const struct ArrowArray *array = batch->children[column->at];
	int64_t at = row + array->offset;

	if (!arrow_valid(array, at))
		return arrow_fail(in, column, "is null; correct it, or remove the row");
	*value = arrow_real(array, *column->format, at);
	if (!isfinite(*value))
		return arrow_fail(in, column,
				  "is not finite; correct it, or remove "
				  "the row");
	return 0;
}

/* The text of a group, or of its number. */
static int arrow_group_name(const struct arrow_reader *in, const struct ArrowArray *array,
			    int64_t at, char *name, size_t size)
{
	const struct arrow_column *column = &in->group;
	int64_t from, to;

	if (!arrow_valid(array, at))
		return arrow_fail(in, column, "is null");
	if (column->index_format) {
		at = (int64_t)arrow_real(array, *column->index_format, at);
		array = array->dictionary;
		if (!array || at < 0 || at >= array->length)
			return arrow_fail(in, column, "is not in its dictionary");
		at += array->offset;
		if (!arrow_valid(array, at))
			return arrow_fail(in, column, "is null");
	}
	if (!is_text(column->format)) {
		snprintf(name, size, "%.17g", arrow_real(array, *column->format, at));
		return 0;
	}
	if (*column->format == 'u') {
		from = ((const int32_t *)array->buffers[1])[at];
		to = ((const int32_t *)array->buffers[1])[at + 1];
	} else {
		from = ((const int64_t *)array->buffers[1])[at];
		to = ((const int64_t *)array->buffers[1])[at + 1];
	}
	if (from < 0 || to < from || to - from >= (int64_t)size)
		return arrow_fail(in, column, "is a text of more than 255 bytes");
	if (to > from)
		memcpy(name, (const char *)array->buffers[2] + from, (size_t)(to - from));
	name[to - from] = '\0';
	return 0;
}

static int arrow_row(struct arrow_reader *in, const struct ArrowArray *batch, int64_t row)
{
	struct sink *sink = in->sink;
	bool grouped = in->group.at >= 0;
	char name[256];
	double values[FIELDS_MAX], wanted = 1;
	int rc = 0;

	if (in->where.at >= 0)
		rc = arrow_number(in, batch, &in->where, row, &wanted);
	if (rc)
		return rc;
	if (wanted == 0) {
		sink->left_out++;
		return 0;
	}
	for (int i = 0; i < sink->n_required && !rc; i++)
		rc = arrow_number(in, batch, &in->columns[i], row, &values[i]);
	for (int i = sink->n_required; i < sink->n; i++)
		if (in->columns[i].at < 0 ||
		    arrow_number(in, batch, &in->columns[i], row, &values[i]))
			values[i] = NAN;
	if (!rc && grouped) {
		const struct ArrowArray *array = batch->children[in->group.at];

		rc = arrow_group_name(in, array, row + array->offset, name, sizeof(name));
	}
	if (!rc)
		rc = sink->take(sink->user, values, grouped ? name : NULL, in->err);
	sink->rows += !rc;
	return rc;
}

/* The rows of a batch; those of a struct array have its offset. */
static int arrow_batch(struct arrow_reader *in, const struct ArrowArray *batch)
{
	int rc = 0;

	for (int64_t i = 0; i < batch->length && !rc; i++, in->row++)
		rc = arrow_valid(batch, i + batch->offset)
			     ? arrow_row(in, batch, i + batch->offset)
			     : incise_error_set(in->err, EINVAL,
						"Arrow stream, row %llu: is null",
						(unsigned long long)in->row);
	return rc;
}

static int arrow_stream_error(const struct arrow_reader *in,
			      struct ArrowArrayStream *stream, int code)
{
	const char *said = stream->get_last_error(stream);

	return incise_error_set(in->err, code, "Arrow stream: %s",
				said ? said : strerror(code));
}

static int arrow_rows(struct arrow_reader *in, struct ArrowArrayStream *stream,
		      int64_t n_children)
{
	int rc;

	do {
		struct ArrowArray batch = {0};

		rc = stream->get_next(stream, &batch);
		if (rc)
			return arrow_stream_error(in, stream, rc);
		if (!batch.release)
			break;
		rc = batch.n_children == n_children
			     ? arrow_batch(in, &batch)
			     : incise_error_set(in->err, EINVAL,
						"Arrow stream: a batch has %lld columns, "
						"its schema %lld",
						(long long)batch.n_children,
						(long long)n_children);
		batch.release(&batch);
	} while (!rc);
	if (!rc && !in->sink->rows)
		rc = incise_error_set(in->err, ENODATA,
				      in->sink->left_out
					      ? "Arrow stream: all %llu rows have 0 in "
						"the column '%s'"
					      : "Arrow stream: has no rows",
				      (unsigned long long)in->sink->left_out,
				      in->where.name);
	return rc;
}

/* Releases the stream. */
static int arrow_read(struct ArrowArrayStream *stream, struct sink *sink,
		      struct incise_error *err)
{
	struct arrow_reader in = {.sink = sink, .err = err};
	struct ArrowSchema schema = {0};
	int rc = stream->get_schema(stream, &schema);

	if (rc) {
		rc = arrow_stream_error(&in, stream, rc);
	} else {
		rc = arrow_columns(&in, &schema);
		if (!rc)
			rc = arrow_rows(&in, stream, schema.n_children);
		schema.release(&schema);
	}
	stream->release(stream);
	return rc;
}

int incise_dataset_each_arrow(struct ArrowArrayStream *stream, const char *const *columns,
			      int n, int n_required, const char *group, const char *where,
			      incise_row_taker take, void *user, uint64_t *left_out,
			      struct incise_error *err)
{
	struct sink sink = {columns, n, n_required, group, where, take, user, 0, 0};
	int rc;

	if (n < 1 || n > FIELDS_MAX) {
		stream->release(stream);
		return incise_error_set(err, EINVAL,
					"Arrow stream: cannot read %d columns", n);
	}
	rc = arrow_read(stream, &sink, err);
	if (left_out)
		*left_out = sink.left_out;
	return rc;
}

struct incise_dataset *incise_dataset_from_arrow(struct ArrowArrayStream *stream,
						 const char *const *columns, int n,
						 const char *group, const char *where,
						 size_t *left_out,
						 struct incise_error *err)
{
	struct incise_dataset *data = new_dataset("Arrow stream", n, err);
	struct sink sink = {columns, n, n, group, where, keep_row, data, 0, 0};
	int rc = -EINVAL;

	if (data)
		rc = arrow_read(stream, &sink, err);
	else
		stream->release(stream);
	if (left_out)
		*left_out = (size_t)sink.left_out;
	if (!rc)
		return data;
	incise_dataset_free(data);
	errno = -rc;
	return NULL;
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
