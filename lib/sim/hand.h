/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A hand that holds the scalpel where one program says, a mouse for example, and whose pose
 * another thread takes: the newest one, whole, and neither waits.
 */
#ifndef INCISE_SIM_HAND_H
#define INCISE_SIM_HAND_H

#include <stdatomic.h>
#include <incise/sim.h>

struct incise_hand {
	_Atomic uint64_t turn; /* the pose of turn n is in pose[n % 2] */
	/* Position, velocity, quaternion; the next one is written beside the one that holds. */
	_Atomic double pose[2][10];
};

/* Up in the air, at rest. */
void incise_hand_init(struct incise_hand *hand);

/* One thread's. */
void incise_hand_move(struct incise_hand *hand, const double position_mm[3],
		      const double velocity_mm_s[3], const double quaternion[4]);

/* Any thread's. */
void incise_hand_look(const struct incise_hand *hand, double position_mm[3],
		      double velocity_mm_s[3], double quaternion[4]) INCISE_REALTIME;

#endif
