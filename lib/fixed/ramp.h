/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The ramp of a motion profile: positions of whole ticks within limits of velocity and
 * acceleration; see ramp.c. Units are 2^-32 steps, and ticks.
 */
#ifndef INCISE_RAMP_H
#define INCISE_RAMP_H

#include "profile.h"

/* A way without an end. A kernel has no UINT64_MAX. */
#define INCISE_RAMP_UNBOUNDED (~(uint64_t)0)

/* Stand at a position; velocity and acceleration are set before. */
void incise_ramp_stand(struct incise_ramp *ramp, int64_t position);

/* One tick: velocity, then position. */
void incise_ramp_tick(struct incise_ramp *ramp);

/*
 * The way from velocity v to rest, without the tick at v itself: v - a, v - 2a, … down to
 * what is left. May be INCISE_RAMP_UNBOUNDED from 2^62 on.
 */
uint64_t incise_ramp_way(uint64_t velocity, uint64_t acceleration);

#endif
