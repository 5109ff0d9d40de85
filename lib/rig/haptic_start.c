// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Starting the owner of a haptic device; see haptic_page.h. `incise device --detach` prints `ready` on
 * standard error, which it leaves then, or `errno N` and a line with the reason why it fails.
 */
#include <errno.h>
#include <fcntl.h> /* O_CLOEXEC */
#include <limits.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "haptic_page.h"

#define PROGRAM "incise-device"
#define ERRNO_MOST 4095

extern char **environ;

/* Beside this program, or in bin/ beside the library's folder; else it is looked up in PATH. */
static void find_program(char path[PATH_MAX + 40])
{
	char folder[PATH_MAX];
	ssize_t n = readlink("/proc/self/exe", folder, sizeof(folder) - 1);

	folder[n > 0 ? n : 0] = 0;
	snprintf(path, PATH_MAX + 40, "%.*s/" PROGRAM,
		 (int)(strrchr(folder, '/') ? strrchr(folder, '/') - folder : 0), folder);
	if (access(path, X_OK) && incise_module_folder(folder, sizeof(folder)))
		snprintf(path, PATH_MAX + 40, "%s/../../bin/" PROGRAM, folder);
	if (access(path, X_OK))
		strcpy(path, PROGRAM);
}

/* Its standard error is @err_fd. Returns 0 or a positive errno. */
static int spawn_owner(pid_t *pid, const char *path, const char *spec, int err_fd)
{
	char *const argv[] = {PROGRAM, "--detach", "--rig", (char *)spec, NULL};
	posix_spawn_file_actions_t files;
	int rc = posix_spawn_file_actions_init(&files);

	if (rc)
		return rc;
	rc = posix_spawn_file_actions_adddup2(&files, err_fd, STDERR_FILENO);
	if (!rc)
		rc = posix_spawnp(pid, path, &files, NULL, argv, environ);
	posix_spawn_file_actions_destroy(&files);
	return rc;
}

/* The last line of a program, without its name, and the errno that it gives; 0: none. */
static int read_line(int fd, char *line, size_t size)
{
	size_t length = 0;
	int code = 0;
	char *last;
	ssize_t n;

	while ((n = read(fd, line + length, size - 1 - length)) > 0 ||
	       (n < 0 && errno == EINTR))
		length += n > 0 ? (size_t)n : 0;
	while (length && line[length - 1] == '\n')
		length--;
	line[length] = 0;
	last = strstr(line, "errno ");
	if (last && sscanf(last, "errno %d", &code) == 1 &&
	    (code < 0 || code > ERRNO_MOST))
		code = 0;
	last = strrchr(line, '\n');
	last = last ? last + 1 : line;
	if (!strncmp(last, "incise device: ", strlen("incise device: ")))
		last += strlen("incise device: ");
	memmove(line, last, strlen(last) + 1);
	return code;
}

int incise_haptic_start_owner(const char *spec, const char *where,
			      struct incise_error *err)
{
	char path[PATH_MAX + 40], line[2000];
	bool ready = false;
	int fds[2], rc, code = 0;
	pid_t pid;

	find_program(path);
	if (pipe2(fds, O_CLOEXEC))
		return incise_error_set(err, errno, "%s: %s", where, strerror(errno));
	rc = spawn_owner(&pid, path, spec, fds[1]);
	close(fds[1]);
	if (!rc) {
		code = read_line(fds[0], line, sizeof(line));
		ready = !strcmp(line, "ready");
		/* An owner that is ready outlives this process, or is reaped with it. */
		while (!ready && waitpid(pid, NULL, 0) < 0 && errno == EINTR)
			;
	}
	close(fds[0]);
	if (rc)
		return incise_error_set(
			err, rc,
			"%s: " PROGRAM ", the owner of the device, cannot "
			"be started: %s; install it beside this program or "
			"in PATH",
			where, strerror(rc));
	if (ready)
		return 0;
	return incise_error_set(err, code ? code : EIO, "%.490s",
				*line ? line : "incise device ended without a reason");
}
