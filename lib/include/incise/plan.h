/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The plan of a scene: the ordered list of the stages that it needs. A loop runs them at each
 * tick.
 *
 *     pose ─▶ predict ─▶ [tool] ─▶ contact ─▶ [normal] ─▶ [incision] ─▶ [membrane] ─▶
 *     [reaction] ─▶ [plane] ─▶ [damping] ─▶ [insertion] ─▶ [spread] ─▶ [skin] ─▶
 *     start ─▶ [work] ─▶ limit ─▶ [actuate]
 *
 * Stages in brackets exist only if the scene or the rig needs them. A plan belongs to one
 * thread at a time.
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

/** Largest number of stages of a plan. */
#define INCISE_PLAN_STAGES_MAX 24

struct incise_plan;

/**
 * Compile a scene. This allocates all memory for the ticks. A scene that is stiffer than its
 * device allows is rejected; the error names the largest safe tissue.gain.
 *
 * @param scene must outlive the plan
 * @param rig   opened with INCISE_RIG_TRACKER, and INCISE_RIG_STEPPER to render force; must
 *              outlive the plan. NULL: no devices; incise_plan_feed() passes the poses, as
 *              from a tracker of 120 Hz with a latency of 4.2 ms
 * @return plan, to be freed with incise_plan_free(); NULL with errno ENODEV (no tracker),
 *         EDOM (not stable, or poses always older than limits.pose_age_ms), ENOTSUP,
 *         ERANGE (incise_fixed_compile()), EINVAL, ENOMEM.
 */
INCISE_API struct incise_plan *incise_plan_new(const struct incise_scene *scene,
					       struct incise_rig *rig,
					       struct incise_error *err);

/**
 * The same without a rig, for poses as from this tracker, which determines the predictor and
 * the stability.
 *
 * @param tracker rate above 0, latency not below 0
 * @return as incise_plan_new()
 */
INCISE_API struct incise_plan *incise_plan_new_fed(
	const struct incise_scene *scene, const struct incise_tracker_info *tracker,
	struct incise_error *err);

/**
 * The same with a plane for scenes without a surface, for example a rig's, in place of z = 0.
 *
 * @param normal outward, any length above 0
 */
INCISE_API struct incise_plan *incise_plan_new_fed_on(
	const struct incise_scene *scene, const struct incise_tracker_info *tracker,
	const double point_mm[3], const double normal[3], struct incise_error *err);

/** NULL is accepted. Does not free the scene and the rig. */
INCISE_API void incise_plan_free(struct incise_plan *plan);

/** Names of the stages in order; NULL after the last. */
INCISE_API const char *incise_plan_stage(const struct incise_plan *plan, int index);

/**
 * Names of the disabled stages, with the reason; NULL after the last. Both strings are valid
 * as long as the plan.
 */
INCISE_API const char *incise_plan_left_out(const struct incise_plan *plan, int index,
					    const char **why);

/** Largest number of inputs of a model in a plan. */
#define INCISE_PLAN_INPUTS_MAX 4

/** A model that gives a plan's reaction force. */
struct incise_plan_model {
	int n_inputs; /**< 0: the phase has no model; the rest is 0 */
	const char
		*input[INCISE_PLAN_INPUTS_MAX]; /**< names; valid as long as the plan */
	double min[INCISE_PLAN_INPUTS_MAX],
		max[INCISE_PLAN_INPUTS_MAX]; /**< their ranges */
	const char *evaluator; /**< "double", or as incise_fixed_arithmetic_name() */
	size_t memory_bytes;
};

/** Get the model of a phase, as it is evaluated in the plan's ticks. */
INCISE_API void incise_plan_model(const struct incise_plan *plan,
				  enum incise_cutting_phase phase,
				  struct incise_plan_model *model);

/**
 * Evaluate the model of a phase as the plan's ticks do, without tissue.gain and without limits.
 *
 * @param x the inputs, as of incise_plan_model()
 * @return N; 0 without a model. Real-time safe.
 */
INCISE_API double incise_plan_model_force(const struct incise_plan *plan,
					  enum incise_cutting_phase phase,
					  const double *x) INCISE_REALTIME;

/** Memory of the plan, bytes, including model and surface. */
INCISE_API size_t incise_plan_memory(const struct incise_plan *plan);

/** A starting point on the surface; incise_surface_top(). */
INCISE_API void incise_plan_top(const struct incise_plan *plan,
				struct incise_touch *touch);

