/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The page of a browser and its WebSocket, in a thread of its own:
 *
 *     serving thread ── message ──▶ queue of each visitor ──▶ browser      a full queue loses its oldest
 *                    ◀── order ────────────────────────────── browser      with the second token
 *     the thread itself ◀── part, frame of a file ──────────── browser
 *
 * The page holds no data and is open to all who reach the address. Its WebSocket is not: the host of
 * the request must be an address or localhost, its origin this host, and its first message the token.
 */
#ifndef INCISE_TOOLS_HTTP_SERVER_H
#define INCISE_TOOLS_HTTP_SERVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <jansson.h>
#include "../web/web.h"

#define HTTP_VISITORS 16
#define HTTP_REQUEST 4096 /* bytes of a message of a visitor */
#define HTTP_REPLY 300

struct http_server;

struct http_server_setup {
	const char *address;   /* [ADDR:]PORT; without ADDR this machine only */
	bool control;	       /* a second token allows orders */
	struct web_file *file; /* the viewer's; NULL: live */
	char *head;	       /* JSON for each visitor, live; the server frees it */
	int wake;	       /* an eventfd that is written when an order waits */
	/* An address of before, whose tokens stay, and whose port where the address has 0; or NULL. */
	const char *before;
};

/* Start, or fail the program. */
struct http_server *http_server_new(const struct http_server_setup *setup);

/* "http://127.0.0.1:8080/#TOKEN", with control "#TOKEN.CONTROL": a secret; free(3). */
char *http_server_url(const struct http_server *server);

/* Whether anybody listens. */
bool http_server_has_visitors(struct http_server *server);

/* For all who listen: text of JSON, or a frame with its header of 24 bytes. Copied. */
void http_server_text(struct http_server *server, const char *text);
void http_server_frame(struct http_server *server, double t_s,
		       const struct pixels *pixels);

/* An order; id and visitor are for the reply. */
struct http_order {
	uint64_t visitor;
	json_int_t id;
	char what[16], text[200];
};

/* Take the oldest order; false: there is none. And answer it: @error or a text. */
bool http_server_order(struct http_server *server, struct http_order *order);
void http_server_reply(struct http_server *server, const struct http_order *order,
		       bool error, const char *text);

struct http_counts {
	uint64_t visitors, refused, sent, lost, requests;
	int now;
};
struct http_counts http_server_counts(struct http_server *server);

/* "127.0.0.1:8080" */
const char *http_server_address(const struct http_server *server);

/* End the thread. */
void http_server_free(struct http_server *server);

#endif
