// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Commands to a tracker and its answers; see polhemus_dialogue.h.
 */
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "../../base/hex.h"
#include "polhemus_dialogue.h"
#include "polhemus_model.h"

/* --- parsing --- */

enum { FLAG_BINARY = 1, FLAG_CM = 2, FLAG_COMPENSATED = 4, FLAG_CONTINUOUS = 8 };

/* Copy @n characters without blanks at both ends; unprintable ones become '?'. */
static void copy_text(char *to, const unsigned char *from, size_t n)
{
	while (n && (*from == ' ' || !*from)) {
		from++;
		n--;
	}
	while (n && (from[n - 1] == ' ' || !from[n - 1]))
		n--;
	for (size_t i = 0; i < n; i++)
		to[i] = from[i] >= ' ' && from[i] <= '~' ? (char)from[i] : '?';
	to[n] = '\0';
}

bool polhemus_status_read(const unsigned char *bytes, size_t n,
			  struct polhemus_status *status)
{
	unsigned int flags = 0;
	double error = 0;
	char digits[4] = {0};

	*status = (struct polhemus_status){0};
	if (n != POLHEMUS_STATUS_LENGTH || bytes[0] != '2' || bytes[1] < '1' ||
	    bytes[1] > '4' || bytes[2] != 'S' || bytes[53] != '\r' || bytes[54] != '\n')
		return false;
	for (int i = 3; i < 6; i++) {
		if (incise_hex_digit(bytes[i]) < 0)
			return false;
		flags = flags * 16 + (unsigned int)incise_hex_digit(bytes[i]);
	}
	memcpy(digits, bytes + 6, 3);
	if (polhemus_reply_numbers(digits, &error, 1) < 0)
		return false;
	status->station = bytes[1] - '0';
	status->binary = flags & FLAG_BINARY;
	status->centimetres = flags & FLAG_CM;
	status->compensated = flags & FLAG_COMPENSATED;
	status->continuous = flags & FLAG_CONTINUOUS;
	status->test_error = (int)error;
	status->sensors = incise_hex_digit(bytes[12]);
	copy_text(status->version, bytes + 15, 6);
	copy_text(status->id, bytes + 21, 32);
	return true;
}

/* At most 9 digits in front of the point and up to 16 in all count. */
int polhemus_reply_numbers(const char *text, double *values, int most)
{
	int n = 0;

	for (;;) {
		bool negative = false;
		double value = 0, scale = 1;
		int digits = 0;

		while (*text == ' ')
			text++;
		if (!*text)
			return n;
		if (*text == '-' || *text == '+')
			negative = *text++ == '-';
		for (; isdigit((unsigned char)*text) && digits < 9; text++, digits++)
			value = value * 10 + (*text - '0');
		if (*text == '.')
			for (text++; isdigit((unsigned char)*text); text++) {
				if (digits++ > 15)
					continue;
				scale /= 10;
				value += (*text - '0') * scale;
			}
		if (!digits || n == most)
			return -1;
		values[n++] = negative ? -value : value;
		if (*text && *text != ' ' && *text != '-' && *text != '+' && *text != ',')
			return -1;
		if (*text == ',')
			text++;
	}
}

int polhemus_reply_fields(const char *text, int width, int *values, int most)
{
	size_t length = strlen(text);
	int n = 0;

	if (length % (size_t)width)
		return -1;
	for (; *text; text += width) {
		double value = 0;
		char field[16] = {0};

		memcpy(field, text, (size_t)width);
		if (n == most || polhemus_reply_numbers(field, &value, 1) != 1)
			return -1;
		values[n++] = (int)value;
	}
	return n;
}

int polhemus_frame_read(const unsigned char *b, size_t n, struct polhemus_frame *frame)
{
	size_t length;
	int family;

	if (n && b[0] != 'L' && b[0] != 'P')
		return -1;
	if (n > 1 && !(b[0] == 'L' && b[1] == 'Y') && !(b[0] == 'P' && b[1] == 'A'))
		return -1;
	if (n < 8)
		return 0;
	family = b[0] == 'L' ? POLHEMUS_LIBERTY : POLHEMUS_PATRIOT;
	length = b[6] | (size_t)b[7] << 8;
	if (length + 8 > POLHEMUS_FRAME_MAX)
		return -1;
	if (n < length + 8)
		return 0;
	*frame = (struct polhemus_frame){
		.family = family,
		.station = b[2],
		.command = b[3],
		.error = b[4],
		.payload = b + 8,
		.n = length,
		.length = length + 8,
	};
	return 1;
}