/** The surface in use: the scene's, or the rig's plane; valid as long as the plan. Real-time safe. */
INCISE_API const struct incise_surface *incise_plan_surface(
	const struct incise_plan *plan) INCISE_REALTIME;

/** Support of a device in a search, besides the force that leans; incise-scene(5) has its figures. */
enum incise_held {
	INCISE_HELD_FREE,    /**< nothing */
	INCISE_HELD_ACROSS,  /**< a spring across the normal, without a mass */
	INCISE_HELD_IN_HAND, /**< mass, damping and stiffness of a firm hand */
};

/** A simulated loop. */
struct incise_plan_lean {
	double lean_N;	       /**< force that leans */
	double along_mm_s;     /**< its speed along the skin */
	double askew;	       /**< share of it along the skin */
	double place_mm[3];    /**< of the surface, where it leans */
	enum incise_tool tool; /**< that leans */
	enum incise_held held;
	bool guided; /**< along the normal only */
	bool tilted; /**< the tool: by 40 degrees about the way that it would cut; else it is upright on the skin */
	double depth_mm, swing_mm, settle_s;
};

/**
 * The state with the least margin among all states of rest that a search came to: the loop, with its forces for small
 * motions there, swings with the least increase of them, by its eigenvalues in three dimensions.
 */
struct incise_plan_weakest {
	double margin; /**< with so many times the forces; INCISE_PLAN_MARGIN_MOST: with no fewer */
	double along[3]; /**< direction of that swing, unit; 0: not found */
	double hz;	 /**< of that swing */
	double lean_N, depth_mm;
	double place_mm[3];    /**< of the surface */
	enum incise_tool tool; /**< that leans */
	enum incise_held held;
	bool tilted; /**< as above */
	int states;  /**< looked at */
	/** States with a margin below 1 that rest all the same: the account of work ends their swings. */
	int paid;
};
#define INCISE_PLAN_MARGIN_MOST 16 /**< a larger margin is not looked for */

/** A plan's stability, computed before its first tick. */
struct incise_plan_stability {
	/** Its delay may be above INCISE_STABILITY_DELAY_MAX if it is the tracker's. */
	struct incise_haptic_device device;
	bool own_delay;	       /**< the scene gives the delay; else it is the tracker's */
	double stiffness_N_mm; /**< largest stiffness of the scene, in any phase */
	double damping_N_s_mm; /**< damping of the scene */
	int late_ticks;	       /**< of the slowest actuator, in addition to the tracker */
	int n_axes;	       /**< number of actuators of the rig; may be 0 */
	/** of each actuator: the larger of the scene's and its own */
	int axis_late_ticks[INCISE_RIG_AXES_MAX];
	/**
	 * Largest slope of the model's force over speed, absolute value; 0 without a model.
	 */
	double speed_slope_N_s_mm;
	double slope_N_mm; /**< largest slope over depth; 0 without a model */
	/** Stiffness with which the tissue of a model unloads; 0: it does not dissipate */
	double unloading_N_mm;
	double support_mm;  /**< largest depth of the model's support; 0 without one */
	double beyond_N_mm; /**< slope of the force beyond that depth */
	/**
	 * Number of simulated closed loops, each with a hand that leans with a constant force up to
	 * the scene's limit, and the loop that took longest to come to rest.
	 */
	int runs;
	int64_t ticks; /**< of all of them: the same at each check of a scene */
	struct incise_plan_lean worst;
	struct incise_plan_weakest weakest; /**< of the same search */
	/**
	 * Range at rest due to the noise of a tracker, sd 0.02 mm, in a hand that leans with
	 * half of the scene's limit.
	 */
	double noise_mm, noise_N;
	bool certified; /**< the model's slopes are bounds, not estimates */
	/**
	 * Largest slope of the model's force over the acceleration, absolute value: it acts as a mass
	 * of 1000 times so many kg; 0 without such an input.
	 */
	double acceleration_slope_N_s2_mm;
};

/** Get stiffness, damping and margin of the plan, and its device. */
INCISE_API void incise_plan_stability(const struct incise_plan *plan,
				      struct incise_plan_stability *stability);

/** The texture of a plan's cuts; see incise/texture.h. */
struct incise_plan_texture {
	double most;			  /**< largest |τ| */
	double rms;			  /**< of τ */
	double events_per_mm;		  /**< of such cuts, as they were learned */
	double factor_least, factor_most; /**< of a cut's force */
};

/** Get the texture of the plan. @return false: it has none, and all is 0. */
INCISE_API bool incise_plan_texture(const struct incise_plan *plan,
				    struct incise_plan_texture *texture);

