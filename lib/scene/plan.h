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
#include "../control/limit.h"
#include "../control/predict.h"
#include "../control/start.h"
#include "../surface/average.h"
#include "../surface/surface.h"
#include "../tissue/incision.h"
#include "../tissue/instrument.h"
#include "actuate.h"
#include "integers.h"
#include "scene.h"

/* Poses taken at one tick; more than a tracker sends in a period, even after a stall. */
#define INCISE_PLAN_POSES 32

/* Returns 0, or a negative errno of a device. */
typedef int incise_stage_fn(struct incise_plan *plan,
			    struct incise_tick *tick) INCISE_REALTIME;

struct incise_stage {
	const char *name;
	/* Also runs while there is no fresh pose; the others stand still then. */
	bool always;
	incise_stage_fn *run; /* or a force: */
	incise_force_fn *add;
	struct incise_acting_force *own;
	incise_fixed_stage_fn
		*integer; /* takes their place in integers; NULL: none does */
};

/* Stages besides forces; those that no loop has are always left out. */
#define INCISE_PLAN_OTHER_STAGES 10
#define INCISE_PLAN_NO_STAGES 2
_Static_assert(INCISE_PLAN_OTHER_STAGES + INCISE_FORCES_MAX <= INCISE_PLAN_STAGES_MAX,
	       "raise INCISE_PLAN_STAGES_MAX");

/* A tracker that gives only unusable poses for so long has failed, as one that is unplugged. */
#define INCISE_PLAN_BLIND_NS (10 * INCISE_NS_PER_S)

/* The height of an end above the surface, when that was last searched for it. */
struct incise_above {
	bool known;
	double end_mm[3], above_mm;
};

enum { INCISE_PLAN_TIP, INCISE_PLAN_HANDLE, INCISE_PLAN_TUBE, INCISE_PLAN_ENDS };

struct incise_plan {
	const struct incise_scene *scene;
	struct incise_stage stage[INCISE_PLAN_STAGES_MAX];
	int n_stages;
	struct {
		const char *name, *why;
	} left_out[INCISE_PLAN_STAGES_MAX + INCISE_PLAN_NO_STAGES];
	int n_left_out;
	struct incise_plan_stability stability;
	int fault; /* negative errno of the device that failed, or 0 */

	/* pose */
	struct incise_tracker *tracker;	   /* or NULL: poses are fed */
	struct incise_tracker_sample *fed; /* INCISE_PLAN_POSES, then */
	int n_fed;
	struct incise_predict predict;
	int64_t pose_age_ns;
	struct incise_pose_counts poses;
	char pose_flag; /* of the scalpel's newest pose; ' ' or 0: none */
	uint8_t scalpel_station, tube_station; /* of the tracker; 0: any, none */
	bool unusable, tube_unusable;	       /* the newest pose of that station is */
	bool none_usable;	 /* the newest pose of all is unusable … */
	int64_t unusable_ns;	 /* … since the tick of the first of them … */
	bool blind;		 /* … which was INCISE_PLAN_BLIND_NS ago */
	double velocity_mm_s[3]; /* of the end of what is held */
	double attitude[4];
	double tip_mm[3]; /* of the blade in the frame of the tracker's poses */

	/* tool, contact, normal */
	struct incise_instrument instrument;
	bool inserts;		       /* handle and tube can be held */
	char no_tool[128];	       /* the reason why not */
	struct incise_predict *handle; /* its end's position; with stage tool */
	struct incise_predict *tube;   /* the same, if it has a station */
	struct incise_above above[INCISE_PLAN_ENDS]; /* with a tube's station */
	const struct incise_surface *surface;
	struct incise_surface *own_surface; /* the rig's plane, when it is that */
	double up[3];			    /* normal of the surface's top */
	struct incise_proxy proxy;
	double sn[3];	    /* the paper's Sn of this tick */
	double normal[3];   /* the one that forces go along: Sn, or its average */
	double depth_mm;    /* ≥ 0; of the tissue in front of a membrane */
	double p0_mm[3];    /* where the contact began … */
	int64_t touched_ns; /* … and when */
	double deepest_mm;  /* of the blade since then */
	bool skin_open;	    /* it came into a cut that was there */
	double side[3];	    /* of the blade then: Sx(0) */
	struct incise_incision *incision; /* with its stage */
	struct incise_opening opening;	  /* that handle or tube went into … */
	double tightness; /* … and how tight it was; incise_incision_tightness() */
	bool printed_orientation; /* the scene's orientation = "paper" */
	struct {
		bool met;	 /* the tool is beyond the plane of the membrane … */
		bool hit;	 /* … and came there through it */
		double depth_mm; /* of the plane, below the skin */
		bool punctured;
	} membrane;
	int average_ticks;
	struct incise_average *average; /* with stage normal */

