/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What incise view is to do, and what it has done so far: shared by the sources of its ticks.
 */
#ifndef INCISE_VIEW_JOB_H
#define INCISE_VIEW_JOB_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/plan.h>
#include <incise/rig.h>
#include <incise/scene.h>
#include <incise/view.h>
#include "../cli/scene_argument.h"
#include "view_hand.h"
#include "live.h"
#include "view_output.h"

struct view_job {
	struct scene_argument argument;
	const char *rig, *from;
	bool procedure, no_panel, no_output, has_camera, json;
	double camera[3];
	double duration_s;
	struct view_output output;

	struct incise_scene *scene;
	double rate_hz;
	struct incise_rig *own_rig;
	struct incise_plan *plan;
	struct incise_view *view;

	int64_t made_ns; /* CLOCK_MONOTONIC, when the view was made */
	uint64_t frames, lost;
	int64_t begin_ns, end_ns; /* CLOCK_MONOTONIC, of the frames */
	bool keep;		  /* the picture, under a name of its own */
};

/* CLOCK_MONOTONIC. */
int64_t view_wall(void);
void view_pause_until(int64_t t_ns);

/* Make the view, once there is a plan; fails the program. */
void view_job_view(struct view_job *job);

/* One frame: drawn, shown, written. @status NULL: of a loop in simulated time. */
void view_job_draw(struct view_job *job, const struct incise_view_status *status,
		   double t_s);

/* Keys and mouse; @hand NULL: nobody holds a tool. Whether it goes on. */
bool view_job_events(struct view_job *job, struct view_hand *hand,
		     struct view_live *live);

/* The sources of ticks, each to its end: loops in real time, and in simulated time. */
void view_running(struct view_job *job);
void view_rig(struct view_job *job);
void view_procedure(struct view_job *job);
void view_recording(struct view_job *job);

#endif
