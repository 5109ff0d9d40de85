// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figure of a texture: the beginning of its tape, and unseen cuts as recorded and as rendered. See
 * figure.h.
 *
 *     ┌─ tape ───────────────────────┐
 *     ├─ drops ──────┬─ spectrum ────┤
 *     └──────────────┴───────────────┘
 */
#include <math.h>
#include <incise/texture.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "figure.h"

#define TAPE_HEIGHT 320
#define LOOKS_HEIGHT 400
#define HEIGHT (TAPE_HEIGHT + LOOKS_HEIGHT)

/* The tape is drawn over so many events. */
#define EVENTS 30

static const char *const series[] = {"recorded", "rendered"};

/* Returns the end of the part that is drawn. */
static double write_tape(const struct incise_texture *texture,
			 const struct incise_texture_info *info, const char *folder)
{
	static double tau[INCISE_TEXTURE_TAPE];
	double step = incise_texture_tape(texture, info->seed, tau);
	double end = fmin(EVENTS / fmax(info->recorded.rate, 1e-9),
			  step * INCISE_TEXTURE_TAPE);
	FILE *data = plot_data(folder, "tape.dat");

	for (int i = 0; i < INCISE_TEXTURE_TAPE && i * step <= end; i++)
		fprintf(data, "%.6g %.6g\n", i * step, 100 * tau[i]);
	plot_data_end(data, folder);
	return end;
}

/* A row for each decile, and for each octave at its middle, with both looks. */
static void write_looks(const struct incise_texture_info *info, const char *folder)
{
	const struct incise_texture_look *was = &info->recorded, *is = &info->rendered;
	FILE *data = plot_data(folder, "drops.dat");

	for (int i = 0; i < INCISE_TEXTURE_DECILES; i++)
		fprintf(data, "%d %.6g %.6g\n", 10 * (i + 1), 100 * was->drop[i],
			100 * is->drop[i]);
	plot_data_end(data, folder);
	data = plot_data(folder, "octaves.dat");
	for (int i = 0; i < INCISE_TEXTURE_OCTAVES; i++)
		fprintf(data, "%.6g %.6g %.6g\n", info->up_to_cycles / pow(2, i + 0.5),
			was->octave[i], is->octave[i]);
	plot_data_end(data, folder);
}

static void put_looks(FILE *script, double x, const char *file)
{
	fprintf(script, "set size 0.5,%g\nset origin %g,0\n",
		(double)LOOKS_HEIGHT / HEIGHT, x);
	for (int i = 0, n = 0; i < 2; i++)
		plot_add(script, &n, "'%s' using 1:%d with linespoints lt %d title '%s'",
			 file, i + 2, i + 1, series[i]);
	fputc('\n', script);
}

FILE *figure_of_texture(const struct figure *figure)
{
	struct incise_error err = {0};
	struct incise_texture *texture =
		cli_require(incise_texture_load(figure->path, NULL, &err), &err);
	struct incise_texture_info info;
	FILE *script;
	double end;

	incise_texture_info(texture, &info);
	end = write_tape(texture, &info, figure->folder);
	write_looks(&info, figure->folder);
	script = plot_begin(figure->folder, figure->name, FIGURE_WIDTH, HEIGHT);
	fprintf(script,
		"set multiplot\nset size 1,%g\nset origin 0,%g\nunset key\n"
		"set title 'texture of %d events in %d cuts, at most %.0f %%'\n"
		"set xlabel 'way / %s'\nset ylabel 'of the model''s force / %%'\n"
		"set xrange [0:%.6g]\nplot 'tape.dat' with lines lt 1\n"
		"set key inside top left\nset xrange [*:*]\n"
		"set title 'drops: %.3g events per %s recorded, %.3g rendered'\n"
		"set xlabel 'share of the drops / %%'\nset ylabel 'drop / %%'\n",
		(double)TAPE_HEIGHT / HEIGHT, (double)LOOKS_HEIGHT / HEIGHT,
		info.n_events, info.n_cuts, 100 * info.most, info.unit, end,
		info.recorded.rate, info.unit, info.rendered.rate);
	put_looks(script, 0, "drops.dat");
	fprintf(script,
		"set title 'spectrum: %.2g dB apart, %.2g dB without texture'\n"
		"set xlabel 'cycles per %s'\nset ylabel 'power / dB'\nset logscale x 2\n",
		info.error[1], info.error[0], info.unit);
	put_looks(script, 0.5, "octaves.dat");
	fputs("unset multiplot\n", script);
	incise_texture_free(texture);
	return script;
}
