/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Paper 2's procedure as a script for the scalpel of sim:mouse, at the top of a surface: cut along
 * and across, let it bleed, enlarge the cut with the handle, insert a tube. As poses, and as ticks
 * that a benchmark keeps in memory.
 *
 *     blade  ╲__30 mm__╱   ╲_15 mm_╱         handle  ║ ↻        tube  ║
 *   0 s     1 s       2.6 s  4.1 s 5.2 s … 9 s      11 s   14 s      18 s … 22 s
 */
#ifndef INCISE_PROCEDURE_H
#define INCISE_PROCEDURE_H

#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/view.h>

#define PROCEDURE_S 22.0

struct procedure_pose {
	double position_mm[3]; /* of the scalpel's tip */
	double velocity_mm_s[3];
	double quaternion[4];
	enum incise_tool tool;
};

/* @handle_mm: length of the scalpel. @t_s: below 0 is the start, above PROCEDURE_S the end. */
void procedure_at(const struct incise_touch *top, double handle_mm, double t_s,
		  struct procedure_pose *pose);

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

/* @texture_px: of the texture, or 0 for the scene's own. Fails the program. */
void fed_view_open(struct fed_view *fed, const struct view_script *script, int texture_px,
		   int width, int height);

/* Give the view all ticks up to a time since the first; times ascend. */
void fed_view_until(struct fed_view *fed, double t_s);

/* Draw; fails the program. */
void fed_view_frame(struct fed_view *fed);
void fed_view_close(struct fed_view *fed);

#endif
