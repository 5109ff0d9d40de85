/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench vision: error of the exposed length against run time per picture.
 */
#ifndef INCISE_BENCH_VISION_H
#define INCISE_BENCH_VISION_H

#include <stdbool.h>

void bench_vision(bool json, bool quick, const char *plot);

#endif
