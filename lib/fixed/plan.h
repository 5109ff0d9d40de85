/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * A scene's plan in integers: all that a tick needs, from poses to the targets of the actuators. It is
 * the whole of arithmetic = "fixed" in a program, and runs unchanged in the kernel module. lib/tissue
 * has the same stages in double.
 *
 *   pose ─▶ predict ─▶ tool ─▶ contact ─▶ normal ─▶ incision ─▶ membrane ─▶ texture ─▶ forces ─▶
 *   start ─▶ limit ─▶ targets
 *
 * Parts that a scene does not need are 0 in its plan, and cost a comparison.
 *
 *   NAME.plan ─▶ incise_fixed_plan_open() ─▶ incise_fixed_plan_begin() ─▶ incise_fixed_plan_tick()
 *
 *   lengths  Q16.16 mm       directions, quaternions  Q2.30      forces  Q16.16 N
 *   springs  Q16.16 N/mm     times  ns of CLOCK_MONOTONIC        speeds  Q16.16 mm/s
 *
 * A tick takes a bounded time, whatever the plan and the poses are: only the loops over the cuts
 * depend on data, INCISE_FIXED_CUTS_MAX at most.
 */
#ifndef INCISE_FIXED_PLAN_H
#define INCISE_FIXED_PLAN_H

#include <incise/export.h>
#include <incise/fixed.h>
#include <incise/tick_flags.h>
#include <incise/tool.h>
#include "grid.h"
#include "input.h"
#include "integers.h"
#include "shape.h"
#include "texture.h"

#define INCISE_FIXED_PLAN_MAGIC "INCISEPL"
#define INCISE_FIXED_PLAN_VERSION 1
#define INCISE_FIXED_PLAN_VERSION_INPUTS 2 /* of a plan with @inputs */
#define INCISE_FIXED_PLAN_VERSION_MORE 3   /* of a plan with forces that came later */
#define INCISE_FIXED_PLAN_VERSION_TEXTURE 4
#define INCISE_FIXED_PLAN_SIZE_MAX (32 << 20)

#define INCISE_FIXED_FORCE_MAX (1 << 28) /* of a plan's limit: 4096 N */
#define INCISE_FIXED_AXES_MAX T_AXES_MAX
#define INCISE_FIXED_AVERAGE_MAX T_AVERAGE_MAX

#define INCISE_FIXED_CUTS_MAX 64
#define INCISE_FIXED_CUT_PLACES 128		  /* half a millimetre apart */
#define INCISE_FIXED_DEPTH_MAX (1000 * (1 << 16)) /* no depth beyond counts */

struct incise_fixed_cut {
	int32_t at_mm[3], along[3], side[3], normal[3];
	int32_t from_mm, to_mm;
	int32_t incision; /* lowest number of the cuts that it is joined with */
	struct {
		int32_t depth_mm, open_mm;
	} place[INCISE_FIXED_CUT_PLACES];
};

/* Place of a handle or tube in an incision; all 0 outside. */
struct incise_fixed_opening {
	int32_t in;
	int32_t cut;
	int32_t at_mm;
	int32_t depth_mm, open_mm;
	int32_t length_mm; /* of all cuts of the incision */
	int32_t along[3];
};

#define INCISE_FIXED_POSE_TOOL 0xffu  /* bits: enum incise_tool, the tool in the hand */
#define INCISE_FIXED_POSE_TUBE 0x100u /* the pose is of the tube's station */
#define INCISE_FIXED_POSE_FADE \
	0x200u /* let go of the force, for as long as this is set */
#define INCISE_FIXED_POSE_KNOWN 0x3ffu

/* Why a pose was not taken. */
enum incise_fixed_pose_answer {
	INCISE_FIXED_POSE_TAKEN,
	INCISE_FIXED_POSE_OLD,	   /* not newer than the last */
	INCISE_FIXED_POSE_FAR,	   /* its position is invalid, or its time below 0 */
	INCISE_FIXED_POSE_UNKNOWN, /* bits of tool that are not known here */
	INCISE_FIXED_POSE_NONE,	   /* its quaternion is 0: only its tool was taken */
};

#include "../number/fixed_kind.h"
#include "../tissue/tick.proto.h"
#include "../number/no_kind.h"

/* Trackers from 20 Hz on: a gap of five periods is 250 ms at most. */
#define INCISE_FIXED_PERIOD_MIN_NS 100000
#define INCISE_FIXED_PERIOD_MAX_NS 50000000
#define INCISE_FIXED_AHEAD_MAX_NS 250000000

/* Tell whether a filter's numbers are within their ranges: then nothing overflows. */
bool incise_fixed_filter_good(const struct incise_fixed_filter *filter);

/* The same of a setup of cuts. */
bool incise_fixed_incision_good(const struct incise_fixed_incision_setup *setup);

/* The bytes of a plan, all little-endian: this, then a model (a blob as of incise/fixed.h), the
 * heights of a grid and a texture, each at a multiple of 8 bytes. */
struct incise_fixed_plan_header {
	char magic[8];
	uint32_t version;
	uint32_t size;			   /* of all */
	uint32_t crc;			   /* CRC-32C of all behind this field */
	uint32_t model_at, model_size;	   /* 0: none */
	uint32_t heights_at, heights_size; /* 0: none */
	uint32_t texture_at;		   /* 0: none */
	char name[64];			   /* of the scene's file, zero-padded */
	char surface[32];		   /* what it was: "plane", "mesh" … */
	struct incise_fixed_numbers numbers;
};

#define INCISE_FIXED_PLAN_CRC_FROM 20

/* A surface outside the plan, of a program; the kernel has no such surface. */
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
	const struct incise_fixed_texture *texture; /* of the cut, or NULL */
	const struct incise_fixed_surface
		*surface; /* takes the place of shape; or NULL */
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

/* The version of a plan, by its numbers and parts. */
uint32_t incise_fixed_plan_version(const struct incise_fixed_plan_header *head);

/* The same of numbers alone, without a model and a grid. @return whether they are good */
bool incise_fixed_numbers_good(const struct incise_fixed_numbers *numbers);

/*
 * From the last pose until there is no force, at most: the pose's age, the fade, the largest force
 * at its slew. A motor's deadman is to be longer.
 */
int64_t incise_fixed_plan_fade_ns(const struct incise_fixed_numbers *numbers);

/* One tick: all stages, then the actuators' targets. @t_ns: not before the last one's. */
void incise_fixed_plan_tick(const struct incise_fixed_plan *plan,
			    struct incise_fixed_state *state, int64_t t_ns,
			    struct incise_fixed_tick *tick) INCISE_REALTIME;

#endif
