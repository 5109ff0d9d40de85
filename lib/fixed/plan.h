/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * A scene's plan in integers: all that a tick needs, from poses to the targets of the actuators. It is
 * the whole of arithmetic = "fixed" in a program, and runs unchanged in the kernel module. lib/scene
 * has the same stages in double.
 *
 *   pose ─▶ predict ─▶ tool ─▶ contact ─▶ normal ─▶ incision ─▶ membrane ─▶ forces ─▶ start ─▶
 *   limit ─▶ targets
 *
 * Parts that a scene does not need are 0 in its plan, and cost a comparison.
 *
 *   NAME.plan ─▶ incise_fixed_plan_open() ─▶ incise_fixed_plan_begin() ─▶ incise_fixed_plan_tick()
 *
 *   lengths  Q16.16 mm       directions, quaternions  Q2.30      forces  Q16.16 N
 *   springs  Q16.16 N/mm     times  ns of CLOCK_MONOTONIC        speeds  Q16.16 mm/s
 *
 * A tick takes a bounded time, whatever the plan and the poses are: no loop depends on data but those
 * over the cuts, INCISE_FIXED_CUTS_MAX at most.
 */
#ifndef INCISE_FIXED_PLAN_H
#define INCISE_FIXED_PLAN_H

#include <incise/export.h>
#include <incise/fixed.h>
#include <incise/tick_flags.h>
#include <incise/tool.h>
#include "front.h"
#include "grid.h"
#include "incision.h"
#include "input.h"
#include "integers.h"
#include "line.h"
#include "predict.h"
#include "shape.h"

#define INCISE_FIXED_PLAN_MAGIC "INCISEPL"
#define INCISE_FIXED_PLAN_VERSION 1
#define INCISE_FIXED_PLAN_VERSION_INPUTS 2 /* of a plan with @inputs */
#define INCISE_FIXED_PLAN_SIZE_MAX (32 << 20)

#define INCISE_FIXED_AXES_MAX 3
#define INCISE_FIXED_AVERAGE_MAX 64
#define INCISE_FIXED_FORCE_MAX (1 << 28) /* of a plan's limit: 4096 N */

/* An actuator: its nut goes where the spring pushes with the wanted force. */
struct incise_fixed_axis {
	int32_t direction[3];
	int32_t dual[3];      /* Q24; the force along it is dual · force */
	int32_t compliance;   /* mm/N, Q20, ≥ 1 */
	int32_t steps_per_mm; /* Q16, ≥ 1 */
	int32_t origin;	      /* along the direction, where the nut is at 0 */
	int32_t travel;	      /* 0 … */
	int32_t rest;	      /* 0 … travel: where the nut goes without a force */
	int32_t reserved;
};

/* A membrane over an airway; stiffness 0: there is none. */
struct incise_fixed_membrane {
	int32_t point[3], normal[3];
	int32_t radius;
	int32_t thickness; /* ≥ 1: it yields after so much */
	int32_t stiffness; /* until then */
	int32_t back_wall;
};

/* The numbers of a plan, in the file and in memory. All are checked by incise_fixed_plan_open(). */
struct incise_fixed_numbers {
	int64_t bound; /* certified error of the force against the plan in double, 2^-32 N */
	int64_t pose_age_ns; /* without a younger pose the force fades */
	int32_t tick_ns;
	int32_t n_axes;
	struct incise_fixed_filter filter;

	/* The scalpel, in the frame of the tracker's poses. */
	int32_t tip[3];	 /* of the blade */
	int32_t axis[3]; /* from the tip to the handle's end */
	int32_t side[3]; /* normal of the flat side of blade and handle */
	int32_t handle;	 /* the handle's end, from the tip */
	int32_t inserts; /* handle and tube can be held */
	int32_t tube;	 /* the tube has a station of the tracker */

	struct incise_fixed_shape shape;
	struct incise_fixed_grid_frame grid;
	int32_t up[3];	       /* normal of the surface's top */
	int32_t leave;	       /* a contact ends so far outside */
	int32_t average_ticks; /* of the normal, 1 … INCISE_FIXED_AVERAGE_MAX */

