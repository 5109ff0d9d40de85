/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise bench stability. They measure and report, and what they report is drawn.
 */
#ifndef INCISE_STABILITY_PARTS_H
#define INCISE_STABILITY_PARTS_H

#include "bench.h"
#include "bench_device.h"

#define N(array) (int)(sizeof(array) / sizeof(*(array)))

void stability_guard(struct bench_run *run);
void stability_integrators(struct bench_run *run);

extern const struct bench_table stability_guard_table, stability_cap_table,
	stability_integrator_table;

#endif
