/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a tracker answers to a command; pure.
 *
 *   FASTRAK    '2' station what … CR LF      in ASCII, also when records are binary
 *              '2' ' ' 'E' "*ERROR*" command "*ERROR* EC" code …
 *   S          55 bytes, see struct polhemus_status
 *   LIBERTY    a frame as in polhemus_records.h, whose command is the one it answers
 *
 * Source: FASTRAK user manual, rev. G (2012), chapters 9 and 10.
 */
#ifndef INCISE_POLHEMUS_REPLY_H
#define INCISE_POLHEMUS_REPLY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define POLHEMUS_STATUS_LENGTH 55

/* The reply to S. */
struct polhemus_status {
	int station; /* which the device chose */
	bool binary; /* records */
	bool centimetres;
	bool compensated;
	bool continuous;
	int test_error; /* of its self-test; 0: none */
	int sensors;	/* bit 0: station 1 has one; -1: it does not say */
	char version[7];
	char id[33]; /* what X set; printable, without blanks at its ends */
};

/* false: these @n bytes are no such reply. */
bool polhemus_status_read(const unsigned char *bytes, size_t n,
			  struct polhemus_status *status);

/*
 * Numbers behind "2sX" up to the end of the line: separated by blanks or by their signs.
 * How many there are, at most @most; -1: something else stands there.
 */
int polhemus_reply_numbers(const char *text, double *values, int most);

/* Integers of @width characters each. -1 as above. */
int polhemus_reply_fields(const char *text, int width, int *values, int most);

/* A frame of LIBERTY or PATRIOT. */
struct polhemus_frame {
	int family;
	unsigned int station;
	unsigned char command;
	unsigned char error; /* 0 or ' ': none */
	const unsigned char *payload;
	size_t n;      /* of payload */
	size_t length; /* of all */
};

#define POLHEMUS_FRAME_MAX 400 /* bytes; ^V answers with about 200 */

/*
 * A frame at @bytes. 1; 0: it needs more bytes; -1: there is none here.
 */
int polhemus_frame_read(const unsigned char *bytes, size_t n,
			struct polhemus_frame *frame);

#endif
