/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench training: error on unseen cuts against the time that training takes, on data
 * of the paper's size whose truth is known.
 */
#ifndef INCISE_BENCH_TRAINING_H
#define INCISE_BENCH_TRAINING_H

#include <stdbool.h>

/* Print as a table or JSON, and draw as @plot.png and .svg (NULL: do not draw). */
void bench_training(bool json, bool quick, const char *plot);

#endif
