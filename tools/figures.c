// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Figures of a bench; see figures.h.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "cli.h"
#include "figures.h"
#include "json.h"

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

json_t *figures_time(json_t *figures, const struct harness_time *time, const char *unit,
		     const char *fmt, ...)
{
	const struct harness_spread *ns = &time->ns, *y = &time->yardsticks;
	double k = 1 / unit_ns(unit);
	json_t *figure;
	va_list args;

	va_start(args, fmt);
	figure = append(
		figures, fmt, args, ns->median,
		json_pack("{ss ss so so so so so so}", "kind", "time", "unit", unit,
			  "value", json_number(k * ns->median), "low",
			  json_number(k * ns->low), "high", json_number(k * ns->high),
			  "yardsticks", json_number(y->median), "yardsticks_low",
			  json_number(y->low), "yardsticks_high", json_number(y->high)));
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
