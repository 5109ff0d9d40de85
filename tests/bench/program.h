/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A benchmark that is a program of its own, build/tests/bench/NAME, of `make bench-all`; see
 * README.md. Its file declares it; main.c runs it.
 */
#ifndef INCISE_BENCH_PROGRAM_H
#define INCISE_BENCH_PROGRAM_H

#include "../../tools/bench/bench.h"

extern const struct bench bench_program;

#endif
