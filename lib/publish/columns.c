// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Columns of uncertainties and of wall time; see writers.h and incise/budget.h.
 */
#include "writers.h"

#define DECIMALS 7
#define DECIMALS_TIME 10

static const struct incise_table_column tai_columns[] = {
	INCISE_COLUMN(struct incise_row_extra, tai_ns, INTEGER, 0, "tai_ns", "ns",
		      "TAI since 1970-01-01 00:00:00 TAI"),
	INCISE_COLUMN(struct incise_row_extra, tai_u_ns, REAL, 0, "tai_u_ns", "ns",
		      "bound of the error of tai_ns; not a number: unknown"),
};

#define TAI_COLUMNS (int)(sizeof(tai_columns) / sizeof(*tai_columns))

const char *const incise_budget_correlations[] = {
	[INCISE_BUDGET_CALIBRATION] = "common to recordings with this calibration",
	[INCISE_BUDGET_RECORDING] = "common to the recording",
	[INCISE_BUDGET_OWN] = "independent",
};

/* Columns so far, with capacity for all. */
struct columns {
	struct incise_table_column *list;
	int n;
	size_t at; /* of struct incise_row_extra */
};

/* The number of the column of this name, or of the next one. */
static int find_column(const struct columns *columns, const char *name)
{
	int i = 0;

	while (i < columns->n && strcmp(columns->list[i].name, name))
		i++;
	return i;
}

/* Replace the column of this name, or add it; @i: of its value in extra.u. */
static void put_column(struct columns *to, const struct incise_budget_value *value,
		       const char *name, const char *about, const char *correlation,
		       int i)
{
	int at = find_column(to, name);

	to->n += at == to->n;
	to->list[at] = (struct incise_table_column){
		name,
		value->unit,
		about,
		INCISE_COLUMN_COARSE,
		!strcmp(value->unit, "s") ? DECIMALS_TIME : DECIMALS,
		to->at + offsetof(struct incise_row_extra, u) +
			(size_t)i * sizeof(double),
		value->value,
		correlation,
		NULL,
	};
}

/* Columns of the uncertainties of the values that have a column. */
static void put_uncertainties(struct columns *to, bool with_parts)
{
	const struct incise_budget_part *parts = incise_budget_parts();

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		const struct incise_budget_value *value = &incise_budget_values()[q];

		if (find_column(to, value->value) == to->n)
			continue;
		put_column(to, value, value->total, "standard uncertainty, of all parts",
			   "partly common", q);
		for (int i = value->first; with_parts && i < value->first + value->n; i++)
			put_column(to, value, parts[i].column, parts[i].about,
				   incise_budget_correlations[parts[i].scope],
				   INCISE_BUDGET_QUANTITIES + i);
	}
}

struct incise_table_column *incise_extra_columns(
	const struct incise_table_column *columns, int *n, size_t at,
	const struct incise_export_options *options)
{
	struct columns all = {.n = *n, .at = at};

	all.list = calloc((size_t)*n + INCISE_BUDGET_COLUMNS + TAI_COLUMNS,
			  sizeof(*all.list));
	if (!all.list)
		return NULL;
	memcpy(all.list, columns, (size_t)*n * sizeof(*columns));
	if (options->uncertainty)
		put_uncertainties(&all, options->uncertainty == INCISE_EXPORT_PARTS);
	for (int i = 0; i < TAI_COLUMNS && options->tai; i++) {
		all.list[all.n] = tai_columns[i];
		all.list[all.n++].at += at;
	}
	*n = all.n;
	return all.list;
}

void incise_extra_budget(struct incise_row_extra *extra,
			 const double part[INCISE_BUDGET_PARTS])
{
	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
		extra->u[q] = incise_budget_total((enum incise_budget_quantity)q, part);
	memcpy(extra->u + INCISE_BUDGET_QUANTITIES, part,
	       INCISE_BUDGET_PARTS * sizeof(*part));
}

int incise_extra_tai(struct incise_row_extra *extra, const struct incise_wall *wall,
		     int64_t t_ns, struct incise_error *err)
{
	int64_t u_ns;

	if (!wall)
		return 0;
	if (incise_wall_tai(wall, t_ns, &extra->tai_ns, &u_ns))
		return incise_error_set(err, ENODATA,
					"at t_ns %lld there is no wall time: its points "
					"are more than 60 s away; export without --tai",
					(long long)t_ns);
	extra->tai_u_ns = u_ns == INCISE_WALL_UNKNOWN ? NAN : (double)u_ns;
	return 0;
}
