/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench capture: how much of a core it takes to record force, tracker and pictures, and
 * to measure them, in real time.
 */
#ifndef INCISE_BENCH_CAPTURE_H
#define INCISE_BENCH_CAPTURE_H

#include <stdbool.h>

/* @only: one of its runs, or NULL; @seconds: of each; 0: the usual. */
void bench_capture(const char *only, double seconds, bool json, bool quick);

#endif
