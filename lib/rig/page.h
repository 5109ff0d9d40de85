/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Slots of set-points and status in memory shared without a lock. Real-time safe.
 *
 *   writer   seq odd ── fields ── seq even          one at a time per slot
 *   reader   seq even ── copy ── the same seq       else once more
 *
 * Every word is read and written as an atomic, so that a race gives a torn copy, which
 * seq shows, and no undefined behaviour.
 */
#ifndef INCISE_PAGE_H
#define INCISE_PAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/export.h>
#include "../../driver/uapi/incise_stepper.h"

/*
 * Write all of a slot but its seq, which is the first of its @n words of 4 bytes. Repairs the odd seq of
 * a dead writer.
 */
void incise_page_write(void *slot, const void *from, size_t n) INCISE_REALTIME;

/* Copy a slot with its seq; false: the copy is torn. */
bool incise_page_read(const void *slot, void *to, size_t n) INCISE_REALTIME;

/*
 * Write a set-point; mode is INCISE_STEPPER_MODE_….
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
