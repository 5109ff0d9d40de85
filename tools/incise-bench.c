// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench NAME: the benchmarks of bench/bench.h by their names.
 */
#include <getopt.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include "bench/bench.h"
#include "bench/compare.h"
#include "cli/cli.h"
#include "cli/json.h"

enum {
	OPT_JSON = CLI_LONG,
	OPT_PLOT,
	OPT_QUICK,
	OPT_DURATION,
	OPT_LOAD,
	OPT_PROFILE,
	OPT_SEED,
	OPT_AGAINST,
};

static const struct cli_option options[] = {
	{OPT_JSON, "json", NULL, "report as JSON"},
	{OPT_AGAINST, "against", "OLD.json",
	 "compare with an older report of --json: what changed\nbeyond noise"},
	{OPT_PLOT, "plot", "NAME",
	 "draw error over time as NAME.png and NAME.svg;\n"
	 "stability: NAME-map, NAME-guard, NAME-integrators;\n"
	 "loop: NAME-wakeups, NAME-rates;\n"
	 "pose: NAME, NAME-rates; timeline: NAME, NAME-windows"},
	{OPT_DURATION, "duration", "TIME",
	 "of each run of capture, and each of loop's wake-ups,\nsuch as 10min (default: 7s and 5s)"},
	{OPT_LOAD, "load", "NAME",
	 "loop: wake-ups under one load only: idle, cpu,\nmemory, disk or view"},
	{OPT_PROFILE, "profile", "WHICH",
	 "scenes: only run some ticks of one, with the stages\nthat it needs or with all: needed or full; for perf\nstat or callgrind"},
	{OPT_SEED, "seed", "N", "extremes: another set of cases (default: 1)"},
	{OPT_QUICK, "quick", NULL, "fewer points and repeats: a look, not a measurement"},
	{0},
};

static const struct bench *const benches[] = {
	&bench_precision, &bench_training, &bench_stability, &bench_loop,
	&bench_pose,	  &bench_timeline, &bench_vision,    &bench_capture,
	&bench_scenes,	  &bench_extremes,
};
#define BENCHES (int)(sizeof(benches) / sizeof(*benches))

/* --- help --- */

/* "  loop [SCENE]           ", and further lines below the summary. */
static void add_summary(char *text, const char *name, const char *operands,
			const char *summary)
{
	char title[40];

	snprintf(title, sizeof(title), "%s%s%s", name, *operands ? " " : "", operands);
	for (const char *line = summary; line; line = strchr(line, '\n')) {
		line += *line == '\n';
		sprintf(text + strlen(text), "  %-22s %.*s\n",
			line == summary ? title : "", (int)strcspn(line, "\n"), line);
	}
}

static const struct cli_command *help(void)
{
	static char synopsis[400], summary[4000];
	static struct cli_command command = {
		.name = "bench",
		.synopsis = synopsis,
		.summary = summary,
		.options = options,
		.notes =
			"Exit: 0 measured, 1 failed, simulation and theory or the forces of two ways differ,\n"
			"or figures got worse, 2 bad usage.\n"
			"See incise-bench(1).",
	};

	strcpy(summary,
	       "Measure error against run time, and what is stable; tables, JSON, pictures.\n");
	for (int i = 0; i < BENCHES; i++) {
		const char *operands = benches[i]->operands ? benches[i]->operands : "";

		sprintf(synopsis + strlen(synopsis), "%s%s%s | ", benches[i]->name,
			*operands ? " " : "", operands);
		add_summary(summary, benches[i]->name, operands, benches[i]->summary);
	}
	strcat(synopsis, "view [SCENE] | all | compare OLD.json NEW.json [OPTIONS]");
	add_summary(summary, "view", "[SCENE]",
		    "the picture of a scene: see 'incise bench view --help'");
	add_summary(summary, "all", "",
		    "all of these, and one report: see 'incise bench all --help'");
	strcat(summary,
	       "compare says what changed beyond noise between two reports of --json.");
	return &command;
}

