// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A replay as a picture; see replay_picture.h.
 */
#include "cli.h"
#include "plot.h"
#include "replay_picture.h"

void replay_picture_begin(struct replay_picture *picture, const char *path)
{
	*picture = (struct replay_picture){.drawn = -1};
	plot_place("plot", path, &picture->folder, &picture->name);
	if (snprintf(picture->file, sizeof(picture->file), "%s.dat", picture->name) >=
	    (int)sizeof(picture->file))
		cli_usage("--plot: '%s' is too long a name", picture->name);
	picture->data = plot_data(picture->folder, picture->file);
}

void replay_picture_add(struct replay_picture *picture,
			const struct incise_replay_tick *told)
{
	int point = (int)(told->done * REPLAY_PICTURE_POINTS);

	if (point == picture->drawn)
		return;
	picture->drawn = point;
	/* gnuplot leaves out what is nan */
	fprintf(picture->data, "%.4f %.5f %.5f %.4f %.4f\n", told->t_s, told->measured_N,
		told->predicted_N, told->depth_mm, told->tick->depth_mm);
}

void replay_picture_draw(struct replay_picture *picture)
{
	FILE *script;

	plot_data_end(picture->data, picture->folder);
	script = plot_begin(picture->folder, picture->name, 1200, 800);
	fprintf(script,
		"set multiplot layout 2,1\n"
		"set xlabel 'time / s'\nset key top right\nset ylabel 'force / N'\n"
		"plot '%s' using 1:2 with lines lc rgb '#999999' title 'measured', \\\n"
		"  '' using 1:3 with lines ls 2 title 'predicted'\n"
		"set ylabel 'depth / mm'\nset yrange [0:*]\n"
		"plot '%s' using 1:4 with lines lc rgb '#999999' title 'recorded', \\\n"
		"  '' using 1:5 with lines ls 1 title 'in the loop'\n"
		"unset multiplot\n",
		picture->file, picture->file);
	if (!plot_draw(script, picture->folder, picture->name))
		cli_fail("gnuplot could not draw %s/%s", picture->folder, picture->name);
}
