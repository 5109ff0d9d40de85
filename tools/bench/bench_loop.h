/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise bench loop: what a tick of the haptic loop costs, how late the machine wakes it,
 * and how the error of the force depends on its rate.
 */
#ifndef INCISE_BENCH_LOOP_H
#define INCISE_BENCH_LOOP_H

#include <stdbool.h>

struct bench_loop {
	const char
		*scene;	  /* path of one to measure instead of the bench's own, or NULL */
	const char *load; /* the only one to measure wake-ups under, or NULL */
	double seconds;	  /* of each measurement of wake-ups; 0: the usual */
	bool json, quick;
	const char *plot; /* name of the pictures, or NULL */
};

void bench_loop(const struct bench_loop *bench);

#endif
