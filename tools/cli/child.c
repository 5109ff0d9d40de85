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
	int in, out, err;
	bool foreground; /* in the process group of the parent */
	pid_t parent;
	volatile int code; /* errno of a start that failed; 0: it runs */
};

static _Noreturn void exec_child(struct start *start)
{
	if (!prctl(PR_SET_PDEATHSIG, SIGTERM) && getppid() == start->parent &&
	    (start->foreground || !setpgid(0, 0)) && redirect(0, start->in) &&
	    redirect(1, start->out) && redirect(2, start->err))
		execvp(start->argv[0], start->argv);
	start->code = errno;
	_exit(127);
}

/* -1 with errno if it cannot be started. */
static pid_t start_child(struct start *start)
{
	/* posix_spawn(3) has no PR_SET_PDEATHSIG. */
	pid_t pid = vfork();

	if (!pid)
		exec_child(start);
	if (pid > 0 && start->code) {
		waitpid(pid, NULL, 0);
		errno = start->code;
		pid = -1;
	}
	return pid;
}

pid_t child_start(char *const argv[], int out, int err)
{
	struct start start = {argv, -1, out, err, false, getpid(), 0};
	pid_t pid = start_child(&start);

	if (pid < 0)
		cli_fail("%s: cannot be started: %s", argv[0], strerror(errno));
	return pid;
}

int child_run(char *const argv[], int in, int out, int err)
{
	struct start start = {argv, in, out, err, true, getpid(), 0};
	pid_t pid = start_child(&start);
	bool told = false;
	int status;

	while (pid > 0 && waitpid(pid, &status, 0) != pid) {
		if (errno != EINTR)
			return -1;
		if (cli_stop && !told)
			told = !kill(pid, SIGTERM);
	}
	return pid < 0 ? -1 : status;
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
