/* SPDX-License-Identifier: GPL-2.0-or-later */
#ifndef INCISE_BENCH_EXTREMES_H
#define INCISE_BENCH_EXTREMES_H

#include <stdbool.h>
#include <stdint.h>

/*
 * Try extreme numbers and bytes at each door of the library, and walls of 10 N/m to 1 GN/m;
 * print what came out, as a table or JSON, and draw the walls as @plot.png and .svg (NULL:
 * do not draw). Fails the program, after the report, when a case came out wrong.
 */
void bench_extremes(uint64_t seed, bool json, bool quick, const char *plot);

#endif
