/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Messages of OpenIGTLink, header versions 1 and 2, as bytes: packed, and found in the bytes of a
 * sender, which may send anything. Numbers on the wire are big-endian, positions in mm.
 *
 *     header, 58 bytes                                       body
 *     ┌────────┬──────┬──────┬─────────┬───────────┬─────┐┌───────────────────────────────┐
 *     │version │ type │ name │ seconds │ body size │ CRC ││ content              version 1│
 *     │ 2      │ 12   │ 20   │ and 2⁻³²│ 8         │ 8   │├──────────┬─────────┬──────────┤
 *     └────────┴──────┴──────┴─────────┴───────────┴─────┘│extended  │ content │ metadata │
 *                                       of the body ↑     │header, 12│         │ version 2│
 *                                                         └──────────┴─────────┴──────────┘
 *
 * libopenigtlink's C functions make the CRC and the order of bytes; every length is checked before
 * they get a byte. Version 1.11 of it has no extended header, and its fractions of a second are up
 * to 12 ns off: both are made here.
 */
#ifndef INCISE_IGTL_MESSAGE_H
#define INCISE_IGTL_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>
#include <openigtlink/igtl_header.h>

#define INCISE_IGTL_EXTENDED 12 /* bytes of an extended header */

/*
 * UTC in ns since 1970 as on the wire: seconds above 32 bits of a fraction, rounded. 0, which says
 * "no time", for a time before 1970 or after February 2106. The inverse is exact for its results.
 */
uint64_t incise_igtl_time(int64_t utc_ns);
int64_t incise_igtl_time_ns(uint64_t time);

/* A STATUS, as on the wire, before its text: libopenigtlink has no C header for it. */
struct incise_igtl_status {
	uint16_t code; /* enum incise_igtl_code */
	int64_t sub_code;
	char error[20];
} __attribute__((packed));

enum incise_igtl_code {
	INCISE_IGTL_OK = 1,
	INCISE_IGTL_BUSY = 6,
	INCISE_IGTL_NOT_READY = 13,
	INCISE_IGTL_NOT_PRESENT = 16,
	INCISE_IGTL_HARDWARE_FAILURE = 18,
	INCISE_IGTL_SHUT_DOWN = 19,
};

/* The parts of a message that are not its content. */
struct incise_igtl_label {
	int version; /* of the header: 1 or 2 */
	const char *type, *name;
	int64_t utc_ns; /* of the acquisition; 0: none */
	uint32_t id;	/* version 2 */
	/* Keys with values, of US-ASCII; version 2. */
	const char *const (*metadata)[2];
	int n_metadata;
};

/*
 * Pack a message whose content is @head, then @content, both in the wire's order. Returns its size,
 * or -ENOBUFS: @capacity is too small.
 */
ssize_t incise_igtl_pack(void *bytes, size_t capacity,
			 const struct incise_igtl_label *label, const void *head,
			 size_t head_n, const void *content, size_t n);

/* A message, parsed as far as all types are alike. It points into the stream. */
struct incise_igtl_message {
	int version; /* of the header: 1 or 2 */
	/* Printable; other letters of the name are '?'. */
	char type[IGTL_HEADER_TYPE_SIZE + 1], name[IGTL_HEADER_NAME_SIZE + 1];
	int64_t utc_ns; /* 0: none */
	uint32_t id;	/* version 2; else 0 */
	const uint8_t *content;
	size_t n;
	int n_metadata; /* version 2; else 0 */
	const uint8_t *metadata;
};

/* A key and a value of metadata, not terminated. */
struct incise_igtl_pair {
	const char *key, *value;
	uint16_t key_n;
	uint32_t value_n;
};

/* Pair @i, from 0: 0, or -ENOENT. It points into the message. */
int incise_igtl_metadata(const struct incise_igtl_message *message, int i,
			 struct incise_igtl_pair *pair);

/* A name of @size bytes, up to a zero, as a printable string: it may go to a terminal. */
void incise_igtl_name(char *to, const char *from, size_t size);

struct incise_igtl_stream;

/*
 * Start to read what a sender sends. Memory grows with what has arrived, not with what a header
 * announces, up to @body_max and some kilobytes; larger bodies are passed over. NULL: no memory.
 */
struct incise_igtl_stream *incise_igtl_stream_new(size_t body_max);
void incise_igtl_stream_free(struct incise_igtl_stream *stream);

/*
 * Go on up to the end of a message; @bytes and @n become what is left. Call it again until it
 * returns 0 or -EPROTO.
 *
 *   1          @message, valid until the next call
 *   0          more bytes are needed
 *   -EBADMSG   a message with a wrong CRC was passed over
 *   -EMSGSIZE  a body over @body_max will be passed over; -ENOMEM: one that found no memory.
 *              @message has version, type, name and time.
 *   -EPROTO    not OpenIGTLink: each further call returns this
 */
int incise_igtl_stream_next(struct incise_igtl_stream *stream, const uint8_t **bytes,
			    size_t *n, struct incise_igtl_message *message);

/* Whether the bytes so far end inside a message: a sender that stops there is stalled. */
bool incise_igtl_stream_inside(const struct incise_igtl_stream *stream);

#endif
