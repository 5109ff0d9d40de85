// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Limits of force and slew; see limit.h.
 */
#include <math.h>
#include "limit.h"

double incise_limit_apply(struct incise_limit *limit, double force_N, bool *held)
{
	double wanted = isfinite(force_N) ? force_N : 0;
	double may = fmax(-limit->force_N, fmin(limit->force_N, wanted));

	may = fmax(limit->last_N - limit->slew_N,
		   fmin(limit->last_N + limit->slew_N, may));
	*held = may != force_N;
	limit->last_N = may;
	return may;
}

void incise_limit_zero(struct incise_limit *limit)
{
	limit->last_N = 0;
}
