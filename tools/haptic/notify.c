// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a service tells its manager; see notify.h.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>
#include "notify.h"

/* The socket's address; 0 where there is none, or none that can be. */
static socklen_t address(struct sockaddr_un *to)
{
	const char *path = getenv("NOTIFY_SOCKET");
	size_t length = path ? strlen(path) : 0;

	if (!length || length >= sizeof(to->sun_path) || (*path != '/' && *path != '@'))
		return 0;
	*to = (struct sockaddr_un){.sun_family = AF_UNIX};
	memcpy(to->sun_path, path, length);
	/* One without a file: its name begins with a 0. */
	if (*path == '@')
		to->sun_path[0] = 0;
	return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
}

void notify_send(const char *fmt, ...)
{
	struct sockaddr_un to;
	socklen_t size = address(&to);
	char text[1024];
	va_list args;
	int length, fd;

	if (!size)
		return;
	va_start(args, fmt);
	length = vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	if (fd < 0)
		return;
	if (length >= (int)sizeof(text))
		length = sizeof(text) - 1;
	if (length > 0)
		sendto(fd, text, (size_t)length, MSG_NOSIGNAL | MSG_DONTWAIT,
		       (struct sockaddr *)&to, size);
	close(fd);
}

void notify_reloading(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	notify_send("RELOADING=1\nMONOTONIC_USEC=%lld",
		    now.tv_sec * 1000000LL + now.tv_nsec / 1000);
}

int64_t notify_watchdog_ns(void)
{
	const char *us = getenv("WATCHDOG_USEC"), *pid = getenv("WATCHDOG_PID");
	long long value = us ? strtoll(us, NULL, 10) : 0;

	/* A parent's is not ours. */
	if (pid && strtoll(pid, NULL, 10) != getpid())
		return 0;
	return value > 0 && value < INT64_MAX / 1000 ? value * 1000 : 0;
}
