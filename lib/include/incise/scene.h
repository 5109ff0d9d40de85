/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A scene says what is felt: the surface, the tissue's model, limits and rate. It
 * compiles to a plan, the ordered list of just the stages that it needs, which a loop
 * runs at each tick.
 *
 *     pose ─▶ predict ─▶ contact ─▶ reaction ─▶ limit ─▶ actuate
 *
 * A .scene file (libconfig):
 *
 *     rate_hz = 1000.0;
 *     model = "liver.fis";          # or .fx; path, relative to the scene's folder
 *     arithmetic = "fixed";         # or "double"
 *     surface = { point_mm = [0.0, 0.0, 0.0]; normal = [0.0, 0.0, 1.0]; };  # or the rig's
 *     limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };
 */
#ifndef INCISE_SCENE_H
#define INCISE_SCENE_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/rig.h>

INCISE_BEGIN_DECLS

struct incise_scene;
struct incise_plan;

/**
 * Read a scene and the model it names.
 *
 * @param path  .scene file
 * @param model path of a model that takes the place of the scene's, or NULL
 * @return scene, to be freed with incise_scene_free(); NULL with errno of fopen(3),
 *         EINVAL (syntax, unknown key, value out of range: file, line and accepted range
 *         are named), or of incise_model_load().
 */
INCISE_API struct incise_scene *incise_scene_load(const char *path, const char *model,
						  struct incise_error *err);

/** Use another arithmetic than the file's: "fixed" or "double". @return 0, -EINVAL. */
INCISE_API int incise_scene_set_arithmetic(struct incise_scene *scene, const char *name,
					   struct incise_error *err);

INCISE_API void incise_scene_free(struct incise_scene *scene);

INCISE_API double incise_scene_rate_hz(const struct incise_scene *scene);

/**
 * Compile a scene for a rig. All that ticks need is allocated here.
 *
 * @param scene may be freed afterwards
 * @param rig   opened with INCISE_RIG_TRACKER, and INCISE_RIG_STEPPER when force is to be
 *              rendered; must outlive the plan
 * @return plan, to be freed with incise_plan_free(); NULL with errno ENODEV (no tracker),
 *         ENOTSUP, ERANGE (incise_fixed_compile()), ENOMEM.
 */
INCISE_API struct incise_plan *incise_plan_new(const struct incise_scene *scene,
					       struct incise_rig *rig,
					       struct incise_error *err);
INCISE_API void incise_plan_free(struct incise_plan *plan);

/** Names of the stages in order; NULL from the first index that is not there. */
INCISE_API const char *incise_plan_stage(const struct incise_plan *plan, int index);

/** What one tick came to. */
struct incise_tick {
	int64_t t_ns;
	double position_mm[3];
	double depth_mm;
	double velocity_mm_s;
	double command_N[3]; /**< force asked for, in the tracker's frame */
	double rendered_N;   /**< force of the actuator on the hand, 0 without one */
	unsigned int flags;  /**< incise_tick_flag bits */
};

/** Things worth counting about a tick. */
enum incise_tick_flag {
	INCISE_TICK_CONTACT = 1,      /**< the blade is in the tissue */
	INCISE_TICK_EXTRAPOLATED = 2, /**< the model was asked outside its support */
	INCISE_TICK_STALE = 4,	      /**< no pose younger than pose_age_ms: no force */
	INCISE_TICK_LIMITED = 8,      /**< force or slew was held at its limit */
	INCISE_TICK_FAULT = 16,	      /**< a device failed: no force from here on */
};

/**
 * Let go: the actuator's nut is sent to 0, where nut and handle are at rest, as fast as
 * it can go. To be called when no more ticks follow.
 */
INCISE_API void incise_plan_release(struct incise_plan *plan);

/**
 * Run all stages once, in order. Real-time safe as far as the devices are.
 *
 * @param t_ns time of the tick, not before the last one's
 * @param tick result: finite, and within the scene's limits, whatever the devices say
 * @return 0, or a negative errno of a device: the force commanded is then zero and stays
 *         so; the one on the hand follows as fast as the actuator can.
 */
INCISE_API int incise_plan_tick(struct incise_plan *plan, int64_t t_ns,
				struct incise_tick *tick);

INCISE_END_DECLS
#endif
