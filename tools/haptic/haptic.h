/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A haptic loop that runs, and all that belongs to it; shared by the files of `incise haptic`.
 */
#ifndef INCISE_HAPTIC_H
#define INCISE_HAPTIC_H

#include <incise/loop.h>
#include <incise/realtime.h>
#include <incise/rig.h>
#include <incise/state.h>
#include "../cli/scene_argument.h"

struct haptic {
	struct scene_argument argument;
	enum incise_tool tool;
	double tip_mm[3];

	struct incise_rig *rig;
	struct incise_scene *scene; /* in force, with its plan */
	struct incise_plan *plan;
	struct incise_loop_options loop;
	struct incise_loop_stats *stats;
	struct incise_realtime *realtime;  /* or NULL */
	const char *scheduling;		   /* "SCHED_FIFO 80" */
	struct incise_state_writer *state; /* or NULL */
	/* Of the loop's thread from the first tick on. */
	struct incise_realtime_counts counts;
};

/* A plan of a scene as this loop runs it; NULL, with @err, when it cannot. */
struct incise_plan *haptic_plan(const struct haptic *haptic,
				const struct incise_scene *scene,
				struct incise_error *err);

#endif
