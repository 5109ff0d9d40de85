// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Commands and answers over a line; see polhemus_dialogue.h.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "polhemus_dialogue.h"

#define QUIET_MS 120   /* without a byte: it has ended; 10 records at 120 Hz */
#define ANSWER_MS 1000 /* the manual gives none; a system cycle is 8 ms */
#define WAIT_MS 20
#define HEARD_MS 5 /* what a read counts that brought bytes: they may never end */
/* What does not stop for so long does not stop: 4 records at 9600 baud take 0.14 s. */
#define ENDLESS_NS INT64_C(500000000)

/* All of it, from the first byte that was heard; see the test of a slow line. */
#define WHOLE_NS INT64_C(15000000000)

static int gone(struct polhemus_dialogue *d, int rc)
{
	return incise_error_set(d->err, -rc,
				"%s: the tracker at %s went away while it was set up: "
				"check its cable and power",
				d->where, d->line->name);
}

int polhemus_say(struct polhemus_dialogue *d, const char *command)
{
	int rc = d->line->ops->write(d->line, command, strlen(command));

	return rc ? gone(d, rc) : 0;
}

/* How many bytes came; @t_ns, when there are some: when. */
static ssize_t listen_at(struct polhemus_dialogue *d, int timeout_ms, int64_t *t_ns)
{
	ssize_t n;

	if (d->line->stop && atomic_load(d->line->stop))
		return gone(d, -ECANCELED);
	if (d->n == sizeof(d->bytes))
		d->n = 0;
	n = d->line->ops->read(d->line, d->bytes + d->n, sizeof(d->bytes) - d->n, t_ns,
			       timeout_ms);
	if (n < 0)
		return gone(d, (int)n);
	if (n && !d->first_ns)
		d->first_ns = *t_ns;
	if (n && *t_ns - d->first_ns > WHOLE_NS)
		return incise_error_set(
			d->err, EIO,
			"%s: the tracker at %s was not set up after 15 s, so slowly does "
			"it answer: see its baud rate, or what else is at that line",
			d->where, d->line->name);
	d->n += (size_t)n;
	return n;
}

static ssize_t listen(struct polhemus_dialogue *d, int timeout_ms)
{
	int64_t t_ns;

	return listen_at(d, timeout_ms, &t_ns);
}

/* By the time of what comes: a byte now and then is no end either. */
int polhemus_drain(struct polhemus_dialogue *d)
{
	int64_t first_ns = 0, t_ns = 0;

	for (bool first = true;; first = false) {
		ssize_t n;

		d->n = 0;
		n = listen_at(d, QUIET_MS, &t_ns);
		if (n <= 0)
			return (int)n;
		if (first)
			first_ns = t_ns;
		if (t_ns - first_ns > ENDLESS_NS)
			return -EBUSY;
	}
}

int polhemus_collect(struct polhemus_dialogue *d)
{
	int64_t first_ns = 0, t_ns = 0;

	d->n = 0;
	for (bool first = true;; first = false) {
		ssize_t n = listen_at(d, QUIET_MS, &t_ns);

		if (n < 0)
			return (int)n;
		if (first)
			first_ns = t_ns;
		if (!n || d->n == sizeof(d->bytes) || t_ns - first_ns > ENDLESS_NS)
			return (int)d->n;
	}
}

void polhemus_print(char *text, size_t size, const char *command)
{
	size_t n = 0;

	for (; *command && n + 3 < size; command++) {
		if (*command == '\r')
			continue;
		if ((unsigned char)*command < ' ') {
			text[n++] = '^';
			text[n++] = (char)(*command + '@');
		} else {
			text[n++] = *command;
		}
	}
	text[n] = '\0';
}

int polhemus_not_taken(struct polhemus_dialogue *d, const char *what, const char *got)
{
	return incise_error_set(d->err, EIO,
				"%s: the tracker at %s did not take %s: it says \"%s\"; "
				"switch it off and on, and try again",
				d->where, d->line->name, what, got);
}

