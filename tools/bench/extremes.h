/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Extreme cases: what was tried at a door of the library, how often, and what came out of
 * it. Each case is judged by a rule that its row states.
 *
 *     case ──▶ held     it did what it shall do, and within its limits
 *          ├─▶ refused  with a line that says why
 *          └─▶ wrong    neither: the first of a row is told, to the bit
 */
#ifndef INCISE_EXTREMES_H
#define INCISE_EXTREMES_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

#define EXTREMES_ROWS_MAX 64

struct extremes_row {
	const char *name;
	const char *what; /* the cases, and the rule */
	long tried, held, refused, wrong;
	char failed[600]; /* the first wrong case; empty */
};

struct extremes {
	struct extremes_row row[EXTREMES_ROWS_MAX];
	int n;
	bool quick;
	uint64_t seed;
};

/* Begin a row; both strings live as long as the program. */
struct extremes_row *extremes_begin(struct extremes *all, const char *name,
				    const char *what);

/* For the generator of a row's cases: never 0, the same in every run. */
uint64_t extremes_seed(const struct extremes *all, const struct extremes_row *row);

/* How many cases to try of so many in full. */
long extremes_cases(const struct extremes *all, long full);

/* A case held, or else is wrong: then words for it are wanted when this is true. */
bool extremes_first_wrong(struct extremes_row *row, bool held);

/* Words for the first wrong case: numbers as %a, so that it can be tried again. */
void extremes_tell(struct extremes_row *row, const char *fmt, ...) INCISE_PRINTF(2, 3);

/* A case was refused: which is wrong without a line that says why. */
void extremes_refused(struct extremes_row *row, const struct incise_error *err);

/* The cases, by door. */
void extremes_model(struct extremes *all);
void extremes_fixed(struct extremes *all);
void extremes_surface(struct extremes *all);
void extremes_guard(struct extremes *all);
void extremes_motion(struct extremes *all);
void extremes_plan(struct extremes *all);
void extremes_wall(struct extremes *all);
void extremes_device(struct extremes *all);
void extremes_files(struct extremes *all);

#endif
