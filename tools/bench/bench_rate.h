/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * How far off the force is that a loop of a certain rate renders, on the virtual rig in
 * simulated time, and what that rate costs.
 */
#ifndef INCISE_BENCH_RATE_H
#define INCISE_BENCH_RATE_H

#include <jansson.h>
#include <stdbool.h>

/* Of a force against the exact one, over a cut. */
struct rate_error {
	double rms_N, max_N;
	double relative; /* rms as part of the exact force's rms */
};

struct rate_row {
	const char *wall, *poses; /* of a series */
	double rate_hz;
	double stiffness_N_mm, limit_N_mm; /* limit: NaN where it is not known */
	struct rate_error command, rendered;
	double hold_N;	  /* rms of an ideal sample and hold */
	double tick_ns;	  /* median */
	double ns_per_s;  /* of haptics */
	char failed[512]; /* why there are no figures; else empty */
};

struct rates {
	struct rate_row *row;
	int n;
	int series, rates; /* rows are in series, each of so many rates */
};

/* The rows live as long as the program. */
void bench_rate(bool quick, struct rates *rates);

json_t *rates_json(const struct rates *rates);
/* Errors at 1 kHz, and how far they are from those of a hold. */
void rates_figures(const struct rates *rates, json_t *figures);
void rates_print(const struct rates *rates);

#endif
