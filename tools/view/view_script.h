/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The scripted procedure as ticks of a loop in simulated time, kept in memory; and a view
 * that is fed with them, so that what it costs to draw is told from what it costs to tick.
 */
#ifndef INCISE_VIEW_SCRIPT_H
#define INCISE_VIEW_SCRIPT_H

#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/view.h>

struct view_script {
	const char *scene; /* path */
	struct incise_tick *tick;
	int n;
};

/* Run the first @seconds of it; fails the program. */
void view_script_begin(struct view_script *script, const char *scene, double seconds);
void view_script_end(struct view_script *script);

/* A view without a screen, and how many ticks it was told. */
struct fed_view {
	const struct view_script *script;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_view *view;
	int told;
};

/* @texture_px: of the texture, or 0 for the scene's own. Fails the program. */
void fed_view_open(struct fed_view *fed, const struct view_script *script, int texture_px,
		   int width, int height);

/* Tell of all ticks up to a time since the first; times ascend. */
void fed_view_until(struct fed_view *fed, double t_s);

/* Draw; fails the program. */
void fed_view_frame(struct fed_view *fed);
void fed_view_close(struct fed_view *fed);

#endif
