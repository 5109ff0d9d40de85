// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The front of a cut in integers; see front.h. The steps stay within 63 bits:
 *
 *   2 × work           2^32 · 2^30 = 2^62, and is held to ±2^62
 *   K × length         2^31 · 2^31 = 2^62, then Q16 and held to 31 bits
 *   force / K          (2^31 << 16) / K, held to 31 bits
 *   2 K × work         2^31 · 2^31, twice the work held to Q16: 16 J
 */
#include "arithmetic.h"
#include "front.h"

#define ONE (1 << 16)
#define WAY_MAX (1 << 30) /* 16384 mm in a tick */
#define WORK_MAX ((int64_t)1 << 62)

static int32_t held(int64_t v, int32_t least, int32_t most)
{
	return (int32_t)incise_fx_within(v, least, most);
}

static int32_t at_most(int32_t a, int32_t b)
{
	return a < b ? a : b;
}

static int32_t at_least(int32_t a, int32_t b)
{
	return a > b ? a : b;
}

/* The force whose elastic energy, F²/2K, is the work put in but for a sixteenth of the most. */
static int32_t paid(int32_t unloading, int64_t work2, int64_t most_work2)
{
	int64_t most2 = (work2 >> 16) - (most_work2 >> 20);

	if (most2 <= 0)
		return 0;
	if (most2 > INT32_MAX)
		most2 = INT32_MAX;
	return held(incise_fx_root((uint64_t)unloading * (uint64_t)most2), 0, INT32_MAX);
}

/* Twice the work; neither is beyond 2^62, so that the sum fits. */
static int64_t worked(int64_t work2, int64_t more2)
{
	work2 += more2;
	return work2 > WORK_MAX ? WORK_MAX : work2 < -WORK_MAX ? -WORK_MAX : work2;
}

int32_t incise_fixed_front_force(struct incise_fixed_front *front, int32_t unloading,
				 int32_t friction, int32_t depth, int32_t advance,
				 int32_t cutting)
{
	int32_t K = at_least(unloading, 1), rubs, upper, elastic, trial, force;
	int64_t way;

	depth = at_least(depth, 0);
	advance = at_least(advance, 0);
	cutting = at_least(cutting, 0);
	rubs = incise_fx_times(held(friction, 0, ONE), cutting);
	way = held((int64_t)depth - front->depth, -WAY_MAX, WAY_MAX);
	front->cut = held((int64_t)front->cut - advance, 0, INT32_MAX);
	elastic = incise_fx_times(K, (int64_t)depth - front->rest);
	front->rest = held((int64_t)front->rest - advance, -INT32_MAX, INT32_MAX);
	trial = force = incise_fx_times(K, (int64_t)depth - front->rest);
	if (advance > 0) {
		int64_t work2 =
			worked(front->work2, ((int64_t)front->force + elastic) * way);

		force = at_least(elastic, at_most(trial, paid(K, work2, front->most2)));
	}
	upper = at_least(rubs, incise_fx_times(K, (int64_t)depth - front->cut));
	force = at_least(-rubs, at_most(force, at_most(upper, cutting)));
	/* Else it stays, and no rounding adds up. */
	if (force != trial)
		front->rest =
			held(depth - incise_fx_quotient(force, K), -INT32_MAX, INT32_MAX);
	if (force >= cutting)
		front->cut =
			at_least(front->cut, held(depth - incise_fx_quotient(cutting, K),
						  0, INT32_MAX));
	front->work2 = worked(front->work2, ((int64_t)front->force + force) * way);
	if (front->work2 > front->most2)
		front->most2 = front->work2;
	front->depth = depth;
	front->force = force;
	return force;
}
