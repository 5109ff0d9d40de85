/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The plan of a scene: the ordered list of just the stages that it needs, which a loop
 * runs at each tick.
 *
 *     pose ─▶ predict ─▶ [tool] ─▶ contact ─▶ [normal] ─▶ [incision] ─▶ [membrane] ─▶
 *     [reaction] ─▶ [plane] ─▶ [damping] ─▶ [insertion] ─▶ [spread] ─▶ start ─▶ limit ─▶
 *     [actuate]
 *
 * Those in brackets are there when the scene or the rig asks for them. A plan belongs to
 * one thread at a time.
 */
#ifndef INCISE_PLAN_H
#define INCISE_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/rig.h>
#include <incise/scene.h>
#include <incise/stability.h>
#include <incise/stepper_plan.h>
#include <incise/surface.h>
#include <incise/tick_flags.h>
#include <incise/tool.h>
#include <incise/tracker.h>

INCISE_BEGIN_DECLS

/** Stages of a plan at most. */
#define INCISE_PLAN_STAGES_MAX 16

struct incise_plan;

/**
 * Compile a scene. All that ticks need is allocated here. A scene that is stiffer than
 * its device can hold is refused with the largest tissue.gain that is safe.
 *
 * @param scene must outlive the plan
 * @param rig   opened with INCISE_RIG_TRACKER, and INCISE_RIG_STEPPER when force is to be
 *              rendered; must outlive the plan. Or NULL: no device is touched, and poses
 *              are given by incise_plan_feed(), as of a tracker of 120 Hz that is 4.2 ms
 *              late
 * @return plan, to be freed with incise_plan_free(); NULL with errno ENODEV (no tracker),
 *         EDOM (not stable, or poses always older than limits.pose_age_ms), ENOTSUP,
 *         ERANGE (incise_fixed_compile()), EINVAL, ENOMEM.
 */
INCISE_API struct incise_plan *incise_plan_new(const struct incise_scene *scene,
					       struct incise_rig *rig,
					       struct incise_error *err);

/**
 * The same without a rig, for poses as of this tracker, which counts for the predictor and
 * the stability.
 *
 * @param tracker rate above 0, latency not below 0
 * @return as incise_plan_new()
 */
INCISE_API struct incise_plan *incise_plan_new_fed(
	const struct incise_scene *scene, const struct incise_tracker_info *tracker,
	struct incise_error *err);

/**
 * The same for tissue whose plane, where the scene has no surface of its own, lies there and
 * not at z = 0; as with a rig.
 *
 * @param normal outward, any length above 0
 */
INCISE_API struct incise_plan *incise_plan_new_fed_on(
	const struct incise_scene *scene, const struct incise_tracker_info *tracker,
	const double point_mm[3], const double normal[3], struct incise_error *err);

/** NULL is accepted. The scene and the rig stay as they are. */
INCISE_API void incise_plan_free(struct incise_plan *plan);

/** Names of the stages in order; NULL from the first index that is not there. */
INCISE_API const char *incise_plan_stage(const struct incise_plan *plan, int index);

/**
 * Names of the stages left out, with the reason; NULL from the first index that is not
 * there. Both strings live as long as the plan.
 */
INCISE_API const char *incise_plan_left_out(const struct incise_plan *plan, int index,
					    const char **why);

/** Memory that the plan holds, bytes, with model and surface. */
INCISE_API size_t incise_plan_memory(const struct incise_plan *plan);

/** A place of the surface to begin at; incise_surface_top(). */
INCISE_API void incise_plan_top(const struct incise_plan *plan,
				struct incise_touch *touch);

/** The surface that is felt: the scene's, or the rig's plane; as long as the plan. */
INCISE_API const struct incise_surface *incise_plan_surface(
	const struct incise_plan *plan);

