/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Steps on lines from user space, by the same rules as the kernel module's timer: shortest
 * times, limits, deadman, latched faults. It has no thread and no clock, so that tests run it
 * in simulated time.
 *
 *   set-points ─▶ profile ─▶ plan ─▶ one edge at a time ─▶ lines
 *   inputs ────────────────▶  │
 *   status ◀──────────────────╯
 *
 *   dir   ────╥────────────────────────────────────────────────╥──────────
 *   step  ____╨___________┌───────┐_______┌───────┐____________╨_____┌────
 *              set_up ≥     high ≥  low ≥           hold ≥   set_up ≥
 */
#ifndef INCISE_PULSER_H
#define INCISE_PULSER_H

#include <stdbool.h>
#include <stdint.h>
#include "../../rig/motion.h"

struct incise_pulser;

enum incise_pulser_output { INCISE_PULSER_STEP, INCISE_PULSER_DIR, INCISE_PULSER_ENABLE };

/* Clock and lines. */
struct incise_pulser_ops {
	int64_t (*now)(void *world); /* ns; monotonic */
	/* 0 or a negative errno */
	int (*write)(void *world, enum incise_pulser_output output, bool active);
	/* INCISE_STEPPER_LINE_… bits that are active, or a negative errno */
	int (*inputs)(void *world);
};

/* One motor, for one thread. */
struct incise_pulser {
	const struct incise_pulser_ops *ops;
	void *world;
	struct incise_motion motion; /* its setpoint and slot are to be set */
	uint32_t home; /* INCISE_STEPPER_LINE_… bit of the home edge, or 0 */

	/* private */
	struct incise_profile_slot steps;  /* of this tick */
	int32_t given;			   /* of them */
	int64_t interval_ns;		   /* of steps at the largest velocity */
	int64_t base_ns;		   /* start of the tick */
	int64_t powered_ns;		   /* no step before that */
	int64_t lead_ns, trail_ns, dir_ns; /* times of the last edges */
	int64_t lead_want_ns;		   /* of that step in the profile */
	uint32_t late_row;
	int direction; /* +1, -1; 0: not known */
	bool high;
};

/* A motor without power at 0. Returns 0, or -EINVAL of incise_profile_init(). */
int incise_pulser_init(struct incise_pulser *pulser,
		       const struct incise_stepper_config *config);

/*
 * Do the action that is due. Returns the time of the next call, ns. A late call delays steps,
 * but never makes intervals too short.
 */
int64_t incise_pulser_run(struct incise_pulser *pulser);

/* Like the ioctls of the same names. */
int incise_pulser_enable(struct incise_pulser *pulser);
void incise_pulser_disable(struct incise_pulser *pulser);
int incise_pulser_clear(struct incise_pulser *pulser);
int incise_pulser_origin(struct incise_pulser *pulser, int32_t steps, bool homed);

/* Latch an INCISE_STEPPER_FAULT_… from outside, for example OWNER; no effect without power. */
void incise_pulser_fault(struct incise_pulser *pulser, uint32_t fault);

#endif
