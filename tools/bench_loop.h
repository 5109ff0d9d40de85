/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench loop: what a tick of the haptic loop costs, and how late the machine wakes
 * it.
 */
#ifndef INCISE_BENCH_LOOP_H
#define INCISE_BENCH_LOOP_H

#include <stdbool.h>

/* @scene: path of one to measure instead of the bench's own, or NULL. */
void bench_loop(const char *scene, bool json, bool quick);

#endif
