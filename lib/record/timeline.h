/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From the time a sample arrived to the time it was acquired, for one stream.
 *
 *     acquisition ──── latency ────► arrival            (both CLOCK_MONOTONIC, ns)
 *
 * First form: the device's nominal latency is taken off. Times never stand still or run
 * backwards, whatever the device says, so that readers may rely on it.
 */
#ifndef INCISE_TIMELINE_H
#define INCISE_TIMELINE_H

#include <stdint.h>

struct incise_timeline {
	int64_t latency_ns;
	int64_t last_ns; /* given out last */
};

void incise_timeline_init(struct incise_timeline *timeline, int64_t latency_ns);

/* Acquisition time of a sample; later than that of any sample before it. */
int64_t incise_timeline_acquired(struct incise_timeline *timeline, int64_t arrival_ns);

#endif
