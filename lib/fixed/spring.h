/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * A spring along a direction, in integers. It holds the blade in the plane of its cut, and
 * stands for tissue where no model is trained. Both forces of Bhasin et al. (2005), §2.2 (plane
 * constraint Fx along Sx0, reaction Fn along Sn), are this one formula:
 *
 *        ○ P   tip               F = -K [(P - P0)·u] u
 *      ╱ ┊
 *    ╱   ┊ (P - P0)·u            u = Sx0, the blade's side: pulls both ways
 *  ×─────┴───▶ u                 u = Sn, out of the tissue: pushes only
 *  P0  anchor
 *
 *   positions   Q16.16 mm        direction   Q2.30
 *   force       Q16.16 N         stiffness   Q16.16 N/mm
 *
 * 64-bit integers only, no division: builds in a kernel, for 32 bits too.
 */
#ifndef INCISE_FIXED_SPRING_H
#define INCISE_FIXED_SPRING_H

#include <incise/export.h>
#include "vector.h"

/* Any numbers are safe here; only a direction of length 1 is a spring. */
struct incise_fixed_spring {
	int32_t stiffness;    /* Q16.16 N/mm; below 0 counts as 0 */
	int32_t anchor[3];    /* P0, Q16.16 mm */
	int32_t direction[3]; /* u, Q2.30 */
};

/*
 * Add the force of a spring that pulls back to its anchor from both sides: the plane
 * constraint.
 *
 * Each component of P - P0 is held to ±16384 mm, the force to ±32768 N along u, and the
 * sum in @force to ±INT32_MAX in each component: nothing ever wraps. Rounding is to the
 * nearest and the same on both sides of the anchor.
 *
 * @param p     tip, Q16.16 mm
 * @param force where it is added, Q16.16 N
 * @return (P - P0)·u, Q16.16 mm, held to ±INT32_MAX. Real-time safe; builds in a kernel.
 */
int32_t incise_fixed_spring_pull(const struct incise_fixed_spring *spring,
				 const int32_t p[3], int32_t force[3]) INCISE_REALTIME;

/*
 * The same for a spring that pushes only, as tissue does: the reaction. There is no force
 * where (P - P0)·u ≥ 0.
 */
int32_t incise_fixed_spring_push(const struct incise_fixed_spring *spring,
				 const int32_t p[3], int32_t force[3]) INCISE_REALTIME;

#endif
