/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Random numbers of the virtual rig: deviate n of a stream is a function of the stream's
 * key and n alone. So no device disturbs another's, none has to be drawn to reach the
 * next, and reading in other portions changes nothing.
 */
#ifndef INCISE_SIM_RANDOM_H
#define INCISE_SIM_RANDOM_H

#include <incise/export.h>
#include <stdint.h>

enum incise_random_purpose {
	INCISE_RANDOM_SURGEON,
	INCISE_RANDOM_TOOTH,
	INCISE_RANDOM_BOUNDARY,
	INCISE_RANDOM_TRACKER,
	INCISE_RANDOM_FORCE,
	INCISE_RANDOM_CAMERA,
};

uint64_t incise_random_key(uint64_t seed, enum incise_random_purpose purpose);

/* 64 random bits. */
uint64_t incise_random_bits(uint64_t key, uint64_t n);

/* Evenly distributed in 0 … 1, 1 excluded. */
double incise_random_uniform(uint64_t key, uint64_t n) INCISE_REALTIME;

/* Normally distributed with mean 0 and sd 1; never beyond 6.7. */
double incise_random_normal(uint64_t key, uint64_t n) INCISE_REALTIME;

#endif
