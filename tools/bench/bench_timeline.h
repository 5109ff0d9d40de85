/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench timeline: how far off the times are that samples are given, over how much of
 * the stream was seen and over what it costs.
 */
#ifndef INCISE_BENCH_TIMELINE_H
#define INCISE_BENCH_TIMELINE_H

#include <stdbool.h>
#include "drifting_stream.h"
#include "harness.h"
#include "time_methods.h"

struct timeline_row {
	const char *name;
	enum lateness_kind late;
	double drift_ppm, window_s;
	double rms_us, p99_us, max_us, mean_us;
	double stated_us,
		within; /* uncertainty, and the share of truth within twice it */
	struct harness_time time; /* of a sample */
	char failed[160];
};

/* Rows of a window stand together, those of a drift, and those of a lateness. */
struct timeline_table {
	struct timeline_row *row;
	int n;
	int windows, drifts; /* how many there are */
};

/* Writes the report to standard output, and with @plot a chart of that name. */
void bench_timeline(bool json, bool quick, const char *plot);

#endif
