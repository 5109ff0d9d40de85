// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench view [SCENE], see bench/bench_view.c. It is a program of its own, as it maps libraries
 * that draw, which other benchmarks do not.
 */
#include <getopt.h>
#include <incise/realtime.h>
#include "bench/bench.h"
#include "bench/compare.h"
#include "cli/cli.h"
#include "cli/scene_argument.h"

enum { OPT_JSON = CLI_LONG, OPT_PLOT, OPT_QUICK, OPT_DURATION, OPT_AGAINST };

static const struct cli_option options[] = {
	{OPT_JSON, "json", NULL, "report as JSON"},
	{OPT_AGAINST, "against", "OLD.json",
	 "compare with an older report of --json: what changed\nbeyond noise"},
	{OPT_PLOT, "plot", "NAME", "draw error over run time as NAME.png and NAME.svg"},
	{OPT_DURATION, "duration", "TIME",
	 "of each run beside a loop, and of that of cuts,\nsuch as 10min (default: 4s)"},
	{OPT_QUICK, "quick", NULL, "fewer frames and runs: a look, not a measurement"},
	{0},
};

static const struct cli_command verb = {
	.name = "bench view",
	.synopsis = "[SCENE] [OPTIONS]",
	.summary =
		"Measure the picture of a scene, drawn without a screen while a cut bleeds: time\n"
		"per frame by sizes of texture and picture; error against a finer texture and more\n"
		"frames, over that time; whether cuts of a loop of 5 kHz are all seen; how late a\n"
		"loop is with and without it. Without SCENE that is paper 2's neck.",
	.options = options,
	.notes = "Exit: 0 measured, 1 failed or figures got worse, 2 bad usage.\n"
		 "See incise-bench-view(1).",
};

static void parse(struct bench_run *run, int argc, char **argv)
{
	static struct scene_argument argument;
	static char *scene[1];
	int opt;

	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_JSON:
			run->json = true;
			break;
		case OPT_PLOT:
			run->plot = optarg;
			break;
		case OPT_DURATION:
			run->seconds = cli_duration("duration", optarg, 0.5, 86400);
			break;
		case OPT_QUICK:
			run->quick = true;
			break;
		case OPT_AGAINST:
			run->against = optarg;
			break;
		}
	if (argc - optind > 1)
		cli_usage("expected at most one scene");
	run->n_operands = argc - optind;
	if (run->n_operands)
		scene_argument_operand(&argument, argc, argv, optind);
	scene[0] = (char *)argument.path;
	run->operands = scene;
}

int main(int argc, char **argv)
{
	static struct bench_run run = {.bench = &bench_view};

	parse(&run, argc, argv);
	if (run.against) {
		compare_against(run.against, run.json);
		run.json = true;
	}
	incise_realtime_prepare();
	cli_catch_signals();
	bench_measure(&run);
	return 0;
}
