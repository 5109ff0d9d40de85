/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A straight line in the surface: where the blade began, its direction there, and how far it
 * went. The front of a cut follows one.
 *
 *              side = Sx(0)
 *                 ▲
 *       from  ────┼───────────▶ to    along = side × normal
 *                 at
 */
#ifndef INCISE_LINE_H
#define INCISE_LINE_H

#include <incise/export.h>
#include <stdbool.h>

struct incise_line {
	bool there;
	double at_mm[3];
	double side[3];	 /* the blade's side axis when the cut began */
	double along[3]; /* unit, in the surface */
	double from_mm, to_mm;
};

/* A cut starts and takes the place of the one before. side and normal are unit. */
void incise_line_begin(struct incise_line *line, const double at_mm[3],
		       const double normal[3], const double side[3]) INCISE_REALTIME;

/* The blade meets the surface here now. */
void incise_line_extend(struct incise_line *line, const double at_mm[3]) INCISE_REALTIME;

/* Whether a point of the surface lies within reach of the cut. */
bool incise_line_holds(const struct incise_line *line, const double at_mm[3],
		       double reach_mm) INCISE_REALTIME;

#endif