/** A plan's stability, computed before its first tick. */
struct incise_plan_stability {
	/** Its delay may be above INCISE_STABILITY_DELAY_MAX where it is the tracker's. */
	struct incise_haptic_device device;
	bool own_delay;	       /**< the scene gives the delay; else it is the tracker's */
	double stiffness_N_mm; /**< largest of the scene, in any phase */
	double damping_N_s_mm; /**< the scene's own */
	/**
	 * Stiffness that the device holds: with own_delay incise_stability_limit(); else
	 * that of the loop with the tracker's rate and latency, and with the predictor.
	 */
	double limit_N_mm;
	int late_ticks; /**< of the latest actuator, on top of the tracker's loop */
	int n_axes;	/**< actuators of the rig; 0 without */
	/** Of each actuator: the wall that is felt along it. */
	struct {
		/** The scene's largest, of any direction; more where the directions are not
		 * at right angles, as actuators then push against each other. */
		double stiffness_N_mm;
		double limit_N_mm; /**< that the device holds with this actuator's lateness */
		int late_ticks; /**< the scene's, or the actuator's own where that is more */
	} axis[INCISE_RIG_AXES_MAX];
	/** Largest slope of the model's force by the speed, either way; 0 without one. */
	double speed_slope_N_s_mm;
	double slope_N_mm; /**< largest by the depth; 0 without a model */
	/** Stiffness with which the tissue of a model unloads; 0: it does not dissipate */
	double unloading_N_mm;
	double support_mm;  /**< largest depth that the model knows; 0 without one */
	double beyond_N_mm; /**< slope with which the force goes on beyond it */
	/**
	 * With a model: closed loops that were tried, each with a hand that leans with a
	 * constant force up to the scene's limit, and the one that took longest to rest.
	 */
	int runs;
	struct {
		double lean_N;	   /**< the hand's force */
		double along_mm_s; /**< its speed along the skin */
		double depth_mm, swing_mm, settle_s;
	} worst;
	/** Range at rest by the noise of a tracker, sd 0.02 mm, in a hand that leans with half
	 * of the scene's limit. */
	double noise_mm, noise_N;
	bool certified; /**< the model's slopes are bounds, not estimates */
};

/** Stiffness and damping of the plan, and what its device holds. */
INCISE_API void incise_plan_stability(const struct incise_plan *plan,
				      struct incise_plan_stability *stability);

/**
 * Let a plan's ticks be those that the kernel renders: incise_plan_tick() reads them, and computes
 * none. The poses, the tool and the end of the force are its feeder's.
 *
 * @param plan of incise_plan_new_fed() of the same scene, before its first tick
 * @param rig with its steppers open to watch; must outlive the plan
 * @return 0; -ENODEV (no actuator), -EOPNOTSUPP (not of the kernel module)
 */
INCISE_API int incise_plan_watch(struct incise_plan *plan, struct incise_rig *rig,
				 struct incise_error *err);

/**
 * Let the kernel render a plan, and give it the poses: the plan is put into integers and loaded, and
 * from now on a tick takes the tracker's poses, hands them on, and reads what is rendered. Without a
 * tick for the actuators' deadman they stop; a tracker that is silent is no such stop, but the force
 * fades.
 *
 * @param plan of incise_plan_new() with arithmetic "fixed" and @rig, whose actuators have no power
 * @return 0; as incise_plan_file_new() and incise_stepper_load_plan()
 */
INCISE_API int incise_plan_feed_kernel(struct incise_plan *plan, struct incise_rig *rig,
				       struct incise_error *err);

/** Get what the last tick of such a plan read. Real-time safe; in the thread that ticks. */
INCISE_API void incise_plan_rendered(const struct incise_plan *plan,
				     struct incise_stepper_rendered *rendered)
	INCISE_REALTIME;

/**
 * The certified error of a plan with arithmetic = "fixed": the largest difference of its force from
 * that of the same plan in double, on the same poses, before limits.
 *
 * It holds for poses that come a tracker's period apart, of a hand up to 1 m/s; for places within
 * @reach_mm of where the contact began, no deeper than half of the surface's radius there; for a
 * blade that enters at 6 degrees to the surface or more; and while both are in the same phase, with
 * the same tool in the same cut: a tick at which one of them is earlier is no error of a force.
 * lib/scene/bound.c has its parts. `incise bench` measures the rest.
 *
 * @return N; 0 in double
 */
INCISE_API double incise_plan_bound(const struct incise_plan *plan, double reach_mm);

/**
 * Give poses to a plan without a rig, before its tick; as from a tracker: those of stations that
 * are neither the scalpel's nor the tube's are left out. Station 0 is the scalpel's.
 *
 * @param n at most 32 are kept until the next tick
 * @return how many were taken; -EINVAL when the plan has a rig. Real-time safe.
 */
INCISE_API int incise_plan_feed(struct incise_plan *plan,
				const struct incise_tracker_sample *samples,
				int n) INCISE_REALTIME;

/**
 * Say where the tip of the blade is in the frame of what the tracker's poses are of: the
 * calibration's tip_mm; by default 0 0 0. Before the first tick. It is the scalpel's alone: the
 * end of a tube with a station of its own is where the tracker measures.
 *
 * @return 0, -EINVAL (not finite, or more than 1e6 mm)
 */
