// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Another verb of incise; see verb.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "verb.h"

void verb_say(char *const *argv)
{
	fputs("$ incise", stdout);
	for (char *const *arg = argv; *arg; arg++)
		printf(" %s", *arg);
	putchar('\n');
}

/* @out: where its output goes, or -1 for ours. */
static pid_t begin(char *const *argv, int out)
{
	posix_spawn_file_actions_t files;
	char *program;
	pid_t pid;
	int rc;

	if (asprintf(&program, "%s/incise-%s", cli_folder(), argv[0]) < 0 ||
	    posix_spawn_file_actions_init(&files))
		cli_fail("no memory");
	if (out >= 0)
		posix_spawn_file_actions_adddup2(&files, out, STDOUT_FILENO);
	fflush(stdout);
	rc = posix_spawn(&pid, program, &files, NULL, argv, environ);
	if (rc)
		cli_fail("%s: %s", program, strerror(rc));
	posix_spawn_file_actions_destroy(&files);
	free(program);
	return pid;
}

static int end(pid_t pid, char *const *argv, struct incise_error *err)
{
	int status;

	while (waitpid(pid, &status, 0) < 0 && errno == EINTR)
		;
	if (!status)
		return 0;
	return incise_error_set(err, ECANCELED, "'incise %s' failed, see the line above",
				argv[0]);
}

int verb_run(char *const *argv, struct incise_error *err)
{
	return end(begin(argv, -1), argv, err);
}

json_t *verb_report(char *const *argv, struct incise_error *err)
{
	json_error_t why = {.text = "no memory"};
	json_t *report;
	int pipe_fd[2];
	pid_t pid;
	FILE *in;

	if (pipe2(pipe_fd, O_CLOEXEC))
		cli_fail("pipe: %s", strerror(errno));
	pid = begin(argv, pipe_fd[1]);
	close(pipe_fd[1]);
	in = fdopen(pipe_fd[0], "r");
	report = in ? json_loadf(in, 0, &why) : NULL;
	if (in)
		fclose(in);
	if (end(pid, argv, err)) {
		json_decref(report);
		return NULL;
	}
	if (!report)
		incise_error_set(err, EINVAL, "'incise %s' printed no report: %s",
				 argv[0], why.text);
	return report;
}
