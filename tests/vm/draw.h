/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Draws of chance that a seed draws again: numbers, and limits of a motor.
 */
#ifndef INCISE_VM_DRAW_H
#define INCISE_VM_DRAW_H

#include <stdint.h>

#include "bench.h"

void draw_seed(uint64_t seed);
uint64_t draw(void);

/* A whole number, both ends included. */
int64_t draw_between(int64_t from, int64_t to);

/* As many of them small as large. */
double draw_scattered(double from, double to);

/* Limits that the module takes; only a jerk may be too low for the tick (ERANGE). */
struct incise_stepper_config draw_config(const struct bench *bench, unsigned int motor);

#endif
