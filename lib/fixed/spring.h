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

#ifndef __KERNEL__
/*
 * Take a spring's numbers from double, each rounded to the nearest.
 *
 * @param stiffness_N_mm 0 … 32767
 * @param anchor_mm      within ±32767
 * @param direction      unit vector, within 1e-6; made one in full
 * @return 0; -EINVAL (not finite, a stiffness below 0, not a unit vector), -ERANGE (more
 *         than the format holds). @spring is left as it was then.
 */
int incise_fixed_spring_set(struct incise_fixed_spring *spring, double stiffness_N_mm,
			    const double anchor_mm[3],
			    const double direction[3]) INCISE_REALTIME;

/*
 * The certified error of either force: the length of its difference, as a vector, from
 * the formula in real numbers, hence of each component too. It holds for every P with
 * |P - P0| ≤ @reach_mm, every P0 and u that incise_fixed_spring_set() takes (u made a
 * unit vector in full), and covers the rounding of P (to the nearest LSB), of P0, u and
 * K, and of all steps, as long as the sum in force[] is not held.
 *
 * @return bound, N; HUGE_VAL where the spring may be held (more than 32767 N, or reach
 *         beyond 16383 mm), or for what is no number.
 */
double incise_fixed_spring_bound(double stiffness_N_mm, double reach_mm);
#endif

#endif
