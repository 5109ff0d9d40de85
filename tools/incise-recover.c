// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise recover: copies an interrupted recording to one that is read like any other, and converts one of an
 * older format.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/recording.h"

struct recover_job {
	const char *output;
	bool json, damaged;
};

static const struct cli_option options[] = {
	{'o', "output", "NAME.rec", "recording to write: a folder",
	 CLI_OUTPUT(struct recover_job, output), .extensions = ".rec"},
	RECORDING_DAMAGED(struct recover_job, damaged),
	{0, "json", NULL, "report as one JSON object",
	 CLI_FLAG(struct recover_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "recover",
	.synopsis = "OLD.rec -o NEW.rec [OPTIONS]",
	.summary =
		"Copy a recording whose recorder was interrupted to one that is read like "
		"any other, with all that was committed; convert one of an older format to "
		"the present one. The old one stays as it is.",
	.options = options,
	.examples = "incise recover liver.rec -o saved.rec",
};

/* Lines for one that was converted. */
static void print_conversion(const char *path, const char *output,
			     const struct incise_recovered *made)
{
	printf("%s: converted from format %d%s\n", path, made->form,
	       made->form < 2 ? ", which has no ledger: its rows could not be checked"
			      : "");
	if (made->signatures || made->timestamps)
		printf("%s and %s of format %d are kept in %s/seal-before, not of the "
		       "new one\n",
		       cli_count((uint64_t)made->signatures, "signature"),
		       cli_count((uint64_t)made->timestamps, "time-stamp"), made->form,
		       output);
}

int main(int argc, char **argv)
{
	struct incise_recording_info info;
	struct incise_recording *recording;
	struct incise_recovered made;
	struct incise_error err = {0};
	struct recover_job job = {0};
	const char *path;
	bool converted;
	char *target;
	int rc;

	cli_parse(&command, argc, argv, &job);
	path = file_operand(cli_operand(argc, argv, "OLD.rec",
					"interrupted or older recording"),
			    FILE_RECORDING);
	if (!job.output)
		cli_usage("missing -o NEW.rec");
	target = recording_target(job.output);
	rc = incise_recording_recover(path, target, job.damaged, &made, &err);
	if (rc == -EBADMSG)
		cli_fail(
			"%s; 'incise verify %s' lists all; --damaged converts it as it is",
			err.text, path);
	cli_check(rc, &err);
	if (*made.altered)
		cli_warn("%s: not as it was recorded: %s", path, made.altered);
	recording_replace(target, job.output);
	free(target);
	recording = cli_require(incise_recording_open(job.output, &err), &err);
	cli_check(incise_recording_info(recording, &info, &err), &err);
	incise_recording_close(recording);
	converted = made.converted;
	if (job.json)
		json_print(json_pack(
			"{so sI sI sI sb so sI so}", "path", json_text(job.output),
			"force", (json_int_t)info.force, "tracker",
			(json_int_t)info.tracker, "depth", (json_int_t)info.depth,
			"complete", info.complete, "converted_from",
			converted ? json_integer(made.form) : json_null(), "seals_before",
			(json_int_t)(made.signatures + made.timestamps), "altered",
			json_text_or_null(made.altered)));
	else
		printf("%s: %s, %s, %.1f s\n", path,
		       cli_count(info.force, "force sample"),
		       cli_count(info.tracker, "tracker sample"),
		       (double)(info.end_ns - info.start_ns) * 1e-9);
	if (converted && !job.json)
		print_conversion(path, job.output, &made);
	if (!info.complete && !job.json)
		printf("%s: all that was committed; its end is missing, so 'incise verify' "
		       "still says 'interrupted' and exits with 1: key intact of its --json "
		       "is true if the rest is as it was written\n",
		       job.output);
	if (!job.json)
		cli_written();
	cli_finish();
	return 0;
}
