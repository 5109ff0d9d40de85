/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Two reports of incise bench held against each other, figure by figure (figures.h): what
 * changed beyond noise, what is gone and what is new. A report is that of one word, an object
 * with `figures`, or of several, an object whose members are such objects.
 *
 *   time      in each of the yardsticks, by more than these disagree, and
 *   measured  in its unit: the intervals are apart by more than two runs of one build are
 *               ├──old──┤  noise  ├──new──┤
 *   exact     by more than the digits of a report
 */
#ifndef INCISE_COMPARE_H
#define INCISE_COMPARE_H

#include <jansson.h>
#include <stdbool.h>
#include <incise/error.h>

/* Gaps between the intervals of the same build's runs, as part of the value; measured, see
 * incise-bench(1). */
#define COMPARE_TIME_NOISE 0.05
#define COMPARE_MEASURED_NOISE 0.5
/* A report's numbers have 12 digits. */
#define COMPARE_EXACT 1e-9

/*
 * Compare; messages call the reports by these names. Returns an object as in incise-bench(1),
 * which the caller releases; NULL and the reason where a report is none, where they have no
 * figure in common, or where one is of --quick and the other is not.
 */
json_t *compare_reports(const json_t *old_report, const char *old_name,
			const json_t *new_report, const char *new_name,
			struct incise_error *err);

/* How many figures got worse, or are gone. */
int compare_worse(const json_t *comparison);

/* The same as a table on standard output. */
void compare_print(const json_t *comparison);

/* Print a comparison as text, or as JSON. Fails the program when something got worse. */
void compare_finish(json_t *comparison, bool json);

/*
 * --against: call it before anything is measured, and report as JSON thereafter. It returns
 * in a process that measures; the first one compares what that reports, prints the comparison,
 * or with @json the report with `against` in it, and does not return.
 */
void compare_against(const char *path, bool json);

#endif
