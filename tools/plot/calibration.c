// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figure of a calibration: each coefficient of its history over the date, with U (k = 2), a
 * panel each; and its value before it was calibrated first. See figure.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/calibration.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "figure.h"

#define TITLE_HEIGHT 50
#define PANEL_HEIGHT 240
#define KEY_HEIGHT 40
#define COLUMNS 2
#define DAY_S 86400.0

/* A coefficient of a kind of calibration. */
struct series {
	const char *kind, *key, *unit;
	int n, passed, failed;
	double first_s, last_s; /* UNIX time */
	double before;		/* active before the first one, NAN: nothing */
	double active;
};

struct history {
	struct incise_calibration_record *record; /* n, oldest first */
	int n;
	struct series *series;
	int n_series;
};

/* "2026-11-21T14:48:16Z" as UNIX time; NAN: it is another text. */
static double date_s(const char *text)
{
	struct tm tm = {0};
	const char *end = strptime(text, "%Y-%m-%dT%H:%M:%SZ", &tm);

	return end && !*end ? (double)timegm(&tm) : NAN;
}

static struct series *find_series(struct history *history, const char *kind,
				  const struct incise_calibration_value *value)
{
	struct series *series;

	for (int i = 0; i < history->n_series; i++) {
		series = &history->series[i];
		if (!strcmp(series->kind, kind) && !strcmp(series->key, value->key))
			return series;
	}
	history->series = cli_resize(history->series, (size_t)history->n_series + 1,
				     sizeof(*history->series));
	series = &history->series[history->n_series++];
	*series = (struct series){
		.kind = kind,
		.key = value->key,
		.unit = value->unit,
		.before = value->found,
	};
	return series;
}

/* A delay has its standard deviation as half of its own bar, in the same record. */
static bool is_bar(const struct incise_calibration_record *record, const char *key)
{
	const char *sd = strstr(key, "_delay_sd_ms");
	char *delay = cli_text("%.*s_delay_ms", sd ? (int)(sd - key) : 0, key);
	bool found = false;

	for (int i = 0; sd && i < record->n; i++)
		found |= !strcmp(record->values[i].key, delay);
	free(delay);
	return found;
}

static struct history read_history(const char *path)
{
	struct incise_calibration active;
	struct history history = {0};
	struct incise_error err = {0};

	history.n = incise_calibration_history(path, &history.record, &err);
	cli_check(history.n < 0 || incise_calibration_load(path, &active, &err), &err);
	for (int i = 0; i < history.n; i++) {
		const struct incise_calibration_record *record = &history.record[i];
		double t_s = date_s(record->date);

		for (int k = 0; k < record->n && !isnan(t_s); k++) {
			struct series *series;

			if (is_bar(record, record->values[k].key))
				continue;
			series = find_series(&history, record->kind, &record->values[k]);
			series->first_s = series->n ? fmin(series->first_s, t_s) : t_s;
			series->last_s = series->n ? fmax(series->last_s, t_s) : t_s;
			series->n++;
			record->pass ? series->passed++ : series->failed++;
		}
	}
	for (int i = 0; i < history.n_series; i++)
		history.series[i].active =
			incise_calibration_get(&active, history.series[i].key);
	if (!history.n_series)
		cli_fail("%s: has no history to draw; 'incise calibrate' adds to it",
			 path);
	return history;
}

/* Rows "UNIX time, value, U, 1 where it passed". */
static void write_series(const struct history *history, const struct series *series,
			 const char *folder, const char *name)
{
	FILE *data = plot_data(folder, name);

	for (int i = 0; i < history->n; i++) {
		const struct incise_calibration_record *record = &history->record[i];
		double t_s = date_s(record->date);

		for (int k = 0; k < record->n && !isnan(t_s); k++) {
			const struct incise_calibration_value *value = &record->values[k];

			if (!strcmp(record->kind, series->kind) &&
			    !strcmp(value->key, series->key))
				fprintf(data, "%.0f %.9g %.4g %d\n", t_s, value->left,
					2 * value->u, record->pass);
		}
	}
	plot_data_end(data, folder);
}

/* "force zero / mV" of force_zero_mV: free(3). */
static char *label_of(const struct series *series)
{
	static const struct {
		const char *key, *name;
	} names[] = {
		{"force_mV_N", "sensitivity of the force"},
		{"depth_mm_px", "scale of the depth"},
		{"stepper_N_step", "force of a microstep"},
		{"stepper_steps_s", "largest rate"},
	};
	const char *unit = series->unit, *last = strrchr(series->key, '_');
	char *name = cli_text("%.*s", (int)(last ? last - series->key : 32), series->key);
	char *label;

	for (char *c = name; *c; c++)
		*c = *c == '_' ? ' ' : *c;
	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++)
		if (!strcmp(names[i].key, series->key))
			snprintf(name = cli_resize(name, strlen(names[i].name) + 1, 1),
				 strlen(names[i].name) + 1, "%s", names[i].name);
	label = cli_text(!*unit		     ? "%s"
			 : strchr(unit, '/') ? "%s / (%s)"
					     : "%s / %s",
			 name, unit);
	free(name);
	return label;
}

