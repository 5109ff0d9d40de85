/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The actuator of the haptic scalpel: a stepper turns a screw whose nut pushes the handle
 * through a spring. There is no torque mode: the spring converts positions to forces.
 *
 *      motor ──▶ screw ──▶ nut ─/\/\/\/─ handle ◀── hand
 *                          position_mm    handle_mm
 *
 *      force_N = spring_N_mm · (position_mm - handle_mm)
 *
 * States:
 *
 *      disabled ── enable ─▶ ready ◀─▶ moving     set: a target, and a sign of life
 *         ▲                    │ deadman, limit, e-stop, alarm …
 *         ╰──── clear ──── fault ◀─ stopping      latched: nothing moves by itself again
 */
#ifndef INCISE_STEPPER_H
#define INCISE_STEPPER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/stepper_state.h>

INCISE_BEGIN_DECLS

/** Constant properties of the actuator. */
struct incise_stepper_info {
	char name[64];
	double spring_N_mm;	   /**< series spring */
	double travel_mm;	   /**< position is clamped to 0 … travel_mm */
	double step_mm;		   /**< a microstep */
	double velocity_mm_s;	   /**< largest */
	double acceleration_mm_s2; /**< largest */
	double jerk_mm_s3;	   /**< largest; 0: no limit */
	double deadman_s;	   /**< it stops after this time without a target */
	double rate_max_hz;	   /**< largest step rate of the backend; 0: any */
	double within_mm;	   /**< at rest, largest distance from the target … */
	double settle_s;	   /**< … after this time in state ready */
	bool measures_handle;	   /**< status has handle_mm and force_N */
	bool can_home;		   /**< incise_stepper_home() works */
	/**
	 * Without measures_handle: position of handle_mm = 0 along the actuator's axis, in the
	 * tracker's frame.
	 */
	double origin_mm;
	unsigned int inputs; /**< incise_stepper_line bits that are wired */
	double rest_mm;	     /**< nut position without force on a released handle */
	double late_s;	     /**< from a target to its force, from rig.conf; 0: unknown */
};

/** State of an actuator. */
struct incise_stepper_status {
	int64_t t_ns;
	double position_mm;   /**< of the nut, counted in microsteps */
	double velocity_mm_s; /**< of the nut */
	double handle_mm;     /**< of the handle; NaN if not measured */
	double force_N;	      /**< on the hand; NaN if not measured */
	unsigned int faults;  /**< incise_stepper_fault bits */
	enum incise_stepper_state state;
	unsigned int inputs; /**< incise_stepper_line bits that are active */
	bool homed;	     /**< position_mm is absolute, not only a count */
	uint64_t late;	     /**< late steps since it was opened */
};

struct incise_stepper;

/**
 * Set a new target. The nut moves only when powered; on the simulated rig it always is.
 * Without a target for the deadman time the nut stops and is switched off. With `retract` in
 * rig.conf, and on the simulated rig, it first returns to info.rest_mm, where there is no
 * force.
 *
 * @param position_mm target of the nut; clamped to the travel
 * @return 0; -EDOM (not finite; the last target remains), -EIO (not powered, or a fault is
 *         latched), -EPERM (opened with INCISE_RIG_WATCH), -ENODEV (gone). Real-time safe: no
 *         system call.
 */
INCISE_API int incise_stepper_set(struct incise_stepper *stepper,
				  double position_mm) INCISE_REALTIME;

/**
 * Move at a speed until the next target, within the travel; for bring-up. Otherwise as
 * incise_stepper_set().
 *
 * @return 0; -EDOM, -EIO, -ENODEV; -EOPNOTSUPP (the simulated rig).
 */
INCISE_API int incise_stepper_jog(struct incise_stepper *stepper, double velocity_mm_s);

/**
 * Read back position, force, state and faults.
 * @return 0, -EIO, -ENODEV. Real-time safe: no system call but the clock.
 */
INCISE_API int incise_stepper_status(struct incise_stepper *stepper,
				     struct incise_stepper_status *status)
	INCISE_REALTIME;

/**
 * Switch it on. Its target is its position; the deadman runs from now on.
 *
 * @return 0, also if it was on; -EPERM (a fault is latched: clear it), -EBUSY (an input
 *         forbids it, for example the emergency stop; the message names it), -EIO, -ENODEV.
 */
INCISE_API int incise_stepper_enable(struct incise_stepper *stepper,
				     struct incise_error *err);

