/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a plan, for lib/scene: its stages, and the state that they share.
 */
#ifndef INCISE_PLAN_INTERNAL_H
#define INCISE_PLAN_INTERNAL_H

#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/plan.h>
#include <incise/stepper_plan.h>
#include "../control/host_path.h"
#include "../control/model_input.h"
#include "../control/predict.h"
#include "../rig/stylus.h"
#include "../surface/surface.h"
#include "../tissue/incision.h"
#include "actuate.h"
#include "integers.h"
#include "scene.h"

/* Poses taken at one tick; more than a tracker sends in a period, even after a stall. */
#define INCISE_PLAN_POSES 32

/* Returns 0, or a negative errno of a device. */
typedef int incise_stage_fn(struct incise_plan *plan,
			    struct incise_tick *tick) INCISE_REALTIME;

/* A stage of a device, or a stage of numbers. */
struct incise_stage {
	const char *name;
	incise_stage_fn *run; /* or: */
	struct incise_stage_pair numbers;
};

/* The operations of a plan in double, in integers, or in the kernel. All are real-time safe. */
struct incise_plan_ops {
	/* All stages; @stage_ns: with the time of each, or NULL. 0 or a negative errno. */
	int (*tick)(struct incise_plan *plan, int64_t t_ns, struct incise_tick *tick,
		    int64_t *stage_ns) INCISE_REALTIME;
	void (*take_pose)(struct incise_plan *plan, bool tube,
			  const struct incise_tracker_sample *sample,
			  int64_t now_ns) INCISE_REALTIME;
	/* Follow plan->wanted and plan->fading. */
	void (*hold)(struct incise_plan *plan) INCISE_REALTIME;
	/* Whether the wanted force and the last one are 0. */
	bool (*faded)(const struct incise_plan *plan) INCISE_REALTIME;
	/* No force from now on, at once. */
	void (*zero)(struct incise_plan *plan) INCISE_REALTIME;
	/* Returns 0; -EINVAL (farther than the numbers hold). */
	int (*set_tip)(struct incise_plan *plan, const double tip_mm[3]) INCISE_REALTIME;
	/* Whether the membrane is open; and the cuts: get cut i from 0 on, drop all, add one. */
	int32_t *(*punctured)(struct incise_plan *plan)INCISE_REALTIME;
	bool (*cut)(struct incise_plan *plan, int i,
		    struct incise_cut *cut) INCISE_REALTIME;
	void (*clear_cuts)(struct incise_plan *plan) INCISE_REALTIME;
	bool (*add_cut)(struct incise_plan *plan,
			const struct incise_cut *cut) INCISE_REALTIME;
};
extern const struct incise_plan_ops incise_double_ops, incise_fixed_ops;

/* A plan's numbers, and its ticks in double. */
struct incise_doubles {
	struct incise_double_plan plan;
	struct incise_double_state state;
	struct incise_double_tick tick;
};

/* Stages besides forces; those that no loop has are always left out. */
#define INCISE_PLAN_OTHER_STAGES 12
#define INCISE_PLAN_NO_STAGES 2
_Static_assert(INCISE_PLAN_OTHER_STAGES + INCISE_FORCES <= INCISE_PLAN_STAGES_MAX,
	       "raise INCISE_PLAN_STAGES_MAX");

/* A tracker that gives only unusable poses for so long has failed, like an unplugged one. */
#define INCISE_PLAN_BLIND_NS (10 * INCISE_NS_PER_S)

/* The poses of a plan. */
struct incise_plan_poses {
	struct incise_tracker *tracker;	   /* or NULL: poses are fed */
	struct incise_tracker_sample *fed; /* INCISE_PLAN_POSES, then */
	int n_fed;
	struct incise_pose_counts counts;
	char flag; /* of the scalpel's newest pose; ' ' or 0: none */
	uint8_t scalpel_station, tube_station; /* of the tracker; 0: any, none */
	bool unusable, tube_unusable;	       /* the newest pose of that station is */
	bool none_usable;    /* the newest pose of all is unusable … */
	int64_t unusable_ns; /* … since the tick of the first of them … */
	bool blind;	     /* … which was INCISE_PLAN_BLIND_NS ago */
};

