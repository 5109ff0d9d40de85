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
 *
 * From the start of a rig to a force on the hand:
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
	double travel_mm;	   /**< position is held within 0 … travel_mm */
	double step_mm;		   /**< one microstep */
	double velocity_mm_s;	   /**< largest */
	double acceleration_mm_s2; /**< largest */
	double jerk_mm_s3;	   /**< largest; 0: not limited */
	double deadman_s;	   /**< without a target for so long, it stops */
	double rate_max_hz;	   /**< largest step rate the backend takes; 0: any */
	double within_mm;     /**< at rest, position may be off its target by that … */
	double settle_s;      /**< … so long after the state is ready again */
	bool measures_handle; /**< status has handle_mm and force_N */
	bool can_home;	      /**< incise_stepper_home() can find its 0 */
	double origin_mm;     /**< without measures_handle: where handle_mm is 0, along
					the actuator's axis in the tracker's frame */
	unsigned int inputs;  /**< incise_stepper_line bits that are wired */
	double rest_mm; /**< of the nut: without force on a handle that was let go */
	double late_s;	/**< from a target to its force, by rig.conf; 0: not known */
};

/** Where it stands. */
struct incise_stepper_status {
	int64_t t_ns;
	double position_mm;   /**< of the nut, counted in microsteps */
	double velocity_mm_s; /**< of the nut */
	double handle_mm;     /**< of the handle; NaN where it is not measured */
	double force_N;	      /**< on the hand; NaN where it is not measured */
	unsigned int faults;  /**< incise_stepper_fault bits */
	enum incise_stepper_state state;
	unsigned int inputs; /**< incise_stepper_line bits that are active */
	bool homed;	     /**< position_mm is that of the machine, not just a count */
	uint64_t late;	     /**< steps that came too late since it was opened */
};

struct incise_stepper;

/**
 * Give a new target. It moves the nut only when powered; the virtual rig's always is.
 * Without a target for the deadman time the nut comes to rest and power goes away (after
 * going back to info.rest_mm, which is no force, where `retract` says so in rig.conf, and
 * in the virtual rig).
 *
 * @param position_mm target of the nut; clamped to the travel
 * @return 0; -EDOM (not finite; the last target stands), -EIO (not powered, or a fault is
 *         latched), -EPERM (opened to watch), -ENODEV (gone). Real-time safe: no system
 *         call.
 */
INCISE_API int incise_stepper_set(struct incise_stepper *stepper,
				  double position_mm) INCISE_REALTIME;

/**
 * Move at a speed until the next target, within the travel; by hand, for bring-up. As
 * incise_stepper_set() otherwise.
 *
 * @return 0; -EDOM, -EIO, -ENODEV; -EOPNOTSUPP (the virtual rig).
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
 * Power it. Its target is where it stands; the deadman runs from here on.
 *
 * @return 0, also when it was powered; -EPERM (a fault is latched: clear it), -EBUSY (an
 *         input forbids it, such as the e-stop), -EIO, -ENODEV. The message says which.
 */
INCISE_API int incise_stepper_enable(struct incise_stepper *stepper,
				     struct incise_error *err);

/** Bring it to rest and take power away; returns when that is done. @return 0, -EIO,
 * -ENODEV, -ETIMEDOUT (1 s and the time to stop went by). */
INCISE_API int incise_stepper_disable(struct incise_stepper *stepper,
				      struct incise_error *err);

/** Forget latched faults. @return 0; -EBUSY (a cause is still there), -EIO, -ENODEV. */
INCISE_API int incise_stepper_clear(struct incise_stepper *stepper,
				    struct incise_error *err);

/**
 * Edge of the input found by homing. Of a nut that was homed before, the difference is
 * the error of the count since then, or the repeatability of the edge.
 */
struct incise_stepper_edge_found {
	/** In the count before homing; NaN: a drive homed by itself and does not report it. */
	double before_mm;
	double after_mm; /**< in the count of the machine: `home_mm` of rig.conf */
};

/**
 * Find the machine's 0: move towards the home input (or the limit at 0 where there is
 * none), back off, approach again slowly, then move to `home_mm` of rig.conf. Must be
 * powered. A drive that homes by itself does so in its own way. Blocks, at most 60 s and
 * the time for the travel at `home_mm_s`; SIGINT stops it through @stop.
 *
 * @param stop checked between polls; non-zero ends with -EINTR and the nut at rest.
 *             May be NULL.
 * @param edge unchanged on an error; may be NULL
 * @return 0, homed; -EOPNOTSUPP (neither input is wired), -EIO (a fault, named in the
 *         message), -ETIMEDOUT, -EINTR, -ENODEV.
 */
INCISE_API int incise_stepper_home(struct incise_stepper *stepper,
				   const volatile int *stop,
				   struct incise_stepper_edge_found *edge,
				   struct incise_error *err);

/** Returns the constant properties of the actuator. */
INCISE_API void incise_stepper_info(const struct incise_stepper *stepper,
				    struct incise_stepper_info *info);

/**
 * The cause of a fault in one line that says what to do: the device's own description of
 * it, such as a drive's emergency message, else incise_stepper_fault_text().
 *
 * @param text always a string; empty where there is no fault
 * @return length of the line, as snprintf(3). For people: not real-time safe.
 */
INCISE_API int incise_stepper_cause(struct incise_stepper *stepper, char *text,
				    size_t size);

/** Something that a backend counts since it was opened. */
struct incise_stepper_counter {
	const char *key;  /**< "sync_late", for JSON */
	const char *text; /**< "SYNCs sent late", for people */
	uint64_t value;
	bool trouble; /**< it is 0 on a sound machine */
};

/**
 * Returns the actuator's counter i; status.late is not among them.
 * @param i 0 …
 * @return 0; -ENOENT (there are no more). The strings live as long as the device.
 */
INCISE_API int incise_stepper_counter(struct incise_stepper *stepper, int i,
				      struct incise_stepper_counter *counter);

/** "disabled", "ready", "moving", "stopping", "fault". */
INCISE_API const char *incise_stepper_state_name(enum incise_stepper_state state);

/**
 * A fault in words that say what to do, such as "e-stop: release it, then clear".
 * @param fault one bit
 */
INCISE_API const char *incise_stepper_fault_text(enum incise_stepper_fault fault);

INCISE_END_DECLS
#endif
