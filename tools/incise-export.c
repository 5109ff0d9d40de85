// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise export: makes a dataset of recordings, raw or averaged as in paper 1, §4.1.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recording.h>
#include "../lib/publish/formats.h"
#include "cli/calibration.h"
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/recording.h"

#define BINS_MAX 1000
#define CAMERA_OFF_MM 1.0 /* of depths by two devices that may differ */

struct export_job {
	const char *output;
	bool json, damaged, no_lineage;
	int min_count; /* 0: not given */
	struct cli_bar progress;
	enum { PLAIN, ROS2 } profile;
	int uncertainty; /* enum incise_export_uncertainty */
	struct calibration_used calibration;
	struct incise_export_options how;
};

/* "12x10", "12x10,by-cut,depth=8" */
static void parse_bins(void *options, char *text)
{
	static const struct cli_option keys[] = {
		{0, "average by-cut", NULL, NULL,
		 CLI_FLAG(struct export_job, how.by_cut)},
		{0, "average depth", "MM", NULL,
		 CLI_NUMBER(struct export_job, how.depth_max_mm, 0.1, 1e6)},
		{0, "average velocity", "MM_S", NULL,
		 CLI_NUMBER(struct export_job, how.velocity_max_mm_s, 0.1, 1e6)},
		{0, "average count", "N", NULL,
		 CLI_INTEGER(struct export_job, min_count, 1, 1000000000)},
		{0},
	};
	struct incise_export_options *how = &((struct export_job *)options)->how;
	char extra, *comma = strchr(text, ',');

	if (comma) {
		*comma++ = '\0';
		cli_keys(comma, keys, options);
	}
	if (sscanf(text, "%5d%*1[xX]%5d%c", &how->depth_bins, &how->velocity_bins,
		   &extra) != 2 ||
	    how->depth_bins < 1 || how->depth_bins > BINS_MAX || how->velocity_bins < 1 ||
	    how->velocity_bins > BINS_MAX)
		cli_usage("--average: expected DEPTHxVELOCITY, for example 12x10, each 1 "
			  "to %d, found '%s'",
			  BINS_MAX, text);
}

static void parse_part(void *options, char *text)
{
	struct incise_export_options *how = &((struct export_job *)options)->how;

	cli_time_range("range", text, &how->from_s, &how->to_s);
	if (isinf(how->to_s))
		how->to_s = 0;
}

static void load_calibration(void *options, char *path)
{
	struct export_job *job = options;

	calibration_use(&job->calibration, path, NULL);
	job->how.calibration = &job->calibration.values;
	job->how.calibration_path = job->calibration.path;
}

static const char *const profiles[] = {"plain", "ros2", NULL};

static const char *const uncertainties[] = {"none", "total", "parts", NULL};

