/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Rows of the tracker that are not on its line, see ../time/fit.h, found as they are asked for: from a part
 * of the stream and its surroundings, so that memory does not grow with the recording.
 *
 *     numbers   |◄─────────── rows that are fitted ───────────►|
 *                     |◄───── rows that are answered ────►|
 */
#ifndef INCISE_OTHERS_H
#define INCISE_OTHERS_H

#include <incise/error.h>
#include "../time/fit.h"

struct incise_stream_source;
struct incise_others;

/* Of a source that may have some. NULL: no memory; errors of the rows are their reader's. */
struct incise_others *incise_others_new(const struct incise_stream_source *source);

/* The row of this number among them, or NULL. In order it is read once. */
const struct incise_fit_time *incise_others_find(struct incise_others *others,
						 uint64_t seq);

/* The first of them from a number on, or NULL. */
const struct incise_fit_time *incise_others_next(struct incise_others *others,
						 uint64_t seq);

void incise_others_free(struct incise_others *others);

#endif
