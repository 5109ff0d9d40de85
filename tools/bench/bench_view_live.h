/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The picture beside a loop that runs: whether it takes all cuts of a fast loop, and whether
 * the loop is later for it.
 */
#ifndef INCISE_BENCH_VIEW_LIVE_H
#define INCISE_BENCH_VIEW_LIVE_H

#include <jansson.h>
#include <stdbool.h>
#include "wakeup.h"
#include "metrics.h"

/* Cuts at 5 kHz. */
struct absorbed {
	double seconds, cut_mm, tick_us, frames_hz;
	uint64_t ticks, lost, stamps;
	bool realtime;
};

void bench_view_absorbed(const char *scene, double seconds, struct absorbed *absorbed);
void absorbed_figures(const struct absorbed *absorbed, json_t *figures);
json_t *absorbed_json(const struct absorbed *absorbed);
void absorbed_print(const struct absorbed *absorbed);

/* The scene's loop without and with the picture: A B B A. */
#define BESIDE_RUNS 4

struct beside {
	struct wakeup run[BESIDE_RUNS];
	int n;
	double seconds; /* of each */
	bool realtime;
	/* Of all runs of a kind: without, with. */
	double p999_us[2], cyclictest_us[2];
};

void bench_view_beside(const char *scene, double seconds, bool quick,
		       struct beside *beside);
void beside_figures(const struct beside *beside, json_t *figures);
json_t *beside_json(const struct beside *beside);
void beside_print(const struct beside *beside);

#endif
