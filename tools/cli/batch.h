/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Values of a batch of rows of a recording (incise/arrow.h), by column and row; the types are those
 * that the stream is documented to have.
 */
#ifndef INCISE_CLI_BATCH_H
#define INCISE_CLI_BATCH_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <incise/arrow.h>

static inline double real_at(const struct ArrowArray *batch, int column, int64_t i)
{
	const struct ArrowArray *array = batch->children[column];
	const uint8_t *known = array->buffers[0];

	i += array->offset;
	return known && !(known[i / 8] >> i % 8 & 1)
		       ? NAN
		       : ((const double *)array->buffers[1])[i];
}

static inline int64_t whole_at(const struct ArrowArray *batch, int column, int64_t i)
{
	const struct ArrowArray *array = batch->children[column];

	return ((const int64_t *)array->buffers[1])[i + array->offset];
}

static inline bool flag_at(const struct ArrowArray *batch, int column, int64_t i)
{
	const struct ArrowArray *array = batch->children[column];

	i += array->offset;
	return ((const uint8_t *)array->buffers[1])[i / 8] >> i % 8 & 1;
}

/* A text of at most size - 1 bytes. */
static inline void text_at(const struct ArrowArray *batch, int column, int64_t i,
			   char *text, size_t size)
{
	const struct ArrowArray *array = batch->children[column];
	const int32_t *at = (const int32_t *)array->buffers[1] + i + array->offset;

	snprintf(text, size, "%.*s", at[1] - at[0],
		 (const char *)array->buffers[2] + at[0]);
}

#endif
