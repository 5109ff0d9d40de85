// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of incise bench stability; see stability_picture.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../../lib/control/guard.h"
#include <incise/stability.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "stability_picture.h"

#define N(array) (sizeof(array) / sizeof(*(array)))

/* The values that a parameter has, in the order of their first coming. */
static int values_of(const struct ratios *ratios, int param, double *values, int max)
{
	int n = 0;

	for (int i = 0; i < ratios->n; i++) {
		double value = ratios->row[i].param[param];
		int k = 0;

		while (k < n && values[k] != value)
			k++;
		if (k == n && n < max)
			values[n++] = value;
	}
	return n;
}

/* ---- map ---- */

#define MAP_MAX 8
#define MAP_LEAST 1e-4

/* Unit mass and period. */
static double limit(double delta, double beta, int delay)
{
	struct incise_haptic_device device = {.mass_kg = 1000,
					      .damping_N_s_mm = delta,
					      .period_s = 1,
					      .delay_ticks = delay};

	return incise_stability_limit(&device, beta);
}

/* Blocks: for each wall and delay the curve, then the points. */
static void write_map(const struct ratios *exact, const struct plot_part *p,
		      const double *walls, int n_walls, const double *delays,
		      int n_delays)
{
	FILE *out = plot_data(p->folder, p->data);

	for (int w = 0; w < n_walls; w++)
		for (int d = 0; d < n_delays; d++) {
			for (double delta = 5e-4; delta < 20; delta *= 1.03) {
				double K = limit(delta, walls[w], delays[d]);

				fprintf(out, "%g %g\n", delta, K > 0 ? K : NAN);
			}
			fputs("\n\nNaN NaN 7\n", out);
			for (int i = 0; i < exact->n; i++) {
				const struct ratio *r = &exact->row[i];

				/* Nothing is stable: a triangle at the lower edge. */
				if (r->param[1] == walls[w] && r->param[2] == delays[d])
					fprintf(out, "%g %g %d\n", r->param[0],
						fmax(r->simulated, MAP_LEAST * 1.3),
						r->simulated > 0 ? 7 : 11);
			}
			fputs("\n\n", out);
		}
	plot_data_end(out, p->folder);
}

void stability_picture_map(const struct ratios *exact, const char *folder,
			   const char *name)
{
	double walls[MAP_MAX], delays[MAP_MAX];
	int n_walls = values_of(exact, 1, walls, MAP_MAX);
	int n_delays = values_of(exact, 2, delays, MAP_MAX);
	struct plot_part p = plot_part(folder, name, "map");
	FILE *script;

	write_map(exact, &p, walls, n_walls, delays, n_delays);
	script = plot_begin(folder, p.name, 420 * n_walls + 60, 520);
	fprintf(script,
		"set multiplot layout 1,%d title \"Largest stable stiffness of a sampled wall: "
		"lines computed, points simulated in time; stable below; triangle: none is\" font ',13'\n"
		"set logscale xy\nset xrange [5e-4:20]\nset yrange [%g:50]\n"
		"set format y '10^{%%L}'\nset format x '10^{%%L}'\nset termoption enhanced\n"
		"set xlabel \"damping of the device, bT/m\"\nset key top left Left reverse\n"
		"data = '%s'\n",
		n_walls, MAP_LEAST, p.data);
	for (int w = 0; w < n_walls; w++) {
		fprintf(script,
			"set title \"damping of the wall BT/m = %g\"\nset ylabel \"%s\"\nplot \\\n",
			walls[w], w ? "" : "stiffness of the wall, KT^2/m");
		for (int d = 0; d < n_delays; d++) {
			int block = 2 * (w * n_delays + d);

			fprintf(script,
				"  data index %d using 1:2 with lines ls %d title 'delay %g', \\\n"
				"  '' index %d using 1:2:3 with points ls %d pt variable ps 0.9, \\\n",
				block, d % 5 + 1, delays[d], block + 1, d % 5 + 1);
		}
		fputs("  NaN\n", script);
	}
	fputs("unset multiplot\n", script);
	plot_part_draw(script, &p);
}

/* ---- guard ---- */

static bool plain(const struct guard_bench *bench, int i, enum guard_setting setting)
{
	const struct guard_row *r = &bench->row[i];

	return i < bench->swept && r->setting == setting && r->clamp_N == 0;
}

