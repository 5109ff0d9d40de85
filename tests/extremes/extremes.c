// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Trying of properties, and counting of their cases; see extremes.h.
 */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "extremes.h"
#include "numbers.h"

/* By name, so that a property has the same cases wherever it stands. */
static uint64_t seed_of(const char *name, uint64_t seed)
{
	uint64_t hash = 0xcbf29ce484222325 ^ seed * 0x9e3779b97f4a7c15;

	for (; *name; name++)
		hash = (hash ^ (unsigned char)*name) * 0x100000001b3;
	return hash | 1;
}

long extremes_cases(const struct extremes_row *row, long full)
{
	return (full + row->setup->part - 1) / row->setup->part;
}

void extremes_try(const struct property *property, const struct extremes_setup *setup,
		  struct extremes_row *row)
{
	*row = (struct extremes_row){property->name, property->what, .setup = setup};
	any_state = seed_of(property->name, setup->seed);
	if (property->all)
		property->all(row, property);
	else
		for (long k = extremes_cases(row, property->cases); k; k--)
			property->each(row, property);
}

void extremes_check(struct extremes_row *row, bool held, const char *fmt, ...)
{
	size_t length;
	va_list args;

	row->tried++;
	row->held += held;
	row->wrong += !held;
	if (held || row->wrong > 1)
		return;
	va_start(args, fmt);
	vsnprintf(row->failed, sizeof(row->failed), fmt, args);
	va_end(args);
	length = strlen(row->failed);
	snprintf(row->failed + length, sizeof(row->failed) - length, ", case %ld",
		 row->tried);
}

void extremes_refused(struct extremes_row *row, const struct incise_error *err)
{
	if (err->code > 0 && *err->text && !strchr(err->text, '\n'))
		extremes_refused_plainly(row);
	else
		extremes_check(row, false,
			       "refused without a line that gives the reason: %s",
			       err->text);
}

void extremes_refused_plainly(struct extremes_row *row)
{
	row->tried++;
	row->refused++;
}