	/* forces */
	double force_N[3]; /* of this tick, before limits */
	double gain;
	bool dissipates;       /* a model's force unloads when the blade draws back … */
	double unloading_N_mm; /* … with this stiffness */
	/* The model's steepest slope by each input, N per its unit, times the gain. */
	double input_slope[INCISE_MODEL_INPUT_KINDS];
	double support_mm;  /* the model's largest depth; beyond it the force … */
	double beyond_N_mm; /* … goes on with this slope, ≥ 0 */
	const struct incise_model *model; /* fuzzy: one of these */
	const struct incise_fixed *fixed;
	struct incise_fixed *own_fixed; /* compiled here */
	/* Inputs that a search for swings holds: bits 1 << enum incise_model_input, and where. */
	unsigned int holds;
	double held[INCISE_MODEL_INPUT_KINDS];
	struct incise_acting_force acting[INCISE_FORCES_MAX];

	/* start, limit */
	struct incise_start start;
	bool fading;   /* asked to let go of the force */
	bool changing; /* the same, for another tool */
	struct incise_limit limit;
	int64_t last_ns; /* of the last tick; 0: none */

	struct incise_axes axes; /* none: nothing is rendered */

	struct incise_integers *integers; /* with arithmetic = "fixed"; else NULL */

	/* The kernel renders: with incise_plan_watch(), and with incise_plan_feed_kernel(). */
	bool watched, feeds;
	bool seen;
	struct incise_stepper_rendered last_seen;
	int64_t fed_ns;	 /* when a pose, or a sign of life, was given last; 0: none was */
	int64_t life_ns; /* so often, at least */
	bool follow;	 /* all actuators do */
	bool fade_told;	 /* the last one said whether to fade as it is */
};

/* --- stages, but for the forces, which are in forces.h --- */

/* From poses to the tool on the surface. */
incise_stage_fn incise_stage_pose;
incise_stage_fn incise_stage_fed;
incise_stage_fn incise_stage_predict;
incise_stage_fn incise_stage_tool;
incise_stage_fn incise_stage_contact;
incise_stage_fn incise_stage_normal;
incise_stage_fn incise_stage_incision;
incise_stage_fn incise_stage_membrane;

/* From the tissue's force to the hand. */
incise_stage_fn incise_stage_start;
incise_stage_fn incise_stage_limit;
incise_stage_fn incise_stage_actuate;

/* In place of all but poses: what the kernel renders. */
incise_stage_fn incise_stage_watched;

/* incise_plan_faded() of a plan that the kernel renders. */
bool incise_plan_kernel_faded(const struct incise_plan *plan) INCISE_REALTIME;

/* Give the kernel a pose; NULL: a sign of life. 0 or a negative errno. */
int incise_plan_give(struct incise_plan *plan, bool tube,
		     const struct incise_tracker_sample *sample,
		     int64_t now_ns) INCISE_REALTIME;

/* --- plan --- */

/*
 * A copy that can tick beside the plan, with all forces so many times as strong. It shares what the
 * plan has allocated, and keeps the plan's stability.
 */
void incise_plan_copy(struct incise_plan *copy, const struct incise_plan *plan,
		      double gain);

/* The lower end of the support of an input of a phase's model, and the upper one. */
void incise_plan_input_range(const struct incise_plan *plan,
			     enum incise_cutting_phase phase, int i, double ends[2]);

/* Fill in the stages that the scene and the rig need, and why the others are left out. */
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

/* The flag of the scalpel's newest pose; ' ' or 0: none. Real-time safe. */
char incise_plan_pose_flag(const struct incise_plan *plan) INCISE_REALTIME;

/* The reason of a fault in a few words, without what the device says; NULL: no fault. */
const char *incise_plan_fault(const struct incise_plan *plan);

/*
 * Compute the scene's stability on this device, and whether it is stable, with
 * the plan's predictor.
 * Returns 0; -EDOM (not stable: the message names the largest gain), -ENOMEM.
 */
int incise_plan_check(struct incise_plan *plan, const struct incise_tracker_info *tracker,
		      struct incise_error *err);

/*
 * Of a plan that is ready to run: whether a scene with a model comes to rest, by a search.
 * Returns 0; -EDOM (it swings: the message says what ends that), -ENOMEM.
 */
int incise_plan_check_rest(struct incise_plan *plan,
			   const struct incise_tracker_info *tracker,
			   struct incise_error *err);

#endif
