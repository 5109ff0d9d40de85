/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The actuator before the first tick of a loop and after the last one.
 */
#ifndef INCISE_HAPTIC_ACTUATOR_H
#define INCISE_HAPTIC_ACTUATOR_H

#include <stdbool.h>
#include <incise/rig.h>

/*
 * Power it. Without its 0 a target is no position: that of a real machine must be found,
 * where it has a switch for that. The first tick must follow within its deadman's time.
 *
 * @home    find the 0, unless it is known
 * @recover clear first what a program that died and a machine that slept leave latched, and
 *          only that: a fault that has its cause in the machine waits for a person
 *
 * Returns 0 or a negative errno.
 */
int haptic_take_hold(struct incise_rig *rig, bool home, bool recover,
		     struct incise_error *err);

/* To where there is no force, then without power. What fails of it is warned of. */
void haptic_let_go(struct incise_rig *rig);

#endif
