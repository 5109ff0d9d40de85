// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Columns of uncertainties; see writers.h and incise/budget.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "writers.h"

#define DECIMALS 7
#define DECIMALS_TIME 10

const char *const incise_budget_correlations[] = {
	[INCISE_BUDGET_CALIBRATION] = "common to recordings with this calibration",
	[INCISE_BUDGET_RECORDING] = "common to the recording",
	[INCISE_BUDGET_OWN] = "independent",
};

double incise_coarse(double u)
{
	union {
		float real;
		uint32_t bits;
	} single = {.real = (float)u};

	if (isfinite(single.real))
		single.bits = (single.bits + 0x800) & ~0xfffU;
	return single.real;
}

static int find(const struct incise_budget_columns *columns, const char *name)
{
	for (int i = 0; i < columns->n; i++)
		if (!strcmp(columns->columns[i].name, name))
			return i;
	return -1;
}

/* Replace the column of this name, or add it. Returns its number. */
static int put(struct incise_budget_columns *to, const struct incise_budget_value *value,
	       const char *name, const char *about, const char *correlation)
{
	int at = find(to, name);

	if (at < 0)
		at = to->n++;
	to->columns[at] = (struct incise_table_column){
		name,
		value->unit,
		about,
		INCISE_COLUMN_SINGLE,
		!strcmp(value->unit, "s") ? DECIMALS_TIME : DECIMALS,
		value->value,
		correlation,
	};
	return at;
}

int incise_budget_columns(struct incise_budget_columns *to,
			  const struct incise_table_column *columns, int n,
			  enum incise_export_uncertainty uncertainty)
{
	const struct incise_budget_value *values = incise_budget_values();
	const struct incise_budget_part *parts = incise_budget_parts();

	*to = (struct incise_budget_columns){.n = n};
	to->columns = calloc((size_t)n + INCISE_BUDGET_COLUMNS, sizeof(*to->columns));
	if (!to->columns)
		return -ENOMEM;
	memcpy(to->columns, columns, (size_t)n * sizeof(*columns));
	for (int i = 0; i < INCISE_BUDGET_COLUMNS; i++)
		to->at[i] = -1;
	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		const struct incise_budget_value *value = &values[q];

		if (find(to, value->value) < 0)
			continue;
		to->at[q] = put(to, value, value->total,
				"standard uncertainty, of all parts", "partly common");
		if (uncertainty < INCISE_EXPORT_PARTS)
			continue;
		for (int i = value->first; i < value->first + value->n; i++)
			to->at[INCISE_BUDGET_QUANTITIES + i] =
				put(to, value, parts[i].column, parts[i].about,
				    incise_budget_correlations[parts[i].scope]);
	}
	return 0;
}

void incise_budget_cells(const struct incise_budget_columns *columns,
			 const double part[INCISE_BUDGET_PARTS], union incise_cell *cells)
{
	for (int i = 0; i < INCISE_BUDGET_COLUMNS; i++) {
		double u;

		if (columns->at[i] < 0)
			continue;
		u = i < INCISE_BUDGET_QUANTITIES
			    ? incise_budget_total((enum incise_budget_quantity)i, part)
			    : part[i - INCISE_BUDGET_QUANTITIES];
		cells[columns->at[i]].real = incise_coarse(u);
	}
}
