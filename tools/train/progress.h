/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Progress of a training, OUTPUT.progress: what an interrupted one has read, for the next of the
 * same sources and options to go on from. It is written after a source, as a whole, so seldom that
 * writing takes a tenth of the time at most; and it is removed when the program ends by itself.
 */
#ifndef TRAIN_PROGRESS_H
#define TRAIN_PROGRESS_H

#include "sources.h"

struct progress;

/* Parts of the file, each some bytes or none. */
enum progress_part { PROGRESS_SURVEYS, PROGRESS_SOURCES, PROGRESS_FIT, PROGRESS_CHECK };
#define PROGRESS_PARTS 4

/*
 * For an output and sources; options: all that changes the result. Reads what an interrupted
 * training of the same left. NULL: one source, or one that can be read once only.
 */
struct progress *progress_new(const char *output, const char *options,
			      const struct source *sources, int n);

/* A part that was read; NULL: none. It is valid until it is replaced. */
const void *progress_part(const struct progress *progress, enum progress_part part,
			  size_t *size);

/* Replace a part by bytes of malloc(3), which become its own. */
void progress_set(struct progress *progress, enum progress_part part, void *bytes,
		  size_t size);

/* Whether it is time to write, and writing. A failure is not one of the training. */
bool progress_due(const struct progress *progress);
void progress_write(struct progress *progress);

#endif
