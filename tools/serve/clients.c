// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * TCP clients with bounded queues; see clients.h.
 */
#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "clients.h"
#include "serve.h"

#define NS 1000000000LL
#define EVENTS 64
#define LISTENERS 4 /* addresses of one name */
#define PAST 64	    /* closed clients in the report */
#define GATHER 16   /* messages in one system call */

struct message {
	int refs, kind;
	bool large;
	size_t n;
	uint8_t bytes[];
};

struct client {
	struct clients *clients;
	int fd;
	unsigned int events; /* that are waited for */
	void *user;
	char address[72];
	int64_t opened_ns;

	struct message *queue[CLIENT_QUEUE]; /* a ring: the first may have begun */
	int first, waiting;
	size_t begun;	     /* bytes of the first that left */
	int64_t moved_ns;    /* when bytes left, or no bytes waited */
	uint64_t sent, lost; /* messages */

	uint64_t received; /* bytes */
	size_t window;	   /* of them in this second */
	int64_t window_ns, inside_ns;
	char why[100]; /* to close it; "" not */
};

/* A client that is gone, for the report. */
struct past {
	char address[72], why[100];
	double seconds;
	uint64_t sent, lost, received;
};

struct clients {
	struct clients_setup setup;
	int epoll, listener[LISTENERS], listeners;
	char address[80];
	struct client *client[CLIENTS_MOST];
	int n;
	uint64_t accepted, refused, sent, lost;
	struct past past[PAST];
	int n_past;
	uint64_t left_out;
};

/* --- messages ------------------------------------------------------------------------ */

struct message *message_new(int kind, bool large, size_t capacity)
{
	struct message *message = cli_alloc(1, sizeof(*message) + capacity);

	message->refs = 1;
	message->kind = kind;
	message->large = large;
	message->n = capacity;
	return message;
}

uint8_t *message_bytes(struct message *message)
{
	return message->bytes;
}

void message_set_size(struct message *message, size_t n)
{
	message->n = n;
}

void message_drop(struct message *message)
{
	if (!--message->refs)
		free(message);
}

static struct message **find_client_message(struct client *client, int i)
{
	return &client->queue[(client->first + i) % CLIENT_QUEUE];
}

/* --- one client ---------------------------------------------------------------------- */

static void set_events(struct client *client)
{
	unsigned int events = (client->window < CLIENT_RECEIVED ? EPOLLIN : 0) |
			      (client->waiting ? EPOLLOUT : 0);
	struct epoll_event event = {.events = events, .data.ptr = client};

	if (events == client->events)
		return;
	client->events = events;
	epoll_ctl(client->clients->epoll, EPOLL_CTL_MOD, client->fd, &event);
}

/* It is closed in clients_work() or clients_tick(), not under the feet of a caller. */
static void doom(struct client *client, const char *why)
{
	if (!*client->why)
		snprintf(client->why, sizeof(client->why), "%s", why);
}

/* Send as much as the socket takes. */
static void flush(struct client *client)
{
	while (client->waiting && !*client->why) {
		struct iovec parts[GATHER];
		struct msghdr gathered = {.msg_iov = parts};
		struct message *message;
		ssize_t n;

		for (int i = 0; i < client->waiting && i < GATHER; i++) {
			message = *find_client_message(client, i);
			parts[gathered.msg_iovlen++] =
				(struct iovec){message->bytes, message->n};
		}
		parts[0].iov_base = (uint8_t *)parts[0].iov_base + client->begun;
		parts[0].iov_len -= client->begun;
		n = sendmsg(client->fd, &gathered, MSG_NOSIGNAL | MSG_DONTWAIT);
		if (n < 0 && errno == EINTR)
			continue;
		if (n < 0 && errno == EAGAIN)
			break;
		if (n < 0) {
			doom(client, strerror(errno));
			break;
		}
		client->moved_ns = cli_now_ns();
		client->begun += (size_t)n;
		while (client->waiting &&
		       client->begun >= (message = *find_client_message(client, 0))->n) {
			client->begun -= message->n;
			client->first = (client->first + 1) % CLIENT_QUEUE;
			client->waiting--;
			client->sent++;
			client->clients->sent++;
			message_drop(message);
		}
	}
	set_events(client);
}

