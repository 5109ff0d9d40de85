// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A hand that holds the scalpel where a program says; see hand.h.
 */
#include "hand.h"

#define TRIES 100

static const double above_mm = 30;

void incise_hand_init(struct incise_hand *hand)
{
	atomic_store(&hand->turn, 0);
	for (int i = 0; i < 10; i++)
		atomic_store(&hand->pose[0][i], i == 2 ? above_mm : i == 6);
}

void incise_hand_move(struct incise_hand *hand, const double position_mm[3],
		      const double velocity_mm_s[3], const double quaternion[4])
{
	uint64_t next = atomic_load_explicit(&hand->turn, memory_order_relaxed) + 1;

	/* Whoever sees any of these sees the turn before, and looks again. */
	atomic_thread_fence(memory_order_release);
	for (int i = 0; i < 10; i++)
		atomic_store_explicit(&hand->pose[next & 1][i],
				      i < 3   ? position_mm[i]
				      : i < 6 ? velocity_mm_s[i - 3]
					      : quaternion[i - 6],
				      memory_order_relaxed);
	atomic_store_explicit(&hand->turn, next, memory_order_release);
}

void incise_hand_look(const struct incise_hand *hand, double position_mm[3],
		      double velocity_mm_s[3], double quaternion[4])
{
	/* A mover that is put off in the middle is at the other pose; only one that moves
	 * twice meanwhile, which no hand does so fast, makes this look again. */
	for (int try = 0; try < TRIES; try++) {
		uint64_t turn = atomic_load_explicit(&hand->turn, memory_order_acquire);

		for (int i = 0; i < 10; i++) {
			double value = atomic_load_explicit(&hand->pose[turn & 1][i],
							    memory_order_relaxed);

			*(i < 3	  ? &position_mm[i]
			  : i < 6 ? &velocity_mm_s[i - 3]
				  : &quaternion[i - 6]) = value;
		}
		atomic_thread_fence(memory_order_acquire);
		if (turn == atomic_load_explicit(&hand->turn, memory_order_relaxed))
			return;
	}
}