static int refused(struct polhemus_dialogue *d, const char *command, const char *said)
{
	char text[40];

	polhemus_print(text, sizeof(text), command);
	return incise_error_set(
		d->err, EINVAL,
		"%s: the tracker at %s refuses the command %s: \"%s\"; its "
		"firmware may be too old",
		d->where, d->line->name, text, said);
}

/* The first line in d->bytes, without its end, and out of there; false: there is none. */
static bool next_line(struct polhemus_dialogue *d, char *text, size_t size)
{
	unsigned char *end = memchr(d->bytes, '\n', d->n);
	size_t n, length;

	if (!end)
		return false;
	length = (size_t)(end - d->bytes);
	n = length && d->bytes[length - 1] == '\r' ? length - 1 : length;
	/* What is not text stands before it: a record's end. */
	if (n >= size)
		n = size - 1;
	for (size_t i = 0; i < n; i++)
		text[i] = d->bytes[i] ? (char)d->bytes[i] : '?';
	text[n] = '\0';
	d->n -= length + 1;
	memmove(d->bytes, end + 1, d->n);
	return true;
}

int polhemus_ask(struct polhemus_dialogue *d, const char *command, char type, char *reply)
{
	char text[POLHEMUS_REPLY_MAX + 3];
	int waited = 0, rc;

	d->n = 0;
	rc = polhemus_say(d, command);
	while (!rc && waited < ANSWER_MS) {
		ssize_t n = listen(d, WAIT_MS);

		if (n < 0)
			return (int)n;
		/* What comes and comes is no answer either. */
		waited += n ? HEARD_MS : WAIT_MS;
		while (next_line(d, text, sizeof(text))) {
			if (strstr(text, "*ERROR*"))
				return refused(d, command, text);
			if (text[0] != '2' || !text[1] || text[2] != type)
				continue;
			strcpy(reply, text + 3);
			return 0;
		}
	}
	return rc ? rc : -ETIMEDOUT;
}

int polhemus_ask_status(struct polhemus_dialogue *d, struct polhemus_status *status)
{
	unsigned char bytes[POLHEMUS_STATUS_LENGTH];
	char reply[POLHEMUS_REPLY_MAX];
	int rc = polhemus_ask(d, "S", 'S', reply);

	if (rc)
		return rc;
	if (strlen(reply) != POLHEMUS_STATUS_LENGTH - 5)
		return polhemus_not_taken(d, "S", reply);
	/* Which station it is about was looked at, and does not matter. */
	memcpy(bytes, "21S", 3);
	memcpy(bytes + 3, reply, POLHEMUS_STATUS_LENGTH - 5);
	memcpy(bytes + POLHEMUS_STATUS_LENGTH - 2, "\r\n", 2);
	if (!polhemus_status_read(bytes, sizeof(bytes), status))
		return polhemus_not_taken(d, "S", reply);
	return 0;
}

int polhemus_ask_frame(struct polhemus_dialogue *d, const char *command,
		       unsigned char type, struct polhemus_frame *frame)
{
	char said[24];
	size_t at = 0;
	int waited = 0, rc;

	d->n = 0;
	rc = polhemus_say(d, command);
	while (!rc && waited < ANSWER_MS) {
		size_t before = d->n;
		ssize_t n = listen(d, WAIT_MS);

		if (n < 0)
			return (int)n;
		waited += n ? HEARD_MS : WAIT_MS;
		/* listen() began at the front again. */
		if (d->n < before + (size_t)n)
			at = 0;
		while (at < d->n) {
			int is = polhemus_frame_read(d->bytes + at, d->n - at, frame);

			if (!is)
				break;
			at += is > 0 ? frame->length : 1;
			if (is > 0 && frame->error && frame->error != ' ') {
				snprintf(said, sizeof(said), "error %#x", frame->error);
				return refused(d, command, said);
			}
			if (is > 0 && frame->command == type)
				return 0;
		}
	}
	return rc ? rc : -ETIMEDOUT;
}
