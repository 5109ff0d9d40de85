// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Another program beside a measurement; see child.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "child.h"
#include "cli.h"

#define POLL_US 10000
#define ASKED_S 3 /* to end by itself once asked */

bool child_possible(const char *program)
{
	char command[100];

	snprintf(command, sizeof(command), "command -v %s >/dev/null 2>&1", program);
	return !system(command);
}

/* Let a descriptor of the child be one of ours, or lead nowhere. */
static void lead(posix_spawn_file_actions_t *files, int from, int to)
{
	if (to < 0)
		posix_spawn_file_actions_addopen(files, from, "/dev/null", O_WRONLY, 0);
	else
		posix_spawn_file_actions_adddup2(files, to, from);
}

pid_t child_begin(char *const argv[], int out)
{
	return child_begin_heard(argv, out, -1);
}

pid_t child_begin_heard(char *const argv[], int out, int err)
{
	posix_spawn_file_actions_t files;
	posix_spawnattr_t attributes;
	pid_t pid;
	int rc;

	if (posix_spawn_file_actions_init(&files) || posix_spawnattr_init(&attributes))
		cli_fail("no memory");
	posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
	lead(&files, 1, out);
	lead(&files, 2, err);
	posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
	posix_spawnattr_setpgroup(&attributes, 0);
	rc = posix_spawnp(&pid, argv[0], &files, &attributes, argv, environ);
	posix_spawn_file_actions_destroy(&files);
	posix_spawnattr_destroy(&attributes);
	if (rc)
		cli_fail("%s: cannot be started: %s", argv[0], strerror(rc));
	return pid;
}

bool child_ended(pid_t pid, int *status)
{
	return waitpid(pid, status, WNOHANG) == pid;
}

int child_end(pid_t pid, double wait_s)
{
	int status = 0;

	for (double s = 0; s < wait_s && !cli_stop; s += POLL_US * 1e-6) {
		if (child_ended(pid, &status))
			return status;
		usleep(POLL_US);
	}
	kill(-pid, SIGTERM);
	for (double s = 0; s < ASKED_S; s += POLL_US * 1e-6) {
		if (child_ended(pid, &status))
			return status;
		usleep(POLL_US);
	}
	kill(-pid, SIGKILL);
	waitpid(pid, &status, 0);
	return status;
}
