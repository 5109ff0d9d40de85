// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise export: makes a dataset of recordings, raw or averaged as in paper 1, §4.1.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibration.h>
#include <incise/recording.h>
#include "cli/cli.h"
#include "cli/json.h"

#define BINS_MAX 1000

enum {
	OPT_BY_CUT = CLI_LONG,
	OPT_DEPTH_MAX,
	OPT_VELOCITY_MAX,
	OPT_MIN_COUNT,
	OPT_RESAMPLE,
	OPT_LINEAGE,
	OPT_JSON
};

static const struct cli_option options[] = {
	{'o', "output", "FILE",
	 "dataset to write: FILE.csv, or FILE.h5 for HDF5; - is CSV on\nstandard output (default)"},
	{'r', "rate", "HZ",
	 "rows per second, each the mean of its samples (default: all\nsamples)"},
	{OPT_RESAMPLE, "resample", NULL,
	 "all of the recording with the pose, at each force sample or on a\ngrid of --rate, with uncertainty and flags"},
	{'a', "average", "DEPTHxVELOCITY",
	 "average in so many bins of depth and of velocity: 12x10"},
	{OPT_BY_CUT, "by-cut", NULL,
	 "average each cut by itself and name it in the column 'cut'"},
	{OPT_DEPTH_MAX, "depth-max", "MM",
	 "upper end of the bins (default: largest in the data)"},
	{OPT_VELOCITY_MAX, "velocity-max", "MM_S",
	 "upper end of the bins (default: largest in the data)"},
	{OPT_MIN_COUNT, "min-count", "N",
	 "leave out bins with fewer samples (default: 50)"},
	{'c', "calibration", "FILE.conf",
	 "take this calibration of force, camera and delays, not that of\nthe recordings"},
	{OPT_LINEAGE, "lineage", NULL,
	 "begin a CSV with comments that tell where it is from"},
	{OPT_JSON, "json", NULL, "report as one JSON object; needs -o FILE"},
	{0},
};

static const struct cli_command command = {
	.name = "export",
	.synopsis = "NAME.rec… [-o FILE] [OPTIONS]",
	.summary =
		"Make a dataset of the cuts of some recordings: every force sample with depth\n"
		"and velocity at its time, or their averages.",
	.options = options,
	.notes = "Example: incise export liver.rec --average 12x10 -o liver.csv\n"
		 "Exit codes: 0 success, 1 failure, 2 bad usage.",
};

/* "12x10" */
static void parse_bins(const char *text, int *depth, int *velocity)
{
	char extra;

	if (sscanf(text, "%5d%*1[xX]%5d%c", depth, velocity, &extra) != 2 || *depth < 1 ||
	    *depth > BINS_MAX || *velocity < 1 || *velocity > BINS_MAX)
		cli_usage(
			"--average: '%s' is not DEPTHxVELOCITY such as 12x10, each 1 to %d",
			text, BINS_MAX);
}

static void print_report(const struct incise_export_report *report, const char *output)
{
	json_print(json_pack("{so sI si sI so so}", "path", json_text(output), "rows",
			     (json_int_t)report->rows, "cuts", report->cuts, "clipped",
			     (json_int_t)report->clipped, "depth_max_mm",
			     json_number(report->depth_max_mm), "velocity_max_mm_s",
			     json_number(report->velocity_max_mm_s)));
}

/* The file under way, and what its bar shows. */
struct bar {
	const char *path;
	int percent;
};

static int progress(void *context, double share)
{
	static const char full[] = "##############################";
	struct bar *bar = context;
	int percent = (int)(100 * share), n = (int)(share * (sizeof(full) - 1));

	if (percent == bar->percent)
		return 0;
	bar->percent = percent;
	cli_progress("%s [%-*.*s] %d %%", bar->path, (int)sizeof(full) - 1, n, full,
		     percent);
	return 0;
}

static void export(char **paths, int n, const struct incise_export_options *how,
		   const char *output, struct incise_export_report *report)
{
	struct incise_recording **recordings =
		calloc(n, sizeof(struct incise_recording *));
	struct incise_error err = {0};

	if (!recordings)
		cli_fail("out of memory");
	for (int i = 0; i < n; i++) {
		recordings[i] = incise_recording_open(paths[i], &err);
		if (!recordings[i])
			cli_fail_with(&err);
	}
	if (incise_export(recordings, n, how, output, report, &err))
		cli_fail_with(&err);
	cli_progress_end();
	for (int i = 0; i < n; i++)
		incise_recording_close(recordings[i]);
	free(recordings);
}

int main(int argc, char **argv)
{
	struct incise_calibration calibration;
	struct incise_error err = {0};
	struct bar bar = {.percent = -1};
	struct incise_export_options how;
	struct incise_export_report report = {0};
	const char *output = "-";
	bool json = false, min_count = false;
	int id;

	incise_export_options_init(&how);
	while ((id = cli_next(&command, argc, argv)) != CLI_END) {
		switch (id) {
		case 'o':
			output = optarg;
			break;
		case 'r':
			how.rate_hz = cli_number("rate", optarg, 1e-3, 1e9);
			break;
		case 'a':
			parse_bins(optarg, &how.depth_bins, &how.velocity_bins);
			break;
		case OPT_BY_CUT:
			how.by_cut = true;
			break;
		case OPT_DEPTH_MAX:
			how.depth_max_mm = cli_number("depth-max", optarg, 0.1, 1e6);
			break;
		case OPT_VELOCITY_MAX:
			how.velocity_max_mm_s =
				cli_number("velocity-max", optarg, 0.1, 1e6);
			break;
		case OPT_MIN_COUNT:
			how.min_count = cli_integer("min-count", optarg, 1, 1000000000);
			min_count = true;
			break;
		case 'c':
			if (incise_calibration_load(optarg, &calibration, &err))
				cli_fail_with(&err);
			how.calibration = &calibration;
			break;
		case OPT_RESAMPLE:
			how.resample = true;
			break;
		case OPT_LINEAGE:
			how.provenance = true;
			break;
		case OPT_JSON:
			json = true;
			break;
		}
	}
	if (optind == argc)
		cli_usage("which recording?");
	if (how.resample && (how.depth_bins || (how.rate_hz > 0 && how.rate_hz < 1)))
		cli_usage("--resample takes a --rate of 1 or more, and no --average");
	if (how.rate_hz > 0 && how.depth_bins)
		cli_usage("--rate and --average exclude each other");
	if (!how.depth_bins && (how.by_cut || min_count || how.depth_max_mm > 0 ||
				how.velocity_max_mm_s > 0))
		cli_usage("--by-cut, --depth-max, --velocity-max and --min-count go with "
			  "--average");
	if (json && !strcmp(output, "-"))
		cli_usage("--json needs -o FILE: standard output cannot take both");

	/* A bar would run through rows on the same terminal. */
	if (strcmp(output, "-")) {
		how.progress = progress;
		how.context = &bar;
		bar.path = output;
	}
	export(argv + optind, argc - optind, &how, output, &report);
	if (json)
		print_report(&report, output);
	else if (strcmp(output, "-") && !report.cuts && !how.resample)
		printf("%s: %llu messages\n", output, (unsigned long long)report.rows);
	else if (strcmp(output, "-"))
		printf("%s: %llu rows from %d cuts\n", output,
		       (unsigned long long)report.rows, report.cuts);
	cli_finish();
	return 0;
}