/**
 * Share of the texture that acted on the hand so far, by least squares: 1: all of it, at once. NaN: the plan has no
 * texture, did not cut with it, or the kernel renders it.
 */
INCISE_API double incise_plan_texture_felt(const struct incise_plan *plan);

/**
 * Make a plan read the ticks that the kernel renders: incise_plan_tick() then computes no force.
 * The feeder controls poses, tool and the end of the force.
 *
 * @param plan of incise_plan_new_fed() of the same scene, before its first tick
 * @param rig with its steppers opened with INCISE_RIG_WATCH; must outlive the plan
 * @return 0; -ENODEV (no actuator), -EOPNOTSUPP (actuators not on the kernel module)
 */
INCISE_API int incise_plan_watch(struct incise_plan *plan, struct incise_rig *rig,
				 struct incise_error *err);

/**
 * Make the kernel render a plan. The plan is converted to integers and loaded; from then on a
 * tick passes the tracker's poses to the kernel and reads the rendered state. Without a tick
 * for the actuators' deadman time they stop; without poses they do not stop, but the force
 * ramps to 0.
 *
 * @param plan of incise_plan_new() with arithmetic "fixed" and @rig, whose actuators are off
 * @return 0; as incise_plan_file_new() and incise_stepper_load_plan()
 */
INCISE_API int incise_plan_feed_kernel(struct incise_plan *plan, struct incise_rig *rig,
				       struct incise_error *err);

/**
 * Get the state that the last tick of such a plan read. Real-time safe; in the thread of the
 * ticks.
 */
INCISE_API void incise_plan_rendered(const struct incise_plan *plan,
				     struct incise_stepper_rendered *rendered)
	INCISE_REALTIME;

/**
 * The certified error of a plan with arithmetic = "fixed": the largest difference of its force from the force of the
 * same plan in double, on the same poses, before start and limits. It follows from the source of the tick, which runs
 * on numbers that carry their errors (lib/number/bounded.h); the rounding of the slew's limit comes on top, 61 uN for
 * each tick in a row that it holds the force.
 *
 * It holds
 *  - for poses one tracker period apart, of a hand up to 1 m/s and 2 m/s², each within 2 mm of where the filter expects it;
 *  - within @reach_mm of the start of the contact, at most half of the surface's radius deep;
 *  - for a tool that enters at 6 degrees to the surface or more, a blade that stands at 30 degrees
 *    or more in it, and a cut that does not turn, of a bottom no steeper than 45 degrees, whose
 *    advance is not short of work; for averaged normals within 60 degrees of their mean;
 *  - while both plans decide alike: the same phase, the same tool in the same place (of 0.5 mm)
 *    of the same cut, on the same side of an edge of a mesh, in the same place of a tear, with fronts that both or
 *    neither follow a rise of the texture, and did
 *    so since the contact or the cut began. If one changes a tick earlier, that is no error of the force, nor is what it
 *    keeps from that;
 *  - while no force goes unpaid (INCISE_TICK_UNPAID): at the end of an account roundings decide;
 *  - for the tip that is set.
 *
 * A texture adds the error of its way times its steepest fall: much, where it falls within a few micrometres.
 *
 * With a model of three or four inputs it rests on estimated slopes
 * (incise_plan_stability.certified) and is no proof. Takes up to some seconds.
 *
 * @return N, at most twice limits.force_N; 0 in double; infinite: it is not bounded, or no memory
 */
INCISE_API double incise_plan_bound(const struct incise_plan *plan, double reach_mm);

/**
 * Pass poses to a plan without a rig, before its tick. Poses of stations other than the
 * scalpel's and the tube's are ignored. Station 0 is the scalpel's.
 *
 * @param n at most 32 poses are kept until the next tick
 * @return number of accepted poses; -EINVAL if the plan has a rig. Real-time safe.
 */
INCISE_API int incise_plan_feed(struct incise_plan *plan,
				const struct incise_tracker_sample *samples,
				int n) INCISE_REALTIME;

/**
 * Set the position of the blade's tip relative to the tracked point: tip_mm of the
 * calibration; default 0 0 0. Call it before the first tick. It applies only to the scalpel:
 * the end of a tube with its own station is the tracked point.
 *
 * @return 0, -EINVAL (not finite, or more than 1e6 mm)
 */
INCISE_API int incise_plan_set_tip(struct incise_plan *plan, const double tip_mm[3]);

