/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Power to the actuators that a force needs, and away again.
 *
 *   hold_prepare() ─▶ hold_take() ─▶ ticks ─▶ hold_let_go()
 */
#ifndef INCISE_HAPTIC_HOLD_H
#define INCISE_HAPTIC_HOLD_H

#include <stdbool.h>
#include <incise/rig.h>

/*
 * Make the actuators ready for power: a target needs their 0.
 *
 * @home    find it, unless it is known
 * @recover clear first only faults that a dead program or a machine's sleep left latched: a
 * fault with its cause in the machine waits for a person
 *
 * Returns 0 or a negative errno.
 */
int hold_prepare(struct incise_rig *rig, bool home, bool recover,
		 struct incise_error *err);

/*
 * Power all of them, or no actuator. Poses of before are dropped. The first tick must follow
 * within their deadman's time. Returns 0 or a negative errno.
 */
int hold_take(struct incise_rig *rig, struct incise_error *err);

/*
 * Move to where there is no force, then power off; all actuators at once. Returns 0; -EIO if one
 * stopped by itself meanwhile, or a negative errno if its power cannot be taken away: the first.
 */
int hold_let_go(struct incise_rig *rig, struct incise_error *err);

#endif