/* Blocks: a curve per delay with the guard on; then caps that are bounded, and those that
 * are not. */
static int write_guard(const struct guard_bench *bench, const struct plot_part *p,
		       int *delays, int max)
{
	FILE *out = plot_data(p->folder, p->data);
	int n = 0;

	for (int i = 0; i < bench->swept; i++) {
		int k = 0;

		while (k < n && delays[k] != bench->row[i].delay)
			k++;
		if (k == n && n < max)
			delays[n++] = bench->row[i].delay;
	}
	for (int d = 0; d < n; d++) {
		for (int i = 0; i < bench->swept; i++)
			if (plain(bench, i, GUARD_ON) && bench->row[i].delay == delays[d])
				fprintf(out, "%g %g %g\n", bench->row[i].K_N_mm,
					bench->row[i].largest_mm,
					bench->row[i].largest_N);
		fputs("\n\n", out);
	}
	for (int bounded = 1; bounded >= 0; bounded--) {
		fputs("NaN NaN\n", out);
		for (int i = bench->swept; i < bench->n; i++) {
			const struct guard_row *r = &bench->row[i];
			bool all = true;

			if (!r->actuator)
				continue;
			for (int k = bench->swept; k < bench->n; k++)
				if (bench->row[k].actuator &&
				    bench->row[k].delay == r->delay &&
				    bench->row[k].share == r->share)
					all = all && bench->row[k].bounded;
			if (all == bounded)
				fprintf(out, "%d %g\n", r->delay, r->share);
		}
		fputs("\n\n", out);
	}
	plot_data_end(out, p->folder);
	return n;
}

/* "45 of 54": runs of a setting that grow. */
static void count(const struct guard_bench *bench, enum guard_setting setting,
		  char text[32])
{
	int grow = 0, all = 0;

	for (int i = 0; i < bench->swept; i++)
		if (plain(bench, i, setting)) {
			all++;
			grow += !bench->row[i].bounded;
		}
	snprintf(text, 32, "%d of %d", grow, all);
}

void stability_picture_guard(const struct guard_bench *bench, const char *folder,
			     const char *name)
{
	struct plot_part p = plot_part(folder, name, "guard");
	char grow[GUARD_SETTINGS][32];
	int delays[16], n = write_guard(bench, &p, delays, 16);
	FILE *script = plot_begin(folder, p.name, 1320, 540);

	for (int s = 0; s < GUARD_SETTINGS; s++)
		count(bench, s, grow[s]);
	fprintf(script,
		"set multiplot layout 1,3 title \"50 g pressed on a wall that answers late. Not "
		"bounded: %s without a guard, %s with it, %s without its cap, %s in contact "
		"only\" font ',12'\n"
		"data = '%s'\nset logscale xy\nset xrange [0.8:300]\nset xlabel 'stiffness of the wall / N/mm'\n"
		"set key top left Left reverse\nset style line 6 lc rgb '#555555' lw 1.5\n",
		grow[GUARD_OFF], grow[GUARD_ON], grow[GUARD_UNCAPPED],
		grow[GUARD_CONTACT], p.data);
	for (int column = 2; column <= 3; column++) {
		fprintf(script, "set title '%s'\nset ylabel '%s'\nplot \\\n",
			column == 2 ? "guard on: how far the hand is thrown"
				    : "guard on: how hard, without a clamp",
			column == 2 ? "largest way / mm" : "largest force / N");
		for (int d = 0; d < n; d++)
			fprintf(script,
				"  data index %d using 1:%d with linespoints ls %d pt 7 ps 0.7 title "
				"'%d ticks late', \\\n",
				d, column, d % 6 + 1, delays[d]);
		fputs("  NaN\n", script);
	}
	fprintf(script,
		"unset logscale x\nset xrange [-0.5:5.5]\nset yrange [0.008:3]\n"
		"set title 'guard behind a late actuator'\nset xlabel 'delay / ticks'\n"
		"set ylabel 'cap / (m/T)'\nset key bottom left\nplot \\\n"
		"  (x < 0 ? NaN : 2*sin(pi/(4*x+2))) with lines ls 1 title '2 sin(pi/(4d+2))', \\\n"
		"  %g with lines dt 2 lc rgb 'black' title 'as built', \\\n"
		"  data index %d using 1:2 with points pt 7 ps 1.4 lc rgb '#2e8b57' title "
		"'bounded at every stiffness', \\\n"
		"  data index %d using 1:2 with points pt 2 ps 1.4 lw 2 lc rgb '#c0392b' title "
		"'grows at some'\n"
		"unset multiplot\n",
		INCISE_GUARD_SHARE, n, n + 1);
	plot_part_draw(script, &p);
}

