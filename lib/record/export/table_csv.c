// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A table as CSV: a header of names, a row per line, a decimal point in any locale.
 * Lineage goes before it as lines "# key: value", which incise train passes over.
 */
#include <errno.h>
#include <string.h>
#include "../../base/c_locale.h"
#include "decimal.h"
#include "table_writer.h"

static void put_name(struct incise_table *table, int64_t number)
{
	const char *name = table->names[number - 1];
	bool quote = strpbrk(name, ",\" ;#") != NULL;

	if (!quote) {
		fputs_unlocked(name, table->out);
		return;
	}
	fputc_unlocked('"', table->out);
	for (; *name; name++) {
		if (*name == '"')
			fputc_unlocked('"', table->out);
		fputc_unlocked(*name, table->out);
	}
	fputc_unlocked('"', table->out);
}

static int check(struct incise_table *table, bool bad, struct incise_error *err)
{
	int code = errno ? errno : EIO;

	if (!bad && !ferror(table->out))
		return 0;
	return incise_error_set(
		err, code,
		"the dataset cannot be written: %s; make room, or give another -o",
		strerror(code));
}

/* Nothing yet: a failure before the first row prints nothing. */
static int csv_begin(struct incise_table *table, struct incise_error *err)
{
	(void)table;
	(void)err;
	return 0;
}

static void put_header(struct incise_table *table)
{
	for (int i = 0; table->lineage && i < table->lineage->n; i++)
		fprintf(table->out, "# %s: %s\n", table->lineage->items[i].key,
			table->lineage->items[i].value);
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
			const struct incise_column *column = &table->columns[i];
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
