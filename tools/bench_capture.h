/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench capture: how much of a core it takes to record the virtual rig's force and
 * tracker and to measure its pictures, in real time.
 */
#ifndef INCISE_BENCH_CAPTURE_H
#define INCISE_BENCH_CAPTURE_H

#include <stdbool.h>

void bench_capture(bool json, bool quick);

#endif
