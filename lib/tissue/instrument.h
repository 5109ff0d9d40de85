/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The instrument in the hand: blade, handle or tube, and the place of its end. The scalpel can be
 * turned round: then its handle goes first.
 *
 *          blade            handle
 *        axis ▲  ║             ▲ tip
 *             │  ║             ║
 *             │  ║ handle      ║
 *             ○ tip            ○ tip + handle_mm · axis
 *      ───────────────────────────────── surface
 *
 * A tube that has a station of the tracker is held while its end is nearer to the surface than both
 * ends of the scalpel.
 */
#ifndef INCISE_INSTRUMENT_H
#define INCISE_INSTRUMENT_H

#include <stdbool.h>
#include <incise/export.h>
#include <incise/tool.h>

struct incise_instrument {
	/* In the scalpel's frame. */
	double axis[3]; /* from the tip to the handle's end */
	double side[3]; /* normal of the blade's, and the handle's, flat side */
	double handle_mm;
	enum incise_tool wanted; /* INCISE_TOOL_AUTO: by its turn */
	enum incise_tool held;	 /* never AUTO */
	bool tube_nearer;	 /* of a tube with a station; else false */
};

/*
 * Choose what is held, by the attitude (unit quaternion) of the scalpel over a surface
 * with this outward normal. An instrument in the tissue is not changed. Returns whether
 * it is another than before.
 */
bool incise_instrument_choose(struct incise_instrument *instrument,
			      const double attitude[4], const double normal[3],
			      bool touching) INCISE_REALTIME;

/* Whether another one is wanted than the held one, without a look at the scalpel's turn. */
bool incise_instrument_waits(const struct incise_instrument *instrument) INCISE_REALTIME;

/* Where the end of the held one is, mm. */
void incise_instrument_end(const struct incise_instrument *instrument,
			   const double tip_mm[3], const double attitude[4],
			   double end_mm[3]) INCISE_REALTIME;

#endif
