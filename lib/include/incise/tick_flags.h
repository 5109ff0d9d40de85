/* SPDX-License-Identifier: (GPL-2.0-only WITH Linux-syscall-note) OR LGPL-2.1-or-later */
/*
 * Things worth counting about a tick: one set of bits for the loop in a program, its logs and state
 * page, and the kernel module.
 */
#ifndef INCISE_TICK_FLAGS_H
#define INCISE_TICK_FLAGS_H

/** Things worth counting about a tick. */
enum incise_tick_flag {
	INCISE_TICK_CONTACT = 1,      /**< the tool is in the tissue */
	INCISE_TICK_EXTRAPOLATED = 2, /**< the model was asked outside its support */
	/** no pose of the held tool's station younger than pose_age_ms: the force fades */
	INCISE_TICK_STALE = 4,
	INCISE_TICK_CLAMPED = 8, /**< the force was held at force_N */
	INCISE_TICK_FAULT = 16,	 /**< a device failed: no force from here on */
	INCISE_TICK_SLEWED = 32, /**< the change of force was held at slew_N_s */
	INCISE_TICK_TRAVEL = 64, /**< the actuator's target was held within its travel */
	/* 128 was a guard's, and is never set: pages and logs keep their bits */
	INCISE_TICK_STARTING = 256,   /**< waiting for a small force, ramping or fading */
	INCISE_TICK_NOT_FINITE = 512, /**< the force was no number: none was asked for */
	/** the tracker flags the newest pose: not used, by incise_pose_usable() */
	INCISE_TICK_UNUSABLE = 1024,
	INCISE_TICK_IN_CUT = 2048,     /**< handle or tube is in a cut */
	INCISE_TICK_MEMBRANE = 4096,   /**< the tool is on the membrane, which holds */
	INCISE_TICK_LUMEN = 8192,      /**< it is through the membrane */
	INCISE_TICK_BACK_WALL = 16384, /**< it presses on the wall behind */
	/** the blade leaves no cut: tissue.cuts_most are there */
	INCISE_TICK_FULL = 32768,
};
#define INCISE_TICK_FLAGS 16 /**< how many there are */

#endif
