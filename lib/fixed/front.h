/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * The front of a cut in integers: what incise_front_force() does in double, see
 * lib/tissue/front.h for the law and its figure.
 *
 *   lengths Q16.16 mm    forces Q16.16 N    stiffness Q16.16 N/mm    work Q31.32 N mm
 *
 * 64-bit integers only: builds in a kernel, for 32 bits too.
 */
#ifndef INCISE_FIXED_FRONT_H
#define INCISE_FIXED_FRONT_H

#include <incise/export.h>
#include "integers.h"

/* Begins with {0}; any numbers are safe here. */
struct incise_fixed_front {
	int32_t depth, force; /* of the last call */
	int32_t rest, cut;
	int64_t work2, most2; /* twice the work put in, held to ±2^62; the most so far */
};

/*
 * The force on the blade, -friction × cutting … cutting, Q16.16 N.
 *
 * @param unloading  Q16.16 N/mm; below 1 counts as 1
 * @param friction   Q16.16, 0 … 1; outside counts as the nearest inside
 * @param depth      Q16.16 mm; below 0 counts as 0
 * @param advance    Q16.16 mm; below 0 counts as 0
 * @param cutting    Q16.16 N; below 0 counts as 0
 * Real-time safe.
 */
int32_t incise_fixed_front_force(struct incise_fixed_front *front, int32_t unloading,
				 int32_t friction, int32_t depth, int32_t advance,
				 int32_t cutting) INCISE_REALTIME;

#ifndef __KERNEL__
/*
 * Largest difference from incise_front_force() on the same motion, N, where each cutting force
 * differs by no more than @cutting_bound_N and none is above @most_N, while no advance is
 * short of work. A stop passes on the error of its bounds and of its input, and rest and cut
 * are set by one division each, so that nothing adds up:
 *
 *   cutting force    its bound, and friction × it at each of upper, least, cut and rest
 *   lengths          depth, rest, cut: 1/2 LSB and the division's, × K
 *   forces           1/2 LSB per product; the friction's share is 1/2 LSB off
 *   K                1/2 LSB × the elastic way, (1 + friction) × most_N / K
 */
double incise_fixed_front_bound(double unloading_N_mm, double friction, double most_N,
				double cutting_bound_N);
#endif

#endif
