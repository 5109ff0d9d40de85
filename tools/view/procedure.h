/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Paper 2's procedure as a script for the scalpel of sim:mouse, at the top of a surface: cut,
 * let it bleed, enlarge the cut with the handle, insert a tube.
 *
 *     blade  ╲___30 mm___╱        handle  ║ ↻        tube  ║
 *   0 s     1 s         3 s   4 … 9 s    11 s   14 s      17 s … 22 s
 */
#ifndef INCISE_PROCEDURE_H
#define INCISE_PROCEDURE_H

#include <incise/surface.h>
#include <incise/tool.h>

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

#endif
