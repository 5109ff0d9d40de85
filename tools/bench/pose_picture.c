// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of incise bench pose; see pose_picture.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "pose_picture.h"

/* Of the two delays the shorter one is drawn: a block per motion and method. */
static bool drawn(const struct pose_row *row, const struct pose_row *first)
{
	return row->condition.delay_ms == first->condition.delay_ms;
}

static void write_data(const struct pose_table *rows, const char *folder,
		       const char *data)
{
	FILE *out = plot_data(folder, data);

	for (int motion = 0; motion < MOTIONS; motion++)
		for (int method = 0; method < POSE_ROWS; method++) {
			/* A block without points would shift the numbers of the others. */
			fputs("NaN NaN NaN NaN NaN NaN\n", out);
			for (int i = method; i < rows->n; i += POSE_ROWS) {
				const struct pose_row *row = &rows->row[i];

				if (row->condition.motion == &motions[motion] &&
				    drawn(row, rows->row))
					fprintf(out, "%g %g %g %g %g %g\n",
						row->condition.tracker_hz,
						row->error.place_mm.rms,
						row->error.place_mm.max,
						row->time.ns.median, row->time.ns.p5,
						row->time.ns.p95);
			}
			fputs("\n\n", out);
		}
	plot_data_end(out, folder);
}

static void begin(FILE *script, const struct pose_table *rows, const char *what,
		  const char *data)
{
	fprintf(script,
		"set multiplot layout 2,3 title \"Error of the shown pose over %s: a tracker "
		"that is %g ms late, with %g mm of noise and %g %% lost\" font ',13'\n"
		"set logscale xy\nset ylabel 'rms error / mm'\ndata = '%s'\n"
		"set format y '%%g'\nset key off\n",
		what, rows->row->condition.delay_ms, POSE_NOISE_MM, POSE_LOST * 100,
		data);
}

/* The colour of a method; the exact pose is black, and has no cost. */
static const char *style(int method)
{
	static const char *const styles[POSE_ROWS] = {
		"lc rgb '#999999' lw 1.3", "lc rgb '#c0392b' lw 1.3",
		"lc rgb '#2e8b57' lw 1.3", "lc rgb '#1f4e9c' lw 2.2",
		"lc rgb '#d68910' lw 1.3", "lc rgb '#17a2b8' lw 1.3",
		"lc rgb '#8e44ad' lw 1.3", "lc rgb 'black' lw 1 dt 3",
	};

	return styles[method];
}

/* The sixth panel is the key. */
static void draw_key(FILE *script, bool exact)
{
	fputs("unset logscale\nunset xlabel\nunset ylabel\nunset title\nunset xtics\n"
	      "unset ytics\nunset border\nunset grid\nset key at graph 0.9, 0.95 top right "
	      "Left reverse samplen 3 spacing 1.4 font ',12'\n"
	      "set xrange [0:1]\nset yrange [0:1]\nplot \\\n",
	      script);
	for (int method = 0; method < POSE_METHODS + exact; method++)
		fprintf(script, "  NaN with linespoints %s pt %d title '%s', \\\n",
			style(method), method < POSE_METHODS ? 7 : 0,
			method < POSE_METHODS ? pose_methods[method].name
					      : "exact, as late as the tracker");
	fputs("  NaN notitle\nunset multiplot\n", script);
}

void pose_picture_cost(const struct pose_table *rows, const char *folder,
		       const char *name)
{
	char *data;
	FILE *script;

	if (!rows->n)
		return;
	if (asprintf(&data, "%s.dat", name) < 0)
		cli_fail("no memory");
	write_data(rows, folder, data);
	script = plot_begin(folder, name, 1320, 860);
	begin(script, rows, "its cost", data);
	fputs("set xlabel 'time per tick / ns (bars: 5 to 95 %)'\nset termoption noenhanced\n"
	      "set xrange [2:400]\nset yrange [0.01:1]\n",
	      script);
	for (int motion = 0; motion < MOTIONS; motion++) {
		fprintf(script, "set title '%s: %s'\nplot \\\n", motions[motion].name,
			motions[motion].about);
		for (int method = 0; method < POSE_METHODS; method++)
			fprintf(script,
				"  data index %d using 4:2 with lines %s, \\\n"
				"  '' index %d using 4:2:5:6 with xerrorbars %s pt 7 ps 0.7, \\\n"
				"  '' index %d using 4:2:($1 == 60 || $1 == 1000 ? sprintf('%%g', $1) : '') with labels left "
				"offset 0.4,0.4 font ',8', \\\n",
				motion * POSE_ROWS + method, style(method),
				motion * POSE_ROWS + method, style(method),
				motion * POSE_ROWS + method);
		fputs("  NaN\n", script);
	}
	fputs("set label 1 'numbers: Hz of the tracker' at graph 0.1, 0.05\n", script);
	draw_key(script, false);
	free(data);
	if (!plot_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}

void pose_picture_rates(const struct pose_table *rows, const char *folder,
			const char *name)
{
	struct plot_part p;
	FILE *script;

	if (!rows->n)
		return;
	p = plot_part(folder, name, "rates");
	write_data(rows, p.folder, p.data);
	script = plot_begin(p.folder, p.name, 1320, 860);
	begin(script, rows, "the tracker's rate", p.data);
	fputs("set xlabel 'rate of the tracker / Hz'\nset xrange [50:1200]\n"
	      "set xtics (60, 120, 240, 500, 1000)\nset termoption noenhanced\n",
	      script);
	for (int motion = 0; motion < MOTIONS; motion++) {
		fprintf(script, "set title '%s: %s'\nplot \\\n", motions[motion].name,
			motions[motion].about);
		for (int method = 0; method < POSE_ROWS; method++)
			fprintf(script,
				"  data index %d using 1:2 with linespoints %s pt %d ps 0.8, \\\n",
				motion * POSE_ROWS + method, style(method),
				method < POSE_METHODS ? 7 : 0);
		fputs("  NaN\n", script);
	}
	draw_key(script, true);
	plot_part_draw(script, &p);
}
