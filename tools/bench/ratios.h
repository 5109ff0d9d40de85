/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Figures of a simulation beside those of theory: a table, its JSON, and whether each
 * ratio is what it should be.
 */
#ifndef INCISE_RATIOS_H
#define INCISE_RATIOS_H

#include <stdbool.h>
#include <jansson.h>

#define RATIOS_PARAMS 4
#define RATIOS_MAX 160

/* One figure; theory is what it should be, or the least that it may be. */
struct ratio {
	double param[RATIOS_PARAMS];
	double simulated, theory;
	bool at_least;
};

struct ratios {
	const char *key, *title;
	const char
		*params[RATIOS_PARAMS]; /* keys; those from the first NULL on are none */
	const char *simulated, *theory; /* keys */
	double tolerance;		/* of the ratio, about 1 */
	const char *note;		/* below the table, or NULL */
	struct ratio row[RATIOS_MAX];
	int n;
};

/* Append one; fails the program when the table is full. */
void ratios_add(struct ratios *ratios, struct ratio row);

/* simulated/theory; 1 where both find that there is none. */
double ratios_value(const struct ratio *row);

/* The first row that does not hold, or NULL; *missed counts them. */
const struct ratio *ratios_first_missed(const struct ratios *ratios, int *missed);

/* "bT_m 0.1, delay 2: 1.034 of theory" */
void ratios_describe(const struct ratios *ratios, const struct ratio *row, char *text,
		     size_t size);

void ratios_print(const struct ratios *ratios);
json_t *ratios_json(const struct ratios *ratios);

#endif
