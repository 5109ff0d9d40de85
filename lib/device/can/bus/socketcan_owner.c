// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Who drives a node of an interface; see socketcan_owner.h.
 */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include "socketcan_owner.h"

int can_owner_take(const char *interface, uint8_t node, const char *where,
		   struct incise_error *err)
{
	struct sockaddr_un name = {.sun_family = AF_UNIX};
	int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0), code, n;

	if (fd < 0)
		return incise_error_set(err, EIO, "%s: socket: %s", where,
					strerror(errno));
	n = snprintf(name.sun_path + 1, sizeof(name.sun_path) - 1, "incise-can/%.40s/%u",
		     interface, node);
	if (!bind(fd, (struct sockaddr *)&name,
		  (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 + (size_t)n)))
		return fd;
	code = errno;
	close(fd);
	if (code == EADDRINUSE)
		return incise_error_set(
			err, EBUSY,
			"%s: another program drives it: end that first (ss -xap shows the "
			"one with @%s)",
			where, name.sun_path + 1);
	return incise_error_set(err, EIO, "%s: bind: %s", where, strerror(code));
}
