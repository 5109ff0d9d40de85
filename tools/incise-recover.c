// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise recover: copies an interrupted recording to one that is read like any other.
 */
#include <stdio.h>
#include <stdlib.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/recording.h"

struct job {
	const char *output;
	bool json;
};

static const struct cli_option options[] = {
	{'o', "output", "NAME.rec", "recording to write: a folder",
	 CLI_OUTPUT(struct job, output), .extensions = ".rec"},
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "recover",
	.synopsis = "OLD.rec -o NEW.rec [OPTIONS]",
	.summary =
		"Copy a recording whose recorder was interrupted to one that is read like "
		"any other, with all that was committed. The old one stays as it is.",
	.options = options,
	.examples = "incise recover liver.rec -o saved.rec",
};

int main(int argc, char **argv)
{
	struct incise_recording_info info;
	struct incise_recording *recording;
	struct incise_error err = {0};
	struct job job = {0};
	const char *path;
	char *target;

	cli_parse(&command, argc, argv, &job);
	path = file_operand(cli_operand(argc, argv, "OLD.rec", "interrupted recording"),
			    FILE_RECORDING);
	if (!job.output)
		cli_usage("missing -o NEW.rec");
	target = recording_target(job.output);
	if (incise_recording_recover(path, target, &err))
		cli_fail_with(&err);
	recording_replace(target, job.output);
	free(target);
	recording = cli_require(incise_recording_open(job.output, &err), &err);
	if (incise_recording_info(recording, &info, &err))
		cli_fail_with(&err);
	incise_recording_close(recording);
	if (job.json)
		json_print(json_pack("{so sI sI sI sb}", "path", json_text(job.output),
				     "force", (json_int_t)info.force, "tracker",
				     (json_int_t)info.tracker, "depth",
				     (json_int_t)info.depth, "complete", info.complete));
	else
		printf("%s: %s, %s, %.1f s\n", path,
		       cli_count(info.force, "force sample"),
		       cli_count(info.tracker, "tracker sample"),
		       (double)(info.end_ns - info.start_ns) * 1e-9);
	if (!job.json)
		cli_written();
	cli_finish();
	return 0;
}
