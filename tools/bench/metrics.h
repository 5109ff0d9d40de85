/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Metrics of a benchmark, in the one form that all benchmarks share and `incise bench compare`
 * reads: each a name, a value and its interval.
 *
 *   {"name": "fixed_table", "kind": "time", "unit": "ns", "value": 51.2, "low": 50.9,
 *    "high": 51.8, "yardsticks": 0.00171, "yardsticks_low": …, "yardsticks_high": …,
 *    "wide_yardsticks": …, "memory_yardsticks": …}
 *
 * Kinds: "time", compared as multiples of the reference workloads (harness.h); "measured",
 * whose value differs from run to run; "exact", whose value is the same in every run of the
 * same program.
 */
#ifndef INCISE_METRICS_H
#define INCISE_METRICS_H

#include <jansson.h>
#include <stdbool.h>
#include <incise/error.h>
#include "harness.h"

enum metric_kind { METRIC_TIME, METRIC_MEASURED, METRIC_EXACT, METRIC_KINDS };

/* Append to an array a struct harness_time, a struct harness_spread or a double, as of its kind,
 * and return it; a value that is not finite is left out: NULL. The unit of a time, which is given
 * in ns, is "ns", "us", "ms" or "s"; the name is printf's. */
json_t *metrics_add(json_t *metrics, enum metric_kind kind, const void *value,
		    const char *unit, const char *fmt, ...) INCISE_PRINTF(5, 6);

/* Less is better unless this is called. */
void metrics_more_is_better(json_t *metric);

/* --- comparison ---
 *
 * Two reports of incise bench compared with each other, metric by metric: which
 * changed beyond noise, are gone, or new. A report covers one benchmark, an object with `figures`, or
 * several, an object whose members are such objects.
 */

/* Compare; messages call the reports by these names. Returns an object as in incise-bench(1) with
 * its "text", which the caller releases; NULL and the reason if one is no report, if they have no
 * metric in common, or if only one is of --quick. */
json_t *compare_reports(const json_t *old_report, const char *old_name,
			const json_t *new_report, const char *new_name,
			struct incise_error *err);

/* A report of a file that can be compared; fails the program without one. */
json_t *compare_load(const char *path);

/* The number of metrics that got worse or are gone. */
int compare_worse(const json_t *comparison);

/* Print a comparison as text, or as JSON, and release it. Returns the same number. */
int compare_print(json_t *comparison, bool json);

/* Fail the program for so many. */
_Noreturn void compare_fail(int worse);

#endif
