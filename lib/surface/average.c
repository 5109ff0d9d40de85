// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The averaged normal; see average.h. A ring of the last n and their running sum. Rounding
 * would pile up in it, so after each turn of the ring it is replaced by the sum of that
 * turn alone, which was added up on the way.
 */
#include "../base/vector.h"
#include "average.h"

/* A sum this short is nothing but rounding: 3 · 64 additions below 64, each 7e-15. */
#define VANISHED 1e-9

void incise_average_init(struct incise_average *a, int n)
{
	*a = (struct incise_average){.n = n < 1			   ? 1
					  : n > INCISE_AVERAGE_MAX ? INCISE_AVERAGE_MAX
								   : n};
}

void incise_average_reset(struct incise_average *a)
{
	incise_average_init(a, a->n);
}

static void take(struct incise_average *a, const double normal[3])
{
	double *place = a->ring[a->at];

	if (a->count == a->n)
		v3_add(a->sum, a->sum, -1, place);
	else
		a->count++;
	v3_copy(place, normal);
	v3_add(a->sum, a->sum, 1, normal);
	v3_add(a->turn, a->turn, 1, normal);
	if (++a->at == a->n) {
		v3_copy(a->sum, a->turn);
		v3_copy(a->turn, (const double[3]){0, 0, 0});
		a->at = 0;
	}
}

void incise_average_add(struct incise_average *a, const double normal[3],
			double averaged[3])
{
	double length = v3_length(normal);

	/* A square that overflows is too long as well, and NaN is neither. */
	if (length > 0.5 && length < 2) {
		take(a, normal);
		if (a->n == 1)
			v3_copy(a->last, normal);
		else
			v3_unit(a->last, a->sum, VANISHED);
	}
	v3_copy(averaged, a->last);
}
