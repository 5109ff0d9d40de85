/* SPDX-License-Identifier: (GPL-2.0-only WITH Linux-syscall-note) OR LGPL-2.1-or-later */
/*
 * Flags of a tick: one set of bits for the loop in a program, its logs and status file, and
 * the kernel module.
 */
#ifndef INCISE_TICK_FLAGS_H
#define INCISE_TICK_FLAGS_H

/** Flags of a tick. */
enum incise_tick_flag {
	INCISE_TICK_CONTACT = 1,      /**< the tool is in the tissue */
	INCISE_TICK_EXTRAPOLATED = 2, /**< outside the model's support */
	/** no pose of the tool's station younger than pose_age_ms: the force ramps to 0 */
	INCISE_TICK_STALE = 4,
	INCISE_TICK_CLAMPED = 8, /**< the force was limited to force_N */
	INCISE_TICK_FAULT = 16,	 /**< a device failed: no force from now on */
	INCISE_TICK_SLEWED = 32, /**< the change of force was limited to slew_N_s */
	INCISE_TICK_TRAVEL = 64, /**< the actuator's target was clamped to its travel */
	/** a part of the force that nothing had paid for was left out; in old logs a guard's */
	INCISE_TICK_UNPAID = 128,
	INCISE_TICK_STARTING = 256,   /**< waiting for a small force, or ramping */
	INCISE_TICK_NOT_FINITE = 512, /**< the force was not finite: 0 was commanded */
	/** the newest pose is not used: its flag is unusable, see incise_pose_usable() */
	INCISE_TICK_UNUSABLE = 1024,
	INCISE_TICK_IN_CUT = 2048,     /**< handle or tube is in a cut */
	INCISE_TICK_MEMBRANE = 4096,   /**< the tool presses on the closed membrane */
	INCISE_TICK_LUMEN = 8192,      /**< the tool is through the membrane */
	INCISE_TICK_BACK_WALL = 16384, /**< the tool presses on the back wall */
	/** the blade leaves no cut: there are tissue.cuts_most cuts */
	INCISE_TICK_FULL = 32768,
};
#define INCISE_TICK_FLAGS 16 /**< number of flags */

#endif
