// SPDX-License-Identifier: GPL-2.0-or-later
/* tools/cli/child.c: a child ends with the program that started it. */
#include "../unit.h"
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include "../../../tools/cli/child.h"

static char *const sleeps[] = {"sleep", "1000", NULL};

TEST(test_ends_when_asked)
{
	pid_t pid = child_start(sleeps, -1, -1);
	int status;

	assert_int_equal(getpgid(pid), pid);
	assert_false(child_ended(pid, &status));
	status = child_end(pid, 0);
	assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
}

TEST(test_ends_with_its_killed_parent)
{
	int to[2], status;
	pid_t parent, pid;

	/* The child of the killed parent becomes ours. */
	assert_int_equal(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
	assert_int_equal(pipe(to), 0);
	parent = fork();
	if (!parent) {
		pid = child_start(sleeps, -1, -1);
		if (write(to[1], &pid, sizeof(pid)) != sizeof(pid))
			_exit(1);
		pause();
		_exit(1);
	}
	assert_int_equal(read(to[0], &pid, sizeof(pid)), sizeof(pid));
	kill(parent, SIGKILL);
	assert_int_equal(waitpid(parent, &status, 0), parent);
	assert_int_equal(waitpid(pid, &status, 0), pid);
	assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM);
	close(to[0]);
	close(to[1]);
}

TEST(test_output_goes_to_its_descriptor)
{
	char *const says[] = {"sh", "-c", "cat; echo out; echo err >&2", NULL};
	char text[20] = "";
	int to[2], status = 0;
	pid_t pid;

	assert_int_equal(pipe(to), 0);
	pid = child_start(says, to[1], -1);
	status = child_end(pid, 60);
	close(to[1]);
	assert_int_equal(status, 0);
	assert_int_equal(read(to[0], text, sizeof(text) - 1), 4);
	assert_string_equal(text, "out\n");
	close(to[0]);
}
