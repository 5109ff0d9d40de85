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

#define HEIGHT 720

/* The tape is drawn over so many events. */
#define EVENTS 30

static void put_data(FILE *script, const struct incise_texture *texture)
{
	const struct incise_texture_info *info = incise_texture_info(texture);
	const struct incise_texture_look *was = &info->recorded, *is = &info->rendered;
	static double tau[INCISE_TEXTURE_TAPE];
	double step = incise_texture_tape(texture, info->seed, tau);

	fputs("$tape << end\n", script);
	for (int i = 0; i < INCISE_TEXTURE_TAPE && i * step * was->rate <= EVENTS; i++)
		fprintf(script, "%.6g %.4g\n", i * step, 100 * tau[i]);
	fputs("end\n$drops << end\n", script);
	for (int i = 0; i < INCISE_TEXTURE_DECILES; i++)
		fprintf(script, "%d %.4g %.4g\n", 10 * (i + 1), 100 * was->drop[i],
			100 * is->drop[i]);
	fputs("end\n$octaves << end\n", script);
	for (int i = 0; i < INCISE_TEXTURE_OCTAVES; i++)
		fprintf(script, "%.6g %.4g %.4g\n", info->up_to_cycles / pow(2, i + 0.5),
			was->octave[i], is->octave[i]);
	fputs("end\n", script);
}

FILE *figure_of_texture(const struct figure *figure)
{
	static const char looks[] =
		" using 1:2 with linespoints lt 1 title 'recorded', '' using 1:3 with "
		"linespoints lt 2 title 'rendered'\n";
	struct incise_error err = {0};
	struct incise_texture *texture =
		cli_require(incise_texture_load(figure->path, NULL, &err), &err);
	FILE *script = plot_begin(figure->folder, figure->name, FIGURE_WIDTH, HEIGHT);
	const struct incise_texture_info *info = incise_texture_info(texture);

	put_data(script, texture);
	fprintf(script,
		"set multiplot\nset size 1,0.45\nset origin 0,0.55\nunset key\n"
		"set title 'texture of %d events in %d cuts, at most %.0f %%'\n"
		"set xlabel 'way / %s'\nset ylabel 'of the model''s force / %%'\n"
		"set autoscale xfix\nplot $tape with lines lt 1\nset autoscale x\n",
		info->n_events, info->n_cuts, 100 * info->most, info->unit);
	fprintf(script,
		"set size 0.5,0.55\nset origin 0,0\nset key inside top left\n"
		"set title 'drops: %.3g events per %s recorded, %.3g rendered'\n"
		"set xlabel 'share of the drops / %%'\nset ylabel 'drop / %%'\n"
		"plot $drops%s",
		info->recorded.rate, info->unit, info->rendered.rate, looks);
	fprintf(script,
		"set origin 0.5,0\nset logscale x 2\nset key bottom left\n"
		"set title 'spectrum: %.2g dB apart, %.2g dB without texture'\n"
		"set xlabel 'frequency / (1/%s)'\nset ylabel 'power / dB'\nplot $octaves%s"
		"unset multiplot\n",
		info->error[1], info->error[0], info->unit, looks);
	incise_texture_free(texture);
	return script;
}
