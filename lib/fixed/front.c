// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * The front of a cut in integers; see front.h. The steps stay within 63 bits:
 *
 *   2 × work           2^32 · 2^30 = 2^62, and is held to ±2^62
 *   K × length         2^31 · 2^31 = 2^62, then Q16 and held to 31 bits
 *   force / K          (2^31 << 16) / K, held to 31 bits
 *   2 K × work         2^31 · 2^31, twice the work held to Q16: 16 J
 */
#include "front.h"

#define ONE (1 << 16)
#define WAY_MAX (1 << 30) /* 16384 mm in a tick */
#define WORK_MAX ((int64_t)1 << 62)

static int32_t hold(int64_t v, int32_t least, int32_t most)
{
	return v > most ? most : v < least ? least : (int32_t)v;
}

static int32_t at_most(int32_t a, int32_t b)
{
	return a < b ? a : b;
}

static int32_t at_least(int32_t a, int32_t b)
{
	return a > b ? a : b;
}

/* a × b in Q16.16 to the nearest, halves away from 0. */
static int32_t times(int32_t a, int64_t b)
{
	int64_t product = a * (int64_t)hold(b, -INT32_MAX, INT32_MAX);
	int64_t size = (product < 0 ? -product : product) + ONE / 2;

	return hold(product < 0 ? -(size >> 16) : size >> 16, -INT32_MAX, INT32_MAX);
}

/* a / b in Q16.16 to the nearest; b ≥ 1. */
static int64_t quotient(int32_t a, int32_t b)
{
	int64_t size = (int64_t)(a < 0 ? -(int64_t)a : a) << 16;

	size = div64_s64(size + b / 2, b);
	return a < 0 ? -size : size;
}

static uint32_t root(uint64_t v)
{
	uint64_t bit = (uint64_t)1 << 62, result = 0;

	for (; bit; bit >>= 2) {
		if (v >= result + bit) {
			v -= result + bit;
			result = (result >> 1) + bit;
		} else {
			result >>= 1;
		}
	}
	return (uint32_t)result;
}

/* The force whose elastic energy, F²/2K, is the work put in but for a sixteenth of the most. */
static int32_t paid(int32_t unloading, int64_t work2, int64_t most_work2)
{
	int64_t most2 = (work2 >> 16) - (most_work2 >> 20);

	if (most2 <= 0)
		return 0;
	if (most2 > INT32_MAX)
		most2 = INT32_MAX;
	return hold(root((uint64_t)unloading * (uint64_t)most2), 0, INT32_MAX);
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
	rubs = times(hold(friction, 0, ONE), cutting);
	way = hold((int64_t)depth - front->depth, -WAY_MAX, WAY_MAX);
	front->cut = hold((int64_t)front->cut - advance, 0, INT32_MAX);
	elastic = times(K, (int64_t)depth - front->rest);
	front->rest = hold((int64_t)front->rest - advance, -INT32_MAX, INT32_MAX);
	trial = force = times(K, (int64_t)depth - front->rest);
	if (advance > 0) {
		int64_t work2 =
			worked(front->work2, ((int64_t)front->force + elastic) * way);

		force = at_least(elastic, at_most(trial, paid(K, work2, front->most2)));
	}
	upper = at_least(rubs, times(K, (int64_t)depth - front->cut));
	force = at_least(-rubs, at_most(force, at_most(upper, cutting)));
	/* Else it stays, and no rounding adds up. */
	if (force != trial)
		front->rest = hold(depth - quotient(force, K), -INT32_MAX, INT32_MAX);
	if (force >= cutting)
		front->cut = at_least(front->cut,
				      hold(depth - quotient(cutting, K), 0, INT32_MAX));
	front->work2 = worked(front->work2, ((int64_t)front->force + force) * way);
	if (front->work2 > front->most2)
		front->most2 = front->work2;
	front->depth = depth;
	front->force = force;
	return force;
}
