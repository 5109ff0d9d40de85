// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Simulation beside theory; see ratios.h.
 */
#include <math.h>
#include <stdio.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "ratios.h"

void ratios_add(struct ratios *ratios, struct ratio row)
{
	if (ratios->n == RATIOS_MAX)
		cli_fail("%s: more than %d rows", ratios->key, RATIOS_MAX);
	ratios->row[ratios->n++] = row;
}

double ratios_value(const struct ratio *row)
{
	if (row->simulated == row->theory)
		return 1;
	return row->simulated / row->theory;
}

/* Whether it is as it should be. */
static bool holds(const struct ratios *ratios, const struct ratio *row)
{
	double ratio = ratios_value(row);

	return ratio >= 1 - ratios->tolerance &&
	       (row->at_least || ratio <= 1 + ratios->tolerance);
}

const struct ratio *ratios_first_missed(const struct ratios *ratios, int *missed)
{
	const struct ratio *first = NULL;

	*missed = 0;
	for (int i = 0; i < ratios->n; i++)
		if (!holds(ratios, &ratios->row[i])) {
			if (!first)
				first = &ratios->row[i];
			(*missed)++;
		}
	return first;
}

void ratios_describe(const struct ratios *ratios, const struct ratio *row, char *text,
		     size_t size)
{
	size_t at = 0;

	for (int i = 0; i < RATIOS_PARAMS && ratios->params[i] && at < size; i++)
		at += snprintf(text + at, size - at, "%s%s %g", i ? ", " : "",
			       ratios->params[i], row->param[i]);
	if (at < size)
		snprintf(text + at, size - at, ": %.3f of theory", ratios_value(row));
}

void ratios_print(const struct ratios *ratios)
{
	printf("%s\n", ratios->title);
	for (int p = 0; p < RATIOS_PARAMS && ratios->params[p]; p++)
		printf("%14s", ratios->params[p]);
	printf("%16s%16s%9s\n", ratios->simulated, ratios->theory, "ratio");
	for (int i = 0; i < ratios->n; i++) {
		const struct ratio *row = &ratios->row[i];

		for (int p = 0; p < RATIOS_PARAMS && ratios->params[p]; p++)
			printf("%14g", row->param[p]);
		printf("%16.6g%16.6g%9.4f  %s%s\n", row->simulated, row->theory,
		       ratios_value(row), row->at_least ? "at least " : "",
		       holds(ratios, row) ? "ok" : "MISSED");
	}
	if (ratios->note)
		printf("%s\n", ratios->note);
	putchar('\n');
}

json_t *ratios_json(const struct ratios *ratios)
{
	json_t *rows = json_array();

	for (int i = 0; i < ratios->n; i++) {
		const struct ratio *r = &ratios->row[i];
		json_t *row = json_object();

		for (int p = 0; p < RATIOS_PARAMS && ratios->params[p]; p++)
			json_object_set_new(row, ratios->params[p],
					    r->param[p] == floor(r->param[p]) &&
							    fabs(r->param[p]) < 1e6
						    ? json_integer(r->param[p])
						    : json_number(r->param[p]));
		json_object_set_new(row, ratios->simulated, json_number(r->simulated));
		json_object_set_new(row, ratios->theory, json_number(r->theory));
		json_object_set_new(row, "ratio", json_number(ratios_value(r)));
		json_object_set_new(row, "at_least", json_boolean(r->at_least));
		json_object_set_new(row, "ok", json_boolean(holds(ratios, r)));
		json_array_append_new(rows, row);
	}
	return rows;
}
