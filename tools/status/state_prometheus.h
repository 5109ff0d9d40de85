/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The state of loops for Prometheus: its text format 0.0.4, in base units (s, N, J).
 */
#ifndef INCISE_STATE_PROMETHEUS_H
#define INCISE_STATE_PROMETHEUS_H

#include <stdio.h>
#include <incise/state.h>

struct state_metrics {
	const char *name;
	const struct incise_state_now *now;
};

/* All of several loops; a metric's lines stand together, as the format asks. */
void state_prometheus(FILE *out, const struct state_metrics *loops, int n);

#endif
