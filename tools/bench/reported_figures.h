/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The figures of a report of incise bench (figures.h), read again. What is in a file may have
 * been written by anyone: each type is looked at, and names are plain: fit for a terminal.
 */
#ifndef INCISE_REPORTED_FIGURES_H
#define INCISE_REPORTED_FIGURES_H

#include <jansson.h>
#include <stdbool.h>
#include <incise/error.h>
#include "yardstick.h"

/* The longest name of a word or a figure. */
#define REPORTED_NAME_BYTES 300

enum figure_kind { FIGURE_TIME, FIGURE_MEASURED, FIGURE_EXACT, FIGURE_KINDS };

/* "time", "measured", "exact" */
extern const char *const figure_kind_names[FIGURE_KINDS];

struct figure {
	const char *word; /* NULL in a report of one word */
	const char *name, *unit;
	enum figure_kind kind;
	double value;
	/* What is compared: a time in each yardstick, else the value. */
	struct interval {
		double middle, low, high;
	} by[YARDSTICKS];
	int scales;
	bool more_is_better, met;
};

struct reported_figures {
	const char *report; /* as messages name it */
	struct figure *figure;
	int n;
	json_t *index; /* place by word and name; of a word alone it is there, too */
};

/*
 * Those of a report, in which they live. 0 or a negative errno, and the reason; free them in
 * either case.
 */
int reported_figures_read(const json_t *report, const char *name,
			  struct reported_figures *all, struct incise_error *err);
void reported_figures_free(struct reported_figures *all);

/* The one of that word, name, kind and unit, or NULL. */
struct figure *reported_figures_find(const struct reported_figures *all,
				     const struct figure *like);

/* Whether any is of that word. */
bool reported_figures_have(const struct reported_figures *all, const char *word);

#endif
