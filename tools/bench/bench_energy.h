/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench stability, experiments (c) and (d): the energy that a sampled wall makes,
 * against the friction that takes it.
 */
#ifndef INCISE_BENCH_ENERGY_H
#define INCISE_BENCH_ENERGY_H

#include "ratios.h"

/* From which amplitude on Coulomb friction does not end an oscillation. */
void bench_amplitude(struct ratios *ratios, bool quick);

/* From which stiffness on a hand that shakes across an encoder's steps gets energy. */
void bench_quantisation(struct ratios *ratios, bool quick);

/* What a press to a depth and back makes, and the damping that a bounce needs to take it. */
void bench_leak(struct ratios *ratios, bool quick);
void bench_break_even(struct ratios *ratios, bool quick);

#endif
