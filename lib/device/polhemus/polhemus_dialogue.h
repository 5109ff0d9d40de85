/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Commands and answers over a line, before records flow. Waits are counted in what the reads
 * waited, so that a test's line may have a time of its own.
 */
#ifndef INCISE_POLHEMUS_DIALOGUE_H
#define INCISE_POLHEMUS_DIALOGUE_H

#include <stdbool.h>
#include <incise/error.h>
#include "polhemus_line.h"
#include "polhemus_reply.h"

#define POLHEMUS_REPLY_MAX 128 /* characters of an answer, without what stands before */

struct polhemus_dialogue {
	struct polhemus_line *line;
	const char *where; /* messages begin with it */
	struct incise_error *err;
	unsigned char bytes[1024]; /* that came and were not understood yet */
	size_t n;
	int64_t first_ns; /* when the first byte was heard; 0: none was */
};

/* All of them: -ECANCELED once line->stop is set. */

/* 0, -ENODEV, -EIO. */
int polhemus_say(struct polhemus_dialogue *d, const char *command);

/* Throw away what comes, until nothing does. -EBUSY, without a line: for 0.5 s it does not. */
int polhemus_drain(struct polhemus_dialogue *d);

/*
 * All that comes until nothing does, or for 0.5 s, or until d->bytes is full: how many bytes
 * are in there.
 */
int polhemus_collect(struct polhemus_dialogue *d);

/*
 * A command to a FASTRAK that it answers with "2sX…": what stands behind the X, in @reply of
 * POLHEMUS_REPLY_MAX. -ETIMEDOUT without a line; -EINVAL: it said *ERROR*.
 */
int polhemus_ask(struct polhemus_dialogue *d, const char *command, char type,
		 char *reply);

/* S; as above. */
int polhemus_ask_status(struct polhemus_dialogue *d, struct polhemus_status *status);

/* A command to a LIBERTY or PATRIOT; the frame points into d->bytes until the next call. */
int polhemus_ask_frame(struct polhemus_dialogue *d, const char *command,
		       unsigned char type, struct polhemus_frame *frame);

/* "…: the FASTRAK at LINE did not take WHAT: …"; -EIO. */
int polhemus_not_taken(struct polhemus_dialogue *d, const char *what, const char *got);

/* A command as it can be printed, without its CR. */
void polhemus_print(char *text, size_t size, const char *command);

#endif
