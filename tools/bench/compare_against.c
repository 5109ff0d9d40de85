// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * --against; see compare.h.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "compare.h"
#include "../cli/json.h"
#include "../cli/file.h"

/* In the first process: what the other one said, and how it ended. */
static void wait_and_compare(pid_t pid, const struct memory_file *said, const char *path,
			     json_t *old_report, bool json)
{
	struct incise_error err = {0};
	json_t *report, *comparison;
	int status, worse;

	/* A Ctrl-C is for who measures. */
	signal(SIGINT, SIG_IGN);
	while (waitpid(pid, &status, 0) < 0)
		if (errno != EINTR)
			cli_fail("what measures is lost: %s", strerror(errno));
	rewind(said->file);
	/* What failed before it had a report has said why. */
	report = json_read_from(said->file, "the report", &err);
	if (!report && status)
		_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
	comparison = report ? compare_reports(old_report, path, report, "this run", &err)
			    : NULL;
	if (!comparison)
		cli_fail_with(&err);
	if (json) {
		worse = compare_worse(comparison);
		json_object_set_new(report, "against", comparison);
		json_print(report);
		if (worse)
			cli_fail("%d worse or gone against %s", worse, path);
	} else {
		compare_finish(comparison, false);
	}
	exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
}

void compare_against(const char *path, bool json)
{
	struct memory_file said = memory_file_begin("report");
	struct incise_error err = {0};
	json_t *old_report = json_read(path, &err), *itself;
	pid_t parent = getpid(), pid;

	/* One that is no report is said now, not after the work. */
	itself = old_report ? compare_reports(old_report, path, old_report, path, &err)
			    : NULL;
	if (!itself)
		cli_fail_with(&err);
	json_decref(itself);
	fflush(stdout);
	pid = fork();
	if (pid < 0)
		cli_fail("no process to measure in: %s", strerror(errno));
	if (pid)
		wait_and_compare(pid, &said, path, old_report, json);
	prctl(PR_SET_PDEATHSIG, SIGTERM);
	if (getppid() != parent)
		_exit(1);
	if (dup2(fileno(said.file), STDOUT_FILENO) < 0)
		cli_fail("no output to report to: %s", strerror(errno));
	fclose(said.file);
	json_decref(old_report);
}
