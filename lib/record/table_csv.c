// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A table as CSV: a header of names, a row per line, a decimal point in any locale.
 * Lineage goes before it as lines "# key: value", which incise train passes over.
 *
 * printf(3) would take most of the time of an export; the digits here are the same.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "../base/c_locale.h"
#include "table_writer.h"

#define CELL_MAX 400 /* bytes of a number: %.6f of the largest double is 316 */

/* The digits of a whole number; returns behind the last. */
static char *put_digits(char *to, uint64_t value, int least)
{
	char digits[24];
	int n = 0;

	for (; value || n < least; value /= 10)
		digits[n++] = '0' + value % 10;
	while (n)
		*to++ = digits[--n];
	return to;
}

static char *put_integer(char *to, int64_t value)
{
	if (value < 0)
		*to++ = '-';
	return put_digits(to, value < 0 ? -(uint64_t)value : (uint64_t)value, 1);
}

/*
 * As printf("%.*f"). The product is off by half of its last digit, 2^-53 of it: below
 * 2^40 that is 1.3e-4, so only within 1e-3 of a half can the rounding be in doubt.
 */
static char *put_real(char *to, double value, int decimals)
{
	static const double powers[] = {1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};
	double scaled, whole;
	uint64_t n, power;

	if (decimals < 0)
		return to + sprintf(to, "%.9g", value);
	if (decimals > 9 || !(fabs(value) * powers[decimals] < 0x1p40))
		return to + sprintf(to, "%.*f", decimals, value);
	scaled = fabs(value) * powers[decimals];
	whole = floor(scaled);
	if (fabs(scaled - whole - 0.5) < 1e-3)
		return to + sprintf(to, "%.*f", decimals, value);
	n = (uint64_t)whole + (scaled - whole > 0.5);
	power = (uint64_t)powers[decimals];
	if (signbit(value))
		*to++ = '-';
	to = put_digits(to, n / power, 1);
	if (decimals) {
		*to++ = '.';
		to = put_digits(to, n % power, decimals);
	}
	return to;
}

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
	char text[CELL_MAX];

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
				to = put_real(to, cell->real, column->decimals);
			else
				to = put_integer(to, cell->integer);
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
