// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Batches of samples, and their bytes in a block; see batch.h.
 *
 *     column   │ width │ base, span │ values …                    i: differences from a line
 *              │ width │ values …                                 others; width 0: one for all
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "batch.h"

#define TIME_MAX (INT64_MAX / 4) /* 73 years; sums and differences do not overflow */

static size_t size_of_batch(char type)
{
	switch (type) {
	case 'c':
		return 1;
	case 's':
		return INCISE_LEDGER_TEXT + 1;
	case 'h':
		return INCISE_FRAMES_DIGEST;
	default:
		return 8;
	}
}

bool incise_batch_reserve(struct incise_batch *batch, size_t n)
{
	size_t capacity = batch->capacity ? batch->capacity : 64;

	if (n <= batch->capacity)
		return true;
	while (capacity < n)
		capacity *= 2;
	for (int i = 0; batch->form->types[i]; i++) {
		void *more = reallocarray(batch->column[i].any, capacity,
					  size_of_batch(batch->form->types[i]));

		if (!more)
			return false;
		batch->column[i].any = more;
	}
	batch->capacity = capacity;
	return true;
}

void incise_batch_free(struct incise_batch *batch)
{
	for (int i = 0; i < INCISE_BATCH_COLUMNS; i++)
		free(batch->column[i].any);
	*batch = (struct incise_batch){.form = batch->form};
}

/* --- bytes ----------------------------------------------------------------------------- */

/* Little-endian on any machine; compilers make one store of it, and one load. */
static void put_word(uint8_t *to, uint64_t value, int width)
{
	for (int i = 0; i < width; i++)
		to[i] = value >> 8 * i;
}

static uint64_t get_word(const uint8_t *from, int width)
{
	uint64_t value = 0;

	for (int i = 0; i < width; i++)
		value |= (uint64_t)from[i] << 8 * i;
	return value;
}

/* From 0 to @span in n - 1 steps, each rounded down. */
struct batch_line {
	uint64_t value, step, rest, sum, steps;
};

static struct batch_line line_to(uint64_t span, size_t n)
{
	uint64_t steps = n > 1 ? n - 1 : 1;

	return (struct batch_line){
		.step = span / steps, .rest = span % steps, .steps = steps};
}

static void line_next(struct batch_line *line)
{
	line->value += line->step;
	line->sum += line->rest;
	if (line->sum >= line->steps) {
		line->sum -= line->steps;
		line->value++;
	}
}

static int width_of_batch(uint64_t range)
{
	return !range		     ? 0
	       : range <= UINT8_MAX  ? 1
	       : range <= UINT16_MAX ? 2
	       : range <= UINT32_MAX ? 4
				     : 8;
}

/* The range of the differences from a line, modulo 2^64. */
static uint64_t range_of_batch(const int64_t *values, size_t n, uint64_t span,
			       int64_t *least)
{
	struct batch_line line = line_to(span, n);
	int64_t low = values[0], high = values[0];

	for (size_t k = 0; k < n; k++, line_next(&line)) {
		int64_t off = (int64_t)((uint64_t)values[k] - line.value);

		low = off < low ? off : low;
		high = off > high ? off : high;
	}
	*least = low;
	return (uint64_t)high - (uint64_t)low;
}

#define INTEGER_HEAD (1 + 8 + 8)

static uint8_t *put_integers(uint8_t *to, const int64_t *values, size_t n)
{
	int64_t base, base_of_line;
	uint64_t range = range_of_batch(values, n, 0, &base), range_of_line, span = 0;
	struct batch_line line;
	int width;

	/* Numbers and times are near a line; codes are not. */
	if (values[n - 1] > values[0]) {
		uint64_t rise = (uint64_t)values[n - 1] - (uint64_t)values[0];

		range_of_line = range_of_batch(values, n, rise, &base_of_line);
		if (width_of_batch(range_of_line) < width_of_batch(range)) {
			range = range_of_line;
			base = base_of_line;
			span = rise;
		}
	}
	width = width_of_batch(range);
	*to = width;
	put_word(to + 1, base, 8);
	put_word(to + 9, span, 8);
	to += INTEGER_HEAD;
	line = line_to(span, n);
	for (size_t k = 0; k < n && width; k++, line_next(&line), to += width)
		put_word(to, (uint64_t)values[k] - (uint64_t)base - line.value, width);
	return to;
}

static uint64_t bits_of(double value)
{
	uint64_t bits = 0x7ff8000000000000; /* one NaN for all */

	if (!isnan(value))
		memcpy(&bits, &value, sizeof(bits));
	return bits;
}

static uint8_t *put_reals(uint8_t *to, const double *values, size_t n)
{
	const uint64_t first = bits_of(values[0]);
	bool same = true, single = true;

	for (size_t k = 0; k < n; k++) {
		same &= bits_of(values[k]) == first;
		single &= bits_of((float)values[k]) == bits_of(values[k]);
	}
	*to++ = same ? 0 : single ? 4 : 8;
	for (size_t k = 0; k < (same ? 1 : n); k++) {
		float value = (float)values[k];
		uint32_t bits = 0x7fc00000;

		if (!isnan(value))
			memcpy(&bits, &value, sizeof(bits));
		put_word(to, same || !single ? bits_of(values[k]) : bits,
			 same || !single ? 8 : 4);
		to += same || !single ? 8 : 4;
	}
	return to;
}

