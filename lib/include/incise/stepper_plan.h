/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A plan that the controller of the steppers runs by itself: it is given poses in place of targets.
 * The kernel module incise_stepper has that; see driver/uapi/incise_stepper.h.
 *
 *   incise_stepper_load_plan() ─▶ incise_stepper_enable() ─▶ incise_stepper_follow_plan()
 *                                                        ─▶ incise_stepper_pose() …
 *                                 incise_stepper_rendered() ◀─ whoever watches
 *
 * All give -EOPNOTSUPP where the stepper's backend has no plans. Threads: as of incise/stepper.h.
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

/** Force and state that a controller rendered at its last tick. */
struct incise_stepper_rendered {
	enum incise_stepper_plan_state state;
	unsigned int reasons; /**< enum incise_stepper_plan_reason */
	uint32_t plan;	      /**< incise_plan_file_info.crc of the plan that it runs */
	uint64_t ticks;	      /**< since it was enabled */
	uint64_t missed;      /**< left out, as the timer came too late */
	uint64_t poses, refused; /**< poses that were taken, and those that were not */
	int64_t t_ns;		 /**< when the tick was due */
	int64_t age_ns;		 /**< of its pose; INT64_MAX: there was none */
	unsigned int flags;	 /**< INCISE_TICK_… */
	enum incise_phase phase;
	enum incise_tool held;
	double tool_mm[3];	       /**< the end of what is held */
	double proxy_mm[3], normal[3]; /**< in a contact; else 0 */
	double quaternion[4];	       /**< of the scalpel; w first */
	double depth_mm, speed_mm_s;
	double command_N[3]; /**< the force */
	double along_N[3];   /**< of each actuator */
};

/**
 * Load a plan: the actuators of it in their order, which is that of the controller's motors, without
 * power.
 *
 * @param bytes of incise_plan_file_bytes()
 * @return 0; -EINVAL (actuators of two controllers, in another order, or not as many as it has; or
 *         no plan), -EBUSY (one has power), -ERANGE (a deadman that is not longer than the plan's
 *         fade, or a tick that this machine has no time for), -EPERM (opened to watch), -ENODEV.
 *         @err says which. May block.
 */
INCISE_API int incise_stepper_load_plan(struct incise_stepper *const *steppers, int n,
					const void *bytes, size_t size,
					struct incise_error *err);

/**
 * Let an actuator follow its plan from now on, with power. Poses are given to the plan's first one.
 *
 * @return 0, or as incise_stepper_set(). Real-time safe.
 */
INCISE_API int incise_stepper_follow_plan(struct incise_stepper *stepper) INCISE_REALTIME;

/** A pose for a plan. */
struct incise_stepper_pose_given {
	/** NULL: no pose, but a sign of life that keeps the actuators' power. */
	const struct incise_tracker_sample *sample;
	enum incise_tool tool; /**< that the hand holds, or INCISE_TOOL_AUTO */
	bool tube;	       /**< it is of the tube's station */
	bool fade;	       /**< let go of the force, for as long as poses say so */
};

/**
 * Give the plan a pose.
 *
 * @param first the plan's first actuator
 * @return 0; -EDOM (a position that is no number); -ENODEV (gone), -EIO (a fault: see
 *         incise_stepper_cause()), -EPERM (opened to watch). Real-time safe.
 */
INCISE_API int incise_stepper_pose(struct incise_stepper *first,
				   const struct incise_stepper_pose_given *pose)
	INCISE_REALTIME;

/**
 * Read what is rendered. A watcher may.
 *
 * @return 0; -EAGAIN (it was being written; *rendered is unchanged), -EIO (impossible values).
 *         Real-time safe.
 */
INCISE_API int incise_stepper_rendered(struct incise_stepper *stepper,
				       struct incise_stepper_rendered *rendered)
	INCISE_REALTIME;

/** "felt"; "unknown" for none. */
INCISE_API const char *incise_stepper_plan_state_name(
	enum incise_stepper_plan_state state);

/** "no fresh pose came", one line; "unknown" for none. */
INCISE_API const char *incise_stepper_plan_reason_text(
	enum incise_stepper_plan_reason reason);

#endif
