/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise bench stability. They measure and report, and the reports are drawn.
 */
#ifndef INCISE_STABILITY_PARTS_H
#define INCISE_STABILITY_PARTS_H

#include "bench.h"

/* The device: light, in a loop of 1 kHz. */
#define DEVICE_KG 0.05
#define N_S2_PER_MM_KG 1e-3		    /* 1 kg = 1 N s²/m */
#define DEVICE (DEVICE_KG * N_S2_PER_MM_KG) /* N s²/mm */
#define PERIOD_S 1e-3

void stability_rest(struct bench_run *run);

extern const struct bench_table stability_rest_table;

#endif
