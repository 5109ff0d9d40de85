/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Tests use lib/fixed/spring.c in floating point by these: take a spring from double, and bound the
 * error of its force.
 */
#ifndef INCISE_TEST_FIXED_SPRING_H
#define INCISE_TEST_FIXED_SPRING_H

#include <errno.h>
#include <math.h>
#include <incise/fixed.h>
#include "../../lib/fixed/spring.h"
#include "../../lib/base/vector.h"

/* Q16.16 ends a little above. */
#define LARGEST 32767.0

/* P - P0 is held at 16384. */
#define REACH_MAX 16383.0

/* Tolerance of a direction's length 1. */
#define SPRING_UNIT_MM 1e-6

/*
 * Take a spring's numbers from double, each rounded to the nearest.
 *
 * @param stiffness_N_mm 0 … 32767
 * @param anchor_mm      within ±32767
 * @param direction      unit vector, within 1e-6; made one in full
 * @return 0; -EINVAL (not finite, a stiffness below 0, not a unit vector), -ERANGE (more
 *         than the format holds). @spring is left as it was then.
 */
static inline int incise_fixed_spring_set(struct incise_fixed_spring *spring,
					  double stiffness_N_mm,
					  const double anchor_mm[3],
					  const double direction[3])
{
	struct incise_fixed_spring set;
	double length = v3_length(direction);

	if (!isfinite(stiffness_N_mm) || stiffness_N_mm < 0 || !v3_finite(anchor_mm) ||
	    !(fabs(length - 1) <= SPRING_UNIT_MM))
		return -EINVAL;
	if (stiffness_N_mm > LARGEST)
		return -ERANGE;
	set.stiffness = (int32_t)lrint(stiffness_N_mm * INCISE_FIXED_ONE);
	for (int i = 0; i < 3; i++) {
		if (fabs(anchor_mm[i]) > LARGEST)
			return -ERANGE;
		set.anchor[i] = (int32_t)lrint(anchor_mm[i] * INCISE_FIXED_ONE);
		set.direction[i] =
			(int32_t)lrint(direction[i] / length * INCISE_FIXED_UNIT);
	}
	*spring = set;
	return 0;
}

/*
 * With h = 2^-17, half an LSB of Q16.16, and m = 2^-31, half an LSB of Q2.30, and numbers
 * with a hat those of the integers:
 *
 *   d = P - P0       d^ is off by 2h in each component: P's rounding and P0's
 *   u                u^ is off by m in each component, √3 m in length
 *   K                K^ is off by h
 *
 *   x = d·u          x^ - x = (d^ - d)·u^ + d·(u^ - u) + rounding
 *                    Σ|u^| ≤ √3 + 3m, |d| ≤ reach:
 *     stretch        ≤ 2h(√3 + 3m) + reach √3 m + h
 *
 *   f = Kx           f^ - f = K(x^ - x) + (K^ - K)x^ + rounding
 *     force          ≤ K stretch + h(reach + stretch) + h
 *
 *   F = fu           F^ - F = (f^ - f)u^ + f(u^ - u) + rounding, in length
 *                    ≤ force (1 + √3 m) + K reach √3 m + √3 h
 *
 * Pushing only, x is min(x, 0) and x^ is min(x^, 0): they are no farther apart than
 * before, so that the same holds.
 */
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
static inline double incise_fixed_spring_bound(double stiffness_N_mm, double reach_mm)
{
	const double h = 0x1p-17, m = 0x1p-31;
	double stretch, force, bound;

	if (!(stiffness_N_mm >= 0 && stiffness_N_mm <= LARGEST && reach_mm >= 0 &&
	      reach_mm <= REACH_MAX))
		return HUGE_VAL;
	stretch = 2 * h * (sqrt(3) + 3 * m) + reach_mm * sqrt(3) * m + h;
	force = stiffness_N_mm * stretch + h * (reach_mm + stretch) + h;
	bound = force * (1 + sqrt(3) * m) + stiffness_N_mm * reach_mm * sqrt(3) * m +
		sqrt(3) * h;
	if (stiffness_N_mm * reach_mm + bound > LARGEST)
		return HUGE_VAL;
	/* Double rounds too: here, in making u a unit vector, and in scaling by it. */
	return bound * (1 + 1e-9) + stiffness_N_mm * reach_mm * 0x1p-48;
}

#endif
