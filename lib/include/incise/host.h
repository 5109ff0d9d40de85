/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cutting force inside a simulator that steps at 30 Hz … 2 kHz: MuJoCo, SOFA, ROS 2, a game
 * engine. The host gives a pose at each of its steps and gets a wrench, which it holds until
 * its next step.
 *
 *   host's steps  ├───────── H ─────────┤─────────────────────┤
 *   poses         x₀                    x₁                    x₂
 *   ticks           interpolated: ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵ ╵   at the scene's rate_hz
 *   wrench        0 ······· held ·······╵ of the last tick ····╵
 *
 * Inside is a plan of its own, which ticks on a grid of the host's time from the first step on.
 * Between two steps of the host a pose is interpolated: its position linearly, or by a cubic
 * with the host's velocities; its attitude along the shorter way. A pose whose time is within a
 * hundredth of a tick of the grid is fed as it is: a host at the scene's rate gets the bits of
 * incise_plan_tick() for a tracker of that rate without latency.
 *
 * Pose and force are held for a host's step, which is a part of the check of stability: the
 * longer the step, the less stiff a tissue it allows. The scene's group `device` is the mass
 * and damping that the simulated tool has.
 *
 * Without a clock all follows from the host's time alone: equal inputs give equal bits, however
 * slowly they come.
 *
 * All functions but incise_host_new() and incise_host_free() may be called from any thread, at
 * any time. A lock of the host's own is held for the length of a call; the calls of several
 * threads are ordered by it. No call allocates, opens or waits for anything else, but the lock
 * makes them unfit for a thread that must not wait.
 *
 * mm, N, s; times of the host in ns.
 */
#ifndef INCISE_HOST_H
#define INCISE_HOST_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/clock.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/tool.h>

INCISE_BEGIN_DECLS

/** One tool of a simulator. */
struct incise_host;

/** Settings of a host. All 0: a host at the scene's rate, without velocities and clock. */
struct incise_host_options {
	/**
	 * Largest step of the host, s, up to 512 ticks; 0: a tick. A multiple of the tick, or a
	 * whole part of it, counts as the step of a host that always steps by just that; a host
	 * that also makes shorter steps adds a thousandth of a tick. Any other step counts as up
	 * to two ticks longer: the last tick before it may be one old, and a host whose steps
	 * differ swung in a test without the other. Steps up to the largest are checked with
	 * a tick that is one old, too.
	 */
	double host_period_s;
	bool gives_velocity; /**< each step has a velocity; false: velocities are not read */
	/** Lower the gain of a tissue that is too stiff for the host; see incise_host_info() */
	bool fit_gain;
	double tip_mm[3]; /**< the tip in the frame of the pose; incise_plan_set_tip() */
	enum incise_tool tool; /**< at the start; incise_plan_set_tool() */
	/**
	 * Live: where this clock is ahead of the host's time by more than limits.pose_age_ms,
	 * the force fades, as poses are too old. It must outlive the host, and only be read
	 * meanwhile. NULL: deterministic.
	 */
	struct incise_clock *clock;
};

/** A pose of the tool in the frame of the scene. */
struct incise_host_pose {
	double position_mm[3]; /**< each within ±1e4, not at it */
	/** w first, from the tool's to the scene's frame; its length is between 0.9 and 1.1 */
	double quaternion[4];
};

/** A wrench on the tool, in the frame of the scene. */
struct incise_host_wrench {
	double force_N[3];
	double torque_N_mm[3]; /**< about the position of the pose */
	unsigned int flags;    /**< of the last tick: incise_tick_flag bits */
};

/** Properties of a host. */
struct incise_host_info {
	double tick_s;	   /**< period of the plan's ticks */
	int hold_ticks;	   /**< the longest hold of a force that was checked */
	double gain;	   /**< tissue.gain in use … */
	double scene_gain; /**< … and the scene's */
	struct incise_plan_stability stability; /**< with that gain and that hold */
};

/**
 * Compile a scene for a host. This allocates all memory for the steps.
 *
 * @param scene   must outlive the host
 * @param options or NULL: all 0
 * @return host, to be freed with incise_host_free(); NULL with errno EINVAL (options out of
 *         range), EDOM (the scene swings at this step: the error names the largest safe
 *         tissue.gain, and with fit_gain there is none; or host_period_s is more than
 *         limits.pose_age_ms allows), or of incise_plan_new_fed(). Takes up to some seconds.
 */
INCISE_API struct incise_host *incise_host_new(const struct incise_scene *scene,
					       const struct incise_host_options *options,
					       struct incise_error *err);

/** NULL is accepted. Does not free the scene and the clock. No other call may be at work. */
INCISE_API void incise_host_free(struct incise_host *host);

/**
 * Go on to a time of the host, with its pose there. A step to the time of the last one, or to
 * one before the next tick, returns the same wrench.
 *
 * @param t_ns     any start, within ±4e18
 * @param velocity_mm_s of the position, or NULL; read with options.gives_velocity only
 * @param wrench   always finite, the force at most limits.force_N
 * @return 0;
 *         -ESTALE: the step was longer than the largest, or the clock is ahead. The force ramps
 *         to 0 by the plan's own fade, limits.fade_ms, and comes back by its own ramp; the time
 *         beyond a fade is left out;
 *         -ERANGE: the time went back, with the same effect; the host's new time is taken over;
 *         -EINVAL: a pose, a time or a velocity is missing, not finite or out of range: the
 *         wrench is 0, and the step counts as not made.
 */
INCISE_API int incise_host_step(struct incise_host *host, int64_t t_ns,
				const struct incise_host_pose *pose,
				const double velocity_mm_s[3],
				struct incise_host_wrench *wrench);

/**
 * Start again, as after incise_host_new(): an episode of learning. Cuts heal; the next time may
 * be any.
 */
INCISE_API void incise_host_reset(struct incise_host *host);

/** Change the tool in the hand. @return as incise_plan_set_tool() */
INCISE_API int incise_host_set_tool(struct incise_host *host, enum incise_tool tool);

/** Get the last tick; all 0 before the first. Its t_ns is the plan's time, not the host's. */
INCISE_API void incise_host_last(struct incise_host *host, struct incise_tick *tick);

/** Get the properties of a host. */
INCISE_API void incise_host_info(struct incise_host *host, struct incise_host_info *info);

INCISE_END_DECLS
#endif
