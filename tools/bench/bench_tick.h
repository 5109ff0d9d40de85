/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a tick of the haptic loop costs: all forces, guard and limits, over a plane, a sphere
 * and meshes; or over a user's scene.
 */
#ifndef INCISE_BENCH_TICK_H
#define INCISE_BENCH_TICK_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include "metrics.h"
#include "../cli/file.h"
#include "../cli/tick_cost.h"

#define BENCH_TICK_ROWS 5

struct tick_row {
	const char *name;
	size_t memory, triangles;
	double load_s;
	struct tick_cost cost;
	struct harness_time time; /* of a tick, in turn with the others */
	/* While they are measured: */
	struct incise_scene *scene;
	struct tick_stroke *timed;
};

/* The bench's own scenes, or @scene. Returns how many rows. */
int bench_tick(const char *scene, bool quick, struct tick_row rows[BENCH_TICK_ROWS]);

/* The bench's own plane as a file, for so many ticks a second. */
struct memory_file bench_tick_plane(double rate_hz);

/* A sheet of waves as an OBJ file, with so many cells of two triangles along each side. */
struct memory_file bench_tick_sheet(int cells);

json_t *tick_row_json(const struct tick_row *row);

/* {"median", "p99", "p999"} in ns. */
json_t *tick_cost_json(const struct tick_cost *cost);

void tick_rows_figures(const struct tick_row *rows, int n, json_t *figures);
void tick_rows_print(const struct tick_row *rows, int n);

#endif
