/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * TCP clients that are sent messages and cannot slow each other: each has a queue of its own,
 * and a full queue loses its oldest messages.
 *
 *     message, shared ─┬─▶ queue of client 1 ─▶ its socket
 *                      └─▶ queue of client 2 ─▶ its socket      at most CLIENTS_MOST
 *
 * Bounds, for any clients: CLIENT_WAITING messages and one frame wait for each; the kernel
 * holds CLIENT_SOCKET bytes; CLIENT_RECEIVED bytes a second are read from each.
 */
#ifndef INCISE_TOOLS_SERVE_CLIENTS_H
#define INCISE_TOOLS_SERVE_CLIENTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <jansson.h>

#define CLIENTS_MOST 32
#define CLIENT_WAITING 64 /* of each kind; of a large one, 1 */
#define CLIENT_QUEUE 256  /* of all kinds */
#define CLIENT_SOCKET \
	(256 * 1024) /* bytes that wait in the kernel; it takes twice that */
#define CLIENT_RECEIVED (64 * 1024) /* bytes a second */

/* A message to one client or many. */
struct message;
struct message *message_new(int kind, bool large, size_t capacity);
uint8_t *message_bytes(struct message *message);
void message_set_size(struct message *message, size_t n);
/* It is shared: its maker drops it, too. */
void message_drop(struct message *message);

struct clients;
struct client;

struct clients_setup {
	const char *address; /* [ADDR:]PORT; without ADDR this machine only */
	double idle_s;	     /* a client that stands still for so long is closed */
	/*
	 * A client came; bytes came from it. A text closes the client: why. @user is the
	 * pointer that opened() sets.
	 */
	void *(*opened)(void *context, struct client *client);
	const char *(*received)(void *context, struct client *client, void *user,
				const uint8_t *bytes, size_t n);
	/* Whether it is in the middle of a message that it sends. */
	bool (*inside)(void *user);
	void (*closed)(void *user);
	/* CLIENTS_MOST are connected: the answer to one more. Returns its size. */
	size_t (*full)(void *context, uint8_t *bytes, size_t capacity);
	void *context;
};

/* Listen, or fail the program. */
struct clients *clients_new(const struct clients_setup *setup);
/* The address in use, with its port: "127.0.0.1:18944". */
const char *clients_address(const struct clients *clients);
int clients_fd(const struct clients *clients);
void clients_work(struct clients *clients);
void clients_tick(struct clients *clients, int64_t now_ns);
/* Call @each for all that are connected. */
void clients_each(struct clients *clients,
		  void (*each)(void *context, struct client *client, void *user),
		  void *context);
/* Put it in the client's queue, where the oldest of that kind may be lost for it. */
void clients_send(struct client *client, struct message *message);
/* Send the waiting bytes, of each client in one system call. clients_work() does so, too. */
void clients_flush(struct clients *clients);
bool clients_are_empty(const struct clients *clients);
int clients_summary(const struct clients *clients, char *text, size_t size);
json_t *clients_report(const struct clients *clients);
void clients_print(const struct clients *clients);
/* Close all; before the report, which has those that are closed. */
void clients_close(struct clients *clients, const char *why);
void clients_free(struct clients *clients);

#endif
