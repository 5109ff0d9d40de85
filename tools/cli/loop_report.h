/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Reports of the commands that run the loop: names of tools, flags of ticks, lateness of ticks.
 */
#ifndef INCISE_LOOP_REPORT_H
#define INCISE_LOOP_REPORT_H

#include <incise/loop.h>
#include <incise/scene.h>
#include "json.h"

/* By enum incise_tool; ends with NULL. */
extern const char *const loop_tool_names[];

/* As JSON names them, from the lowest bit on. */
extern const char *const loop_flag_names[INCISE_TICK_FLAGS]; /* NULL: never set */

/*
 * A letter for each flag, from the lowest bit on, or '-'; incise-haptic(1) explains them.
 * text has INCISE_TICK_FLAGS + 1.
 */
const char *loop_flags_text(unsigned int flags, char *text);

/* Counts by the name of their flag. */
json_t *loop_flags_json(const uint64_t counts[INCISE_TICK_FLAGS]);

/* Bins of 1 µs or 100 ns as a quantile in their unit; INFINITY in the open last bin,
 * NaN of fewer wake-ups than the quantile takes, see stopwatch_resolves(). */
double loop_quantile(const uint64_t *histogram, double share, double unit);

/* "< 74 us", or that it lies beyond the histogram; text is the caller's. */
const char *loop_below(char *text, size_t size, double us);

/* Lateness of the wake-ups, µs, with the histogram. */
json_t *loop_lateness_json(const struct incise_loop_stats *stats);

/* The line "texture", if there was one. */
void loop_texture_line(const struct incise_loop_stats *stats,
		       const struct incise_scene *scene);

/* The line "lateness". */
void loop_lateness_line(const struct incise_loop_stats *stats);

#endif
