/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The cut that the blade left in the tissue: where it began, along which line it runs in the
 * surface, and how far. An instrument put in later is easy to insert there.
 *
 *              side = Sx(0)
 *                 ▲
 *       from  ────┼───────────▶ to    along = side × normal
 *                 at
 */
#ifndef INCISE_INCISION_H
#define INCISE_INCISION_H

#include <incise/export.h>
#include <stdbool.h>

struct incise_incision {
	bool there;
	double at_mm[3];
	double side[3];	 /* the blade's side axis when the cut began */
	double along[3]; /* unit, in the surface */
	double from_mm, to_mm;
};

/* A cut starts and takes the place of the one before. side and normal are unit. */
void incise_incision_begin(struct incise_incision *incision, const double at_mm[3],
			   const double normal[3], const double side[3]) INCISE_REALTIME;

/* The blade meets the surface here now. */
void incise_incision_extend(struct incise_incision *incision,
			    const double at_mm[3]) INCISE_REALTIME;

/* Whether a point of the surface lies within reach of the cut. */
bool incise_incision_holds(const struct incise_incision *incision, const double at_mm[3],
			   double reach_mm) INCISE_REALTIME;

#endif
