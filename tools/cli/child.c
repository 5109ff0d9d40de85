// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Another program beside a measurement; see child.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
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
static bool lead(int from, int to)
{
	/* Where @from is closed the new one is it, and is to stay. */
	if (to < 0)
		to = open("/dev/null", (from ? O_WRONLY : O_RDONLY) | O_CLOEXEC);
	if (to == from)
		return !fcntl(to, F_SETFD, 0);
	return to >= 0 && dup2(to, from) == from;
}

pid_t child_begin(char *const argv[], int out)
{
	return child_begin_heard(argv, out, -1);
}

struct start {
	char *const *argv;
	int out, err;
	pid_t parent;
	volatile int why; /* it could not be; 0: it is */
};

static _Noreturn void become(struct start *start)
{
	if (!prctl(PR_SET_PDEATHSIG, SIGTERM) && getppid() == start->parent &&
	    !setpgid(0, 0) && lead(0, -1) && lead(1, start->out) && lead(2, start->err))
		execvp(start->argv[0], start->argv);
	start->why = errno;
	_exit(127);
}

pid_t child_begin_heard(char *const argv[], int out, int err)
{
	struct start start = {argv, out, err, getpid(), 0};
	/* posix_spawn(3) cannot make it end with us. */
	pid_t pid = vfork();

	if (!pid)
		become(&start);
	if (pid < 0)
		start.why = errno;
	else if (start.why)
		waitpid(pid, NULL, 0);
	if (start.why)
		cli_fail("%s: cannot be started: %s", start.argv[0], strerror(start.why));
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
