// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of incise bench loop; see loop_picture.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <incise/loop.h>
#include "../cli/cli.h"
#include "loop_picture.h"
#include "../cli/plot.h"

/* ---- wake-ups ---- */

/* Bins of the picture are a tenth wider than the ones before, whole µs at least. */
static int next_edge(int edge)
{
	int next = edge + edge / 10;

	return next > edge ? next : edge + 1;
}

/* Lower edge, share of all wake-ups; both ends are drawn down to the axis. */
static void write_histogram(FILE *out, const struct lateness *l)
{
	int from = 0;

	fputs("1 0\n", out);
	while (l->bins && from < INCISE_LOOP_BINS) {
		int to = next_edge(from);
		uint64_t n = 0;

		for (int i = from; i < to && i < INCISE_LOOP_BINS; i++)
			n += l->bins[i];
		/* What came within the first µs begins where the axis does. */
		fprintf(out, "%g %g\n", fmax(from, 0.9), (double)n / (double)l->ticks);
		from = to;
	}
	fputs("\n\n", out);
}

static int measured(const struct wakeups *wakeups, double rate_hz)
{
	int n = 0;

	for (int i = 0; i < wakeups->n; i++)
		n += wakeups->row[i].got.loop.bins && wakeups->row[i].rate_hz == rate_hz;
	return n;
}

/* Panels of one rate stand in a row. */
static int columns_of(const struct wakeups *wakeups, int *lines)
{
	int columns = 0;

	*lines = 0;
	for (int i = 0; i < wakeups->n; i++) {
		int n = measured(wakeups, wakeups->row[i].rate_hz);

		columns = n > columns ? n : columns;
		if (!i || wakeups->row[i].rate_hz != wakeups->row[i - 1].rate_hz)
			*lines += n > 0;
	}
	return columns;
}

static void draw_panel(FILE *script, const struct wakeup_row *row, int block)
{
	fprintf(script, "set title \"%g kHz, %s\\n99.9 %%: %.0f us", row->rate_hz / 1e3,
		load_name(row->load), row->got.loop.p999);
	if (row->got.cyclictest.bins)
		fprintf(script, ", cyclictest %.0f us", row->got.cyclictest.p999);
	fprintf(script,
		"\" font ',11'\nplot data index %d using 1:($2 > 0 ? $2 : 1e-9) with fillsteps "
		"fc rgb '#8fbbd9' title 'loop'",
		block);
	if (row->got.cyclictest.bins)
		fprintf(script,
			", \\\n  '' index %d using 1:($2 > 0 ? $2 : 1e-9) with steps ls 2 title "
			"'cyclictest'",
			block + 1);
	fputs("\n", script);
}

void loop_picture_wakeups(const struct wakeups *wakeups, const char *folder,
			  const char *name)
{
	int lines, columns = columns_of(wakeups, &lines), block = 0;
	double most = 1;
	struct plot_part p;
	FILE *out, *script;

	if (!columns)
		return;
	p = plot_part(folder, name, "wakeups");
	out = plot_data(p.folder, p.data);
	for (int i = 0; i < wakeups->n; i++)
		if (wakeups->row[i].got.loop.bins) {
			write_histogram(out, &wakeups->row[i].got.loop);
			write_histogram(out, &wakeups->row[i].got.cyclictest);
			most = fmax(most, (double)wakeups->row[i].got.loop.ticks);
		}
	plot_data_end(out, p.folder);
	script = plot_begin(folder, p.name, columns > 1 ? 330 * columns + 60 : 640,
			    330 * lines + 60);
	fprintf(script,
		"set multiplot layout %d,%d title \"How late the loop's thread wakes, and "
		"cyclictest beside it%s%s, %.3g s each\" font ',13'\n"
		"set logscale xy\nset xrange [0.9:20000]\nset yrange [%g:1]\n"
		"set format y '10^{%%L}'\nset format x '10^{%%L}'\nset termoption enhanced\n"
		"set xlabel 'late / us'\nset ylabel 'share of wake-ups'\n"
		"set style fill solid\nset key top right samplen 2\ndata = '%s'\n",
		lines, columns, columns > 1 ? ": " : "\\n",
		wakeups->realtime ? "SCHED_FIFO" : "SCHED_OTHER", wakeups->seconds,
		0.5 / most, p.data);
	for (int i = 0; i < wakeups->n; i++) {
		const struct wakeup_row *row = &wakeups->row[i];

		if (!row->got.loop.bins)
			continue;
		draw_panel(script, row, block);
		block += 2;
	}
	fputs("unset multiplot\n", script);
	plot_part_draw(script, &p);
}

/* ---- rates ---- */

/* Blocks: one per series, of those that did not fail. */
static void write_rates(FILE *out, const struct rates *rates)
{
	for (int i = 0; i < rates->n; i++) {
		const struct rate_row *r = &rates->row[i];

		if (i % rates->rates == 0)
			fputs(i ? "\n\nNaN NaN NaN NaN NaN\n" : "NaN NaN NaN NaN NaN\n",
			      out);
		if (!*r->failed)
			fprintf(out, "%g %g %g %g %g\n", r->rate_hz,
				r->command.rms_N * 1e3, r->rendered.rms_N * 1e3,
				r->hold_N * 1e3, r->ns_per_s * 1e-3);
	}
}

static void draw_lines(FILE *script, const struct rates *rates, const char *x)
{
	fputs("plot \\\n", script);
	for (int s = 0; s * rates->rates < rates->n; s++) {
		const struct rate_row *r = &rates->row[s * rates->rates];

		fprintf(script,
			"  data index %d using %s:2 with linespoints ls %d pt 7 ps 0.8 title "
			"'%g N/mm, %s poses: asked for', \\\n"
			"  '' index %d using %s:3 with linespoints ls %d dt 2 pt 6 ps 0.8 "
			"title 'rendered', \\\n",
			s, x, s + 1, r->stiffness_N_mm, r->poses, s, x, s + 1);
	}
}

void loop_picture_rates(const struct rates *rates, const char *folder, const char *name)
{
	struct plot_part p = plot_part(folder, name, "rates");
	FILE *out = plot_data(p.folder, p.data), *script;

	write_rates(out, rates);
	plot_data_end(out, p.folder);
	script = plot_begin(folder, p.name, 1320, 620);
	fprintf(script,
		"set multiplot layout 1,2 title \"Error of the force over a cut of some 3 N, "
		"against the exact force of a plain wall\" font ',13'\n"
		"set logscale xy\nset yrange [0.05:100]\nset ylabel 'rms error / mN'\n"
		"data = '%s'\nset xrange [200:10000]\nset xlabel 'rate of the loop / Hz'\n"
		"set xtics (250, 500, 1000, 2000, 4000, 8000)\n"
		"set key bottom left Left reverse samplen 3 spacing 0.9\n",
		p.data);
	draw_lines(script, rates, "1");
	fprintf(script,
		"  data index 0 using 1:4 with lines lc rgb 'black' lw 1 dt 3 title '%g N/mm, "
		"ideal sample and hold'\n"
		"set xrange [*:*]\nset xtics auto\n"
		"set xlabel 'run time for a second of haptics / us'\nset key off\n",
		rates->row[0].stiffness_N_mm);
	draw_lines(script, rates, "5");
	fputs("  NaN\nunset multiplot\n", script);
	plot_part_draw(script, &p);
}
