/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench scenes: what each scene leaves out, and what that saves.
 */
#ifndef INCISE_BENCH_SCENES_H
#define INCISE_BENCH_SCENES_H

#include <stdbool.h>

#define BENCH_SCENES_MOST 64

/* Scenes by name or file; with none those that ship and some that are made here. */
void bench_scenes(char *const *scenes, int n, bool json, bool quick, const char *plot);

/* Run some ticks of a scene, with what it needs or in full, for another program to count. */
void bench_scenes_profile(const char *scene, bool full);

#endif
