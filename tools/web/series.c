// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Values over an axis, reduced to their extremes; see web.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "web.h"

void web_series_init(struct web_series *series, double from, double to, int n, int room)
{
	*series = (struct web_series){.from = from, .to = to, .n = n, .room = room};
	series->low = cli_alloc((size_t)n, sizeof(*series->low));
	series->high = cli_alloc((size_t)n, sizeof(*series->high));
	series->x = cli_alloc((size_t)room + 1, sizeof(*series->x));
	series->y = cli_alloc((size_t)room + 1, sizeof(*series->y));
	for (int i = 0; i < n; i++) {
		series->low[i] = INFINITY;
		series->high[i] = -INFINITY;
	}
}

void web_series_free(struct web_series *series)
{
	free(series->low);
	free(series->high);
	free(series->x);
	free(series->y);
	*series = (struct web_series){0};
}

/* The span of a place, from 0 to n; n is behind the end. */
static int span_of(const struct web_series *series, double x)
{
	double share = (x - series->from) / (series->to - series->from);

	return share > 0 ? (int)fmin(share * series->n, series->n) : 0;
}

static void keep_sample(struct web_series *series, double x, double y)
{
	if (series->samples <= series->room) {
		series->x[series->samples] = x;
		series->y[series->samples] = (float)y;
		series->samples++;
	}
}

void web_series_add(struct web_series *series, double x, double y)
{
	int i;

	if (isnan(y)) {
		/* No gap before the first sample, and one between two. */
		if (series->samples && series->samples <= series->room &&
		    !isnan(series->y[series->samples - 1]))
			keep_sample(series, x, y);
		return;
	}
	if (!(x >= series->from && x <= series->to))
		return;
	keep_sample(series, x, y);
	i = span_of(series, x);
	i -= i == series->n; /* the end itself */
	series->low[i] = fminf(series->low[i], (float)y);
	series->high[i] = fmaxf(series->high[i], (float)y);
}

/* --- JSON ---------------------------------------------------------------------------------- */

static void put_number(FILE *out, const char *format, double value, bool first)
{
	if (!first)
		fputc(',', out);
	if (isfinite(value))
		fprintf(out, format, value);
	else
		fputs("null", out);
}

static void put_samples(const struct web_series *series, double from, double to, web_u *u,
			const void *of, FILE *out)
{
	int first = 0, end = series->samples;

	/* One sample beyond each end, to which lines lead. */
	while (first + 1 < end && series->x[first + 1] < from)
		first++;
	while (end - 2 >= first && series->x[end - 2] > to)
		end--;
	fputs("{\"x\":[", out);
	for (int i = first; i < end; i++)
		put_number(out, "%.10g", series->x[i], i == first);
	fputs("],\"y\":[", out);
	for (int i = first; i < end; i++)
		put_number(out, "%.6g", series->y[i], i == first);
	for (int i = first; u && i < end; i++) {
		fputs(i == first ? "],\"u\":[" : "", out);
		put_number(out, "%.3g", u(of, series->y[i]), i == first);
	}
	fputs("]}", out);
}

struct extremes {
	float low, high;
};

static struct extremes extremes_of(const struct web_series *series, double from,
				   double to)
{
	struct extremes found = {INFINITY, -INFINITY};
	int first = span_of(series, from), end = span_of(series, to);

	end += end == first;
	for (int i = first; i < end && i < series->n; i++) {
		found.low = fminf(found.low, series->low[i]);
		found.high = fmaxf(found.high, series->high[i]);
	}
	return found;
}

void web_series_put(const struct web_series *series, double from, double to, int columns,
		    web_u *u, const void *of, FILE *out)
{
	double step = (to - from) / columns;

	if (u && isnan(u(of, 0)))
		u = NULL;
	if (series->samples <= series->room && series->samples <= columns + 2) {
		put_samples(series, from, to, u, of, out);
		return;
	}
	for (int pass = 0; pass < (u ? 3 : 2); pass++) {
		fputs(pass == 0	  ? "{\"low\":["
		      : pass == 1 ? "],\"high\":["
				  : "],\"u\":[",
		      out);
		for (int i = 0; i < columns; i++) {
			double at = from + step * i;
			struct extremes found =
				at + step < series->from || at > series->to
					? (struct extremes){INFINITY, -INFINITY}
					: extremes_of(series, at, at + step);
			double middle = (found.low + found.high) / 2;

			if (pass < 2)
				put_number(out, "%.6g", pass ? found.high : found.low,
					   !i);
			else
				put_number(out, "%.3g",
					   isfinite(middle) ? u(of, middle) : NAN, !i);
		}
	}
	fputs("]}", out);
}
