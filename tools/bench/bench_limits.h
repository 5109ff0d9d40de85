/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench stability, experiments (a) and (b): the limits of a sampled wall, simulated
 * in time and computed.
 */
#ifndef INCISE_BENCH_LIMITS_H
#define INCISE_BENCH_LIMITS_H

#include "ratios.h"

/* A wall alone on the device against the exact limit, over damping and delay. */
void bench_exact_limit(struct ratios *ratios, bool quick);

/* The lowest stiffness that some mass and spring in the hand makes unstable, against the
 * bound of passivity. */
void bench_colgate(struct ratios *ratios, bool quick);

/* Small damping, against the linear law. */
void bench_gil(struct ratios *ratios, bool quick);

#endif
