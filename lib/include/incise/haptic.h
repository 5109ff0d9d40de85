/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A haptic device: gives the pose of its handle, and takes a force on it.
 *
 *     hand ─▶ handle ─▶ position, velocity, buttons ──▶ incise_haptic_read()
 *               ▲
 *               ╰────── motors ◀── force, torque ◀───── incise_haptic_push()
 *
 * Its frame is the device's own: right-handed, mm. The group haptic_setup of rig.conf, and
 * `frame` of calibration.conf, place it in the scene; incise_rig_haptic() has the device of a rig.
 *
 * A device of a rig is owned by a small process, `incise device`, which gives no force when its
 * heartbeat stops; see incise/haptic_page.h. Only that of the simulated rig is not.
 */
#ifndef INCISE_HAPTIC_H
#define INCISE_HAPTIC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/haptic_page.h> /* struct incise_haptic_info */

INCISE_BEGIN_DECLS

/** Largest number of motors that a rig makes a device of (moteus). */
#define INCISE_HAPTIC_MOTORS_MAX 3

/** State of the device at a sample. */
enum incise_haptic_flag {
	/** Not calibrated, without supply, or in a state of its own: renders no force. */
	INCISE_HAPTIC_NOT_READY = 1,
	/** Its own protection has switched the force off, or limits it. */
	INCISE_HAPTIC_PROTECTED = 2,
	/** A battery is low. */
	INCISE_HAPTIC_BATTERY = 4,
	/** Position and velocity are of another device than before: ids changed. */
	INCISE_HAPTIC_CHANGED = 8,
};
#define INCISE_HAPTIC_FLAGS 4 /**< number of flags */

/** A sample of the handle. */
struct incise_haptic_sample {
	int64_t t_ns; /**< of the acquisition, CLOCK_MONOTONIC, as well as it is known */
	uint64_t seq; /**< counts from 0; a gap is a lost sample */
	double position_mm[3];	 /**< in the device's frame */
	double velocity_mm_s[3]; /**< NaN: the device gives none */
	/** unit, w first; from the handle's to the device's frame; 1 0 0 0 without orientation */
	double quaternion[4];
	uint32_t buttons; /**< pressed ones, the first is bit 0 */
	uint32_t flags;	  /**< incise_haptic_flag bits */
};

/** Settings of a haptic device; the group `haptic_setup` of rig.conf. */
struct incise_haptic_setup {
	/* In place of the device's own; 0: as the device says. */
	double mass_kg, damping_N_s_mm, coulomb_N;
	double peak_N, continuous_N;
	double low_mm[3], high_mm[3];
	double latency_ms, force_latency_ms;
	double rate_hz;
	/** Frame of the device in the tracker's frame of the scene: unit, w first, and its origin. */
	double turn[4], origin_mm[3];
	int clutch; /**< button, from 1, that uncouples the tool while pressed; 0: none */
	int enable; /**< button, from 1, without which there is no force; 0: none */
	double start_s; /**< from no force to all of it; default 1 */
	double lost_s;	/**< its owner ends so long after its last user; default 5 */
	/* Motors of a device that a rig is made of (moteus), each along a line through the handle. */
	double motor_direction
		[3 *
		 INCISE_HAPTIC_MOTORS_MAX]; /**< of the handle as it turns positively */
	double motor_mm_turn[INCISE_HAPTIC_MOTORS_MAX]; /**< 2 π radius, or the lead */
	double motor_torque_N_mm[INCISE_HAPTIC_MOTORS_MAX]; /**< largest */
	int n_motor_directions, n_motors, n_motor_torques;  /**< numbers given in each */
};

/** The reason why a rig's device takes no force. */
enum incise_haptic_off {
	INCISE_HAPTIC_ON,
	/** The handle has not been in the middle of the workspace since the last stop. */
	INCISE_HAPTIC_OUTSIDE,
	INCISE_HAPTIC_CLUTCH,  /**< its button is pressed */
	INCISE_HAPTIC_ENABLE,  /**< its button is not pressed */
	INCISE_HAPTIC_UNREADY, /**< by the flags of the last sample */
	INCISE_HAPTIC_LATE,    /**< samples are older than the plan assumed */
};

/** The same in words: "on, …", or "off: …" with what to do. */
INCISE_API const char *incise_haptic_off_text(enum incise_haptic_off off);

#define INCISE_HAPTIC_CUT_MAX 16 /**< bytes of the reason of a cut */

/** Ages of a rig's samples at the ticks of a plan, and its losses. */
struct incise_haptic_ages {
	uint64_t ticks, lost;
	double assumed_ms;		    /**< by the plan: latency and period */
	double mean_ms, most_ms, jitter_ms; /**< jitter: standard deviation */
	/** Times that the device's owner took the force away though the loop asked for one; 0 without owner. */
	unsigned int cuts;
	/** Reason of the last time, as the state in the log of incise device; or "" */
	char last_cut[INCISE_HAPTIC_CUT_MAX];
};

/** Count the age at @p now_ns of a sample of @p t_ns. Returns the age, ns. */
INCISE_API int64_t incise_haptic_ages_add(struct incise_haptic_ages *ages, int64_t t_ns,
					  int64_t now_ns) INCISE_REALTIME;

struct incise_haptic;

/**
 * Open a device in this process; a rig opens its own by itself. For its owner.
 *
 * @param device BACKEND:ARGUMENTS, as in rig.conf; not "local:"
 * @param where  begin of messages
 * @param clock  real; must outlive the device
 * @return device, to be closed with incise_haptic_close(); NULL with errno ENODEV (no such
 *         backend, or no such device), EINVAL (arguments), EBUSY (another program has it),
 *         ETIMEDOUT (no answer), EPROTO (wrong answers), EACCES, EIO, ENOMEM
 */
INCISE_API struct incise_haptic *incise_haptic_open(
	const char *device, const char *where, const struct incise_haptic_setup *setup,
	struct incise_clock *clock, struct incise_error *err);

/** No force, then close it. NULL is accepted. */
INCISE_API void incise_haptic_close(struct incise_haptic *haptic);

/**
 * Take samples that have arrived, oldest first, without waiting.
 *
 * @return number of samples, 0 … n; -EIO, -ENODEV (unplugged), -EPROTO (not understood), -ESHUTDOWN (its
 *         owner ended)
 */
INCISE_API int incise_haptic_read(struct incise_haptic *haptic,
				  struct incise_haptic_sample *samples,
				  int n) INCISE_REALTIME;

/**
 * Set the force, and torque, on the handle from now on, in the device's frame. It is a sign of life,
 * too: without one the force becomes 0.
 *
 * @param torque_N_mm or NULL
 * @return 0; -EDOM (not finite: the last force remains, and ages), -EIO, -ENODEV, -ESHUTDOWN
 */
INCISE_API int incise_haptic_push(struct incise_haptic *haptic, const double force_N[3],
				  const double torque_N_mm[3]) INCISE_REALTIME;

/** Get the properties of the device. */
INCISE_API void incise_haptic_info(const struct incise_haptic *haptic,
				   struct incise_haptic_info *info);

/** Samples lost so far. */
INCISE_API uint64_t incise_haptic_lost(const struct incise_haptic *haptic);

/**
 * Print the cause of an error, or why there is no force, in one line that says what to do.
 *
 * @return length of the line, as snprintf(3); 0: none. Not real-time safe.
 */
INCISE_API int incise_haptic_cause(struct incise_haptic *haptic, char *text, size_t size);

INCISE_END_DECLS
#endif