/* --- over a line --- */

#define QUIET_MS 120   /* without a byte ends a stream; 10 records at 120 Hz */
#define ANSWER_MS 1000 /* the manual gives no limit; a system cycle is 8 ms */
#define WAIT_MS 20
#define RECEIVED_MS \
	5 /* counted for a read that received bytes: a stream may be endless */
/* A stream that lasts so long is endless: 4 records at 9600 baud take 0.14 s. */
#define ENDLESS_NS INT64_C(500000000)
/* For the whole dialogue, from the first byte; see the test of a slow line. */
#define WHOLE_NS INT64_C(15000000000)

static int gone(struct polhemus_dialogue *d, int rc)
{
	return incise_error_set(d->err, -rc,
				"%s: the tracker at %s disconnected during set-up; "
				"check its cable and power",
				d->where, d->line->name);
}

int polhemus_say(struct polhemus_dialogue *d, const char *command)
{
	int rc = d->line->ops->write(d->line, command, strlen(command));

	return rc ? gone(d, rc) : 0;
}

/* Number of bytes received, the last at *t_ns. */
static ssize_t receive_at(struct polhemus_dialogue *d, int timeout_ms, int64_t *t_ns)
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
			"%s: the tracker at %s answers so slowly that its set-up "
			"exceeded 15 s; check its baud rate, and other devices on that "
			"line",
			d->where, d->line->name);
	d->n += (size_t)n;
	return n;
}

static ssize_t receive_polhemus_dialogue(struct polhemus_dialogue *d, int timeout_ms)
{
	int64_t t_ns;

	return receive_at(d, timeout_ms, &t_ns);
}

/* By the time of arrival: a byte now and then does not end it. */
int polhemus_drain(struct polhemus_dialogue *d)
{
	int64_t first_ns = 0, t_ns = 0;

	for (bool first = true;; first = false) {
		ssize_t n;

		d->n = 0;
		n = receive_at(d, QUIET_MS, &t_ns);
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
		ssize_t n = receive_at(d, QUIET_MS, &t_ns);

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
				"%s: the tracker at %s did not accept %s: \"%s\"; "
				"switch it off and on, and try again",
				d->where, d->line->name, what, got);
}

static int refused_polhemus_dialogue(struct polhemus_dialogue *d, const char *command,
				     const char *said)
{
	char text[40];

	polhemus_print(text, sizeof(text), command);
	return incise_error_set(
		d->err, EINVAL,
		"%s: the tracker at %s rejects the command %s: \"%s\"; its firmware "
		"may be too old",
		d->where, d->line->name, text, said);
}

/* Take the first line out of d->bytes, without its end. */
static bool next_polhemus_dialogue_line(struct polhemus_dialogue *d, char *text,
					size_t size)
{
	unsigned char *end = memchr(d->bytes, '\n', d->n);
	size_t n, length;

	if (!end)
		return false;
	length = (size_t)(end - d->bytes);
	n = length && d->bytes[length - 1] == '\r' ? length - 1 : length;
	/* The end of a record may precede the text. */
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
		ssize_t n = receive_polhemus_dialogue(d, WAIT_MS);

		if (n < 0)
			return (int)n;
		/* An endless stream is no answer. */
		waited += n ? RECEIVED_MS : WAIT_MS;
		while (next_polhemus_dialogue_line(d, text, sizeof(text))) {
			if (strstr(text, "*ERROR*"))
				return refused_polhemus_dialogue(d, command, text);
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
	/* polhemus_ask() has dropped the station, which does not matter. */
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
		ssize_t n = receive_polhemus_dialogue(d, WAIT_MS);

		if (n < 0)
			return (int)n;
		waited += n ? RECEIVED_MS : WAIT_MS;
		/* receive() started at the front again. */
		if (d->n < before + (size_t)n)
			at = 0;
		while (at < d->n) {
			int is = polhemus_frame_read(d->bytes + at, d->n - at, frame);

			if (!is)
				break;
			at += is > 0 ? frame->length : 1;
			if (is > 0 && frame->error && frame->error != ' ') {
				snprintf(said, sizeof(said), "error %#x", frame->error);
				return refused_polhemus_dialogue(d, command, said);
			}
			if (is > 0 && frame->command == type)
				return 0;
		}
	}
	return rc ? rc : -ETIMEDOUT;
}
