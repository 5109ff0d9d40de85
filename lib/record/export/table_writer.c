// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A table on its way into a file; see table_writer.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <incise/backend.h>
#include "../../base/c_locale.h"
#include "../../device/module.h"
#include "decimal.h"
#include "table_writer.h"

#define MODULE "export_hdf5.so"

int incise_table_open(struct incise_table *table,
		      const struct incise_table_format *format, FILE *out,
		      const struct incise_table_column *columns, int n_columns,
		      const struct incise_provenance *provenance,
		      struct incise_error *err)
{
	int rc;

	*table = (struct incise_table){
		.format = format,
		.columns = columns,
		.n_columns = n_columns,
		.provenance = provenance,
		.out = out,
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

/* Write the rows of the block. */
static int write_block(struct incise_table *table, struct incise_error *err)
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
	return ++table->filled == INCISE_TABLE_BLOCK ? write_block(table, err) : 0;
}

int incise_table_finish(struct incise_table *table, struct incise_error *err)
{
	int rc = write_block(table, err);

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

/*
 * --- CSV: a header of names, a row per line, a decimal point in any locale -----------------
 *
 * The provenance is written before it as lines "# key: value", which incise train skips.
 */

static void put_name(struct incise_table *table, int64_t number)
{
	const char *name = table->names[number - 1];
	bool quote = strpbrk(name, ",\" ;#") != NULL;

	if (quote)
		fputc_unlocked('"', table->out);
	/* A spreadsheet would compute it. */
	if (*name && strchr("=+-@", *name))
		fputc_unlocked('\'', table->out);
	for (; *name; name++) {
		if (*name == '"')
			fputc_unlocked('"', table->out);
		fputc_unlocked(*name, table->out);
	}
	if (quote)
		fputc_unlocked('"', table->out);
}

static int check(struct incise_table *table, bool bad, struct incise_error *err)
{
	int code = errno ? errno : EIO;

	if (!bad && !ferror(table->out))
		return 0;
	return incise_error_set(
		err, code,
		"the dataset cannot be written: %s; free disk space, or give another -o",
		strerror(code));
}

/* A failure before the first row prints nothing, not even the header. */
static int csv_begin(struct incise_table *table, struct incise_error *err)
{
	(void)table;
	(void)err;
	return 0;
}

static void put_header(struct incise_table *table)
{
	for (int i = 0; table->provenance && i < table->provenance->n; i++)
		fprintf(table->out, "# %s: %s\n", table->provenance->items[i].key,
			table->provenance->items[i].value);
	for (int i = 0; i < table->n_columns; i++)
		fprintf(table->out, "%s%s", i ? "," : "", table->columns[i].name);
	fputc('\n', table->out);
}

static int csv_rows(struct incise_table *table, struct incise_error *err)
{
	struct incise_c_locale locale = incise_c_locale_begin();
	char text[INCISE_DECIMAL_MAX];

	if (!table->rows)
		put_header(table);
	for (size_t row = 0; row < table->filled; row++) {
		for (int i = 0; i < table->n_columns; i++) {
			const struct incise_table_column *column = &table->columns[i];
			const union incise_cell *cell =
				&table->block[(size_t)i * INCISE_TABLE_BLOCK + row];
			char *to = text;

			if (i)
				fputc_unlocked(',', table->out);
			if (column->type == INCISE_COLUMN_NAME)
				put_name(table, cell->integer);
			else if (column->type == INCISE_COLUMN_REAL ||
				 column->type == INCISE_COLUMN_SINGLE)
				to = incise_decimal_real(to, cell->real,
							 column->decimals);
			else
				to = incise_decimal_integer(to, cell->integer);
			fwrite_unlocked(text, 1, to - text, table->out);
		}
		fputc_unlocked('\n', table->out);
	}
	incise_c_locale_end(locale);
	return check(table, false, err);
}

static int csv_end(struct incise_table *table, struct incise_error *err)
{
	errno = 0;
	return check(table, fflush(table->out), err);
}

const struct incise_table_format incise_table_csv = {
	.abi = INCISE_TABLE_ABI,
	.begin = csv_begin,
	.rows = csv_rows,
	.end = csv_end,
};

/* --- HDF5 ---------------------------------------------------------------------------- */

/*
 * The module is loaded at first use, so that only programs that write HDF5 map its library. It
 * stays loaded: libhdf5 runs code at the program's end.
 */
const struct incise_table_format *incise_table_hdf5(struct incise_error *err)
{
	const struct incise_table_format *format = NULL;
	const struct incise_backend *backend;
	struct incise_module module;

	if (incise_module_find(&module, MODULE, "incise_backend", "HDF5",
			       "libhdf5-dev is", err))
		return NULL;
	backend = module.symbol;
	if (backend->abi == INCISE_BACKEND_ABI && backend->open &&
	    !strcmp(backend->kind, "export") && !strcmp(backend->name, "hdf5"))
		format = backend->open(NULL, err);
	if (format && format->abi == INCISE_TABLE_ABI)
		return format;
	errno = -incise_module_refuse(&module, MODULE, "HDF5", err);
	return NULL;
}
