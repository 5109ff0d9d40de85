/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench precision: error against run time of the model's arithmetics, on this
 * machine, in one run.
 */
#ifndef INCISE_BENCH_PRECISION_H
#define INCISE_BENCH_PRECISION_H

#include <stdbool.h>

/* @path: model, or NULL for one of the paper's size; @plot: picture's name, or NULL. */
void bench_precision(const char *path, bool json, bool quick, const char *plot);

#endif
