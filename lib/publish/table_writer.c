// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A table on its way into a file or a stream; see table_writer.h.
 */
#include <errno.h>
#include <math.h>
#include "table_writer.h"

int incise_table_open(struct incise_table *table, struct incise_error *err)
{
	int rc;

	table->block = calloc((size_t)table->n_columns * INCISE_TABLE_STRIDE,
			      sizeof(*table->block));
	if (!table->block)
		return incise_error_set(err, ENOMEM, "table: out of memory");
	rc = table->format->open ? table->format->open(table, err) : 0;
	if (rc)
		incise_table_close(table);
	return rc;
}

int incise_table_name(struct incise_table *table, const char *name)
{
	int n = table->n_names;
	char **names;

	if (n && !strcmp(table->names[n - 1], name))
		return n;
	if ((n & (n - 1)) == 0) { /* double the capacity at each power of two */
		names = realloc(table->names, (n ? 2 * n : 1) * sizeof(*names));
		if (!names)
			return -ENOMEM;
		table->names = names;
	}
	table->names[n] = strdup(name);
	if (!table->names[n])
		return -ENOMEM;
	return ++table->n_names;
}

/* Twelve bits of an uncertainty are enough, and make a file that is smaller and faster to write. */
static double round_coarse(double u)
{
	union {
		float real;
		uint32_t bits;
	} single = {.real = (float)u};

	if (isfinite(single.real))
		single.bits = (single.bits + 0x800) & ~0xfffU;
	return single.real;
}

/* Keep a text for the block. Returns its place, or -ENOMEM. */
static int64_t keep_text(struct incise_table *table, const char *text)
{
	size_t at = table->texts_used, size = strlen(text) + 1;

	if (at + size > table->texts_size) {
		char *texts = realloc(table->texts, 2 * (at + size));

		if (!texts)
			return -ENOMEM;
		table->texts = texts;
		table->texts_size = 2 * (at + size);
	}
	memcpy(table->texts + at, text, size);
	table->texts_used = at + size;
	return (int64_t)at;
}

/* Write the rows of the block. */
static int write_block(struct incise_table *table, struct incise_error *err)
{
	int rc = table->filled ? table->format->put(table, err) : 0;

	table->rows += table->filled;
	table->filled = table->texts_used = 0;
	return rc;
}

int incise_table_add(struct incise_table *table, const void *row,
		     struct incise_error *err)
{
	union incise_cell *to = table->block + table->filled;

	for (int i = 0; i < table->n_columns; i++, to += INCISE_TABLE_STRIDE) {
		const struct incise_table_column *column = &table->columns[i];
		const void *value = (const char *)row + column->at;

		switch (column->type) {
		case INCISE_COLUMN_COARSE:
			to->real = round_coarse(*(const double *)value);
			break;
		case INCISE_COLUMN_FLAG:
			to->integer = *(const bool *)value;
			break;
		case INCISE_COLUMN_TEXT:
			to->integer = keep_text(table, *(const char *const *)value);
			if (to->integer < 0)
				return incise_error_set(err, ENOMEM, "out of memory");
			break;
		default:
			memcpy(to, value, sizeof(*to));
		}
	}
	return ++table->filled == INCISE_TABLE_BLOCK ? write_block(table, err) : 0;
}

int incise_table_finish(struct incise_table *table, struct incise_error *err)
{
	int rc = write_block(table, err);

	return rc || !table->format->end ? rc : table->format->end(table, err);
}

void incise_table_close(struct incise_table *table)
{
	if (table->state)
		table->format->close(table);
	for (int i = 0; i < table->n_names; i++)
		free(table->names[i]);
	free(table->names);
	free(table->texts);
	free(table->block);
	*table = (struct incise_table){0};
}
