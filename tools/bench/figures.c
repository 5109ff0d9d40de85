// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Figures of a bench; see figures.h.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "figures.h"
#include "../cli/json.h"

const char *const figures_yardsticks[YARDSTICKS] = {"yardsticks", "wide_yardsticks",
						    "memory_yardsticks"};

json_t *figures_new(void)
{
	return json_array();
}

static double unit_ns(const char *unit)
{
	if (!strcmp(unit, "ns"))
		return 1;
	if (!strcmp(unit, "us"))
		return 1e3;
	if (!strcmp(unit, "ms"))
		return 1e6;
	if (!strcmp(unit, "s"))
		return 1e9;
	cli_fail("'%s' is no unit of time", unit);
}

/* Release what was begun, or append it; a figure that is none is left out. */
static json_t *append(json_t *figures, const char *fmt, va_list args, double value,
		      json_t *figure)
{
	char name[200];

	if (!isfinite(value)) {
		json_decref(figure);
		return NULL;
	}
	vsnprintf(name, sizeof(name), fmt, args);
	json_object_set_new(figure, "name", json_text(name));
	json_array_append_new(figures, figure);
	return figure;
}

/* "NAME", "NAME_low" and "NAME_high" */
static void set_interval(json_t *figure, const char *name, double k,
			 const struct harness_spread *spread)
{
	const double values[] = {spread->median, spread->low, spread->high};
	static const char *const ends[] = {"", "_low", "_high"};
	char key[40];

	for (int i = 0; i < 3; i++) {
		snprintf(key, sizeof(key), "%s%s", name, ends[i]);
		json_object_set_new(figure, key, json_number(k * values[i]));
	}
}

json_t *figures_time(json_t *figures, const struct harness_time *time, const char *unit,
		     const char *fmt, ...)
{
	double k = 1 / unit_ns(unit);
	json_t *figure = json_pack("{ss ss so so so}", "kind", "time", "unit", unit,
				   "value", json_number(k * time->ns.median), "low",
				   json_number(k * time->ns.low), "high",
				   json_number(k * time->ns.high));
	va_list args;

	for (int y = 0; y < YARDSTICKS; y++)
		set_interval(figure, figures_yardsticks[y], 1, &time->by[y]);
	va_start(args, fmt);
	figure = append(figures, fmt, args, time->ns.median, figure);
	va_end(args);
	return figure;
}

json_t *figures_measured(json_t *figures, const struct harness_spread *spread,
			 const char *unit, const char *fmt, ...)
{
	json_t *figure;
	va_list args;

	va_start(args, fmt);
	figure = append(figures, fmt, args, spread->median,
			json_pack("{ss ss so so so}", "kind", "measured", "unit", unit,
				  "value", json_number(spread->median), "low",
				  json_number(spread->low), "high",
				  json_number(spread->high)));
	va_end(args);
	return figure;
}

json_t *figures_exact(json_t *figures, double value, const char *unit, const char *fmt,
		      ...)
{
	json_t *figure;
	va_list args;

	va_start(args, fmt);
	figure = append(figures, fmt, args, value,
			json_pack("{ss ss so}", "kind", "exact", "unit", unit, "value",
				  json_number(value)));
	va_end(args);
	return figure;
}

void figures_more_is_better(json_t *figure)
{
	if (figure)
		json_object_set_new(figure, "better", json_string("more"));
}
