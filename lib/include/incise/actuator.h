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

/** How a drive on a bus is told where to go; CiA 402's cyclic modes. */
enum incise_actuator_mode {
	INCISE_ACTUATOR_CSP, /**< positions; the drive closes all loops */
	INCISE_ACTUATOR_CSV, /**< velocities; the loop of position is closed here */
	INCISE_ACTUATOR_CST, /**< torques; those of position and velocity are closed here */
};

/** A drive on a CAN bus: the group `can`. 0 in a unit: as the drive itself says. */
struct incise_actuator_can {
	enum incise_actuator_mode mode;
	uint32_t bitrate;		  /**< 0: that of the interface */
	uint32_t cycle_ns;		  /**< between SYNCs */
	double counts_per_turn;		  /**< position units per turn of the screw */
	double velocity_per_turn_s;	  /**< velocity units of a turn/s: 60 for rpm */
	double acceleration_per_turn_s2;  /**< acceleration units of a turn/s² */
	double following_mm, following_s; /**< off its target by that, for so long */
	int homing_method;		  /**< CiA 402's number; 0: it cannot home */
	bool absolute;		      /**< its count is the machine's from power-on on */
	double position_gain_1_s;     /**< csv: mm/s per mm */
	double stiffness_permille_mm; /**< cst: ‰ of the rated torque */
	double damping_permille_s_mm;
	double torque_max_permille;
	int master; /**< node id of this program's heartbeat, 1 … 127 */
};

/** What rig.conf says of an actuator. Lengths in mm, times as their names say. */
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
	struct incise_actuator_can can;
};

/** One microstep, mm. */
INCISE_API double incise_actuator_step_mm(const struct incise_actuator *actuator)
	INCISE_REALTIME;

/** The microstep nearest to a position, within the travel; 0 for what is no number. */
INCISE_API int32_t incise_actuator_steps(const struct incise_actuator *actuator,
					 double position_mm) INCISE_REALTIME;

/** The same of a speed, within the largest; microsteps/s. */
INCISE_API int64_t incise_actuator_rate(const struct incise_actuator *actuator,
					double velocity_mm_s);

/** Limits in microsteps, for a profile; rounded towards the slower and nearer. */
INCISE_API void incise_actuator_limits(const struct incise_actuator *actuator,
				       struct incise_profile_limits *limits);

INCISE_END_DECLS
#endif