static void lose(struct client *client, int i)
{
	message_drop(*find_client_message(client, i));
	for (; i < client->waiting - 1; i++)
		*find_client_message(client, i) = *find_client_message(client, i + 1);
	client->waiting--;
	client->lost++;
	client->clients->lost++;
}

/* Make place for a message of this kind: the oldest one goes that has not begun. */
static void make_place(struct client *client, const struct message *message)
{
	int most = message->large ? 1 : CLIENT_WAITING, same = 0, oldest = -1;

	for (int i = client->begun ? 1 : 0; i < client->waiting; i++) {
		if ((*find_client_message(client, i))->kind != message->kind)
			continue;
		oldest = same++ ? oldest : i;
	}
	if (same >= most)
		lose(client, oldest);
	else if (client->waiting == CLIENT_QUEUE)
		lose(client, client->begun ? 1 : 0);
}

void clients_send(struct client *client, struct message *message)
{
	if (*client->why)
		return;
	if (!client->waiting)
		client->moved_ns = cli_now_ns();
	make_place(client, message);
	message->refs++;
	*find_client_message(client, client->waiting++) = message;
	/* Nothing is lost for want of a flush. */
	if ((message->large || client->waiting >= GATHER) && !(client->events & EPOLLOUT))
		flush(client);
}

void clients_flush(struct clients *clients)
{
	for (int i = 0; i < clients->n; i++)
		if (clients->client[i]->waiting &&
		    !(clients->client[i]->events & EPOLLOUT))
			flush(clients->client[i]);
}

static void receive_clients(struct client *client)
{
	struct clients *clients = client->clients;
	uint8_t bytes[4096];
	const char *why;
	ssize_t n;

	/* One part at a time: the next client is next. */
	n = recv(client->fd, bytes, sizeof(bytes), MSG_DONTWAIT);
	if (n < 0 && (errno == EAGAIN || errno == EINTR))
		return;
	if (n <= 0) {
		doom(client, n ? strerror(errno) : "it has left");
		return;
	}
	client->received += (uint64_t)n;
	client->window += (size_t)n;
	why = clients->setup.received(clients->setup.context, client, client->user, bytes,
				      (size_t)n);
	if (why)
		doom(client, why);
	else
		set_events(client);
}

static void close_client(struct clients *clients, int i)
{
	struct client *client = clients->client[i];
	struct past past = {.seconds = (cli_now_ns() - client->opened_ns) / 1e9,
			    .sent = client->sent,
			    .lost = client->lost + (uint64_t)client->waiting,
			    .received = client->received};

	cli_note("%s: closed: %s; %llu messages sent, %llu lost", client->address,
		 client->why, (unsigned long long)past.sent,
		 (unsigned long long)past.lost);
	snprintf(past.address, sizeof(past.address), "%s", client->address);
	snprintf(past.why, sizeof(past.why), "%s", client->why);
	if (clients->n_past < PAST)
		clients->past[clients->n_past++] = past;
	else
		clients->left_out++;
	clients->lost += (uint64_t)client->waiting;
	while (client->waiting) {
		message_drop(*find_client_message(client, 0));
		client->first = (client->first + 1) % CLIENT_QUEUE;
		client->waiting--;
	}
	clients->setup.closed(client->user);
	close(client->fd);
	free(client);
	clients->client[i] = clients->client[--clients->n];
}

static void close_doomed(struct clients *clients)
{
	for (int i = clients->n - 1; i >= 0; i--)
		if (*clients->client[i]->why)
			close_client(clients, i);
}

/* --- all of them --------------------------------------------------------------------- */