/* An axis with three days, or fewer where they are one; of one calibration its time. */
static void put_dates(FILE *script, const struct series *series, double from_s,
		      double to_s)
{
	static const double shares[] = {0.18, 0.5, 0.82};
	double last_s = -INFINITY;
	time_t only = (time_t)series->first_s;

	if (series->n == 1) {
		fprintf(script,
			"set xrange [%.0f:%.0f]\n"
			"set xtics (strftime('%%Y-%%m-%%d %%H:%%M', %.0f) %.0f)\n",
			from_s, to_s, (double)only, (double)only);
		return;
	}
	fprintf(script, "set xrange [%.0f:%.0f]\nset xtics (", from_s, to_s);
	for (int i = 0; i < 3; i++) {
		double day_s =
			round((from_s + shares[i] * (to_s - from_s)) / DAY_S) * DAY_S;
		time_t t = (time_t)day_s;
		struct tm tm;
		char text[32];

		if (day_s <= last_s || !gmtime_r(&t, &tm))
			continue;
		strftime(text, sizeof(text), "%Y-%m-%d", &tm);
		fprintf(script, "%s'%s' %.0f", last_s > 0 ? ", " : "", text, day_s);
		last_s = day_s;
	}
	fputs(")\n", script);
}

static void put_panel(FILE *script, const struct series *series, const char *name)
{
	/* A day at least, and a margin, so that one calibration has an axis too. */
	double margin_s = fmax(0.06 * (series->last_s - series->first_s), DAY_S);
	char *label = label_of(series);

	fputs("set ylabel ", script);
	plot_put_text(script, label);
	fputc('\n', script);
	put_dates(script, series, series->first_s - margin_s, series->last_s + margin_s);
	fputs("plot ", script);
	if (!isnan(series->before))
		fprintf(script, "%.9g with lines lc rgb grey dt 2, \\\n  ",
			series->before);
	if (!isnan(series->active))
		fprintf(script, "%.9g with lines lt 3, \\\n  ", series->active);
	if (series->passed)
		fprintf(script,
			"'%s' using 1:($4>0?$2:NaN):3 with yerrorbars lt 1, "
			"\\\n  '' using 1:($4>0?$2:NaN) with lines lt 1 lw 0.8 dt 3, \\\n  ",
			name);
	if (series->failed)
		fprintf(script,
			"'%s' using 1:($4>0?NaN:$2):3 with yerrorbars lt 2 pt 2, "
			"\\\n  ",
			name);
	fputs("NaN\n", script);
	free(label);
}

/* One for all panels, of what they have. */
static void put_key(FILE *script, const struct history *history)
{
	bool before = false, active = false, passed = false, failed = false;

	for (int i = 0; i < history->n_series; i++) {
		before |= !isnan(history->series[i].before);
		active |= !isnan(history->series[i].active);
		passed |= history->series[i].passed > 0;
		failed |= history->series[i].failed > 0;
	}
	fprintf(script,
		"set size 1,1\nset origin 0,0\neval key_panel\nplot %s%s%s%sNaN notitle\n",
		before ? "keyentry with lines lc rgb grey dt 2 title 'before', " : "",
		active ? "keyentry with lines lt 3 title 'active', " : "",
		passed ? "keyentry with yerrorbars lt 1 title 'value and U (k = 2)', "
		       : "",
		failed ? "keyentry with yerrorbars lt 2 pt 2 title 'not passed', " : "");
}

FILE *figure_of_calibration(const struct figure *figure)
{
	struct history history = read_history(figure->path);
	int rows = (history.n_series + COLUMNS - 1) / COLUMNS;
	int height = TITLE_HEIGHT + rows * PANEL_HEIGHT + KEY_HEIGHT;
	FILE *script = plot_begin(figure->folder, figure->name, FIGURE_WIDTH, height);
	double share = (double)PANEL_HEIGHT / height;

	fputs("set multiplot title ", script);
	plot_put_text(script, figure->path);
	fprintf(script,
		".': %s' noenhanced\n"
		"set key off\nset offsets 0, 0, graph 0.1, graph 0.1\nset size %g,%g\n",
		cli_count(history.n, "calibration"), 1.0 / COLUMNS, share);
	for (int i = 0; i < history.n_series; i++) {
		char *name = cli_text("series-%d.dat", i);

		write_series(&history, &history.series[i], figure->folder, name);
		fprintf(script, "set origin %g,%g\n", (double)(i % COLUMNS) / COLUMNS,
			1 - (double)TITLE_HEIGHT / height - (i / COLUMNS + 1) * share);
		put_panel(script, &history.series[i], name);
		free(name);
	}
	put_key(script, &history);
	fputs("unset multiplot\n", script);
	free(history.series), free(history.record);
	return script;
}
