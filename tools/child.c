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

pid_t child_begin(char *const argv[], int out)
{
	posix_spawn_file_actions_t files;
	posix_spawnattr_t attributes;
	pid_t pid;
	int rc;

	if (posix_spawn_file_actions_init(&files) || posix_spawnattr_init(&attributes))
		cli_fail("no memory");
	posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
	posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
	if (out < 0)
		posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
	else
		posix_spawn_file_actions_adddup2(&files, out, 1);
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
