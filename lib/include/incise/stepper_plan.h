/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A plan that the controller of the steppers runs itself, with poses in place of targets. The
 * kernel module incise_stepper can do that; see driver/uapi/incise_stepper.h.
 *
 *   incise_stepper_load_plan() ─▶ incise_stepper_enable() ─▶ incise_stepper_follow_plan()
 *                                                        ─▶ incise_stepper_pose() …
 *                                 incise_stepper_rendered() ◀─ any watcher
 *
 * All functions return -EOPNOTSUPP if the stepper's backend has no plans. Threads: as for
 * incise/stepper.h.
 */
#ifndef INCISE_STEPPER_PLAN_H
#define INCISE_STEPPER_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/stepper.h>
#include <incise/tool.h>
#include <incise/tracker.h>

/** Force and state of a controller at its last tick. */
struct incise_stepper_rendered {
	enum incise_stepper_plan_state state;
	unsigned int reasons;	 /**< enum incise_stepper_plan_reason */
	uint32_t plan;		 /**< incise_plan_file_info.crc of its plan */
	uint64_t ticks;		 /**< since it was enabled */
	uint64_t missed;	 /**< ticks skipped because the timer was late */
	uint64_t poses, refused; /**< accepted and rejected poses */
	int64_t t_ns;		 /**< when the tick was due */
	int64_t age_ns;		 /**< age of its pose; INT64_MAX: no pose */
	unsigned int flags;	 /**< INCISE_TICK_… */
	enum incise_phase phase;
	enum incise_tool held;
	double tool_mm[3];	       /**< end of the tool in the hand */
	double proxy_mm[3], normal[3]; /**< during contact; else 0 */
	double quaternion[4];	       /**< of the scalpel; w first */
	double depth_mm, speed_mm_s;
	double command_N[3]; /**< the force */
	double along_N[3];   /**< of each actuator */
};

/**
 * Load a plan for these actuators, in the order of the controller's motors; they must be off.
 *
 * @param bytes of incise_plan_file_bytes()
 * @return 0; -EINVAL (actuators of two controllers, in another order or number; or not a
 *         plan), -EBUSY (an actuator is on), -ERANGE (a deadman not longer than the plan's
 *         fade, or a tick too short for this machine), -EPERM (opened with INCISE_RIG_WATCH),
 *         -ENODEV; @err has the details. May block.
 */
INCISE_API int incise_stepper_load_plan(struct incise_stepper *const *steppers, int n,
					const void *bytes, size_t size,
					struct incise_error *err);

/**
 * Make a powered actuator follow its plan from now on. incise_stepper_pose() takes the first
 * actuator of the plan.
 *
 * @return 0, or as incise_stepper_set(). Real-time safe.
 */
INCISE_API int incise_stepper_follow_plan(struct incise_stepper *stepper) INCISE_REALTIME;

/** A pose for incise_stepper_pose(). */
struct incise_stepper_pose_given {
	/** NULL: no pose, but keep the actuators on. */
	const struct incise_tracker_sample *sample;
	enum incise_tool tool; /**< tool in the hand, or INCISE_TOOL_AUTO */
	bool tube;	       /**< the pose belongs to the tube's station */
	bool fade;	       /**< ramp the force to 0 while poses have this */
};

/**
 * Pass a pose to the plan.
 *
 * @param first the plan's first actuator
 * @return 0; -EDOM (a position is not finite); -ENODEV (gone), -EIO (a fault: see
 *         incise_stepper_cause()), -EPERM (opened with INCISE_RIG_WATCH). Real-time safe.
 */
INCISE_API int incise_stepper_pose(struct incise_stepper *first,
				   const struct incise_stepper_pose_given *pose)
	INCISE_REALTIME;

/**
 * Read the rendered force and state; also with INCISE_RIG_WATCH.
 *
 * @return 0; -EAGAIN (it was being written; *rendered is unchanged), -EIO (invalid values).
 *         Real-time safe.
 */
INCISE_API int incise_stepper_rendered(struct incise_stepper *stepper,
				       struct incise_stepper_rendered *rendered)
	INCISE_REALTIME;

/** Name of a state, for example "felt"; "unknown" for other values. */
INCISE_API const char *incise_stepper_plan_state_name(
	enum incise_stepper_plan_state state);

/** Text for one reason, for example "no fresh pose came"; "unknown" for other values. */
INCISE_API const char *incise_stepper_plan_reason_text(
	enum incise_stepper_plan_reason reason);

#endif
