/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Wall time for people and programs; see incise/wall.h.
 */
#ifndef INCISE_TOOLS_WALL_REPORT_H
#define INCISE_TOOLS_WALL_REPORT_H

#include <stdint.h>
#include <jansson.h>
#include <incise/wall.h>

/* "0.013 ms"; "unknown". */
void wall_uncertainty_text(int64_t uncertainty_ns, char text[INCISE_WALL_TEXT]);

/* Lines of a recording from start_ns to end_ns, CLOCK_MONOTONIC. */
void wall_text(const struct incise_wall *wall, int64_t start_ns, int64_t end_ns);

/* An object; NULL: no memory. */
json_t *wall_json(const struct incise_wall *wall, int64_t start_ns, int64_t end_ns);

#endif