	/* The reaction: a spring, or a model, and with `unloading` the front of a cut. */
	int32_t reaction;
	int32_t gain;		 /* of the model's force, Q16 */
	int32_t support, beyond; /* its largest depth, and its slope beyond */
	int32_t unloading, friction;
	int32_t plane;
	int32_t damping; /* N s/mm, Q28 */
	int32_t insertion, aligned, printed;
	int32_t spread;
	struct incise_fixed_incision_setup incision;
	struct incise_fixed_membrane membrane;

	int32_t small;	     /* no force before one as small as this is asked for */
	int32_t ramp_ns;     /* a force comes in this time … */
	int32_t fade_ns;     /* … and goes in this */
	int32_t force, slew; /* largest one, and largest change of it in a tick */
	struct incise_fixed_axis axes[INCISE_FIXED_AXES_MAX];
	/*
	 * The model's inputs, from the lowest bits on: four bits each, enum
	 * incise_fixed_input_kind, once each. 0: depth, or depth and speed.
	 */
	int32_t inputs;
	int32_t reserved[8];
};

/* The bytes of a plan, all little-endian: this, then a model (a blob as of incise/fixed.h) and the
 * heights of a grid, each at a multiple of 8 bytes. */
struct incise_fixed_plan_header {
	char magic[8];
	uint32_t version;
	uint32_t size;			   /* of all */
	uint32_t crc;			   /* CRC-32C of all behind this field */
	uint32_t model_at, model_size;	   /* 0: none */
	uint32_t heights_at, heights_size; /* 0: none */
	uint32_t reserved;
	char name[64];	  /* of the scene's file, zero-padded */
	char surface[32]; /* what it was: "plane", "mesh" … */
	struct incise_fixed_numbers numbers;
};

#define INCISE_FIXED_PLAN_CRC_FROM 20

/* A surface that is not in the plan, as a program has; the kernel has none. */
struct incise_fixed_surface {
	void *context;
	void (*move)(void *context, const int32_t tool[3],
		     struct incise_fixed_proxy *proxy) INCISE_REALTIME;
	/* Q16.16 mm */
	int32_t (*above)(void *context, const int32_t place[3]) INCISE_REALTIME;
	void (*restart)(void *context) INCISE_REALTIME;
};

/* A view of a plan that was checked. Its fields may be read. */
struct incise_fixed_plan {
	struct incise_fixed_numbers numbers;
	struct incise_fixed model; /* where has_model */
	bool has_model;
	struct incise_fixed_grid grid;
	const struct incise_fixed_surface
		*surface; /* takes the place of shape; or NULL */
};

/* A pose of the tracker. */
struct incise_fixed_pose {
	int64_t t_ns; /* when it came */
	int32_t position[3];
	int32_t quaternion[4];
	uint32_t tool; /* INCISE_FIXED_POSE_… */
};

#define INCISE_FIXED_POSE_TOOL 0xffu  /* bits: enum incise_tool, what the hand holds */
#define INCISE_FIXED_POSE_TUBE 0x100u /* the pose is of the tube's station */
#define INCISE_FIXED_POSE_FADE \
	0x200u /* let go of the force, for as long as this is set */
#define INCISE_FIXED_POSE_KNOWN 0x3ffu

/* Why a pose was not taken. */
enum incise_fixed_pose_answer {
	INCISE_FIXED_POSE_TAKEN,
	INCISE_FIXED_POSE_OLD,	   /* not newer than the last */
	INCISE_FIXED_POSE_FAR,	   /* its position is none, or its time below 0 */
	INCISE_FIXED_POSE_UNKNOWN, /* bits of tool that are not known here */
	INCISE_FIXED_POSE_NONE,	   /* its quaternion is 0: only its tool was taken */
};

/* The height of an end above the surface, when that was last searched for it. */
struct incise_fixed_above {
	int64_t above;
	int32_t end[3];
	int32_t known;
};

enum { INCISE_FIXED_TIP, INCISE_FIXED_HANDLE, INCISE_FIXED_TUBE, INCISE_FIXED_ENDS };

