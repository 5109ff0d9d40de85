// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The sweep of stiff walls as a table, as JSON and as a picture; see stiff_sweep.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "stiff_sweep.h"

static const char *const paths[STIFF_PATHS] = {"plan", "wall"};
static const char *const path_titles[STIFF_PATHS] = {
	"a plan, poses of a tracker of 120 Hz, 4.2 ms late",
	"the wall alone, its position that of the tick"};

static bool was_run(const struct stiff_row *r)
{
	return r->largest_mm > 0;
}

void stiff_sweep_print(const struct stiff_sweep *sweep)
{
	printf("stiff walls: 50 g and 0.01 N s/mm, pressed by 1 N, fall 1 mm onto a wall at "
	       "1 kHz; force limited to 4 N; 12 s\n");
	for (int path = 0; path < STIFF_PATHS; path++) {
		printf("%s\n%10s %-9s", path_titles[path], "K_N_m", "");
		for (int guard = 0; guard < 2; guard++)
			printf(" %-9s %8s %9s %9s", guard ? "guard on" : "guard off",
			       "largest", "largest", "at last");
		printf("\n%10s %-9s", "", "");
		for (int guard = 0; guard < 2; guard++)
			printf(" %-9s %8s %9s %9s", "", "N", "mm", "mm");
		for (int i = 0; i < sweep->n; i++) {
			const struct stiff_row *r = &sweep->row[i];

			if (r->path != (enum stiff_path)path || r->guard)
				continue;
			printf("\n%10.4g %-9s", r->K_N_mm * 1e3,
			       r->accepted ? "accepted" : "refused");
			for (int k = i; k < sweep->n; k++) {
				const struct stiff_row *s = &sweep->row[k];

				if (s->path != r->path || s->K_N_mm != r->K_N_mm)
					continue;
				if (was_run(s))
					printf(" %-9s %8.3g %9.3g %9.2g",
					       s->bounded ? "bounded" : "GROWS",
					       s->largest_N, s->largest_mm, s->late_mm);
				else
					printf(" %-9s %8s %9s %9s", "not run", "-", "-",
					       "-");
			}
		}
		printf("\n");
		for (int i = 0; i < sweep->n; i++) {
			const struct stiff_row *r = &sweep->row[i];

			if (r->path == (enum stiff_path)path && *r->failed && !r->guard)
				printf("%.4g N/m: %s\n", r->K_N_mm * 1e3, r->failed);
		}
	}
	for (int i = 0; i < sweep->n; i += sweep->n / 2)
		printf("limit by theory, %s: %.4g N/m\n", paths[sweep->row[i].path],
		       sweep->row[i].limit_N_mm * 1e3);
}

json_t *stiff_sweep_json(const struct stiff_sweep *sweep)
{
	json_t *rows = json_array();

	for (int i = 0; i < sweep->n; i++) {
		const struct stiff_row *r = &sweep->row[i];
		double none = was_run(r) ? 0 : NAN;
		json_t *bounded = was_run(r) ? json_boolean(r->bounded) : json_null();

		json_array_append_new(
			rows,
			json_pack("{ss sf so sb ss so so so sI so so}", "path",
				  paths[r->path], "K_N_m", r->K_N_mm * 1e3,
				  "theory_limit_N_m", json_number(r->limit_N_mm * 1e3),
				  "accepted", r->accepted, "guard",
				  r->guard ? "on" : "off", "largest_N",
				  json_number(r->largest_N + none), "largest_mm",
				  json_number(r->largest_mm + none), "late_mm",
				  json_number(r->late_mm + none), "not_finite",
				  (json_int_t)r->not_finite, "bounded", bounded, "failed",
				  *r->failed ? json_string(r->failed) : json_null()));
	}
	return rows;
}

void stiff_sweep_figures(const struct stiff_sweep *sweep, json_t *figures)
{
	for (int i = 0; i < sweep->n; i++) {
		const struct stiff_row *r = &sweep->row[i];

		if (was_run(r))
			metrics_exact(figures, r->largest_mm, "mm",
				      "%s, %.4g N/m, guard %s, largest", paths[r->path],
				      r->K_N_mm * 1e3, r->guard ? "on" : "off");
	}
}

/* A block per way and guard: N/m, largest N, largest mm, mm at last. */
static void write_data(const struct stiff_sweep *sweep, const char *folder,
		       const char *name)
{
	char *data;
	FILE *out;

	if (asprintf(&data, "%s.dat", name) < 0)
		cli_fail("no memory");
	out = plot_data(folder, data);
	free(data);
	for (int i = 0; i < sweep->n; i++) {
		const struct stiff_row *r = &sweep->row[i];

		if (i && (r->path != r[-1].path || r->guard != r[-1].guard))
			fputs("\n\n", out);
		if (was_run(r))
			fprintf(out, "%g %g %g %g\n", r->K_N_mm * 1e3, r->largest_N,
				r->largest_mm, fmax(r->late_mm, 1e-9));
		else
			fprintf(out, "%g NaN NaN NaN\n", r->K_N_mm * 1e3);
	}
	plot_data_end(out, folder);
}

void stiff_sweep_draw(const struct stiff_sweep *sweep, const char *folder,
		      const char *name)
{
	static const struct {
		int column;
		const char *title, *range;
	} panels[] = {{3, "largest displacement / mm", "[0.5:200]"},
		      {4, "motion in the last quarter / mm", "[1e-9:20]"},
		      {2, "largest force / N", "[0.5:8]"}};
	FILE *script;

	write_data(sweep, folder, name);
	script = plot_begin(folder, name, 1100, 1300);
	fprintf(script,
		"set multiplot layout 3,1 title \"Stiff walls: 50 g, 0.01 N s/mm, pressed by "
		"1 N, behind a limit of 4 N; 12 s at 1 kHz\"\n"
		"set logscale xy\nset format x '%%.0e'\nset xrange [7:1.5e9]\n"
		"set xlabel 'stiffness of the wall / (N/m)'\nset lmargin 12\nset bmargin 4\n"
		"set key inside top right\ndata = '%s.dat'\n",
		name);
	for (int p = 0; p < STIFF_PATHS; p++) {
		double limit = sweep->row[p * sweep->n / 2].limit_N_mm * 1e3;

		fprintf(script,
			"set arrow %d from %g, graph 0 to %g, graph 1 nohead dt 2 lc %d\n"
			"set label %d 'limit of the %s' at %g, graph 0.06 left offset "
			"0.5,0 textcolor lt %d\n",
			p + 1, limit, limit, p ? 4 : 2, p + 1, paths[p], limit,
			p ? 4 : 2);
	}
	for (size_t k = 0; k < sizeof(panels) / sizeof(*panels); k++) {
		fprintf(script, "set ylabel '%s'\nset yrange %s\n%sset key %s\nplot ",
			panels[k].title, panels[k].range,
			panels[k].column == 4 ? "set format y '%.0e'\n"
					      : "set format y '%g'\n",
			k == 0 ? "on" : "off");
		for (int i = 0; i < 4; i++)
			fprintf(script,
				"data index %d using 1:%d with linespoints lc %d dt %d pt %d "
				"ps 0.8 title '%s, guard %s'%s",
				i, panels[k].column, i < 2 ? 2 : 4, i % 2 ? 1 : 3,
				i % 2 ? 7 : 6, paths[i / 2], i % 2 ? "on" : "off",
				i < 3 ? ", " : "\n");
	}
	fputs("unset multiplot\n", script);
	if (!plot_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}