/* --- the command line --- */

static _Noreturn void compare(const struct bench_run *run, int argc, char **argv)
{
	struct incise_error err = {0};
	json_t *reports[2], *comparison = NULL;

	if (argc != 3)
		cli_usage("expected 'compare' and two reports");
	if (run->plot || run->load || run->profile || run->against || run->quick ||
	    run->seed || run->seconds > 0)
		cli_usage("'compare' takes no option but --json");
	for (int i = 0; i < 2; i++) {
		reports[i] = json_read(argv[1 + i], &err);
		if (!reports[i])
			cli_fail_with(&err);
	}
	comparison = compare_reports(reports[0], argv[1], reports[1], argv[2], &err);
	if (!comparison)
		cli_fail_with(&err);
	json_decref(reports[0]);
	json_decref(reports[1]);
	compare_finish(comparison, run->json);
	exit(0);
}

/* An option that was given goes with the benchmark, or is bad usage. */
static void allow(const struct bench *bench, bool given, bool taken, const char *name)
{
	if (given && !taken)
		cli_usage("--%s does not go with '%s'", name, bench->name);
}

static const struct bench *bench_of(int argc, char **argv)
{
	if (argc < 1)
		cli_usage("expected what to measure, such as 'precision'");
	for (int i = 0; i < BENCHES; i++) {
		const struct bench *bench = benches[i];

		if (strcmp(argv[0], bench->name))
			continue;
		if (argc - 1 > bench->n_operands)
			cli_usage("'%s' takes at most %d operand%s, got %d", bench->name,
				  bench->n_operands, bench->n_operands == 1 ? "" : "s",
				  argc - 1);
		return bench;
	}
	if (!strcmp(argv[0], "view") || !strcmp(argv[0], "all"))
		cli_usage("'%s' stands right behind 'incise bench'%s", argv[0],
			  *argv[0] == 'a' ? ""
					  : ", and is built where SDL2, libepoxy, cairo "
					    "and EGL are");
	cli_usage("'%s' is nothing that can be measured", argv[0]);
}

static void parse(struct bench_run *run, int argc, char **argv)
{
	const struct cli_command *command = help();
	int opt;

	while ((opt = cli_next(command, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_JSON:
			run->json = true;
			break;
		case OPT_PLOT:
			run->plot = optarg;
			break;
		case OPT_DURATION:
			run->seconds = cli_duration("duration", optarg, 1, 86400);
			break;
		case OPT_LOAD:
			run->load = optarg;
			break;
		case OPT_PROFILE:
			run->profile = optarg;
			if (strcmp(optarg, "needed") && strcmp(optarg, "full"))
				cli_usage("--profile: '%s' is neither needed nor full",
					  optarg);
			break;
		case OPT_SEED:
			run->seed = cli_integer("seed", optarg, 1, LONG_MAX);
			break;
		case OPT_QUICK:
			run->quick = true;
			break;
		case OPT_AGAINST:
			run->against = optarg;
			break;
		}
}

int main(int argc, char **argv)
{
	static struct bench_run run;
	const struct bench *bench;

	parse(&run, argc, argv);
	argc -= optind;
	argv += optind;
	if (argc && !strcmp(argv[0], "compare"))
		compare(&run, argc, argv);
	run.bench = bench = bench_of(argc, argv);
	allow(bench, run.plot, bench->plots, "plot");
	allow(bench, run.seconds > 0, bench->takes_duration, "duration");
	allow(bench, run.load, bench->takes_load, "load");
	allow(bench, run.profile, bench->takes_profile, "profile");
	allow(bench, run.seed, bench->takes_seed, "seed");
	run.operands = argv + 1;
	run.n_operands = argc - 1;
	if (run.against) {
		compare_against(run.against, run.json);
		run.json = true;
	}
	bench_measure(&run);
	return 0;
}
