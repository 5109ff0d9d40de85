/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The haptic scalpel's actuator: a stepper turns a screw whose nut pushes the handle
 * through a spring. There is no torque mode: force is what the spring makes of a
 * position.
 *
 *      motor ──▶ screw ──▶ nut ─/\/\/\/─ handle ◀── hand
 *                          position_mm    handle_mm
 *
 *      force_N = spring_N_mm · (position_mm - handle_mm)
 */
#ifndef INCISE_STEPPER_H
#define INCISE_STEPPER_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** What is fixed about the actuator. */
struct incise_stepper_info {
	char name[64];
	double spring_N_mm;	   /**< series spring */
	double travel_mm;	   /**< position is held within 0 … travel_mm */
	double step_mm;		   /**< one microstep */
	double velocity_mm_s;	   /**< largest */
	double acceleration_mm_s2; /**< largest */
};

/** Why an actuator does not move; bits. */
enum incise_stepper_fault {
	INCISE_STEPPER_DEADMAN = 1, /**< set-points stopped coming */
	INCISE_STEPPER_TRAVEL = 2, /**< a set-point lay outside the travel and was held */
};

/** Where it stands. */
struct incise_stepper_status {
	int64_t t_ns;
	double position_mm;  /**< of the nut, counted in microsteps */
	double handle_mm;    /**< of the handle */
	double force_N;	     /**< on the hand */
	unsigned int faults; /**< incise_stepper_fault bits */
};

struct incise_stepper;

/**
 * Give a new target. Without one for the deadman time (100 ms) the nut goes back to 0,
 * which is no force, and stays until the next target.
 *
 * @param position_mm target of the nut; clamped to the travel
 * @return 0; -EDOM (not finite; the last target stands), -EIO, -ENODEV. Real-time safe.
 */
INCISE_API int incise_stepper_set(struct incise_stepper *stepper, double position_mm);

/** Read back position, force and faults. @return 0, -EIO, -ENODEV. Real-time safe. */
INCISE_API int incise_stepper_status(struct incise_stepper *stepper,
				     struct incise_stepper_status *status);

INCISE_API void incise_stepper_info(const struct incise_stepper *stepper,
				    struct incise_stepper_info *info);

INCISE_END_DECLS
#endif