/* "127.0.0.1:18944", "[::1]:18944". */
static void address_text(const struct sockaddr *address, socklen_t n, char *text,
			 size_t size)
{
	char host[48], port[8];

	if (getnameinfo(address, n, host, sizeof(host), port, sizeof(port),
			NI_NUMERICHOST | NI_NUMERICSERV))
		snprintf(text, size, "?");
	else
		snprintf(text, size, address->sa_family == AF_INET6 ? "[%s]:%s" : "%s:%s",
			 host, port);
}

static void set_option(int fd, int level, int name, int value)
{
	/* Where it cannot be set, the timeouts of this program remain. */
	setsockopt(fd, level, name, &value, sizeof(value));
}

/* Unread bytes would make close() a reset, which takes the answer with it. */
static void refuse_clients(struct clients *clients, int fd)
{
	uint8_t bytes[1024];
	size_t n;

	recv(fd, bytes, sizeof(bytes), MSG_DONTWAIT);
	n = clients->setup.full(clients->setup.context, bytes, sizeof(bytes));
	if (send(fd, bytes, n, MSG_NOSIGNAL | MSG_DONTWAIT) != (ssize_t)n)
		cli_note("the reason could not be sent to it");
	close(fd);
	clients->refused++;
}

static void accept_one(struct clients *clients, int listener)
{
	struct sockaddr_storage from;
	socklen_t n = sizeof(from);
	struct client *client;
	struct epoll_event event = {.events = EPOLLIN};
	int fd = accept4(listener, (struct sockaddr *)&from, &n,
			 SOCK_NONBLOCK | SOCK_CLOEXEC);

	if (fd < 0)
		return;
	if (clients->n == CLIENTS_MOST) {
		char address[72];

		address_text((struct sockaddr *)&from, n, address, sizeof(address));
		cli_note("%s: refused: %d clients are connected", address, CLIENTS_MOST);
		refuse_clients(clients, fd);
		return;
	}
	set_option(fd, IPPROTO_TCP, TCP_NODELAY, 1);
	set_option(fd, SOL_SOCKET, SO_SNDBUF, CLIENT_SOCKET);
	set_option(fd, SOL_SOCKET, SO_RCVBUF, 2 * 4096);
	/* A machine that has vanished. */
	set_option(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
	set_option(fd, IPPROTO_TCP, TCP_KEEPIDLE, 10);
	set_option(fd, IPPROTO_TCP, TCP_KEEPINTVL, 5);
	set_option(fd, IPPROTO_TCP, TCP_KEEPCNT, 4);
	client = cli_alloc(1, sizeof(*client));
	client->clients = clients;
	client->fd = fd;
	client->events = EPOLLIN;
	client->opened_ns = client->moved_ns = client->window_ns = client->inside_ns =
		cli_now_ns();
	address_text((struct sockaddr *)&from, n, client->address,
		     sizeof(client->address));
	client->user = clients->setup.opened(clients->setup.context, client);
	event.data.ptr = client;
	if (!client->user || epoll_ctl(clients->epoll, EPOLL_CTL_ADD, fd, &event)) {
		if (client->user)
			clients->setup.closed(client->user);
		close(fd);
		free(client);
		clients->refused++;
		return;
	}
	clients->accepted++;
	clients->client[clients->n++] = client;
	cli_note("%s: connected", client->address);
}

void clients_work(struct clients *clients)
{
	struct epoll_event events[EVENTS];
	int n = epoll_wait(clients->epoll, events, EVENTS, 0);

	for (int i = 0; i < n; i++) {
		struct client *client = events[i].data.ptr;
		bool listener = false;

		for (int k = 0; k < clients->listeners; k++)
			if (events[i].data.ptr == &clients->listener[k]) {
				accept_one(clients, clients->listener[k]);
				listener = true;
			}
		if (listener)
			continue;
		if (events[i].events & EPOLLOUT)
			flush(client);
		if (events[i].events & EPOLLIN)
			receive_clients(client);
		else if (events[i].events & (EPOLLERR | EPOLLHUP))
			doom(client, "the connection broke");
	}
	clients_flush(clients);
	close_doomed(clients);
}

/* Ten times a second: find clients that stand still, and allow a new second of received bytes. */
void clients_tick(struct clients *clients, int64_t now_ns)
{
	int64_t idle_ns = (int64_t)(clients->setup.idle_s * 1e9);

	for (int i = 0; i < clients->n; i++) {
		struct client *client = clients->client[i];

		if (!client->waiting)
			client->moved_ns = now_ns;
		if (now_ns - client->moved_ns > idle_ns)
			doom(client, "it took nothing for too long");
		if (!clients->setup.inside(client->user))
			client->inside_ns = now_ns;
		if (now_ns - client->inside_ns > idle_ns)
			doom(client, "it began a message and did not end it");
		if (now_ns - client->window_ns >= NS) {
			client->window_ns = now_ns;
			client->window = 0;
			set_events(client);
		}
	}
	close_doomed(clients);
}

int clients_fd(const struct clients *clients)
{
	return clients->epoll;
}

const char *clients_address(const struct clients *clients)
{
	return clients->address;
}

void clients_each(struct clients *clients,
		  void (*each)(void *context, struct client *client, void *user),
		  void *context)
{
	for (int i = 0; i < clients->n; i++)
		each(context, clients->client[i], clients->client[i]->user);
}

bool clients_are_empty(const struct clients *clients)
{
	for (int i = 0; i < clients->n; i++)
		if (clients->client[i]->waiting)
			return false;
	return true;
}

/* --- listening ----------------------------------------------------------------------- */

/* Cut "[ADDR:]PORT" into its parts, in place. */
static void split(const char *given, char *text, const char **host, const char **port)
{
	char *colon = strrchr(text, ':'), *end;

	*host = "127.0.0.1";
	*port = text;
	if (colon) {
		*colon = 0;
		*host = text;
		*port = colon + 1;
		end = text + strlen(text);
		if (*text == '[' && end[-1] == ']') {
			end[-1] = 0;
			++*host;
		} else if (strchr(text, ':')) {
			cli_usage("--igtl: '%s': put an IPv6 address in brackets, as in "
				  "[::1]:18944",
				  given);
		}
	}
	if (!**port || strspn(*port, "0123456789") != strlen(*port) ||
	    strlen(*port) > 5 || atoi(*port) > 65535)
		cli_usage("--igtl: '%s': expected [ADDR:]PORT with a port from 0 to "
			  "65535, for example 127.0.0.1:18944",
			  given);
	if (!**host)
		cli_usage(
			"--igtl: '%s': no address before the port; 0.0.0.0 and [::] are "
			"all",
			given);
}

static int listen_at(const struct addrinfo *at)
{
	int fd = socket(at->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
	int code;

	if (fd < 0)
		return -errno;
	set_option(fd, SOL_SOCKET, SO_REUSEADDR, 1);
	/* [::] is IPv6 only, so that its meaning does not depend on the machine. */
	if (at->ai_family == AF_INET6)
		set_option(fd, IPPROTO_IPV6, IPV6_V6ONLY, 1);
	if (bind(fd, at->ai_addr, at->ai_addrlen) || listen(fd, 16)) {
		code = errno;
		close(fd);
		return -code;
	}
	return fd;
}

struct clients *clients_new(const struct clients_setup *setup)
{
	struct clients *clients = cli_alloc(1, sizeof(*clients));
	struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE},
			*found;
	struct sockaddr_storage bound;
	socklen_t n = sizeof(bound);
	char *text = cli_text("%s", setup->address);
	const char *host, *port;
	int fd = 0, status;

	clients->setup = *setup;
	split(setup->address, text, &host, &port);
	status = getaddrinfo(host, port, &hints, &found);
	if (status)
		cli_fail("--igtl %s: %s; give an address of this machine", setup->address,
			 gai_strerror(status));
	clients->epoll = epoll_create1(EPOLL_CLOEXEC);
	if (clients->epoll < 0)
		cli_fail("epoll: %s", strerror(errno));
	for (struct addrinfo *at = found; at && clients->listeners < LISTENERS;
	     at = at->ai_next) {
		int *listener = &clients->listener[clients->listeners];
		struct epoll_event event = {.events = EPOLLIN, .data.ptr = listener};

		fd = listen_at(at);
		if (fd < 0)
			break;
		*listener = fd;
		clients->listeners++;
		epoll_ctl(clients->epoll, EPOLL_CTL_ADD, fd, &event);
		/* With port 0 each address would have another. */
		if (!strcmp(port, "0"))
			break;
	}
	if (fd < 0)
		cli_fail("--igtl %s: %s%s", setup->address, strerror(-fd),
			 fd == -EADDRINUSE
				 ? "; another program listens there, give another "
				   "port"
			 : fd == -EACCES	? "; give a port above 1023"
			 : fd == -EADDRNOTAVAIL ? "; give an address of this machine"
						: "");
	freeaddrinfo(found);
	free(text);
	if (getsockname(clients->listener[0], (struct sockaddr *)&bound, &n))
		cli_fail("--igtl %s: %s", setup->address, strerror(errno));
	address_text((struct sockaddr *)&bound, n, clients->address,
		     sizeof(clients->address));
	return clients;
}

/* --- reports ------------------------------------------------------------------------- */

int clients_summary(const struct clients *clients, char *text, size_t size)
{
	return snprintf(text, size, "%s, %llu sent, %llu lost",
			cli_count(clients->n, "client"),
			(unsigned long long)clients->sent,
			(unsigned long long)clients->lost);
}

static json_t *past_json(const struct past *past)
{
	return json_pack("{so so sI sI sI so}", "address", json_text(past->address),
			 "seconds", json_number(past->seconds), "sent",
			 (json_int_t)past->sent, "lost", (json_int_t)past->lost,
			 "received_bytes", (json_int_t)past->received, "closed",
			 json_text(past->why));
}

/* At the end all are closed: each is in the past. */
json_t *clients_report(const struct clients *clients)
{
	json_t *list = json_array();

	for (int i = 0; i < clients->n_past; i++)
		json_array_append_new(list, past_json(&clients->past[i]));
	return json_pack("{so sI sI sI sI so sI}", "address", json_text(clients->address),
			 "accepted", (json_int_t)clients->accepted, "refused",
			 (json_int_t)clients->refused, "sent", (json_int_t)clients->sent,
			 "lost", (json_int_t)clients->lost, "clients", list,
			 "clients_left_out", (json_int_t)clients->left_out);
}

void clients_print(const struct clients *clients)
{
	printf("OpenIGTLink on %s: %llu clients, %llu refused, %llu messages sent, %llu "
	       "lost\n",
	       clients->address, (unsigned long long)clients->accepted,
	       (unsigned long long)clients->refused, (unsigned long long)clients->sent,
	       (unsigned long long)clients->lost);
	for (int i = 0; i < clients->n_past; i++) {
		const struct past *past = &clients->past[i];

		printf("  %-21s %8.1f s %10llu sent %8llu lost  %s\n", past->address,
		       past->seconds, (unsigned long long)past->sent,
		       (unsigned long long)past->lost, past->why);
	}
	if (clients->left_out)
		printf("  and %llu more\n", (unsigned long long)clients->left_out);
}

void clients_close(struct clients *clients, const char *why)
{
	for (int i = 0; i < clients->n; i++)
		doom(clients->client[i], why);
	close_doomed(clients);
}

void clients_free(struct clients *clients)
{
	clients_close(clients, "incise serve has ended");
	for (int i = 0; i < clients->listeners; i++)
		close(clients->listener[i]);
	close(clients->epoll);
	free(clients);
}