INCISE_API int incise_plan_set_tip(struct incise_plan *plan, const double tip_mm[3]);

/**
 * Say what the hand holds from now on; by default INCISE_TOOL_AUTO. It changes out of the
 * tissue only. Without insertion in the scene there is only the blade.
 *
 * @return 0, -EINVAL. Real-time safe; in the thread that ticks.
 */
INCISE_API int incise_plan_set_tool(struct incise_plan *plan,
				    enum incise_tool tool) INCISE_REALTIME;

/** Longest time that a force takes to fade, ns: limits.fade_ms, and the largest force at its slew. */
INCISE_API int64_t incise_plan_fade_ns(const struct incise_plan *plan) INCISE_REALTIME;

/** The result of one tick. */
struct incise_tick {
	int64_t t_ns;
	double position_mm[3]; /**< of the tip, predicted */
	/** Of the scalpel: w first, unit; all 0 when a fault came before it was known. */
	double quaternion[4];
	double tool_mm[3];  /**< of what the hand holds: Pfing */
	double proxy_mm[3]; /**< of the surface that belongs to it: Pprxy; in contact */
	double normal[3];   /**< along which the tissue pushes; in contact */
	double depth_mm;
	double velocity_mm_s; /**< speed of the tip */
	double command_N[3];  /**< force asked for, in the tracker's frame */
	/** Along each actuator's direction; together the part that can be felt. 0 without one. */
	double actuated_N[INCISE_RIG_AXES_MAX];
	/** Force of each actuator on the hand, 0 without one. */
	double rendered_N[INCISE_RIG_AXES_MAX];
	double unfelt_N;    /**< size of the rest of command_N, 0 without an actuator */
	unsigned int flags; /**< incise_tick_flag bits */
	enum incise_phase phase;
	enum incise_tool tool; /**< never AUTO */
};

/** Poses of scalpel and tube that the plan was given so far. Real-time safe; in the thread that ticks. */
INCISE_API void incise_plan_poses(const struct incise_plan *plan,
				  struct incise_pose_counts *counts) INCISE_REALTIME;

/**
 * Let go: the actuator's nut is sent to 0, where nut and handle are at rest, as fast as
 * it can go. To be called when no more ticks follow.
 *
 * @return 0, or the negative errno of an actuator that takes no target any more, as after a
 *         fault that no tick met: incise_plan_cause() says which. Its own deadman brings it
 *         to rest.
 */
INCISE_API int incise_plan_release(struct incise_plan *plan);

/**
 * The reason why a plan's ticks fail, in one line: the actuator's latched fault and the way
 * to clear it, or the error of a device.
 *
 * @param text always a string; empty while none failed
 * @return length of the line, as snprintf(3). For people: not real-time safe.
 */
INCISE_API int incise_plan_cause(const struct incise_plan *plan, char *text, size_t size);

/**
 * Run all stages once, in order. Real-time safe as far as the devices are.
 *
 * @param t_ns time of the tick, not before the last one's
 * @param tick result: finite, and within the scene's limits, whatever the devices say
 * @return 0, or a negative errno of a device: the force commanded is then zero and stays
 *         so; the one on the hand follows as fast as the actuator can.
 */
INCISE_API int incise_plan_tick(struct incise_plan *plan, int64_t t_ns,
				struct incise_tick *tick) INCISE_REALTIME;

/**
 * Run a plan without a rig over poses: tick k is at start_ns + k·period_ns, and is fed the poses that
 * have arrived since the one before; where these are more than 32, the newest.
 *
 * @param poses     n of them, in order of t_ns, the arrival
 * @param start_ns  not before the plan's last tick
 * @param period_ns above 0
 * @param ticks     n_ticks results
 * @return number of ticks; fewer than n_ticks when one of them failed, which is the last result;
 *         -EINVAL (the plan has a rig, a period, poses out of order). Real-time safe.
 */
INCISE_API int64_t incise_plan_run(struct incise_plan *plan,
				   const struct incise_tracker_sample *poses, size_t n,
				   int64_t start_ns, int64_t period_ns,
				   struct incise_tick *ticks, size_t n_ticks);

/**
 * One tick as incise_plan_tick(), with how long each stage took, by CLOCK_MONOTONIC and with its
 * cost.
 *
 * @param stage_ns array of INCISE_PLAN_STAGES_MAX; 0 for what did not run
 */
INCISE_API int incise_plan_tick_timed(struct incise_plan *plan, int64_t t_ns,
				      struct incise_tick *tick,
				      int64_t *stage_ns) INCISE_REALTIME;

INCISE_END_DECLS
#endif
