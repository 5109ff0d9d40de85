/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How membership functions may move while they learn, on inputs scaled to [0, 1]. A step
 * is in coordinates where all premises are alike: widths and slopes by their logarithm, so
 * that they stay positive, and centres in units of the even spacing.
 */
#ifndef INCISE_PREMISES_H
#define INCISE_PREMISES_H

#include <stdint.h>
#include "basis.h"

/* ∂p/∂step of each premise. */
void incise_premises_scale(const struct incise_basis *basis, double *scale);

/* Take a step and bring the functions back into their bounds. */
void incise_premises_step(struct incise_basis *basis, const double *step);

/*
 * The bounds: centres in order within the range, a quarter of the even spacing apart at
 * least; a function still 0.1 half-way to its neighbours and at the end of the range next
 * to it; no wider than four times the even grid's; slopes of bells from 1 to 8.
 */
void incise_premises_project(struct incise_basis *basis);

/* Another start, by seed: centres by up to 0.3 spacings, widths by up to a third. */
void incise_premises_jitter(struct incise_basis *basis, uint64_t seed);

#endif
