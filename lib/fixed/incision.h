/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The cuts that a blade left, in integers; incise/incision.h has the same in double, its figure and
 * its rules. A tick takes a bounded time: it looks at each cut a few times, and at each place of one
 * cut once.
 *
 *   lengths Q16.16 mm     directions Q2.30     tightness Q16.16, 0 … 1
 */
#ifndef INCISE_FIXED_INCISION_H
#define INCISE_FIXED_INCISION_H

#include <incise/export.h>
#include <incise/tool.h>
#include "integers.h"

#define INCISE_FIXED_CUTS_MAX 64
#define INCISE_FIXED_CUT_PLACES 128 /* half a millimetre apart */
#define INCISE_FIXED_CUT_SPACING (1 << 15)
#define INCISE_FIXED_DEPTH_MAX (1000 * (1 << 16)) /* no depth beyond counts */

/* Of a scene; each 0 … INCISE_FIXED_DEPTH_MAX. */
struct incise_fixed_incision_setup {
	int32_t cuts_most; /* 0 … INCISE_FIXED_CUTS_MAX; 0: the blade leaves no cut */
	int32_t cut_from, stretch;
	int32_t handle_width, handle_thickness;
	int32_t tube;
};

struct incise_fixed_cut {
	int32_t at[3], along[3], side[3], normal[3];
	int32_t from, to;
	int32_t incision; /* lowest number of the cuts that it is joined with */
	struct {
		int32_t depth, open;
	} place[INCISE_FIXED_CUT_PLACES];
};

/* Where a handle or tube is in an incision; all 0 where it is in none. */
struct incise_fixed_opening {
	int32_t in;
	int32_t cut;
	int32_t at;
	int32_t depth, open;
	int32_t along[3];
};

/* Begins with {0}; 68 kB. */
struct incise_fixed_incision {
	int32_t cutting, growing; /* the kernel has a macro current */
	int32_t at[3], depth;	  /* of the last tick */
	int32_t checked[3];	  /* up to here, for other cuts that it meets */
	int32_t behind[3];	  /* the place before that: a way that is no noise */
	struct incise_fixed_opening met; /* of handle or tube at this tick */
	int32_t n;
	struct incise_fixed_cut cut[INCISE_FIXED_CUTS_MAX];
};

/* Tell whether a setup's numbers are within their ranges. */
bool incise_fixed_incision_good(const struct incise_fixed_incision_setup *setup);

/*
 * The blade at this tick: it cuts where it is deeper than cut_from.
 *
 * @param proxy  of the surface; @param normal outward there
 * @param side   of the blade, unit
 * Returns false where it would cut but leaves no cut: cuts_most are there.
 */
bool incise_fixed_incision_cut(struct incise_fixed_incision *incision,
			       const struct incise_fixed_incision_setup *setup,
			       const int32_t proxy[3], const int32_t normal[3],
			       const int32_t side[3], int32_t depth) INCISE_REALTIME;

/* Handle or tube at this tick: it opens the cut that it is in, met. @flat: its side, unit. */
void incise_fixed_incision_open(struct incise_fixed_incision *incision,
				const struct incise_fixed_incision_setup *setup,
				enum incise_tool tool, const int32_t proxy[3],
				const int32_t flat[3], int32_t depth) INCISE_REALTIME;

/* Neither is in the tissue. */
void incise_fixed_incision_leave(struct incise_fixed_incision *incision) INCISE_REALTIME;

/* Tightness of an opening for a tool, Q16.16: 0 (wide open) … 1. */
int32_t incise_fixed_incision_tightness(const struct incise_fixed_incision_setup *setup,
					const struct incise_fixed_opening *opening,
					enum incise_tool tool) INCISE_REALTIME;

#endif