/**
 * Set the tool in the hand from now on; default INCISE_TOOL_AUTO. The tool changes only
 * outside of the tissue. Without insertion in the scene there is only the blade.
 *
 * @return 0, -EINVAL. Real-time safe; in the thread of the ticks.
 */
INCISE_API int incise_plan_set_tool(struct incise_plan *plan,
				    enum incise_tool tool) INCISE_REALTIME;

/**
 * Longest duration of a ramp to 0, ns: limits.fade_ms plus the largest force over its slew.
 */
INCISE_API int64_t incise_plan_fade_ns(const struct incise_plan *plan) INCISE_REALTIME;

/** The result of one tick. */
struct incise_tick {
	int64_t t_ns;
	double position_mm[3]; /**< predicted position of the tip */
	/**
	 * Orientation of the scalpel: w first, unit; all 0 if a fault came before it was
	 * known.
	 */
	double quaternion[4];
	double tool_mm[3];  /**< end of the tool in the hand: Pfing */
	double proxy_mm[3]; /**< its point on the surface: Pprxy; in contact */
	double normal[3];   /**< direction of the tissue's push; in contact */
	double depth_mm;
	double velocity_mm_s; /**< speed of the tip */
	double command_N[3];  /**< commanded force, in the tracker's frame */
	/**
	 * Commanded force along each actuator's direction; their sum can be felt. 0 without
	 * actuator.
	 */
	double actuated_N[INCISE_RIG_AXES_MAX];
	/** Force of each actuator on the hand; 0 without actuator. */
	double rendered_N[INCISE_RIG_AXES_MAX];
	double unfelt_N;    /**< size of the rest of command_N; 0 without actuator */
	unsigned int flags; /**< incise_tick_flag bits */
	enum incise_phase phase;
	enum incise_tool tool; /**< never AUTO */
};

/**
 * Counts of the poses of scalpel and tube so far. Real-time safe; in the thread of the ticks.
 */
INCISE_API void incise_plan_poses(const struct incise_plan *plan,
				  struct incise_pose_counts *counts) INCISE_REALTIME;

/**
 * Release: send the actuator's nut to its rest position, where there is no force, as fast as
 * possible. Call it after the last tick.
 *
 * @return 0, or the negative errno of an actuator that accepts no target, for example after a
 *         fault since the last tick; incise_plan_cause() has the cause. Its own deadman brings
 *         it to rest.
 */
INCISE_API int incise_plan_release(struct incise_plan *plan);

/**
 * Print why a plan's ticks fail, in one line: the actuator's latched fault and how to clear
 * it, or the error of a device.
 *
 * @param text always a string; empty if no tick failed
 * @return length of the line, as snprintf(3). For people: not real-time safe.
 */
INCISE_API int incise_plan_cause(const struct incise_plan *plan, char *text, size_t size);

/**
 * Run all stages once, in order. Real-time safe if the devices are.
 *
 * @param t_ns time of the tick, not before the last tick
 * @param tick result: finite and within the scene's limits for all input from devices
 * @return 0, or a negative errno of a device: the commanded force is then zero and remains
 *         zero; the force on the hand follows as fast as the actuator can.
 */
INCISE_API int incise_plan_tick(struct incise_plan *plan, int64_t t_ns,
				struct incise_tick *tick) INCISE_REALTIME;

/**
 * Run a plan without a rig on poses: tick k is at start_ns + k·period_ns and gets the poses
 * that arrived since the previous tick, at most the newest 32.
 *
 * @param poses     n poses, in order of t_ns, the arrival
 * @param start_ns  not before the plan's last tick
 * @param period_ns above 0
 * @param ticks     n_ticks results
 * @return number of ticks; fewer than n_ticks if the last one failed; -EINVAL (the plan has a
 *         rig; the period; poses out of order). Real-time safe.
 */
INCISE_API int64_t incise_plan_run(struct incise_plan *plan,
				   const struct incise_tracker_sample *poses, size_t n,
				   int64_t start_ns, int64_t period_ns,
				   struct incise_tick *ticks, size_t n_ticks);

/**
 * Run one tick as incise_plan_tick() does, and measure the time of each stage with
 * CLOCK_MONOTONIC, including the cost of reading the clock.
 *
 * @param stage_ns array of INCISE_PLAN_STAGES_MAX; 0 for stages that did not run
 */
INCISE_API int incise_plan_tick_timed(struct incise_plan *plan, int64_t t_ns,
				      struct incise_tick *tick,
				      int64_t *stage_ns) INCISE_REALTIME;

INCISE_END_DECLS
#endif
