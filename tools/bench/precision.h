/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise bench precision beside the evaluators: error against run time of forces, and of
 * what has a setting.
 */
#ifndef INCISE_PRECISION_PARTS_H
#define INCISE_PRECISION_PARTS_H

#include "bench.h"

void precision_forces(struct bench_run *run);
void precision_settings(struct bench_run *run);

extern const struct bench_table precision_force_table, precision_grid_table,
	precision_square_table;

#endif
