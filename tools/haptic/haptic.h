/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A running haptic loop, and the parts of incise haptic that share it.
 */
#ifndef INCISE_TOOLS_HAPTIC_H
#define INCISE_TOOLS_HAPTIC_H

#include <incise/loop.h>
#include <incise/realtime.h>
#include <incise/rig.h>
#include <incise/state.h>
#include "../cli/calibration.h"
#include "../cli/json.h"
#include "../cli/scene_argument.h"
#include "../session/log.h"
#include "feeder.h"

/* Where the ticks are computed; see run.h. */
enum haptic_mode { HAPTIC_LOOP, HAPTIC_FEED, HAPTIC_WATCH };

struct haptic {
	enum haptic_mode mode;
	struct feeder feeder; /* of HAPTIC_WATCH */
	struct scene_argument argument;
	enum incise_tool tool;
	struct calibration_used calibration;

	struct incise_rig *rig;
	struct incise_scene *scene; /* the plan's */
	struct incise_plan *plan;
	struct incise_loop_options loop;
	struct incise_loop_stats *stats;
	struct incise_realtime *realtime;  /* or NULL */
	const char *scheduling;		   /* "SCHED_FIFO 80" */
	struct incise_state_writer *state; /* or NULL */
	struct session_log *session;	   /* or NULL */
	char *page;			   /* its path; or NULL */
	struct incise_realtime_counts
		counts; /* of the loop's thread, from the first tick */
};

/* A plan of a scene as this loop runs it; NULL with @err. */
struct incise_plan *haptic_plan(const struct haptic *haptic,
				const struct incise_scene *scene,
				struct incise_error *err);

struct self_test {
	double force_max_N;   /* largest */
	double silent_ms;     /* from the last pose to no force */
	double silent_max_ms; /* largest by the scene's limits */
	unsigned int contact; /* ticks in the tissue */
};

/*
 * A stroke into the scene's tissue without devices, before anything moves: it must push, stay
 * within the scene's limits, and fade when poses end. @tracker: the rig's.
 * Returns 0, -EPROTO with the reason in @err, or as incise_plan_new_fed().
 */
int haptic_self_test(const struct incise_scene *scene, struct incise_tracker *tracker,
		     struct self_test *test, struct incise_error *err);

/*
 * Say what there is to know of the rig's haptic device, and measure the age of its poses; where the plan
 * assumes younger ones it is made again, or the program ends. Without such a device nothing happens.
 */
void haptic_begin_device(struct haptic *haptic);

/* The device and the ages of its poses, for a report; null, or no line, without one. */
json_t *haptic_device_json(const struct haptic *haptic);
void haptic_device_line(const struct haptic *haptic);

/* From here on SIGHUP reads the scene again, if this process has no terminal that closes. */
void haptic_catch_reload(void);

/*
 * Run the loop in a thread of its own until it ends. The actuator must be powered. A reload
 * replaces scene and plan.
 * Returns as incise_loop_run(), or a negative errno if the loop could not start.
 */
int haptic_supervise(struct haptic *haptic, struct incise_error *err);

#endif
