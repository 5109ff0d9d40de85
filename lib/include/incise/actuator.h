/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What a real actuator is made of, as the group `actuator` of rig.conf says (rig.conf(5)
 * has ranges and defaults), and the one place where mm become microsteps and back.
 *
 *      microsteps ─▶ turns ─▶ mm        step_mm = lead_mm / (steps_per_turn · microsteps)
 *      0 ─────────────────── travel     position 0 is where the spring gives no force
 *
 * For backends of steppers; see incise/backend.h.
 */
#ifndef INCISE_ACTUATOR_H
#define INCISE_ACTUATOR_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/export.h>
#include <incise/profile.h>

INCISE_BEGIN_DECLS

/** GPIO lines of the group `lines`; the first three are outputs. */
enum incise_actuator_line {
	INCISE_LINE_STEP,
	INCISE_LINE_DIR,
	INCISE_LINE_ENABLE,
	INCISE_LINE_LIMIT_MIN,
	INCISE_LINE_LIMIT_MAX,
	INCISE_LINE_HOME,
	INCISE_LINE_ESTOP,
	INCISE_LINE_ALARM,
};
#define INCISE_LINES 8	   /**< how many there are */
#define INCISE_LINES_OUT 3 /**< how many of them are outputs */

struct incise_actuator {
	double spring_N_mm, travel_mm;
	double lead_mm;	    /**< per turn */
	int steps_per_turn; /**< whole steps of the motor */
	int microsteps;	    /**< per whole step */
	bool invert;	    /**< a step up is the dir line inactive */
	double velocity_mm_s, acceleration_mm_s2;
	double jerk_mm_s3; /**< 0: not limited */
	double deadman_s;
	bool retract; /**< on a deadman, go to 0 before power goes away */
	uint32_t tick_ns;
	uint32_t high_ns, low_ns; /**< 0: not given, as short as the machine can */
	uint32_t setup_ns, hold_ns;
	uint64_t enable_ns;
	double home_mm_s, home_mm;
	double origin_mm;	 /**< see struct incise_stepper_info */
	bool has_lines;		 /**< the group `lines` is there */
	int line[INCISE_LINES];	 /**< offsets; -1: not wired */
	unsigned int active_low; /**< bits 1 << incise_actuator_line */
};

/** One microstep, mm. */
INCISE_API double incise_actuator_step_mm(const struct incise_actuator *actuator);

/** The microstep nearest to a position, within the travel; 0 for what is no number. */
INCISE_API int32_t incise_actuator_steps(const struct incise_actuator *actuator,
					 double position_mm);

/** The same of a speed, within the largest; microsteps/s. */
INCISE_API int64_t incise_actuator_rate(const struct incise_actuator *actuator,
					double velocity_mm_s);

/** Limits in microsteps, for a profile; rounded towards the slower and nearer. */
INCISE_API void incise_actuator_limits(const struct incise_actuator *actuator,
				       struct incise_profile_limits *limits);

INCISE_END_DECLS
#endif
