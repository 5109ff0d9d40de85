/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The incision: all cuts of a blade in the tissue, with their depth and opening. It is a
 * function of the ticks alone, so that forces, image and assessment of a session agree: each
 * has its own incision with the same ticks.
 *
 *                    side
 *                     ▲            cut 0
 *        from ════════╪════════════════════▶ to      along
 *                     at    ║
 *                           ║ cut 1, joined: one incision
 *
 *     skin ───╮   ╭───────      open_mm: remaining distance of the lips
 *             │   │
 *             ╰───╯             depth_mm: of the blade's tip
 *
 * A blade deeper than cut_from_mm cuts. A cut is a straight line in the surface. A blade that
 * returns to the line (within INCISE_CUT_BESIDE_MM, and 30° in direction) lengthens and
 * deepens it. Where the blade leaves the line, another cut begins. Cuts that meet are one
 * incision.
 *
 * A tool goes into the cut that lets it in the deepest, among the cuts as near as the nearest:
 * down to the depth of which a stretch round its place, without a gap, is as long as it needs.
 * The stretch goes on where the cut ends and another, joined one goes on within 45° of its
 * direction. A cut across, or a stab, lends neither length nor depth.
 *
 * A handle or tube in a cut opens it as wide as the cut is deep there, up to the tool's extent
 * across the cut. stretch_mm of the opening is elastic; the rest remains.
 *
 * mm, in the tracker's frame.
 */
#ifndef INCISE_INCISION_H
#define INCISE_INCISION_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/plan.h>
#include <incise/scene.h>

INCISE_BEGIN_DECLS

/**
 * A blade farther than this from the line of a cut does not return to it: half the width of a
 * blade.
 */
#define INCISE_CUT_BESIDE_MM 1.0

/** Distance along a cut of the places with a depth and an opening. */
#define INCISE_CUT_SPACING_MM 0.5

/** Number of places: 32 mm to both sides of the start of the cut. */
#define INCISE_CUT_PLACES 128

/** A cut. */
struct incise_cut {
	double at_mm[3];       /**< its start, on the surface */
	double along[3];       /**< unit, in the surface */
	double side[3];	       /**< unit, in the surface, across */
	double normal[3];      /**< unit, out of the tissue */
	double from_mm, to_mm; /**< ends along the cut; ≤ 0 and ≥ 0 */
	int incision;	       /**< lowest number of the cuts that it is joined with */
	struct {
		float depth_mm;
		float open_mm;	    /**< remaining opening */
	} place[INCISE_CUT_PLACES]; /**< see incise_cut_place() */
};

/** The opening for a handle or tube in an incision. */
struct incise_opening {
	/** in a cut that is long enough for it; otherwise the rest is 0 */
	bool in;
	int cut;      /**< number of the cut */
	double at_mm; /**< position along the cut */
	double depth_mm; /**< a stretch of the cut here, long enough for the tool, is so deep */
	double open_mm;	  /**< remaining opening here */
	double length_mm; /**< of the stretch; ≥ the tool's need */
	double along[3];  /**< direction of the cut */
};

struct incise_incision;

/**
 * Make an incision without cuts, for a scene's tissue and tools.
 *
 * @return incision, to be freed with incise_incision_free(); NULL with errno ENOMEM
 */
INCISE_API struct incise_incision *incise_incision_new(const struct incise_scene *scene,
						       struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_incision_free(struct incise_incision *incision);

/**
 * Add a tick, each once and in order. A tick with fields that are not finite cuts nothing.
 *
 * @return false if the blade leaves no cut because there are tissue.cuts_most cuts. Real-time
 *         safe.
 */
INCISE_API bool incise_incision_tick(struct incise_incision *incision,
				     const struct incise_tick *tick) INCISE_REALTIME;

/** Number of cuts. Real-time safe, like the functions below. */
INCISE_API int incise_incision_cuts(const struct incise_incision *incision)
	INCISE_REALTIME;

/**
 * A cut. @param i 0 … cuts - 1. @return cut, valid until the incision is freed; NULL: no such
 * cut
 */
INCISE_API const struct incise_cut *incise_incision_cut(
	const struct incise_incision *incision, int i) INCISE_REALTIME;

/** Index of the place at a position along a cut; clamped to its ends. */
INCISE_API int incise_cut_place(double at_mm) INCISE_REALTIME;

/**
 * Find the opening for a tool whose end is at a point of the surface.
 *
 * @param tool INCISE_TOOL_HANDLE or INCISE_TOOL_TUBE
 */
INCISE_API void incise_incision_opening(const struct incise_incision *incision,
					enum incise_tool tool, const double at_mm[3],
					struct incise_opening *opening) INCISE_REALTIME;

INCISE_END_DECLS
#endif
