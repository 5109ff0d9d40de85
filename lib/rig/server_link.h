/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The connection to a server that devices are behind, by TCP: never blocks but to connect.
 */
#ifndef INCISE_RIG_SERVER_LINK_H
#define INCISE_RIG_SERVER_LINK_H

#include <stdint.h>
#include <sys/socket.h>
#include <incise/error.h>

struct server_link {
	char host[256], port[8];
	struct sockaddr_storage address;
	socklen_t address_n;
	int fd;	  /* or -1 */
	int stop; /* an eventfd that ends each wait, or -1 */
};

/*
 * Take "HOST" or "HOST:PORT", an IPv6 address in brackets; *@rest: behind it, "" or ":…". 0; -EINVAL;
 * -ERANGE: PORT is not from 1 to 65535.
 */
int server_link_parse(struct server_link *link, const char *text, int port,
		      const char **rest);

/* Try each address of the host. 0, or -errno and a message for users of @protocol. */
int server_link_find(struct server_link *link, const char *protocol, const char *where,
		     struct incise_error *err);

/* Connect to the address that was found, within 2 s. 0 or -errno; -ECANCELED: to stop. */
int server_link_connect(struct server_link *link);

/* The same without waiting: it is connected, or has failed, once it has POLLOUT. */
int server_link_start(struct server_link *link);
void server_link_close(struct server_link *link);

/* Until @fd has @events, it is to stop (-ECANCELED), or @ms are over (0). 1: ready. */
int server_link_wait(const struct server_link *link, int fd, short events, int64_t ms);

#endif
