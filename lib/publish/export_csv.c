// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * CSV: a header of names, a row per line, a decimal point in any locale.
 *
 * The provenance is written before it as lines "# key: value", which incise train skips.
 */
#include <errno.h>
#include "../base/c_locale.h"
#include "decimal.h"
#include "writers.h"

static void put_export_csv_name(const struct incise_table *table, int64_t number)
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

static int check_written(struct incise_table *table, bool bad, struct incise_error *err)
{
	int code = errno ? errno : EIO;

	if (!bad && !ferror(table->out))
		return 0;
	return incise_error_set(
		err, code,
		"the dataset cannot be written: %s; free disk space, or give another -o",
		strerror(code));
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

static void put_cell(struct incise_table *table, const struct incise_table_column *column,
		     const union incise_cell *cell, char behind)
{
	char text[INCISE_DECIMAL_MAX + 1], *end = text;

	switch (column->type) {
	case INCISE_COLUMN_NAME:
		put_export_csv_name(table, cell->integer);
		break;
	case INCISE_COLUMN_INTEGER:
	case INCISE_COLUMN_SHORT:
	case INCISE_COLUMN_FLAG:
		end = incise_decimal_integer(text, cell->integer);
		break;
	default:
		end = incise_decimal_real(text, cell->real, column->decimals);
	}
	*end++ = behind;
	fwrite_unlocked(text, 1, end - text, table->out);
}

/* The header comes with the first row: a failure before it prints nothing. */
static int csv_put(struct incise_table *table, struct incise_error *err)
{
	struct incise_c_locale locale = incise_c_locale_begin();

	if (!table->rows)
		put_header(table);
	for (size_t row = 0; row < table->filled; row++)
		for (int i = 0; i < table->n_columns; i++)
			put_cell(table, &table->columns[i],
				 &table->block[(size_t)i * INCISE_TABLE_STRIDE + row],
				 i + 1 < table->n_columns ? ',' : '\n');
	incise_c_locale_end(locale);
	return check_written(table, false, err);
}

static int csv_end(struct incise_table *table, struct incise_error *err)
{
	errno = 0;
	return check_written(table, fflush(table->out), err);
}

const struct incise_table_format incise_table_csv = {
	.abi = INCISE_TABLE_ABI,
	.put = csv_put,
	.end = csv_end,
};