/**
 * Bring it to rest, then switch it off; waits until that is done. A motor of the kernel module may also be
 * opened with INCISE_RIG_WATCH.
 * @return 0, -EIO, -ENODEV, -EPERM (opened with INCISE_RIG_WATCH), -ETIMEDOUT (not done after 1 s plus the
 *         time to stop)
 */
INCISE_API int incise_stepper_disable(struct incise_stepper *stepper,
				      struct incise_error *err);

/** Clear latched faults. @return 0; -EBUSY (a cause persists), -EIO, -ENODEV. */
INCISE_API int incise_stepper_clear(struct incise_stepper *stepper,
				    struct incise_error *err);

/**
 * Edge of the input found by homing. If the nut was homed before, the difference is the error
 * of the count since then, or the repeatability of the edge.
 */
struct incise_stepper_edge_found {
	/** In the count before homing; NaN: not reported by a drive that homes itself. */
	double before_mm;
	double after_mm; /**< in the new count: `home_mm` of rig.conf */
};

/**
 * Find the machine's 0: move towards the home input (without one, the limit at 0), back off,
 * approach again slowly, then move to `home_mm` of rig.conf. Must be powered. A drive that
 * homes itself uses its own method. Blocks for at most 60 s plus the time for the travel at
 * `home_mm_s`; a signal handler can stop it through @stop.
 *
 * @param stop checked between polls; non-zero ends with -EINTR and the nut at rest.
 *             May be NULL.
 * @param edge unchanged on an error; may be NULL
 * @return 0 if homed; -EOPNOTSUPP (neither input is wired), -EIO (a fault; the message names
 *         it), -ETIMEDOUT, -EINTR, -ENODEV.
 */
INCISE_API int incise_stepper_home(struct incise_stepper *stepper,
				   const volatile int *stop,
				   struct incise_stepper_edge_found *edge,
				   struct incise_error *err);

/** Return the constant properties of the actuator. */
INCISE_API void incise_stepper_info(const struct incise_stepper *stepper,
				    struct incise_stepper_info *info);

/**
 * Print the cause of a fault in one line that says what to do: the device's own description,
 * for example a drive's emergency message, else incise_stepper_fault_text().
 *
 * @param text always a string; empty without a fault
 * @return length of the line, as snprintf(3). For people: not real-time safe.
 */
INCISE_API int incise_stepper_cause(struct incise_stepper *stepper, char *text,
				    size_t size);

/** A counter of a backend since it was opened. */
struct incise_stepper_counter {
	const char *key;  /**< "sync_late", for JSON */
	const char *text; /**< "SYNCs sent late", for people */
	uint64_t value;
	bool trouble; /**< it should be 0 */
};

/**
 * Return the actuator's counter i, without status.late.
 * @param i 0 …
 * @return 0; -ENOENT (no more counters). The strings are valid as long as the device.
 */
INCISE_API int incise_stepper_counter(struct incise_stepper *stepper, int i,
				      struct incise_stepper_counter *counter);

/** A driver chip between the step line and the motor, as it reports itself. */
struct incise_stepper_chip {
	char name[100];	      /**< as in rig.conf, "tmc2209:/dev/serial0:0" */
	double run_A, hold_A; /**< its currents, root mean square */
	int microsteps;
	bool stealthchop; /**< StealthChop is at work, else SpreadCycle */
	bool standstill;
	bool warm; /**< temperature warning */
	int load;  /**< StallGuard's value, 0 to 1023: the smaller, the more load */
	int threshold;
	/** A stall is a load of at most this times the threshold; 0: a load of 0. */
	int threshold_load;
};

/**
 * Read the driver chip of an actuator: some messages, so up to 0.2 s. Not real-time safe.
 * @return 0; -EOPNOTSUPP (rig.conf names no driver), or the error of its line.
 */
INCISE_API int incise_stepper_chip(struct incise_stepper *stepper,
				   struct incise_stepper_chip *chip);

/** "disabled", "ready", "moving", "stopping", "fault". */
INCISE_API const char *incise_stepper_state_name(enum incise_stepper_state state);

/**
 * Text for a fault that says what to do, for example "e-stop: release it, then clear".
 * @param fault one bit
 */
INCISE_API const char *incise_stepper_fault_text(enum incise_stepper_fault fault);

INCISE_END_DECLS
#endif
