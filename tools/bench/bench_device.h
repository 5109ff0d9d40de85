/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The device of incise bench stability: light, in a loop of 1 kHz.
 */
#ifndef INCISE_BENCH_DEVICE_H
#define INCISE_BENCH_DEVICE_H

#define DEVICE_KG 0.05
#define N_S2_PER_MM_KG 1e-3		    /* 1 kg = 1 N s²/m */
#define DEVICE (DEVICE_KG * N_S2_PER_MM_KG) /* N s²/mm */
#define PERIOD_S 1e-3

#endif
