// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench NAME: the benchmarks of bench/bench.h by their names.
 */
#include <stdio.h>
#include <string.h>
#include "bench/bench.h"
#include "cli/file_kind.h"
#include "cli/json.h"

static const struct cli_option options[] = {
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct bench_run, json)},
	{0, "against", "OLD.json",
	 "report significant changes since an older report of --json",
	 CLI_INPUT(struct bench_run, against)},
	{'o', "output", "NAME",
	 "precision: plot error over run time as NAME.png and NAME.svg; stability: plot "
	 "the limits as NAME-map",
	 CLI_OUTPUTS(struct bench_run, plot)},
	{0, "duration", "TIME",
	 "loop: of each measurement of wake-up latency (default: 5s)",
	 CLI_DURATION(struct bench_run, seconds, 1, 86400)},
	{0, "load", "NAME",
	 "loop: wake-up latency under one load only: idle, cpu, memory, disk or "
	 "view",
	 CLI_TEXT(struct bench_run, load), .names = bench_loads},
	{0, "quick", NULL, "smoke test with fewer points and repeats",
	 CLI_FLAG(struct bench_run, quick)},
	{0},
};

static const struct bench *const benches[] = {
	&bench_precision, &bench_training, &bench_realism,
	&bench_stability, &bench_loop,	   &bench_scenes,
};

/* --- help --- */

static void add_summary(char *text, const char *name, const char *operands,
			const char *summary)
{
	char *title = cli_text("%s%s%s", name, *operands ? " " : "", operands);

	sprintf(text + strlen(text), "  %-21s  %s\n", title, summary);
	free(title);
}

static const struct cli_command *help(void)
{
	static char summary[4000], all[500];
	static struct cli_command command = {
		.name = "bench",
		.synopsis = "BENCHMARK [OPERAND...] [OPTIONS]",
		.summary = summary,
		.options = options,
		.failure =
			"failure, disagreement with theory or between variants, or worse metrics",
		.operands = all,
	};

	all[0] = '\0';
	strcpy(summary,
	       "Measure error against run time, and stability limits; print tables, JSON or plots.\n");
	for (int i = 0; i < N(benches); i++) {
		const char *operands = benches[i]->operands ? benches[i]->operands : "";

		add_summary(summary, benches[i]->name, operands, benches[i]->summary);
		sprintf(all + strlen(all), "%s %s | ", benches[i]->name, operands);
	}
	strcat(all, "view [SCENE] | all | compare OLD.json NEW.json");
	add_summary(summary, "view", "[SCENE]",
		    "run time and error of the image of a scene; see 'incise bench view "
		    "--help'");
	add_summary(summary, "all", "",
		    "all of these, and one report; see 'incise bench all --help'");
	strcat(summary, "compare OLD.json NEW.json lists the significant changes between "
			"two reports of --json.");
	return &command;
}

/* --- the command line --- */

static _Noreturn void compare_bench(const struct bench_run *run, int argc, char **argv)
{
	struct incise_error err = {0};
	json_t *reports[2], *comparison;
	int worse;

	if (argc != 3)
		cli_usage("expected 'compare' and two reports");
	if (run->plot || run->load || run->against || run->quick || run->seconds > 0)
		cli_usage("'compare' takes no option but --json");
	for (int i = 0; i < 2; i++) {
		file_expect(argv[1 + i], FILE_REPORT);
		reports[i] = cli_require(json_read(argv[1 + i], &err), &err);
	}
	comparison = cli_require(
		compare_reports(reports[0], argv[1], reports[1], argv[2], &err), &err);
	json_decref(reports[0]);
	json_decref(reports[1]);
	worse = compare_print(comparison, run->json);
	if (worse)
		compare_fail(worse);
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
	const char *names[N(benches) + 4] = {0};

	if (argc < 1)
		cli_usage("a benchmark is missing, for example 'precision'");
	for (int i = 0; i < N(benches); i++) {
		const struct bench *bench = benches[i];

		if (strcmp(argv[0], bench->name))
			continue;
		if (argc - 1 > bench->n_operands)
			cli_usage("'%s' takes at most %s, got %d", bench->name,
				  cli_count(bench->n_operands, "operand"), argc - 1);
		return bench;
	}
	if (!strcmp(argv[0], "view") || !strcmp(argv[0], "all"))
		cli_usage("'%s' must come directly after 'incise bench'%s", argv[0],
			  *argv[0] == 'a' ? ""
					  : "; it needs SDL2, libepoxy, cairo and EGL");
	for (int i = 0; i < N(benches); i++)
		names[i] = benches[i]->name;
	names[N(benches)] = "all";
	names[N(benches) + 1] = "view";
	names[N(benches) + 2] = "compare";
	cli_unknown("benchmark", argv[0], names);
}

int main(int argc, char **argv)
{
	static struct bench_run run;
	const struct bench *bench;

	cli_parse(help(), argc, argv, &run);
	argc -= optind;
	argv += optind;
	if (argc && !strcmp(argv[0], "compare"))
		compare_bench(&run, argc, argv);
	run.bench = bench = bench_of(argc, argv);
	allow(bench, run.plot, bench->plot.script, "output");
	allow(bench, run.seconds > 0, bench->takes_duration, "duration");
	allow(bench, run.load, bench->takes_load, "load");
	run.operands = argv + 1;
	run.n_operands = argc - 1;
	bench_measure(&run);
	return 0;
}
