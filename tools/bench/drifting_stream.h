/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A stream of samples whose times of acquisition are known: a device with a clock of its
 * own, whose samples come late by chance, and some not at all.
 *
 *   taken     |    |    |    |    |    |    |     a period of the device's clock
 *   arrives    \delay, and up to 20 ms more
 *             ····|·|·······|·|||·······|··
 */
#ifndef INCISE_DRIFTING_STREAM_H
#define INCISE_DRIFTING_STREAM_H

#include <stdint.h>

/* Of its samples, each later than the quickest by up to LATE_MS, and a share is lost. */
#define STREAM_HZ 240
#define STREAM_DELAY_NS 4200000
#define STREAM_LATE_MS 20
#define STREAM_LOST 0.01

enum lateness_kind {
	LATE_UNIFORM,	  /* by anything up to 20 ms */
	LATE_EXPONENTIAL, /* by 5 ms in the mean, and no more than 20 ms */
	LATE_BURSTS,	  /* what has come goes on together, each 20 ms */
	LATE_KINDS
};
extern const char *const lateness_kinds[LATE_KINDS];

struct drifting_stream {
	uint64_t *seq;
	int64_t *arrival_ns;
	double *taken_ns; /* the truth */
	int n;
	double mean_late_ns; /* of arrivals later than the delay */
	int64_t grain_ns;    /* arrivals come on a grid; 0: on none */
};

/* A stream of so many seconds; to be freed with drifting_stream_end(). */
void drifting_stream_begin(struct drifting_stream *stream, enum lateness_kind kind,
			   double drift_ppm, double seconds, uint64_t seed);
void drifting_stream_end(struct drifting_stream *stream);

#endif
