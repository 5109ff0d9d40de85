/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Two reports of incise bench compared with each other, metric by metric (metrics.h): which
 * changed beyond noise, are gone, or new. A report is that of one benchmark, an object with
 * `figures`, or of several, an object whose members are such objects.
 *
 *   time      by each reference workload, by more than these disagree, and
 *   measured  in its unit: the intervals are apart by more than two runs of one build are
 *               ├──old──┤  noise  ├──new──┤
 *   exact     by more than the digits of a report
 */
#ifndef INCISE_COMPARE_H
#define INCISE_COMPARE_H

#include <jansson.h>
#include <stdbool.h>
#include <incise/error.h>

/*
 * Compare; messages call the reports by these names. Returns an object as in incise-bench(1),
 * which the caller releases; NULL and the reason where one is no report, where they have no
 * metric in common, or where one is of --quick and the other is not.
 */
json_t *compare_reports(const json_t *old_report, const char *old_name,
			const json_t *new_report, const char *new_name,
			struct incise_error *err);

/* A report of a file that can be compared; fails the program where there is none. */
json_t *compare_load(const char *path);

/* How many metrics got worse, or are gone. */
int compare_worse(const json_t *comparison);

/* Print a comparison as text, or as JSON. Fails the program when something got worse. */
void compare_finish(json_t *comparison, bool json);

/*
 * --against: call it before anything is measured, and report as JSON thereafter. It returns
 * in a process that measures; the first one compares that one's report, prints the comparison,
 * or with @json the report with `against` in it, and does not return.
 */
void compare_against(const char *path, bool json);

#endif
