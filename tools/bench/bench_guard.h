/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench stability, experiment (e): a hand presses a light device on walls that are
 * far too stiff and answer late, with the library's guard and without it.
 *
 *   hand's press ──▶ device ──▶ x_k ──▶ wall ──▶ [late answer] ──▶ guard ──▶ clamp ──┐
 *                      ▲                                                             │
 *                      └────────── held for T ◀── [late actuator] ◀──────────────────┘
 */
#ifndef INCISE_BENCH_GUARD_H
#define INCISE_BENCH_GUARD_H

#include <stdbool.h>
#include <jansson.h>

#define GUARD_ROWS_MAX 768

/* How the guard is set: on in every tick, without its cap, or asked in contact only. */
enum guard_setting { GUARD_OFF, GUARD_ON, GUARD_UNCAPPED, GUARD_CONTACT, GUARD_SETTINGS };

struct guard_row {
	double K_N_mm;
	int delay;     /* ticks */
	bool actuator; /* it is the actuator that is late, behind the guard */
	enum guard_setting setting;
	double share;	/* of m/T: the cap */
	double clamp_N; /* 0: none */
	bool bounded;
	double largest_mm, largest_N; /* over the whole run */
	double late_mm;		      /* over its last quarter */
};

struct guard_bench {
	struct guard_row row[GUARD_ROWS_MAX];
	int n;
	int swept; /* of stiffness and delay; behind them are other caps */
};

void bench_guard(struct guard_bench *bench, bool quick);

/* Runs with the guard on and acting at once that were not bounded: there shall be none. */
int guard_bench_missed(const struct guard_bench *bench);

void guard_bench_print(const struct guard_bench *bench);
json_t *guard_bench_json(const struct guard_bench *bench);

/* How many of the late walls each setting holds. */
void guard_bench_figures(const struct guard_bench *bench, json_t *figures);

#endif
