/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Ways of telling when samples were taken from when they arrived.
 */
#ifndef INCISE_TIME_METHODS_H
#define INCISE_TIME_METHODS_H

#include <stdint.h>
#include "drifting_stream.h"

struct time_method {
	const char *name;
	/* Knows the stream's grain, and, as no one can, its mean lateness. To be ended. */
	void *(*begin)(const struct drifting_stream *stream);
	/* The time of a sample when it arrives, ns. */
	double (*take)(void *state, uint64_t seq, int64_t arrival_ns);
	/* The best time of one of them afterwards; NULL: take() was the last word. */
	double (*afterwards)(const void *state, uint64_t seq);
	/* To be called once between them, or NULL. */
	void (*finish)(void *state);
	/* Stated uncertainty of the last one taken, or afterwards of one; NULL: none is. */
	double (*sd_ns)(const void *state, uint64_t seq);
	void (*end)(void *state);
};

#define TIME_METHODS 8
#define TIME_METHOD_ARRIVAL 0
extern const struct time_method time_methods[TIME_METHODS];

#endif
