// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The control socket of a loop; see control.h. SOCK_SEQPACKET: a request is a packet, so that no
 * request is cut or joined, and the loop waits for no rest.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "control.h"

struct control {
	char *path;
	struct stat made; /* the socket's file, as it was made */
	int fd;
	int client[CONTROL_CLIENTS]; /* the oldest first */
	int clients;
};

char *control_path(const char *page)
{
	size_t end = cli_ends_with(page, ".state") ? strlen(".state") : 0;

	return cli_text("%.*s.control", (int)(strlen(page) - end), page);
}

/* --- making it -------------------------------------------------------------------------- */

/* The group's as well in a folder that hands its group on. */
static mode_t mode_in(const char *path)
{
	const char *slash = strrchr(path, '/');
	char *folder =
		slash ? cli_text("%.*s", (int)(slash - path) + 1, path) : cli_text(".");
	struct stat st;
	mode_t mode = !stat(folder, &st) && st.st_mode & S_ISGID ? 0660 : 0600;

	free(folder);
	return mode;
}

/* Whatever the umask, and through no link that somebody puts there meanwhile. */
static int set_mode(const char *path, mode_t mode, struct stat *made)
{
	int fd = open(path, O_PATH | O_NOFOLLOW | O_CLOEXEC), rc = -1;
	char *link = cli_text("/proc/self/fd/%d", fd);

	if (fd >= 0 && !fstat(fd, made) && S_ISSOCK(made->st_mode) &&
	    made->st_uid == geteuid())
		rc = chmod(link, mode);
	free(link);
	if (fd >= 0)
		close(fd);
	return rc;
}

/* Under a name of its own first: a client finds a socket that listens, or no socket. */
static int listen_at(struct control *control)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	char *hidden = cli_text("%s.%d", control->path, (int)getpid());
	int rc = -ENAMETOOLONG;

	if (strlen(hidden) < sizeof(address.sun_path)) {
		strcpy(address.sun_path, hidden);
		unlink(hidden);
		rc = fchmod(control->fd, 0600) ||
				     bind(control->fd, (struct sockaddr *)&address,
					  sizeof(address)) ||
				     listen(control->fd, SOMAXCONN) ||
				     set_mode(hidden, mode_in(control->path),
					      &control->made) ||
				     rename(hidden, control->path)
			     ? -errno
			     : 0;
		if (rc)
			unlink(hidden);
	}
	free(hidden);
	return rc;
}

struct control *control_new(const char *page, struct incise_error *err)
{
	struct control *control = cli_alloc(1, sizeof(*control));
	struct stat st;
	int rc = 0;

	control->path = control_path(page);
	control->fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
	if (control->fd < 0)
		rc = -errno;
	else if (!lstat(control->path, &st) && !S_ISSOCK(st.st_mode))
		rc = -EEXIST;
	if (!rc)
		rc = listen_at(control);
	if (!rc)
		return control;
	incise_error_set(err, -rc, "%s: %s", control->path, strerror(-rc));
	control_free(control);
	errno = -rc;
	return NULL;
}

void control_free(struct control *control)
{
	struct stat st;

	if (!control)
		return;
	for (int i = 0; i < control->clients; i++)
		close(control->client[i]);
	if (control->fd >= 0)
		close(control->fd);
	/* Another loop may have put its own there. */
	if (control->made.st_ino && !lstat(control->path, &st) &&
	    st.st_dev == control->made.st_dev && st.st_ino == control->made.st_ino)
		unlink(control->path);
	free(control->path);
	free(control);
}

/* --- serving ----------------------------------------------------------------------------- */

int control_polled(const struct control *control, struct pollfd *polled)
{
	polled[0] = (struct pollfd){.fd = control->fd, .events = POLLIN};
	for (int i = 0; i < control->clients; i++)
		polled[1 + i] =
			(struct pollfd){.fd = control->client[i], .events = POLLIN};
	return 1 + control->clients;
}

static void drop(struct control *control, int i)
{
	close(control->client[i]);
	control->clients--;
	memmove(&control->client[i], &control->client[i + 1],
		(size_t)(control->clients - i) * sizeof(*control->client));
}

static void take_client(struct control *control)
{
	int fd = accept4(control->fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);

	if (fd < 0)
		return;
	if (control->clients == CONTROL_CLIENTS)
		drop(control, 0);
	control->client[control->clients++] = fd;
}

/* A request as text: without the end of its line, and printable. */
static bool is_text(char *request, size_t n)
{
	if (n && request[n - 1] == '\n')
		n--;
	request[n] = 0;
	for (size_t i = 0; i < n; i++)
		if (request[i] < ' ' || request[i] > '~')
			return false;
	return true;
}

/* One request of a client. Returns false if it is gone, or takes no answer. */
static bool serve_client(int fd,
			 void (*answer)(void *context, const char *request,
					char reply[CONTROL_LINE]),
			 void *context)
{
	char request[CONTROL_LINE], reply[CONTROL_LINE] = "";
	ssize_t n = recv(fd, request, sizeof(request), MSG_DONTWAIT | MSG_TRUNC);
	size_t length;

	if (n <= 0)
		return n < 0 && (errno == EAGAIN || errno == EINTR);
	if (n >= CONTROL_LINE)
		strcpy(reply, "error a request has less than 256 bytes");
	else if (!is_text(request, (size_t)n))
		strcpy(reply, "error a request is a line of printable characters");
	else
		answer(context, request, reply);
	length = strlen(reply);
	reply[length++] = '\n';
	return send(fd, reply, length, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)length;
}

void control_serve(struct control *control, const struct pollfd *polled,
		   void (*answer)(void *context, const char *request,
				  char reply[CONTROL_LINE]),
		   void *context)
{
	/* From the last on: a dropped client moves only the clients behind it. */
	for (int i = control->clients - 1; i >= 0; i--)
		if (polled[1 + i].revents &&
		    !serve_client(control->client[i], answer, context))
			drop(control, i);
	if (polled[0].revents)
		take_client(control);
}

/* --- asking ----------------------------------------------------------------------------- */

static int ask_at(int fd, const char *path, const char *request, int wait_ms,
		  char reply[CONTROL_LINE])
{
	const struct timeval patience = {.tv_sec = wait_ms / 1000,
					 .tv_usec = wait_ms % 1000 * 1000};
	struct sockaddr_un address = {.sun_family = AF_UNIX};
	ssize_t n;

	if (strlen(path) >= sizeof(address.sun_path))
		return -ENAMETOOLONG;
	strcpy(address.sun_path, path);
	setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
	setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
	if (connect(fd, (struct sockaddr *)&address, sizeof(address)) ||
	    send(fd, request, strlen(request), MSG_NOSIGNAL) < 0)
		return -errno;
	n = recv(fd, reply, CONTROL_LINE - 1, 0);
	if (n <= 0)
		return n ? -errno : -ECONNRESET;
	reply[n] = 0;
	reply[strcspn(reply, "\n")] = 0;
	return 0;
}

int control_ask(const char *path, const char *request, int wait_ms,
		char reply[CONTROL_LINE])
{
	int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0), rc;

	if (fd < 0)
		return -errno;
	rc = ask_at(fd, path, request, wait_ms, reply);
	close(fd);
	return rc;
}
