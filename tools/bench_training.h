/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench training: how long training takes on data of the paper's size.
 */
#ifndef INCISE_BENCH_TRAINING_H
#define INCISE_BENCH_TRAINING_H

#include <stdbool.h>

void bench_training(bool json, bool quick);

#endif