static const struct cli_option options[] = {
	{'o', "output", "FILE",
	 "dataset to write, in the format of its extension:" INCISE_ROW_EXTENSIONS
		 INCISE_MESSAGE_EXTENSIONS "; - is CSV on standard output (default)",
	 CLI_OUTPUT(struct export_job, output),
	 .extensions = INCISE_ROW_EXTENSIONS INCISE_MESSAGE_EXTENSIONS},
	{0, "rate", "HZ",
	 "rows per second, each the mean of its samples (default: all samples)",
	 CLI_NUMBER(struct export_job, how.rate_hz, 1e-3, 1e9)},
	{0, "resample", NULL,
	 "export the whole recording with the pose, at each force sample or at "
	 "--rate, with uncertainty and flags",
	 CLI_FLAG(struct export_job, how.resample)},
	{0, "range", "TIME..TIME",
	 "the part to export, such as 2s..4.5s, 90s.. or ..1min; from the first "
	 "sample (default: all)",
	 CLI_PARSED_BY(parse_part)},
	{0, "cut", "N", "only this cut, from 1",
	 CLI_INTEGER(struct export_job, how.cut, 1, 1000000000)},
	{'a', "average", "DEPTHxVELOCITY[,KEY...]",
	 "average in bins of depth and velocity, for example 12x10; keys: by-cut "
	 "averages each cut separately and names it in the column 'cut'; depth=MM "
	 "and velocity=MM_S are the upper ends of the bins (default: largest where "
	 "the blade advances); count=N leaves out bins with fewer samples (default: "
	 "50)",
	 CLI_PARSED_BY(parse_bins)},
	{'c', "calibration", "FILE",
	 "use this calibration of force, camera and delays instead of that of the "
	 "recordings; none: nominal values",
	 CLI_PARSED_BY(load_calibration)},
	{0, "profile", "NAME",
	 "messages of MCAP: plain (JSON, default) or ros2 (ROS 2, as rosbag2 "
	 "stores them; metres and UTC)",
	 CLI_CHOICE(struct export_job, profile, profiles)},
	{0, "tai", NULL,
	 "also columns tai_ns and tai_u_ns: TAI and the bound of its error",
	 CLI_FLAG(struct export_job, how.tai)},
	{0, "uncertainty", "WHICH",
	 "columns of standard uncertainties: none (default), total, or parts, "
	 "which are the total and what it is made of",
	 CLI_CHOICE(struct export_job, uncertainty, uncertainties)},
	{0, "no-lineage", NULL, "write a CSV without the comments on its provenance",
	 CLI_FLAG(struct export_job, no_lineage)},
	RECORDING_DAMAGED(struct export_job, damaged),
	{0, "json", NULL, "report as one JSON object; needs -o FILE",
	 CLI_FLAG(struct export_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "export",
	.synopsis = "NAME.rec… [-o FILE] [OPTIONS]",
	.summary = "Make a dataset from the cuts of recordings: every force sample with "
		   "depth and velocity at its time, or their averages.",
	.options = options,
	.examples = "incise export liver.rec --average 12x10 -o liver.csv",
};

/* A list of what is not stated. */
static json_t *unstated(const struct incise_export_report *report)
{
	char *text = cli_text("%s", report->unstated), *rest = text, *line;
	json_t *list = json_array();

	while ((line = strsep(&rest, "\n")))
		if (*line)
			json_array_append_new(list, json_text(line));
	free(text);
	return list;
}

static void print_export_report(const struct incise_export_report *report,
				const char *output)
{
	json_print(json_pack("{so sI si sI so so so}", "path", json_text(output), "rows",
			     (json_int_t)report->rows, "cuts", report->cuts, "clipped",
			     (json_int_t)report->clipped, "depth_max_mm",
			     json_number(report->depth_max_mm), "velocity_max_mm_s",
			     json_number(report->velocity_max_mm_s), "unstated",
			     unstated(report)));
}

static void warn_camera(const struct incise_export_report *report)
{
	if (report->camera_off_mm > CAMERA_OFF_MM)
		cli_warn(
			"the camera's depths are %.2f times the tracker's, which is up to "
			"%.1f mm: 'incise calibrate depth' measures its scale",
			report->camera_ratio, report->camera_off_mm);
}

static void warn_unstated(const struct incise_export_report *report)
{
	json_t *list = unstated(report), *at;
	size_t i;

	json_array_foreach(list, i, at)
	{
		cli_warn("not stated, and nan: the uncertainty of %s",
			 json_string_value(at));
	}
	json_decref(list);
}

static int progress(void *context, double share)
{
	struct export_job *job = context;

	cli_progress_bar(job->output, share, &job->progress);
	return 0;
}

static bool is_part(const struct export_job *job)
{
	return job->how.from_s > 0 || job->how.to_s > 0 || job->how.cut;
}

static void export(char **paths, int n, const struct export_job *job,
		   struct incise_export_report *report)
{
	struct incise_recording **recordings = cli_alloc(n, sizeof(*recordings));
	struct incise_error err = {0};

	for (int i = 0; i < n; i++) {
		paths[i] = (char *)file_operand(paths[i], FILE_RECORDING);
		recordings[i] = recording_open(paths[i]);
		/* Where a part is exported, the blocks that are read are compared with their checksums. */
		recording_intact(paths[i], !is_part(job), job->damaged, &err);
		cli_check(err.code, &err);
	}
	cli_check(incise_export(recordings, n, &job->how, job->output, report, &err),
		  &err);
	cli_progress_end();
	for (int i = 0; i < n; i++)
		incise_recording_close(recordings[i]);
	free(recordings);
}

static bool has_messages(const struct export_job *job)
{
	return cli_extension_in(job->output, INCISE_MESSAGE_EXTENSIONS);
}

static void parse_export(struct export_job *job, int argc, char **argv)
{
	struct incise_export_options *how = &job->how;

	*job = (struct export_job){.output = "-"};
	incise_export_options_init(how);
	cli_parse(&command, argc, argv, job);
	if (optind == argc)
		cli_usage("missing NAME.rec (recording to export)");
	if (how->resample && (how->depth_bins || (how->rate_hz > 0 && how->rate_hz < 1)))
		cli_usage("--resample needs a --rate of 1 or more, and excludes "
			  "--average");
	if (how->cut && (how->resample || has_messages(job)))
		cli_usage("--cut is of cuts; give --range with --resample "
			  "and" INCISE_MESSAGE_EXTENSIONS);
	if (how->rate_hz > 0 && how->depth_bins)
		cli_usage("--rate and --average exclude each other; give one of them");
	if (how->tai && (how->depth_bins || has_messages(job)))
		cli_usage("--tai goes with rows of" INCISE_ROW_EXTENSIONS
			  ", without --average");
	if (job->profile && !has_messages(job))
		cli_usage("--profile needs -o FILE with" INCISE_MESSAGE_EXTENSIONS);
	if (job->profile == ROS2 && job->uncertainty)
		cli_usage("--uncertainty does not go with --profile ros2, whose messages "
			  "have no place for it");
	how->provenance = !job->no_lineage;
	how->ros2 = job->profile == ROS2;
	how->uncertainty = (enum incise_export_uncertainty)job->uncertainty;
	if (job->min_count)
		how->min_count = job->min_count;
	if (job->json && !strcmp(job->output, "-"))
		cli_usage("--json needs -o FILE: both would write to standard output");
	/* A bar would run through rows on the same terminal. */
	if (strcmp(job->output, "-")) {
		how->progress = progress;
		how->context = job;
	}
}

int main(int argc, char **argv)
{
	struct incise_export_report report = {0};
	struct export_job job;

	parse_export(&job, argc, argv);
	export(argv + optind, argc - optind, &job, &report);
	warn_unstated(&report);
	warn_camera(&report);
	if (job.json)
		print_export_report(&report, job.output);
	else if (strcmp(job.output, "-") && !report.cuts && !job.how.resample)
		printf("wrote %s: %s\n", job.output, cli_count(report.rows, "message"));
	else if (strcmp(job.output, "-"))
		printf("wrote %s: %s from %s\n", job.output,
		       cli_count(report.rows, "row"), cli_count(report.cuts, "cut"));
	cli_finish();
	return 0;
}
