/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The slots of set-points and status in memory that two share without a lock; both sides
 * of it. All are real-time safe.
 *
 *   writer   seq odd ── fields ── seq even          one at a time per slot
 *   reader   seq even ── copy ── the same seq       else once more
 *
 * Every word is read and written as an atomic, so that a race is a torn copy that seq
 * gives away, and never undefined.
 */
#ifndef INCISE_PAGE_H
#define INCISE_PAGE_H

#include <incise/export.h>
#include <stdint.h>
#include "abi.h"

/* Write a set-point; mode is INCISE_STEPPER_MODE_…. Heals a seq that a dead owner left. */
void incise_page_put_setpoint(struct incise_stepper_setpoint *slot, unsigned int mode,
			      int64_t target, int64_t t_ns) INCISE_REALTIME;

/*
 * Take a set-point that is newer than @seq. Returns 1 (taken: @copy; @seq is its), 0
 * (there is none), -EINVAL (one that nobody should write; @seq is its).
 */
int incise_page_get_setpoint(const struct incise_stepper_setpoint *slot, uint32_t *seq,
			     struct incise_stepper_setpoint *copy);

/* Write a status; its seq is the slot's own. */
void incise_page_put_status(struct incise_abi_status *slot,
			    const struct incise_abi_status *status);

/*
 * Read a status. Returns 0; -EAGAIN (it was being written each time one looked; @copy is as
 * it was), -EIO (what stands there makes no sense).
 */
int incise_page_get_status(const struct incise_abi_status *slot,
			   struct incise_abi_status *copy) INCISE_REALTIME;

#endif
