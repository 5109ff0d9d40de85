// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of incise bench timeline; see timeline_picture.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "timeline_picture.h"

static const char *const styles[TIME_METHODS] = {
	"lc rgb '#999999' lw 1.3", "lc rgb '#d68910' lw 1.3", "lc rgb '#c0392b' lw 1.3",
	"lc rgb '#2e8b57' lw 1.3", "lc rgb '#8e44ad' lw 1.3", "lc rgb '#1f4e9c' lw 2.2",
	"lc rgb 'black' lw 1",	   "lc rgb '#17a2b8' lw 2.2",
};

/* Blocks by lateness and method, of the last drift: window, rms, largest, stated, ns. */
static void write_data(const struct timeline_table *table, const char *folder,
		       const char *data)
{
	double drift_ppm = table->row[(table->n - 1)].drift_ppm;
	FILE *out = plot_data(folder, data);

	for (int late = 0; late < LATE_KINDS; late++)
		for (int method = 0; method < TIME_METHODS; method++) {
			/* A block without points would shift the numbers of the others. */
			fputs("NaN NaN NaN NaN NaN NaN NaN\n", out);
			for (int i = method; i < table->n; i += TIME_METHODS) {
				const struct timeline_row *row = &table->row[i];

				if (row->late == (enum lateness_kind)late &&
				    row->drift_ppm == drift_ppm)
					fprintf(out, "%g %g %g %g %g %g %g\n",
						row->window_s, row->rms_us, row->max_us,
						row->stated_us, row->time.ns.median,
						row->time.ns.p5, row->time.ns.p95);
			}
			fputs("\n\n", out);
		}
	plot_data_end(out, folder);
}

static void begin(FILE *script, const struct timeline_table *table, const char *what,
		  const char *data)
{
	fprintf(script,
		"set multiplot layout 1,3 title \"Error of times of acquisition over %s: %d Hz "
		"by a clock that is off by %g ppm, up to %d ms late\" font ',13'\n"
		"set termoption noenhanced\nset logscale xy\nset yrange [1:30000]\n"
		"set ylabel 'rms error / us'\nset key bottom left Left reverse samplen 2 "
		"spacing 0.95 font ',9'\nset format y '%%g'\ndata = '%s'\n",
		what, STREAM_HZ, table->row[table->n - 1].drift_ppm, STREAM_LATE_MS,
		data);
}

void timeline_picture_cost(const struct timeline_table *table, const char *folder,
			   const char *name)
{
	FILE *script;
	char *data;

	if (!table->n)
		return;
	if (asprintf(&data, "%s.dat", name) < 0)
		cli_fail("no memory");
	write_data(table, folder, data);
	script = plot_begin(folder, name, 1320, 620);
	begin(script, table, "their cost", data);
	/* Room below for the key. */
	fputs("set xlabel 'time per sample / ns (bars: 5 to 95 %)'\nset xrange [2:2000]\n"
	      "set yrange [0.05:30000]\n",
	      script);
	for (int late = 0; late < LATE_KINDS; late++) {
		fprintf(script, "set title 'lateness: %s'\nplot \\\n",
			lateness_kinds[late]);
		for (int method = 0; method < TIME_METHODS; method++) {
			int block = late * TIME_METHODS + method;

			fprintf(script,
				"  data index %d using 5:2 with lines %s notitle, \\\n"
				"  '' index %d using 5:2:6:7 with xerrorbars %s pt 7 ps 0.7 "
				"title '%s', \\\n"
				"  '' index %d using 5:2:($1 == 1 || $1 == 120 ? "
				"sprintf('%%g s', $1) : '') with labels left offset 0.5,0.4 "
				"font ',8' notitle, \\\n",
				block, styles[method], block, styles[method],
				time_methods[method].name, block);
		}
		fputs("  NaN notitle\n", script);
	}
	fputs("unset multiplot\n", script);
	free(data);
	if (!plot_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}

void timeline_picture_windows(const struct timeline_table *table, const char *folder,
			      const char *name)
{
	struct plot_part p;
	FILE *script;

	if (!table->n)
		return;
	p = plot_part(folder, name, "windows");
	write_data(table, p.folder, p.data);
	script = plot_begin(p.folder, p.name, 1320, 620);
	begin(script, table, "how much was seen", p.data);
	fputs("set xlabel 'seen / s'\nset xrange [0.8:150]\n"
	      "set xtics (1, 2, 5, 10, 30, 60, 120)\n",
	      script);
	for (int late = 0; late < LATE_KINDS; late++) {
		fprintf(script, "set title 'lateness: %s'\nplot \\\n",
			lateness_kinds[late]);
		for (int method = 0; method < TIME_METHODS; method++) {
			int block = late * TIME_METHODS + method;

			fprintf(script,
				"  data index %d using 1:2 with linespoints %s pt 7 ps 0.8 "
				"title '%s', \\\n",
				block, styles[method], time_methods[method].name);
			if (time_methods[method].sd_ns)
				fprintf(script,
					"  '' index %d using 1:4 with lines %s dt 3 title "
					"'%s, stated', \\\n",
					block, styles[method], time_methods[method].name);
		}
		fputs("  NaN notitle\n", script);
	}
	fputs("unset multiplot\n", script);
	plot_part_draw(script, &p);
}
