/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The incision: all cuts that a blade left in the tissue, with their depth and opening. It is a
 * function of the ticks alone, so that the loop's forces, the image and the assessment of a
 * session agree: each feeds its own with the same ticks.
 *
 *                    side
 *                     ▲            cut 0
 *        from ════════╪════════════════════▶ to      along
 *                     at    ║
 *                           ║ cut 1, joined: one incision
 *
 *     skin ───╮   ╭───────      open_mm: distance of the lips that stays
 *             │   │
 *             ╰───╯             depth_mm: of the blade's tip
 *
 * The blade cuts where it is deeper than cut_from_mm. A cut is a straight line in the surface. It
 * is lengthened and deepened by the blade that returns to its line (within INCISE_CUT_BESIDE_MM, and
 * 30° in direction). Where the blade leaves the line, another one goes on from there. Cuts that
 * meet are one incision.
 *
 * A handle or tube in a cut opens it as wide as it is deep there, up to its own extent across
 * the cut. stretch_mm of that is elastic; the rest stays.
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

/** A blade so far from the line of a cut does not return to it: half the width of a blade. */
#define INCISE_CUT_BESIDE_MM 1.0

/** Depth and opening are kept at places so far apart along a cut. */
#define INCISE_CUT_SPACING_MM 0.5

/** Their number: 32 mm to both sides of where the cut began. */
#define INCISE_CUT_PLACES 128

/** A cut. */
struct incise_cut {
	double at_mm[3];       /**< where it began, on the surface */
	double along[3];       /**< unit, in the surface */
	double side[3];	       /**< unit, in the surface, across */
	double normal[3];      /**< unit, out of the tissue */
	double from_mm, to_mm; /**< ends, along; at most 0, and at least 0 */
	int incision;	       /**< lowest number of the cuts that it is joined with */
	struct {
		float depth_mm;
		float open_mm;	    /**< that stays */
	} place[INCISE_CUT_PLACES]; /**< see incise_cut_place() */
};

/** The place of a handle or tube in an incision. */
struct incise_opening {
	bool in;	 /**< in a cut, which is long enough for it; else the rest is 0 */
	int cut;	 /**< its number */
	double at_mm;	 /**< along it */
	double depth_mm; /**< of the cut here */
	double open_mm;	 /**< that stays here */
	double length_mm; /**< of all cuts of the incision */
	double along[3];  /**< of the cut */
};

struct incise_incision;

/**
 * An incision without cuts, for a scene's tissue and tools.
 *
 * @return incision, to be freed with incise_incision_free(); NULL with errno ENOMEM
 */
INCISE_API struct incise_incision *incise_incision_new(const struct incise_scene *scene,
						       struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_incision_free(struct incise_incision *incision);

/**
 * Add a tick, each once and in order. Fields that are not finite cut nothing.
 *
 * @return false: the blade would cut, but tissue.cuts_most are there: it leaves no cut. Real-time
 *         safe.
 */
INCISE_API bool incise_incision_tick(struct incise_incision *incision,
				     const struct incise_tick *tick) INCISE_REALTIME;

/** Number of cuts. Real-time safe, as what follows. */
INCISE_API int incise_incision_cuts(const struct incise_incision *incision)
	INCISE_REALTIME;

/** A cut. @param i 0 … cuts - 1. @return valid until the incision is freed; NULL: not there */
INCISE_API const struct incise_cut *incise_incision_cut(
	const struct incise_incision *incision, int i) INCISE_REALTIME;

/** The place of a cut that is so far along it; those beyond its ends give the last one. */
INCISE_API int incise_cut_place(double at_mm) INCISE_REALTIME;

/**
 * The opening for a tool whose end is at a place of the surface now.
 *
 * @param tool INCISE_TOOL_HANDLE or INCISE_TOOL_TUBE
 */
INCISE_API void incise_incision_opening(const struct incise_incision *incision,
					enum incise_tool tool, const double at_mm[3],
					struct incise_opening *opening) INCISE_REALTIME;

/** Length of all cuts of an incision, by its number; mm. */
INCISE_API double incise_incision_length_mm(const struct incise_incision *incision,
					    int number) INCISE_REALTIME;

INCISE_END_DECLS
#endif
