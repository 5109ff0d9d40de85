/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Slots of set-points and status in memory shared without a lock. Real-time safe.
 *
 *   writer   seq odd ── fields ── seq even          one at a time per slot
 *   reader   seq even ── copy ── the same seq       else once more
 *
 * The lock and its use of atomics are those of incise/haptic_page.h.
 */
#ifndef INCISE_PAGE_H
#define INCISE_PAGE_H

#include <incise/export.h>
#include <stdint.h>
#include "../../driver/uapi/incise_stepper.h"

/*
 * Write a set-point; mode is INCISE_STEPPER_MODE_…. Repairs the odd seq of a dead owner.
 */
void incise_page_put_setpoint(struct incise_stepper_setpoint *slot, unsigned int mode,
			      int64_t target, int64_t t_ns) INCISE_REALTIME;

/* The same with a pose for the controller's plan. */
void incise_page_put_pose(struct incise_stepper_setpoint *slot,
			  const struct incise_stepper_pose *pose,
			  int64_t t_ns) INCISE_REALTIME;

/*
 * Read a set-point newer than @seq. 1: @copy and @seq are set; 0: no set-point; -EINVAL:
 * an invalid one.
 */
int incise_page_get_setpoint(const struct incise_stepper_setpoint *slot, uint32_t *seq,
			     struct incise_stepper_setpoint *copy);

/* Write a status; its seq is the slot's own. */
void incise_page_put_status(struct incise_stepper_motor_status *slot,
			    const struct incise_stepper_motor_status *status);

/*
 * 0; -EAGAIN: it was being written at each try, @copy is unchanged; -EIO: impossible
 * values.
 */
int incise_page_get_status(const struct incise_stepper_motor_status *slot,
			   struct incise_stepper_motor_status *copy) INCISE_REALTIME;

/* The same for the status of a plan. */
int incise_page_get_plan(const struct incise_stepper_plan_status *slot,
			 struct incise_stepper_plan_status *copy) INCISE_REALTIME;

#endif