/* A plan that the kernel renders: with incise_plan_watch(), and with incise_plan_feed_kernel(). */
struct incise_plan_kernel {
	bool runs, feeds;
	bool seen;
	struct incise_stepper_rendered last_seen;
	int64_t fed_ns;	 /* when a pose, or a sign of life, was given last; 0: never */
	int64_t life_ns; /* so often, at least */
	bool follow;	 /* all actuators do */
	bool fade_told;	 /* the last one said whether to fade as it is */
};

/* Sums of 1, a mean force, its texture and the force that acts, times each other. */
struct incise_felt {
	double sum[4][4];
};

struct incise_plan {
	const struct incise_scene *scene;
	struct incise_stage stage[INCISE_PLAN_STAGES_MAX];
	int n_stages;
	struct {
		const char *name, *why;
	} left_out[INCISE_PLAN_STAGES_MAX + INCISE_PLAN_NO_STAGES];
	int n_left_out;
	struct incise_host_hold hold;
	struct incise_plan_stability stability;
	int fault; /* negative errno of the device that failed, or 0 */
	struct incise_plan_ops ops;

	struct incise_plan_poses poses;
	struct incise_predict predict; /* its gains */
	enum incise_tool wanted;       /* INCISE_TOOL_AUTO: by the scalpel's turn */
	enum incise_tool held;	       /* at the last tick; never AUTO */
	bool inserts;		       /* handle and tube can be held */
	char no_tool[128];	       /* the reason why not */
	bool fading;		       /* asked to let go of the force */

	const struct incise_surface *surface;
	struct incise_surface *own_surface; /* the rig's plane, when it is that */
	double up[3];			    /* normal of the surface's top */
	struct incise_proxy proxy;
	struct incise_incision *incision; /* with its stage */
	int average_ticks;

	/* forces */
	double gain;
	bool dissipates;       /* a model's force unloads when the blade draws back … */
	double unloading_N_mm; /* … with this stiffness */
	/* The model's steepest slope by each input, N per its unit, times the gain. */
	double input_slope[INCISE_MODEL_INPUT_KINDS];
	double support_mm;    /* the model's largest depth; beyond it the force … */
	double beyond_N_mm;   /* … goes on with this slope, ≥ 0 */
	double edge_N_mm;     /* slope there without the gain … */
	double steepest_N_mm; /* … and the largest of all, without it */
	double upright; /* least cosine between the normals of skin and membrane, over its disc */
	double account_N_mm;		  /* all springs together */
	bool accounts;			  /* for the work of its forces */
	const struct incise_model *model; /* fuzzy: one of these */
	const struct incise_fixed *fixed;
	struct incise_fixed *own_fixed;		    /* compiled here */
	const struct incise_fixed_texture *texture; /* of the cut, checked, or NULL */
	struct incise_acting_force acting[INCISE_FORCES];
	struct incise_felt felt;

	struct incise_doubles doubles;	  /* by all of the above */
	struct incise_integers *integers; /* with arithmetic = "fixed"; else NULL */
	double last_N[3];		  /* rendered last */
	struct incise_axes axes;	  /* without axes nothing is rendered … */
	struct incise_stylus *stylus;	  /* … but by a haptic device; or NULL */
	double early_s; /* its force acts so much before stability.late_ticks have passed */
	enum incise_haptic_off off; /* of it, at the last tick; then the force fades */
	struct incise_plan_kernel kernel;
};

/* Whether a model takes the place of a force's first number. */
static inline bool incise_plan_has_model(const struct incise_plan *plan,
					 const struct incise_acting_force *own)
{
	return own->force == &incise_tissue_forces[INCISE_FORCE_REACTION] &&
	       (plan->model || plan->fixed);
}

/* --- stages of devices --- */

incise_stage_fn incise_stage_pose, incise_stage_fed, incise_stage_actuate,
	incise_stage_push;

/* --- plan --- */

