/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench stability, experiment (f): error against run time of integrators of a
 * spring from soft to hard, ratio of damping 0.1, 50 g. Every one is listed, those that
 * diverge too.
 *
 *   force  2 N          ┌───────────
 *          1 N  ┌───────┘             each for a second, at 1 kHz
 *            0 ─┘
 */
#ifndef INCISE_BENCH_INTEGRATORS_H
#define INCISE_BENCH_INTEGRATORS_H

#include <stdbool.h>
#include <jansson.h>
#include "metrics.h"
#include "integrators.h"

#define INTEGRATOR_ROWS_MAX 256

struct integrator_row {
	enum integrator kind;
	double K_N_m, step_s;
	/* Of the places at whole milliseconds, as part of the largest true one. */
	double max_error, rms_error;
	struct harness_time ms_time; /* of run time, for a ms of motion */
	bool diverged;
};

struct integrator_bench {
	struct integrator_row row[INTEGRATOR_ROWS_MAX];
	int n;
	int table; /* rows of the table at 1 kHz; behind them are other steps */
};

void bench_integrators(struct integrator_bench *bench, bool quick);

/* Rows of the exact ones that are not. */
int integrator_bench_missed(const struct integrator_bench *bench);

void integrator_bench_print(const struct integrator_bench *bench);
json_t *integrator_bench_json(const struct integrator_bench *bench);

/* Times and errors at 1 kHz. */
void integrator_bench_figures(const struct integrator_bench *bench, json_t *figures);

#endif
