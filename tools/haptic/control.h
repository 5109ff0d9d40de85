/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The control socket of a loop, beside its state page: orders of other programs, a line each way.
 * incise-haptic(1) has the protocol.
 *
 *     client ── "tool tube" ──▶ NAME.control ──▶ supervisor ──▶ loop
 *            ◀── "ok held=blade wanted=tube" ──
 */
#ifndef INCISE_HAPTIC_CONTROL_H
#define INCISE_HAPTIC_CONTROL_H

#include <poll.h>
#include <incise/error.h>

#define CONTROL_LINE 256  /* bytes of a request or a reply, with its 0 */
#define CONTROL_CLIENTS 8 /* at once; a further one takes the place of the oldest */
#define CONTROL_POLLED (1 + CONTROL_CLIENTS)

struct control;

/* The socket's path for a page: NAME.control for NAME.state. free(3). */
char *control_path(const char *page);

/*
 * Listen beside the page, which this process must have made: an existing socket belongs to a loop
 * that has ended, and is replaced. The owner may connect, and in a folder that gives its group to
 * new files (set-group-ID, as /run/incise) the group. NULL with errno and @err.
 */
struct control *control_new(const char *page, struct incise_error *err);

/* Fill in the descriptors to poll, CONTROL_POLLED at most. Returns how many. */
int control_polled(const struct control *control, struct pollfd *polled);

/*
 * Answer the requests that have come. Never waits: a client that does not take its answer is
 * dropped. A request is printable; the answer is too, and without the end of its line.
 */
void control_serve(struct control *control, const struct pollfd *polled,
		   void (*answer)(void *context, const char *request,
				  char reply[CONTROL_LINE]),
		   void *context);

/*
 * Ask a loop at its socket's path, as another program: one line each way. A loop that lives answers
 * within 0.1 s. Returns 0; -ECONNREFUSED or -ENOENT (no loop listens), -EAGAIN (it
 * does not answer), -ECONNRESET (it has ended meanwhile, or too many ask it), or of connect(2).
 */
int control_ask(const char *path, const char *request, int wait_ms,
		char reply[CONTROL_LINE]);

/* Close, and remove the socket. NULL is accepted. */
void control_free(struct control *control);

#endif
