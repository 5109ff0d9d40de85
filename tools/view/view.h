/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The parts of incise view: sources of ticks, and the frames that are drawn of them, in a
 * window or into files. Every failure ends the program.
 */
#ifndef INCISE_VIEW_TOOL_H
#define INCISE_VIEW_TOOL_H

#include <stdbool.h>
#include <stdint.h>
#include <jansson.h>
#include <incise/film.h>
#include <incise/plan.h>
#include <incise/rig.h>
#include <incise/scene.h>
#include <incise/sim.h>
#include <incise/view.h>
#include "../cli/cli.h"
#include "../cli/scene_argument.h"
#include "../session/log.h"
#include "live.h"

#define VIEW_STRIP_MAX 12

/* Frames that are not for a window: a folder of PNG files, a film, a strip of a few. */
struct view_output {
	const char *folder, *film_path, *strip_path; /* each may be NULL */
	double strip_s[VIEW_STRIP_MAX];		     /* times of its frames, ascending */
	int n_strip;
	int width, height, fps;

	struct incise_film *film;
	uint8_t *rgb, *strip; /* a frame with room for its time below it; the strip */
	int stripped;
	uint64_t frames; /* that were written */
};

struct view_job {
	struct scene_argument argument;
	const char *rig, *from;
	bool procedure, no_panel, no_output, has_camera, json;
	double camera[3];
	double duration_s;
	struct view_output output;
	struct session_options session;
	struct session_log *log; /* or NULL */
	char fault[320];	 /* of the watched loop; "": no loop */

	struct incise_scene *scene;
	double rate_hz;
	struct incise_rig *own_rig;
	struct incise_plan *plan;
	struct incise_view *view;

	int64_t made_ns; /* CLOCK_MONOTONIC, when the view was made */
	uint64_t frames, lost;
	int64_t begin_ns, end_ns; /* CLOCK_MONOTONIC, of the frames */
	bool keep;		  /* write the next frame to a file of its own */
	double total_s;		  /* of the run; 0: not known */
	struct cli_bar progress;
};

void view_pause_until(int64_t t_ns);

/* Open the output files; whether there are any; close them. */
void view_output_begin(struct view_output *output);
bool view_output_wanted(const struct view_output *output);
void view_output_end(struct view_output *output);

/* Whether no frame is left to write: after the last one of a strip without other files. */
bool view_output_complete(const struct view_output *output);

/* Print the files that were written, or add them to a report. */
void view_output_print(const struct view_output *output);
void view_output_json(const struct view_output *output, json_t *files);

/* Make the view of the job's plan. */
void view_job_view(struct view_job *job);

/*
 * Draw, show and write the frame of a time; of a strip alone only those that it has. @status NULL:
 * of a loop in simulated time.
 */
void view_job_draw(struct view_job *job, const struct incise_view_status *status,
		   double t_s);

/*
 * The hand at a window: mouse, pen or joystick move the scalpel of sim:mouse over the tissue.
 *
 *     pointer ──ray──▶ point of the surface ──▶ tip above it; pressed: that deep below it
 */
struct view_hand {
	struct incise_sim *sim;
	double handle_mm;
	double depth_mm; /* when it is pressed */
	enum incise_tool tool;

	/* The pointer on the surface, and its pressure, 0 … 1. */
	double point_mm[3], normal[3], press;
	double stick[2]; /* of a joystick */
	/* The tip now. */
	double height_mm, at_mm[3], round;
};

void view_hand_begin(struct view_hand *hand, struct incise_sim *sim, double handle_mm,
		     const struct incise_touch *top);

/* Move on by @dt_s; once a frame. */
void view_hand_move(struct view_hand *hand, double dt_s);

/* Handle keys and mouse; @hand may be NULL. Returns false to end. */
bool view_job_events(struct view_job *job, struct view_hand *hand,
		     struct view_live *live);

/* The sources of ticks, each until its end: a loop of another program, a loop here. */
void view_running(struct view_job *job);
void view_rig(struct view_job *job);

/* In simulated time: the scripted procedure, a recording. */
void view_procedure(struct view_job *job);
void view_recording(struct view_job *job);

#endif
