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

/* "time", "measured", "exact" */
extern const char *const metric_kind_names[METRIC_KINDS];

/*
 * These append to an array and return what they appended; a value that is not finite is left
 * out: NULL. The unit of a time, which is given in ns, is "ns", "us", "ms" or "s"; the name is
 * printf's.
 */
json_t *metrics_time(json_t *metrics, const struct harness_time *time, const char *unit,
		     const char *fmt, ...) INCISE_PRINTF(4, 5);
json_t *metrics_measured(json_t *metrics, const struct harness_spread *spread,
			 const char *unit, const char *fmt, ...) INCISE_PRINTF(4, 5);
json_t *metrics_exact(json_t *metrics, double value, const char *unit, const char *fmt,
		      ...) INCISE_PRINTF(4, 5);

/* Less is better unless this is said. */
void metrics_more_is_better(json_t *metric);

/* --- read again --- */

/* The longest name of a benchmark or a metric. */
#define METRIC_NAME_BYTES 300

struct metric {
	const char *bench; /* NULL in a report of one benchmark */
	const char *name, *unit;
	enum metric_kind kind;
	double value;
	/* Compared is a time by each workload, else the value. */
	struct interval {
		double middle, low, high;
	} by[WORKLOADS];
	int scales;
	bool more_is_better;
};

struct metrics {
	const char *report; /* as messages name it */
	struct metric *metric;
	int n;
	json_t *index; /* place by benchmark and name; of a benchmark alone it is there, too */
};

/*
 * Those of a report, in which they live. A file may have been written by anyone: each type is
 * checked, and names are fit for a terminal. 0 or a negative errno, and the reason; free them
 * in either case.
 */
int metrics_read(const json_t *report, const char *name, struct metrics *all,
		 struct incise_error *err);
void metrics_free(struct metrics *all);

/* The one of that benchmark, name, kind and unit, or NULL. */
const struct metric *metrics_find(const struct metrics *all, const struct metric *like);

/* Whether any is of that benchmark. */
bool metrics_have(const struct metrics *all, const char *bench);

#endif
