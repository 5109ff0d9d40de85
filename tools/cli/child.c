// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A program that runs next to this one; see child.h.
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
#define TERM_S 3 /* between SIGTERM and SIGKILL */

bool child_possible(const char *program)
{
	char command[100];

	snprintf(command, sizeof(command), "command -v %s >/dev/null 2>&1", program);
	return !system(command);
}

/* Make descriptor @from of the child one of ours; @to -1: /dev/null. */
static bool redirect(int from, int to)
{
	/* If @from is closed, the new descriptor is @from and must stay open. */
	if (to < 0)
		to = open("/dev/null", (from ? O_WRONLY : O_RDONLY) | O_CLOEXEC);
	if (to == from)
		return !fcntl(to, F_SETFD, 0);
	return to >= 0 && dup2(to, from) == from;
}

struct start {
	char *const *argv;
	int out, err;
	pid_t parent;
	volatile int code; /* errno of a start that failed; 0: it runs */
};

static _Noreturn void exec_child(struct start *start)
{
	if (!prctl(PR_SET_PDEATHSIG, SIGTERM) && getppid() == start->parent &&
	    !setpgid(0, 0) && redirect(0, -1) && redirect(1, start->out) &&
	    redirect(2, start->err))
		execvp(start->argv[0], start->argv);
	start->code = errno;
	_exit(127);
}

pid_t child_start(char *const argv[], int out, int err)
{
	struct start start = {argv, out, err, getpid(), 0};
	/* posix_spawn(3) has no PR_SET_PDEATHSIG. */
	pid_t pid = vfork();

	if (!pid)
		exec_child(&start);
	if (pid < 0)
		start.code = errno;
	else if (start.code)
		waitpid(pid, NULL, 0);
	if (start.code)
		cli_fail("%s: cannot be started: %s", start.argv[0],
			 strerror(start.code));
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
	for (double s = 0; s < TERM_S; s += POLL_US * 1e-6) {
		if (child_ended(pid, &status))
			return status;
		usleep(POLL_US);
	}
	kill(-pid, SIGKILL);
	waitpid(pid, &status, 0);
	return status;
}
