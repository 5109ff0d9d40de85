/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * A straight line in the surface, in integers; lib/tissue/line.h has the same in double, and its
 * figure. Lengths Q16.16 mm, directions Q2.30.
 */
#ifndef INCISE_FIXED_LINE_H
#define INCISE_FIXED_LINE_H

#include <incise/export.h>
#include "integers.h"

/* A blade so far beside the line of its cut is in new tissue: half the width of a blade, 1 mm. */
#define INCISE_FIXED_BESIDE (1 << 16)

struct incise_fixed_line {
	int32_t there;
	int32_t at[3];
	int32_t side[3];  /* the blade's side axis when the cut began */
	int32_t along[3]; /* unit, in the surface */
	int32_t from, to;
};

/* The direction of a blade in a surface; any there when it lies flat. side and normal are unit. */
void incise_fixed_line_along(int32_t along[3], const int32_t normal[3],
			     const int32_t side[3]) INCISE_REALTIME;

/* A cut starts and takes the place of the one before. */
void incise_fixed_line_begin(struct incise_fixed_line *line, const int32_t at[3],
			     const int32_t normal[3],
			     const int32_t side[3]) INCISE_REALTIME;

/* The blade meets the surface here now. */
void incise_fixed_line_extend(struct incise_fixed_line *line,
			      const int32_t at[3]) INCISE_REALTIME;

/* Whether a point of the surface lies within INCISE_FIXED_BESIDE of the cut. */
bool incise_fixed_line_holds(const struct incise_fixed_line *line,
			     const int32_t at[3]) INCISE_REALTIME;

/*
 * Length of new tissue, Q16.16: the way of the blade beyond its own cut. Where it left the line
 * sideways another one begins, and INCISE_FIXED_BESIDE is new.
 */
int32_t incise_fixed_line_advance(struct incise_fixed_line *line, const int32_t at[3],
				  const int32_t normal[3],
				  const int32_t side[3]) INCISE_REALTIME;

#endif
