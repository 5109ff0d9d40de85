/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The tool in the hand, and the phases of its contact with the tissue.
 *
 *     free ──▶ cutting    with the blade
 *      ▲  ╲
 *      │    ▶ insertion   with the handle, which enlarges the cut, or a tube
 *      └──── out of the tissue by more than tissue.leave_mm
 */
#ifndef INCISE_TOOL_H
#define INCISE_TOOL_H

/** The tool in the hand. */
enum incise_tool {
	/**
	 * Blade or handle, the lower end of the scalpel; or the tube, if it has a station of
	 * the tracker and is nearer to the tissue than both.
	 */
	INCISE_TOOL_AUTO,
	INCISE_TOOL_BLADE,
	INCISE_TOOL_HANDLE, /**< the scalpel's other end */
	INCISE_TOOL_TUBE,   /**< round; its end is its own station, else the tip */
};

/** Phases of a procedure; Bhasin et al. (2005), §2.2 and §2.3. */
enum incise_phase {
	INCISE_PHASE_FREE,
	INCISE_PHASE_CUTTING,
	INCISE_PHASE_INSERTION,
};

/** Phases of a cut that can have a model each; incise-scene(5) says when each begins. */
enum incise_cutting_phase {
	INCISE_CUT,
	INCISE_PUNCTURE,
	INCISE_WITHDRAW,
};
#define INCISE_CUTTING_PHASES 3 /**< number of them */

#endif