/*
 * As incise_plan_new_fed(), in the loop of a host that steps once in so many ticks of the
 * tracker. With hold->fit hold->gain is the gain that was found.
 */
struct incise_plan *incise_plan_new_held(const struct incise_scene *scene,
					 const struct incise_tracker_info *tracker,
					 struct incise_host_hold *hold,
					 struct incise_error *err);

/*
 * A copy that can tick beside the plan, with another gain: as the plan of a scene with that. It shares the
 * memory of the plan.
 */
void incise_plan_copy(struct incise_plan *copy, const struct incise_plan *plan,
		      double gain);

/* The range of an input over the models that have it. Returns whether any has. */
bool incise_plan_kind_range(const struct incise_plan *plan, enum incise_model_input kind,
			    double ends[2]);

/* Scale all numbers of a checked plan that go with the gain. incise_plan_set_numbers() takes it over. */
void incise_plan_set_gain(struct incise_plan *plan, double gain);

/* The most by which the plan's texture multiplies the force of its front, (1 + max τ) · factor; 1 without one. */
double incise_plan_texture_most(const struct incise_plan *plan);

/* Fill in the plan in double, by all that was found of the scene. */
void incise_plan_set_numbers(struct incise_plan *plan);

/* Take in a tick of new tissue: the force of its front and the texture of that, which are along the normal. */
void incise_plan_feel(struct incise_plan *plan, const struct incise_tick *tick,
		      double mean_N, double texture_N) INCISE_REALTIME;

/* Add a tick; the share of the texture that acts, NaN: not known. */
void incise_felt_add(struct incise_felt *felt, double mean_N, double texture_N,
		     double acting_N) INCISE_REALTIME;
double incise_felt_share(const struct incise_felt *felt);

/* Take the force away, and keep why. Returns @rc. */
int incise_plan_fail(struct incise_plan *plan, struct incise_tick *tick,
		     int rc) INCISE_REALTIME;

/*
 * Largest difference of the front's force in integers on the same motion, N, where each cutting force differs
 * by no more than @cutting_bound_N and is at most @most_N, while no advance is short of work. Infinite: it is
 * not bounded.
 */
double incise_front_bound(double unloading_N_mm, double friction, double most_N,
			  double cutting_bound_N);

/* Fill in the stages that the scene and the rig need, and the reasons to leave out the others. */
void incise_plan_choose(struct incise_plan *plan);

/*
 * The tissue of a plan that it replaces: its cuts, as many as it has room for, and whether the membrane
 * is open. Real-time safe; some 10 us for 64 cuts.
 */
void incise_plan_take_over(struct incise_plan *plan,
			   const struct incise_plan *before) INCISE_REALTIME;

/* Ramp the force to zero, or let it return. The plan goes on. Real-time safe. */
void incise_plan_fade(struct incise_plan *plan, bool fading) INCISE_REALTIME;

/* Whether a force that fades has reached zero. Real-time safe. */
bool incise_plan_faded(const struct incise_plan *plan) INCISE_REALTIME;

/* The reason why the rig's haptic device takes no force. Real-time safe. */
enum incise_haptic_off incise_plan_off(const struct incise_plan *plan) INCISE_REALTIME;

/* The flag of the scalpel's newest pose; ' ' or 0: no flag. Real-time safe. */
char incise_plan_pose_flag(const struct incise_plan *plan) INCISE_REALTIME;

/* The reason of a fault in a few words, without the device's own; NULL: no fault. */
const char *incise_plan_fault(const struct incise_plan *plan);

/*
 * Find the numbers of the scene's stability on this device.
 * Returns 0; -EDOM (they are outside of what can be checked), -ENOMEM.
 */
int incise_plan_survey(struct incise_plan *plan,
		       const struct incise_tracker_info *tracker,
		       struct incise_error *err);

/*
 * Of a plan that is ready to run: whether a scene with a model comes to rest, by a search.
 * Returns 0; -EDOM (it swings: the message names the remedy), -ENOMEM.
 */
int incise_plan_check_rest(struct incise_plan *plan,
			   const struct incise_tracker_info *tracker,
			   struct incise_error *err);

#endif
