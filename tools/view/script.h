/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Ticks of the scripted procedure that are kept in memory, and views without a screen that get
 * them: drawing is measured without the loop.
 */
#ifndef INCISE_VIEW_SCRIPT_H
#define INCISE_VIEW_SCRIPT_H

#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/view.h>

/* Ticks of the procedure, from a loop in simulated time. */
struct view_script {
	const char *scene; /* path */
	struct incise_tick *tick;
	int n;
};

/* Run the first @seconds of the procedure; fails the program. */
void view_script_begin(struct view_script *script, const char *scene, double seconds);
void view_script_end(struct view_script *script);

/* A view without a screen that gets such ticks: drawing is timed without the loop. */
struct fed_view {
	const struct view_script *script;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_view *view;
	int fed; /* ticks so far */
};

/*
 * @texture_px: of the texture, or 0 for the scene's own. @live: as of struct incise_view_setup. Fails
 * the program.
 */
void fed_view_open(struct fed_view *fed, const struct view_script *script, int texture_px,
		   int width, int height, bool live);

/* Give the view all ticks up to a time since the first; times ascend. */
void fed_view_until(struct fed_view *fed, double t_s);

/* Draw; fails the program. */
void fed_view_frame(struct fed_view *fed);
void fed_view_close(struct fed_view *fed);

#endif
