/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Commands to a tracker before records flow, and its answers. Waiting is counted by the
 * waits of the reads, so that a test's line may have its own time.
 *
 *   FASTRAK    '2' station what … CR LF      in ASCII, also when records are binary
 *              '2' ' ' 'E' "*ERROR*" command "*ERROR* EC" code …
 *   S          55 bytes, see struct polhemus_status
 *   LIBERTY    a frame as in polhemus_records.h, with the command that it answers
 *
 * Source: FASTRAK user manual, rev. G (2012), chapters 9 and 10.
 */
#ifndef INCISE_POLHEMUS_DIALOGUE_H
#define INCISE_POLHEMUS_DIALOGUE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include "polhemus_line.h"

#define POLHEMUS_STATUS_LENGTH 55

/* The reply to S. */
struct polhemus_status {
	int station; /* chosen by the device */
	bool binary; /* records */
	bool centimetres;
	bool compensated;
	bool continuous;
	int test_error; /* of its self-test; 0: no error */
	int sensors;	/* bit 0: station 1 has one; -1: it does not say */
	char version[7];
	char id[33]; /* set by X; printable, without blanks at its ends */
};

/* False: no such reply. */
bool polhemus_status_read(const unsigned char *bytes, size_t n,
			  struct polhemus_status *status);

/*
 * The numbers in @text, separated by blanks or by their signs; how many, at most @most.
 * -1: there is something else.
 */
int polhemus_reply_numbers(const char *text, double *values, int most);

/* Integers of @width characters each. -1 as above. */
int polhemus_reply_fields(const char *text, int width, int *values, int most);

/* A frame of LIBERTY or PATRIOT. */
struct polhemus_frame {
	int family;
	unsigned int station;
	unsigned char command;
	unsigned char error; /* 0 or ' ': no error */
	const unsigned char *payload;
	size_t n;      /* of payload */
	size_t length; /* of all */
};

#define POLHEMUS_FRAME_MAX 400 /* bytes; ^V answers with about 200 */

/* 1: a frame at @bytes; 0: it needs more bytes; -1: no frame. */
int polhemus_frame_read(const unsigned char *bytes, size_t n,
			struct polhemus_frame *frame);

#define POLHEMUS_REPLY_MAX 128 /* characters of an answer behind "2sX" */

struct polhemus_dialogue {
	struct polhemus_line *line;
	const char *where; /* messages begin with it */
	struct incise_error *err;
	unsigned char bytes[1024]; /* received, not yet parsed */
	size_t n;
	int64_t first_ns; /* when the first byte was received; 0: no byte yet */
};

/* All of these return -ECANCELED once line->stop is set. */

/* 0, -ENODEV, -EIO. */
int polhemus_say(struct polhemus_dialogue *d, const char *command);

/*
 * Drop bytes until they end. -EBUSY, without a message: they come for more than 0.5 s.
 */
int polhemus_drain(struct polhemus_dialogue *d);

/* Receive until no byte comes, for 0.5 s, or until d->bytes is full; how many bytes. */
int polhemus_collect(struct polhemus_dialogue *d);

/*
 * Send a command that a FASTRAK answers with "2sX…"; @reply, of POLHEMUS_REPLY_MAX, gets
 * the text behind X. -ETIMEDOUT, without a message; -EINVAL: it answered *ERROR*.
 */
int polhemus_ask(struct polhemus_dialogue *d, const char *command, char type,
		 char *reply);

/* The same for S. */
int polhemus_ask_status(struct polhemus_dialogue *d, struct polhemus_status *status);

/* The same for a LIBERTY or PATRIOT; @frame points into d->bytes until the next call. */
int polhemus_ask_frame(struct polhemus_dialogue *d, const char *command,
		       unsigned char type, struct polhemus_frame *frame);

/* "…: the FASTRAK at LINE did not take WHAT: …"; -EIO. */
int polhemus_not_taken(struct polhemus_dialogue *d, const char *what, const char *got);

/* A command in printable characters, without its CR. */
void polhemus_print(char *text, size_t size, const char *command);

#endif
