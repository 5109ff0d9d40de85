// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The picture of incise bench scenes; see scenes_picture.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "scenes_picture.h"

#define BAR 0.36 /* of the room of a scene; two of them, and a gap */

/* Place from above, name, ns, 5 %, 95 %, instructions; the same of the full pipeline. */
static int write_data(const struct scene_row *rows, int n, const char *folder,
		      const char *name)
{
	FILE *out = plot_data(folder, name);
	int drawn = 0;

	for (int i = 0; i < n; i++) {
		const struct scene_way *few = &rows[i].saving.few,
				       *full = &rows[i].saving.full;

		if (isnan(few->time.ns.median) || isnan(full->time.ns.median))
			continue;
		fprintf(out, "%d %s %g %g %g %g %g %g %g %g\n", drawn++, rows[i].name,
			few->time.ns.median, few->time.ns.p5, few->time.ns.p95,
			few->instructions, full->time.ns.median, full->time.ns.p5,
			full->time.ns.p95, full->instructions);
	}
	plot_data_end(out, folder);
	return drawn;
}

/* The bars of two columns, the scene's own above, each with its value behind its end. */
static void plot_bars(FILE *script, int few, int full, const char *limits)
{
	static const char *const titles[] = {"only what the scene needs",
					     "every stage kept, neutral"};
	static const char *const colours[] = {"#1b6ca8", "#d68910"};
	const int columns[] = {few, full};

	for (int i = 0; i < 2; i++) {
		double low = i ? 0 : -BAR, high = i ? BAR : 0;

		fprintf(script,
			"%s data using (0):($1):(0):%d:($1%+g):($1%+g)%s with boxxyerror fs "
			"solid 1 noborder fc rgb '%s' title '%s', \\\n"
			"  '' using %d:($1%+g):(sprintf('%%.0f', $%d)) with labels left "
			"offset 0.6,0 font ',9'%s",
			i ? " " : "plot", columns[i], low, high, i ? "" : limits,
			colours[i], titles[i], columns[i], (low + high) / 2, columns[i],
			i ? "\n" : ", \\\n");
	}
}

void scenes_picture(const struct scene_row *rows, int n, const struct machine *machine,
		    const char *folder, const char *name)
{
	char data[300];
	bool counted = false;
	FILE *script;
	int drawn, height;

	if (snprintf(data, sizeof(data), "%s.dat", name) >= (int)sizeof(data))
		cli_fail("%s is too long a name", name);
	drawn = write_data(rows, n, folder, data);
	if (!drawn)
		return;
	for (int i = 0; i < n; i++)
		counted |= isfinite(rows[i].saving.few.instructions);
	height = 160 + 46 * drawn;
	script = plot_begin(folder, name, 1150, height);
	fprintf(script,
		"data = '%s'\n"
		"set multiplot layout 1,2 title \"A tick of each scene, against the full "
		"pipeline\\n%s, %s\" font ',12'\n"
		"set yrange [%g:-0.6]\nset xrange [0:*]\nset offsets 0, graph 0.12, 0, 0\n"
		"set ytics nomirror scale 0\nset grid noytics\nset border 3\n"
		"set key at screen 0.57,screen %g center maxrows 1\nset bmargin 5\n"
		"set lmargin at screen 0.17\n"
		"set rmargin at screen 0.56\n"
		"set xlabel 'median time of a tick / ns'\n",
		data, machine->cpu, machine->kernel, drawn - 0.4, 18.0 / height);
	plot_bars(script, 3, 7, ":ytic(2)");
	fputs("unset key\nset format y ''\nset lmargin at screen 0.6\nset rmargin at screen 0.97\n"
	      "set xlabel 'instructions of a tick'\n",
	      script);
	if (counted)
		plot_bars(script, 6, 10, "");
	fputs("unset multiplot\n", script);
	if (!plot_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}
