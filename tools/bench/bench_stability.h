/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench stability: how stiff a virtual wall may be, simulated in time beside what
 * theory says; the guard of passivity; integrators of a stiff spring.
 */
#ifndef INCISE_BENCH_STABILITY_H
#define INCISE_BENCH_STABILITY_H

#include <stdbool.h>

/* @plot: picture's name as the user gave it, or NULL. Fails the program, after the report,
 * when simulation and theory differ. */
void bench_stability(bool json, bool quick, const char *plot);

#endif