/* The state of a plan between ticks; 75 kB. Set by incise_fixed_plan_begin(). */
struct incise_fixed_state {
	struct incise_fixed_predict scalpel, handle, tube;
	struct incise_fixed_above above[INCISE_FIXED_ENDS]; /* with a tube's station */
	int64_t last_ns; /* of the last tick; 0: none */
	int64_t gain;	 /* of start, Q30 */
	int32_t released, fading, changing;
	int32_t wanted, held, tube_nearer;
	struct incise_fixed_proxy proxy;
	int32_t attitude[4], velocity[3];
	int32_t p0[3], sn[3], normal[3], depth;
	int64_t touched_ns; /* when the contact began */
	int32_t side[3];    /* of the blade when its contact began */
	int32_t flat[3];    /* of blade and handle now */
	struct {
		int32_t n, at;
		int32_t ring[INCISE_FIXED_AVERAGE_MAX][3];
		int64_t sum[3];
	} average;
	struct incise_fixed_line line; /* of the front */
	struct incise_fixed_front front;
	struct incise_fixed_opening opening; /* that handle or tube went into … */
	int32_t tightness;		     /* … and how tight it was, Q16 */
	struct {
		int32_t met, hit, depth, punctured;
	} membrane;
	int32_t force[3]; /* of the tissue, before limits */
	int32_t last[3];  /* what was rendered */
	int32_t place
		[INCISE_FIXED_AXES_MAX]; /* of the handle along each axis, from its origin */
	struct incise_fixed_incision incision;
};

/* The result of a tick. Without contact proxy and normal are 0. */
struct incise_fixed_tick {
	int64_t t_ns;
	int64_t age_ns; /* of the pose; INT64_MAX: there was none */
	int32_t position[3], attitude[4];
	int32_t tool[3], proxy[3], normal[3];
	int32_t depth, speed;
	int32_t command[3];
	int32_t along[INCISE_FIXED_AXES_MAX];  /* force of each actuator */
	int32_t target[INCISE_FIXED_AXES_MAX]; /* of its nut, steps */
	uint32_t flags;			       /* INCISE_TICK_… */
	int32_t phase, held;		       /* enum incise_phase, enum incise_tool */
};

/*
 * Check a plan in full, and make a view of it: after this no pose and no time makes a tick overflow,
 * read outside, or take longer than it may.
 *
 * @param blob aligned to 8 bytes; must outlive @plan
 * @return 0; -22 (EINVAL), -95 (ENOTSUP: another version). Builds in a kernel.
 */
int incise_fixed_plan_open(struct incise_fixed_plan *plan, const void *blob,
			   uint32_t size);

/* The same of numbers alone, without a model and a grid. @return whether they are good */
bool incise_fixed_numbers_good(const struct incise_fixed_numbers *numbers);

/*
 * From the last pose until there is no force, at most: the pose's age, the fade, the largest force
 * at its slew. A motor's deadman is to be longer.
 */
int64_t incise_fixed_plan_fade_ns(const struct incise_fixed_numbers *numbers);

/* Start without a pose, a contact or a cut. */
void incise_fixed_plan_begin(const struct incise_fixed_plan *plan,
			     struct incise_fixed_state *state);

/*
 * Take a pose in, before the tick; one from the future counts as of now. Any numbers are safe.
 */
enum incise_fixed_pose_answer incise_fixed_plan_pose(const struct incise_fixed_plan *plan,
						     struct incise_fixed_state *state,
						     const struct incise_fixed_pose *pose,
						     int64_t now_ns) INCISE_REALTIME;

/*
 * The stages of a tick, in their order. One that its plan does not need does nothing; a program may
 * leave it out.
 */
typedef void incise_fixed_stage_fn(const struct incise_fixed_plan *plan,
				   struct incise_fixed_state *state,
				   struct incise_fixed_tick *tick) INCISE_REALTIME;
incise_fixed_stage_fn incise_fixed_stage_predict, incise_fixed_stage_tool,
	incise_fixed_stage_contact, incise_fixed_stage_normal,
	incise_fixed_stage_incision, incise_fixed_stage_membrane,
	incise_fixed_stage_reaction, incise_fixed_stage_plane, incise_fixed_stage_damping,
	incise_fixed_stage_insertion, incise_fixed_stage_spread, incise_fixed_stage_start,
	incise_fixed_stage_limit;

/* One tick: all stages, then the actuators' targets. @t_ns: not before the last one's. */
void incise_fixed_plan_tick(const struct incise_fixed_plan *plan,
			    struct incise_fixed_state *state, int64_t t_ns,
			    struct incise_fixed_tick *tick) INCISE_REALTIME;

#endif
