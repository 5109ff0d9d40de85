/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The figures of a bench in the one form that all benches share, for holding one report
 * against another: each a name, a value and how sure it is.
 *
 *   {"name": "fixed_table", "kind": "time", "unit": "ns", "value": 51.2, "low": 50.9,
 *    "high": 51.8, "yardsticks": 0.00171, "yardsticks_low": …, "yardsticks_high": …,
 *    "wide_yardsticks": …, "memory_yardsticks": …}
 *
 * Kinds: "time", compared in yardsticks (harness.h); "measured", whose value differs from
 * run to run; "exact", whose value is the same in every run of the same program. What to
 * compare is in compare.h.
 */
#ifndef INCISE_FIGURES_H
#define INCISE_FIGURES_H

#include <jansson.h>
#include <incise/error.h>
#include "harness.h"

/* Keys of a time in each yardstick; with "_low" and "_high" behind them of its interval. */
extern const char *const figures_yardsticks[YARDSTICKS];

/* An array; all below append to it and return what they appended. A value that is not finite
 * is left out: NULL. */
json_t *figures_new(void);

/* A time of so many ns in a @unit ("ns", "us", "ms": 1, 1e3, 1e6). The name is printf's. */
json_t *figures_time(json_t *figures, const struct harness_time *time, const char *unit,
		     const char *fmt, ...) INCISE_PRINTF(4, 5);

json_t *figures_measured(json_t *figures, const struct harness_spread *spread,
			 const char *unit, const char *fmt, ...) INCISE_PRINTF(4, 5);

json_t *figures_exact(json_t *figures, double value, const char *unit, const char *fmt,
		      ...) INCISE_PRINTF(4, 5);

/* Less is better unless this is said. */
void figures_more_is_better(json_t *figure);

#endif
