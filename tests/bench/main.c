// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The command line of a benchmark that is a program of its own; see program.h.
 */
#include <limits.h>
#include <stdlib.h>
#include "program.h"

/* The programs that it runs, and the scenes, are next to build/bin. */
const char *cli_folder(void)
{
	return BUILD_FOLDER "/bin";
}

static const struct cli_option options[] = {
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct bench_run, json)},
	{0, "duration", "TIME", "of each measurement: capture, serve",
	 CLI_DURATION(struct bench_run, seconds, 1, 86400)},
	{0, "seed", "N", "of the cases: extremes; of the rigs: coverage (default: 1)",
	 CLI_INTEGER(struct bench_run, seed, 1, LONG_MAX)},
	{0, "quick", NULL, "smoke test with fewer points and repeats",
	 CLI_FLAG(struct bench_run, quick)},
	{0},
};

int main(int argc, char **argv)
{
	static struct bench_run run = {.bench = &bench_program};
	const struct cli_command command = {
		.name = bench_program.name,
		.synopsis = "[OPERAND...] [OPTIONS]",
		.summary = bench_program.summary,
		.options = options,
		.operands = bench_program.operands,
	};

	cli_parse(&command, argc, argv, &run);
	run.operands = argv + optind;
	run.n_operands = argc - optind;
	if (run.n_operands > bench_program.n_operands)
		cli_usage("at most %d operands", bench_program.n_operands);
	if ((run.seconds > 0 && !bench_program.takes_duration) ||
	    (run.seed && !bench_program.takes_seed))
		cli_usage("'%s' takes no --duration or --seed", bench_program.name);
	bench_measure(&run);
	return 0;
}