/* Values of some bytes each. */
static uint8_t *put_bytes(uint8_t *to, const uint8_t *values, size_t n, size_t size)
{
	bool same = true;

	for (size_t k = 1; k < n; k++)
		same &= !memcmp(values, values + k * size, size);
	*to++ = same ? 0 : size;
	memcpy(to, values, same ? size : n * size);
	return to + (same ? size : n * size);
}

size_t incise_batch_bound(const struct incise_batch *batch)
{
	size_t bound = 0;

	for (const char *type = batch->form->types; *type; type++)
		bound += INTEGER_HEAD + batch->n * size_of_batch(*type);
	return bound;
}

size_t incise_batch_encode(const struct incise_batch *batch, uint8_t *data)
{
	uint8_t *to = data;

	for (int i = 0; batch->form->types[i]; i++) {
		const union incise_column *column = &batch->column[i];
		const char type = batch->form->types[i];

		if (type == 'i')
			to = put_integers(to, column->i, batch->n);
		else if (type == 'r' || type == 'n')
			to = put_reals(to, column->r, batch->n);
		else
			to = put_bytes(to, column->any, batch->n, size_of_batch(type));
	}
	return to - data;
}

struct input {
	const uint8_t *at;
	size_t left;
};

/* The next bytes, or NULL: there are fewer. */
static const uint8_t *take_bytes(struct input *input, size_t n)
{
	const uint8_t *at = input->at;

	if (n > input->left)
		return NULL;
	input->at += n;
	input->left -= n;
	return at;
}

static bool get_integers(struct input *input, int64_t *values, size_t n)
{
	const uint8_t *head = take_bytes(input, INTEGER_HEAD), *from;
	struct batch_line line;
	uint64_t base;

	if (!head || (*head != 0 && *head != 1 && *head != 2 && *head != 4 && *head != 8))
		return false;
	from = take_bytes(input, n * *head);
	if (!from)
		return false;
	base = get_word(head + 1, 8);
	line = line_to(get_word(head + 9, 8), n);
#define EACH(width)                                                                   \
	case width:                                                                   \
		for (size_t k = 0; k < n; k++, line_next(&line), from += width)       \
			values[k] =                                                   \
				(int64_t)(base + line.value + get_word(from, width)); \
		break
	switch (*head) {
		EACH(0);
		EACH(1);
		EACH(2);
		EACH(4);
		EACH(8);
	}
#undef EACH
	return true;
}

static bool get_reals(struct input *input, double *values, size_t n, bool missing)
{
	const uint8_t *width = take_bytes(input, 1), *from;
	bool good = true;

	if (!width || (*width != 0 && *width != 4 && *width != 8))
		return false;
	from = take_bytes(input, *width ? n * *width : 8);
	if (!from)
		return false;
	for (size_t k = 0; k < n; k++) {
		uint32_t low;
		uint64_t bits;
		float single;

		if (*width == 4) {
			low = get_word(from + 4 * k, 4);
			memcpy(&single, &low, sizeof(single));
			values[k] = single;
		} else {
			bits = get_word(from + *width * k, 8);
			memcpy(&values[k], &bits, sizeof(bits));
		}
		good &= isfinite(values[k]) || (missing && isnan(values[k]));
	}
	return good;
}

static bool get_bytes(struct input *input, uint8_t *values, size_t n, size_t size,
		      bool text)
{
	const uint8_t *width = take_bytes(input, 1), *from;

	if (!width || (*width && *width != size))
		return false;
	from = take_bytes(input, *width ? n * size : size);
	if (!from)
		return false;
	for (size_t k = 0; k < n; k++) {
		memcpy(values + k * size, from + *width * k, size);
		if (text && values[k * size + size - 1])
			return false;
	}
	return true;
}

const char *incise_batch_decode(struct incise_batch *batch,
				const struct incise_ledger_block *block,
				const uint8_t *data, size_t size)
{
	const size_t n = block->count;
	struct input input = {data, size};
	const int64_t *seq, *t_ns;

	batch->n = 0;
	if (block->count < 1 || block->count > INCISE_BATCH_ROWS_MAX)
		return "its count is impossible";
	if (!incise_batch_reserve(batch, n))
		return "there is no memory for it";
	for (int i = 0; batch->form->types[i]; i++) {
		const char type = batch->form->types[i];
		union incise_column *column = &batch->column[i];

		if (!(type == 'i'   ? get_integers(&input, column->i, n)
		      : type == 'r' ? get_reals(&input, column->r, n, false)
		      : type == 'n' ? get_reals(&input, column->r, n, true)
				    : get_bytes(&input, column->any, n,
						size_of_batch(type), type == 's')))
			return "a column is impossible, or not as long as its count";
	}
	if (input.left)
		return "it is longer than its count";
	seq = batch->column[0].i;
	t_ns = batch->column[1].i;
	for (size_t k = 1; k < n; k++)
		if (seq[k] <= seq[k - 1])
			return "its numbers do not increase";
	for (size_t k = 0; k < n; k++)
		if (t_ns[k] < -TIME_MAX || t_ns[k] > TIME_MAX)
			return "a time is impossible";
	if (seq[0] < 0 || seq[0] != block->first_seq || seq[n - 1] != block->last_seq)
		return "its first or last number differs";
	if (t_ns[0] != block->first_ns || t_ns[n - 1] != block->last_ns)
		return "its first or last time differs";
	batch->n = n;
	return NULL;
}
