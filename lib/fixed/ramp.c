// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * A ramp: each tick the fastest velocity from which it can still stop in time. Within a tick
 * the velocity is constant, from one to the next it changes by a at most, so a stop from v
 * goes v, v-a, v-2a, … and the tick at v and all behind it cover exactly
 *
 *   S(v) = Σ (v - i·a), i = 0…n  =  (n+1)(2v - n·a)/2,  n = ⌊v/a⌋
 *
 *   v ┤▇
 *     │▇▇▇       S(v) rises with v and is linear between multiples of a, so the fastest v
 *     │▇▇▇▇▇     with S(v) ≤ way is ⌊(way + a·n(n+1)/2)/(n+1)⌋ with the largest n that has
 *     │▇▇▇▇▇▇▇   a·n(n+1)/2 ≤ way: no root, and one division, in braking only. What
 *   0 ┼───────▶  rounding leaves over, at most n, a later tick takes: it ends on the target
 *      ticks     to the last bit.
 *
 * n moves by 1 per tick at most and is kept, not computed. No motion within the limits is at
 * rest on the target in fewer ticks: the test tries all small ones.
 *
 * Nothing overflows. Positions lie within ±10⁹·2^32 < 2^62, ways between them within
 * W = 2·10⁹·2^32 < 2^63; velocities are at most 400·2^32 < 2^41, accelerations 2^46. It can
 * always stop within the limits: S(v - a) ≤ W. The fastest that a tick may ask for is v + a,
 * with S(v + a) = S(v - a) + 2v + a < W + 2^43; where a is beyond all velocities, S is just
 * the velocity. So the largest number here, 2·S, stays below 2^64 - 2^60. It has no sign.
 */
#include "integers.h"
#include "ramp.h"

/* 2·S(v); n = ⌊v/a⌋. */
static uint64_t twice_stop(uint64_t v, uint64_t a, uint64_t n)
{
	return (n + 1) * (2 * v - n * a);
}

/* ⌊v/a⌋, not above n. */
static uint64_t down_to(uint64_t v, uint64_t a, uint64_t n)
{
	while (n * a > v)
		n--;
	return n;
}

/* The fastest v with S(v) ≤ way; ⌊v/a⌋ is not above n. */
static uint64_t fastest(uint64_t way, uint64_t a, uint64_t n)
{
	while (n * a * (n + 1) / 2 > way)
		n--;
	return div64_u64(way + n * a * (n + 1) / 2, n + 1);
}

void incise_ramp_stand(struct incise_ramp *ramp, int64_t position)
{
	ramp->position = position;
	ramp->target = position;
	ramp->velocity = 0;
	ramp->brake = 0;
}

void incise_ramp_tick(struct incise_ramp *ramp)
{
	bool down = ramp->target < ramp->position;
	uint64_t way = (uint64_t)(down ? ramp->position - ramp->target
				       : ramp->target - ramp->position);
	/* Towards the target is up, from here on. */
	int64_t now = down ? -ramp->velocity : ramp->velocity;
	int64_t a = (int64_t)ramp->acceleration, low = now - a, v = now + a;
	uint64_t speed, n;

	if (v > (int64_t)ramp->top)
		v = low > (int64_t)ramp->top ? low : (int64_t)ramp->top;
	if (v > 0) {
		n = down_to((uint64_t)v, ramp->acceleration, ramp->brake + 1);
		if (twice_stop((uint64_t)v, ramp->acceleration, n) / 2 > way) {
			/*
			 * At rest too late even when it brakes now: then it passes the
			 * target, and comes back.
			 */
			if (low > 0 && twice_stop((uint64_t)low, ramp->acceleration,
						  ramp->brake - 1) /
						       2 >
					       way)
				v = low;
			else
				v = (int64_t)fastest(way, ramp->acceleration, n);
		}
	}
	speed = (uint64_t)(v < 0 ? -v : v);
	ramp->brake = down_to(speed, ramp->acceleration, ramp->brake + 1);
	ramp->velocity = down ? -v : v;
	ramp->position += ramp->velocity;
}

uint64_t incise_ramp_way(uint64_t velocity, uint64_t acceleration)
{
	uint64_t n = div64_u64(velocity, acceleration);

	if (velocity && n >= div64_u64(INCISE_RAMP_UNBOUNDED, 2 * velocity))
		return INCISE_RAMP_UNBOUNDED;
	return twice_stop(velocity, acceleration, n) / 2 - velocity;
}
