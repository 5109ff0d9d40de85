/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Motions of a scalpel whose truth is known at any time: what poses are held against.
 *
 *   line      ╱        30 mm/s, for ever
 *   tremor    ∿∿∿∿     ±0.1 mm at 8, 10 and 12 Hz, one on each axis
 *   stroke    ╭─╮_╭─   40 mm and back, 10 mm deep, up to 94 mm/s; the hand leans
 *   wall      ╲__╱     60 mm/s, and stopped dead in no time
 *   surgeon            two cuts of the virtual rig, with its tremor
 */
#ifndef INCISE_MOTIONS_H
#define INCISE_MOTIONS_H

#include <stdint.h>

struct motion_state {
	double position_mm[3], velocity_mm_s[3];
	double quaternion[4]; /* unit, w first */
};

struct motion {
	const char *name, *about;
	/* NULL: the virtual surgeon's, of which the virtual rig tells. */
	void (*at)(double t_s, struct motion_state *state);
};

#define MOTIONS 5
#define MOTION_LINE 0
#define MOTION_STROKE 2
extern const struct motion motions[MOTIONS];

/* The states at n times, each at least 1 us after the one before, and 1 ms or more. */
void motion_states(const struct motion *motion, const int64_t *t_ns, int n,
		   struct motion_state *states);

#endif
