// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise demo: walks paper 1 on the virtual rig with the same commands a person would
 * type, and leaves a folder with the data, the model, pictures like the paper's and a
 * summary.
 *
 *   capture ─▶ export ─▶ train ─▶ haptic     each printed as "$ incise …"
 *                 └────────┴────────┴───────┴──▶ pictures, summary
 */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include "cli/cli.h"
#include "demo/demo.h"
#include "demo/demo_scene.h"
#include "cli/json.h"
#include "cli/plot.h"

enum { OPT_SEED = CLI_LONG, OPT_LOOP, OPT_SCENE, OPT_FORCE, OPT_JSON };

static const struct cli_option options[] = {
	{'o', "output", "DIR", "folder to leave everything in (default: demo.out)"},
	{OPT_SEED, "seed", "N", "of the virtual rig (default: 1)"},
	{OPT_LOOP, "loop", "TIME", "length of the haptic loop (default: 10s)"},
	{OPT_SCENE, "scene", "SCENE",
	 "paper 2 instead: a film and a strip of a procedure on this scene, as neck"},
	{OPT_FORCE, "force", NULL, "write into a folder that exists"},
	{OPT_JSON, "json", NULL, "print the summary as JSON, and nothing else"},
	{0},
};

static const struct cli_command command = {
	.name = "demo",
	.synopsis = "[OPTIONS]",
	.summary =
		"Walk paper 1 on the virtual rig: cut, record, export, train, compile to fixed\n"
		"point, run the haptic loop; leave data, model, pictures and summary in a folder.",
	.options = options,
	.notes = "Exit: 0 done, 1 failed, 2 bad usage. See incise-demo(1).",
};

int main(int argc, char **argv)
{
	struct demo demo = {.folder = "demo.out", .seed = 1};
	const char *loop_time = "10s", *scene = NULL;
	struct incise_model *model;
	char *plot;
	struct timespec begin, end;
	bool force = false;
	double seconds;
	int opt;

	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case 'o':
			demo.folder = optarg;
			break;
		case OPT_SEED:
			demo.seed = cli_integer("seed", optarg, 0, DEMO_SEED_MAX);
			break;
		case OPT_LOOP:
			cli_duration("loop", optarg, 0.2, 3600);
			loop_time = optarg;
			break;
		case OPT_SCENE:
			scene = optarg;
			break;
		case OPT_FORCE:
			force = true;
			break;
		case OPT_JSON:
			demo.quiet = true;
			break;
		}
	if (optind != argc)
		cli_usage("'%s': demo takes options only", argv[optind]);
	if (scene && demo.quiet)
		cli_usage("--scene makes pictures, and has nothing to say as JSON");
	if (scene) {
		demo_scene(scene, demo.folder, force);
		return 0;
	}
	if (!plot_possible())
		cli_fail(
			"gnuplot is not installed, it draws the pictures: apt-get install "
			"gnuplot-nox, or run 'make demo'");
	clock_gettime(CLOCK_MONOTONIC, &begin);
	demo_make_folder(demo.folder, force);
	plot = demo_path(&demo, "plot");
	demo_make_folder(plot, true);
	free(plot);
	demo.pictures = json_array();
	demo.summary = demo_summary_begin(demo.seed);
	demo_walk(&demo, loop_time);
	model = demo_model(&demo, "liver.fis");
	demo_step(&demo, "Compare, and draw the pictures");
	demo_worth(&demo, model);
	demo_figures(&demo, model);
	json_object_set_new(demo.summary, "pictures", demo.pictures);
	clock_gettime(CLOCK_MONOTONIC, &end);
	seconds = end.tv_sec - begin.tv_sec + (end.tv_nsec - begin.tv_nsec) * 1e-9;
	json_object_set_new(demo.summary, "seconds", json_number(seconds));
	demo_summary_save(&demo, seconds);
	if (demo.quiet) {
		json_print(json_incref(demo.summary));
	} else {
		putchar('\n');
		demo_summary_print(&demo, stdout, seconds);
		printf("left in            %s: summary.json, pictures (*.png, *.svg), data, "
		       "models\n",
		       demo.folder);
	}
	cli_finish();
	incise_model_free(model);
	json_decref(demo.summary);
	return 0;
}
