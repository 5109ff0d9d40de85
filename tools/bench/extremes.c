// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Counting of extreme cases; see extremes.h.
 */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "extremes.h"

/* Of the cases in full, so many are a look. */
#define QUICK_PART 20

struct extremes_row *extremes_begin(struct extremes *all, const char *name,
				    const char *what)
{
	struct extremes_row *row = &all->row[all->n];

	if (all->n == EXTREMES_ROWS_MAX)
		cli_fail("extremes: more than %d rows", EXTREMES_ROWS_MAX);
	all->n++;
	*row = (struct extremes_row){.name = name, .what = what};
	cli_progress("extremes: %s", name);
	return row;
}

/* By name, so that a row has the same cases wherever it stands. */
uint64_t extremes_seed(const struct extremes *all, const struct extremes_row *row)
{
	uint64_t hash = 0xcbf29ce484222325 ^ all->seed * 0x9e3779b97f4a7c15;

	for (const char *c = row->name; *c; c++)
		hash = (hash ^ (unsigned char)*c) * 0x100000001b3;
	return hash | 1;
}

long extremes_cases(const struct extremes *all, long full)
{
	return all->quick ? (full + QUICK_PART - 1) / QUICK_PART : full;
}

bool extremes_first_wrong(struct extremes_row *row, bool held)
{
	row->tried++;
	row->held += held;
	row->wrong += !held;
	return !held && row->wrong == 1;
}

void extremes_tell(struct extremes_row *row, const char *fmt, ...)
{
	size_t length = strlen(row->failed);
	va_list args;

	va_start(args, fmt);
	vsnprintf(row->failed + length, sizeof(row->failed) - length, fmt, args);
	va_end(args);
}

void extremes_refused(struct extremes_row *row, const struct incise_error *err)
{
	if (err->code > 0 && *err->text && !strchr(err->text, '\n')) {
		row->tried++;
		row->refused++;
		return;
	}
	if (extremes_first_wrong(row, false))
		extremes_tell(row, "case %ld is refused without a line that says why: %s",
			      row->tried, err->text);
}