/* ---- integrators ---- */

#define DIVERGED 10 /* its place on the axis */

/* Blocks: for each stiffness of the sweep and then for steps of 1 ms, one per kind. */
static void write_integrators(const struct integrator_bench *bench,
			      const struct plot_part *p)
{
	static const double swept[] = {1e3, 1e5};
	FILE *out = plot_data(p->folder, p->data);

	for (size_t s = 0; s <= N(swept); s++)
		for (int kind = 0; kind < INTEGRATORS; kind++) {
			fputs("NaN NaN\n", out);
			for (int i = 0; i < bench->n; i++) {
				const struct integrator_row *r = &bench->row[i];
				double error = r->diverged ? DIVERGED
							   : fmax(r->max_error, 1e-16);

				if (r->kind != (enum integrator)kind)
					continue;
				if (s == N(swept) && i < bench->table)
					fprintf(out, "%g %g\n", r->K_N_m, error);
				else if (s < N(swept) && r->K_N_m == swept[s] &&
					 !r->diverged)
					fprintf(out, "%g %g\n", r->ms_time.ns.median,
						error);
			}
			fputs("\n\n", out);
		}
	plot_data_end(out, p->folder);
}

void stability_picture_integrators(const struct integrator_bench *bench,
				   const char *folder, const char *name)
{
	static const struct {
		const char *title, *style;
	} kinds[INTEGRATORS] = {{"explicit Euler", "ls 1"},
				{"semi-implicit Euler", "ls 2"},
				{"implicit Euler", "ls 3"},
				{"trapezoid", "ls 4"},
				{"RK4", "ls 5"},
				{"exact, a matrix (ZOH)", "lc rgb 'black' lw 1.5"},
				{"exact, plant with events", "lc rgb '#888888' lw 1.5"}};
	static const char *const titles[] = {"1 kN/m, steps from 1 ms down",
					     "100 kN/m, from the largest step that holds",
					     "steps of 1 ms; at the top: diverged"};
	struct plot_part p = plot_part(folder, name, "integrators");
	FILE *script;

	write_integrators(bench, &p);
	script = plot_begin(folder, p.name, 1500, 560);
	fprintf(script,
		"set multiplot layout 1,3 title \"Integrators of a mass on a spring: 50 g, ratio "
		"of damping 0.1\" font ',13'\n"
		"set termoption enhanced\nset logscale xy\nset format xy '10^{%%L}'\n"
		"set yrange [1e-17:%d]\ndata = '%s'\n"
		"set key off\n",
		DIVERGED * 3, p.data);
	for (size_t s = 0; s < N(titles); s++) {
		bool sweep = s + 1 < N(titles);

		fprintf(script,
			"%sset title '%s'\nset ylabel '%s'\nset xlabel '%s'\nset xrange "
			"[%s]\nplot \\\n",
			sweep ? ""
			      : "set key on at graph 0.97, graph 0.6 right samplen 2\n",
			titles[s], s ? "" : "largest error / largest place",
			sweep ? "run time for 1 ms of motion / ns" : "stiffness / (N/m)",
			sweep ? "2:30000" : "5:2e9");
		for (int kind = 0; kind < INTEGRATORS; kind++)
			fprintf(script,
				"  data index %zu using 1:2 with %s %s pt 7 ps %s title '%s', \\\n",
				s * INTEGRATORS + kind,
				sweep && kind >= EXACT_ZOH ? "points" : "linespoints",
				kinds[kind].style,
				sweep && kind >= EXACT_ZOH ? "1.5" : "0.7",
				kinds[kind].title);
		fputs("  NaN\n", script);
	}
	fputs("unset multiplot\n", script);
	plot_part_draw(script, &p);
}
