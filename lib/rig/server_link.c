// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The connection to a server; see server_link.h.
 */
#include <errno.h>
#include <limits.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "server_link.h"

#define CONNECT_MS 2000

int server_link_wait(const struct server_link *link, int fd, short events, int64_t ms)
{
	struct pollfd on[2] = {{.fd = link->stop, .events = POLLIN},
			       {.fd = fd, .events = events}};
	int n = poll(on, 2, ms < 0 ? 0 : ms > INT_MAX ? INT_MAX : (int)ms);

	if (n > 0 && on[0].revents)
		return -ECANCELED;
	return n > 0;
}

/* A peer that lost its power or its cable does not close: the kernel asks it, and gives up. */
static void watch_peer(int fd)
{
	static const struct {
		int level, option, value;
	} options[] = {
		{SOL_SOCKET, SO_KEEPALIVE, 1},	{IPPROTO_TCP, TCP_NODELAY, 1},
		{IPPROTO_TCP, TCP_KEEPIDLE, 2}, {IPPROTO_TCP, TCP_KEEPINTVL, 1},
		{IPPROTO_TCP, TCP_KEEPCNT, 3},
	};

	/* An error leaves the silence, which ends it later. */
	for (size_t i = 0; i < sizeof(options) / sizeof(*options); i++)
		setsockopt(fd, options[i].level, options[i].option, &options[i].value,
			   sizeof(options[i].value));
}

int server_link_start(struct server_link *link)
{
	int rc = 0, fd = socket(link->address.ss_family,
				SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);

	if (fd < 0)
		return -errno;
	link->fd = fd;
	watch_peer(fd);
	if (connect(fd, (const struct sockaddr *)&link->address, link->address_n) &&
	    errno != EINPROGRESS) {
		rc = -errno;
		server_link_close(link);
	}
	return rc;
}

int server_link_connect(struct server_link *link)
{
	socklen_t size = sizeof(int);
	int code = 0, rc = server_link_start(link);

	if (rc)
		return rc;
	rc = server_link_wait(link, link->fd, POLLOUT, CONNECT_MS);
	rc = rc == 1 ? 0 : rc ? rc : -ETIMEDOUT;
	if (!rc && !getsockopt(link->fd, SOL_SOCKET, SO_ERROR, &code, &size))
		rc = -code;
	if (rc)
		server_link_close(link);
	return rc;
}

void server_link_close(struct server_link *link)
{
	if (link->fd >= 0)
		close(link->fd);
	link->fd = -1;
}

int server_link_parse(struct server_link *link, const char *text, int port,
		      const char **rest)
{
	bool bracket = *text == '[';
	const char *host = text + bracket;
	size_t host_n = strcspn(host, bracket ? "]" : ":");
	const char *colon = host + host_n + (bracket && host[host_n]);
	size_t port_n = *colon == ':' ? strcspn(colon + 1, ":") : 0;
	long number = port_n ? strtol(colon + 1, NULL, 10) : port;

	if (!host_n || (bracket && !host[host_n]) || host_n >= sizeof(link->host) ||
	    (*colon && !port_n))
		return -EINVAL;
	if (port_n &&
	    (strspn(colon + 1, "0123456789") != port_n || number < 1 || number > 65535))
		return -ERANGE;
	*rest = port_n ? colon + 1 + port_n : colon;
	snprintf(link->host, sizeof(link->host), "%.*s", (int)host_n, host);
	snprintf(link->port, sizeof(link->port), "%ld", number);
	return 0;
}

int server_link_find(struct server_link *link, const char *protocol, const char *where,
		     struct incise_error *err)
{
	struct addrinfo hints = {.ai_socktype = SOCK_STREAM}, *found = NULL, *one;
	int rc = getaddrinfo(link->host, link->port, &hints, &found), failed = -ENODEV;

	if (rc)
		return incise_error_set(
			err, ENODEV,
			"%s: the host %.100s cannot be found: %s; correct its name",
			where, link->host, gai_strerror(rc));
	for (one = found; one && link->fd < 0; one = one->ai_next) {
		memcpy(&link->address, one->ai_addr, one->ai_addrlen);
		link->address_n = one->ai_addrlen;
		failed = server_link_connect(link);
	}
	freeaddrinfo(found);
	return link->fd >= 0
		       ? 0
		       : incise_error_set(err, -failed,
					  "%s: %.100s port %s: %s; start its %s server, "
					  "and check host and port",
					  where, link->host, link->port,
					  strerror(-failed), protocol);
}
