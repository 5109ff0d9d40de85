// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A table on its way into a file; see table_writer.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "table_writer.h"

int incise_table_open(struct incise_table *table,
		      const struct incise_table_format *format,
		      struct incise_outfile *file, FILE *out,
		      const struct incise_column *columns, int n_columns,
		      const struct incise_lineage *lineage, struct incise_error *err)
{
	int rc;

	*table = (struct incise_table){
		.format = format,
		.columns = columns,
		.n_columns = n_columns,
		.lineage = lineage,
		.file = file,
		.out = file ? incise_outfile_stream(file) : out,
	};
	table->block =
		calloc((size_t)n_columns * INCISE_TABLE_BLOCK, sizeof(*table->block));
	if (!table->block)
		return incise_error_set(err, ENOMEM, "table: out of memory");
	rc = format->begin(table, err);
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
	if ((n & (n - 1)) == 0) { /* at each power of two: room for as many again */
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

static int hand_on(struct incise_table *table, struct incise_error *err)
{
	int rc = table->filled ? table->format->rows(table, err) : 0;

	table->rows += table->filled;
	table->filled = 0;
	return rc;
}

int incise_table_add(struct incise_table *table, const union incise_cell *cells,
		     struct incise_error *err)
{
	for (int i = 0; i < table->n_columns; i++)
		table->block[(size_t)i * INCISE_TABLE_BLOCK + table->filled] = cells[i];
	return ++table->filled == INCISE_TABLE_BLOCK ? hand_on(table, err) : 0;
}

int incise_table_finish(struct incise_table *table, struct incise_error *err)
{
	int rc = hand_on(table, err);

	return rc ? rc : table->format->end(table, err);
}

void incise_table_close(struct incise_table *table)
{
	if (table->state)
		table->format->close(table);
	for (int i = 0; i < table->n_names; i++)
		free(table->names[i]);
	free(table->names);
	free(table->block);
	*table = (struct incise_table){0};
}
