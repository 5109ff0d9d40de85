// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise join: puts recordings of several machines on one timeline.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/session.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/recording.h"
#include "cli/joined_report.h"

struct join_job {
	const char *output;
	struct incise_session_options how;
	bool json, damaged;
};

static const char *const aligns[] = {"clocks", "tap", "sync", NULL};

static const struct cli_option options[] = {
	{'o', "output", "NAME.rec", "joined recording to write: a folder",
	 CLI_OUTPUT(struct join_job, output), .extensions = ".rec"},
	{0, "tolerance", "TIME",
	 "refuse times that are uncertain by more, for example 1ms (default: state "
	 "the uncertainty)",
	 CLI_QUANTITY(struct join_job, how.within_s, joined_times, 1e-9, 3600)},
	{0, "align", "SIGNAL",
	 "align by clocks (default), tap (knocks in force or motion) or sync "
	 "(events of the SYNC line), and compare with the clocks",
	 CLI_CHOICE(struct join_job, how.align, aligns)},
	RECORDING_DAMAGED(struct join_job, damaged),
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct join_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "join",
	.synopsis = "A.rec B.rec… -o JOINED.rec [OPTIONS]",
	.summary = "Put recordings of several machines on one timeline, the clock of the "
		   "first one, by their wall time or by a signal that all recorded. The "
		   "recordings stay as they are.",
	.options = options,
	.examples = "incise join force.rec tracker.rec --tolerance 1ms -o day.rec",
};

static void print_note(void *context, const char *text)
{
	(void)context;
	cli_warn("%s", text);
}

/* Name the file that --overwrite replaces as the user did. */
static void fail_join(const struct incise_error *err, const char *target,
		      const char *given)
{
	size_t n = strlen(target);

	if (!strncmp(err->text, target, n))
		cli_fail("%s%s", given, err->text + n);
	cli_fail_with(err);
}

int main(int argc, char **argv)
{
	struct join_job job = {.how.note = print_note};
	const struct incise_session_info *members;
	struct incise_recording *session;
	struct incise_error err = {0};
	char *target, *path;
	int n;

	cli_parse(&command, argc, argv, &job);
	if (argc - optind < 2)
		cli_usage("missing %s (recordings to join)",
			  optind == argc ? "A.rec and B.rec" : "B.rec");
	if (!job.output)
		cli_usage("missing -o JOINED.rec");
	for (int i = optind; i < argc; i++) {
		argv[i] = (char *)file_operand(argv[i], FILE_RECORDING);
		recording_intact(argv[i], true, job.damaged, &err);
		cli_check(err.code, &err);
	}
	target = recording_target(job.output);
	if (incise_session_join((const char *const *)argv + optind, argc - optind,
				&job.how, target, &err))
		fail_join(&err, target, job.output);
	recording_replace(target, job.output);
	/* Each stream of the first member that has it: what is reported is the same for all. */
	path = cli_text("%s:*", job.output);
	session = cli_require(incise_recording_open(path, &err), &err);
	n = incise_session_members(session, &members);
	if (job.json)
		json_print(json_pack("{so so}", "path", json_text(job.output), "members",
				     joined_json(members, n)));
	else
		joined_print(members, n);
	incise_recording_close(session);
	free(path);
	free(target);
	if (!job.json)
		cli_written();
	cli_finish();
	return 0;
}
