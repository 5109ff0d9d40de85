// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The ramp against trying everything: each tick the fastest velocity from which a stop, done
 * tick by tick, ends in time; and against the fewest ticks that any motion needs. Small
 * numbers are tried in full, the largest that exist by chance, in 128 bits.
 */
#include "../unit.h"
#include "../../../lib/fixed/ramp.h"
#include "../model/paper_model.h"

typedef __int128 wide;

/* Where a stop ends that starts with a tick at v, by doing it. */
static int stop_of(int p, int v, int a)
{
	for (;;) {
		p += v;
		if (abs(v) <= a)
			return p;
		v -= v > 0 ? a : -a;
	}
}

/* The velocity of the next tick, found by trying all from the fastest down. */
static int tried(int p, int now, int target, int a, int top)
{
	int s = target < p ? -1 : 1, low = s * now - a, v = s * now + a;

	if (v > top)
		v = low > top ? low : top;
	for (; v > low; v--)
		if (v <= 0 || s * stop_of(p, s * v, a) <= s * target)
			break;
	return s * v;
}

static struct incise_ramp ramp_at(int64_t p, int64_t v, int64_t target, uint64_t a,
				  uint64_t top)
{
	struct incise_ramp ramp = {.acceleration = a};

	incise_ramp_stand(&ramp, p);
	ramp.velocity = v;
	ramp.brake = (uint64_t)llabs(v) / a;
	ramp.target = target;
	ramp.top = top;
	return ramp;
}

TEST(test_all_small)
{
	int n = 0;

	for (int a = 1; a <= 9; a++)
		for (int top = 0; top <= 20; top++)
			for (int v = -20; v <= 20; v++)
				for (int target = -130; target <= 130; target++, n++) {
					struct incise_ramp r =
						ramp_at(7, v, target, a, top);
					int right = tried(7, v, target, a, top);

					incise_ramp_tick(&r);
					if (r.velocity != right ||
					    r.position != 7 + right ||
					    r.brake != (uint64_t)(abs(right) / a))
						fail_msg("a %d, top %d, v %d, to %d: %d, "
							 "not %d",
							 a, top, v, target,
							 (int)r.velocity, right);
				}
	assert_true(n > 1000000);
}

/* Fewest ticks from every (p, v) to rest at 0, by relaxing until nothing changes. */
#define FAR 90
#define FAST 9
#define NEVER 1000
static int fewest[2 * FAR + 1][2 * FAST + 1];

static bool relax(int a, int top)
{
	bool changed = false;

	for (int p = -FAR; p <= FAR; p++)
		for (int v = -top; v <= top; v++)
			for (int u = v - a; u <= v + a; u++) {
				int best;

				if (abs(u) > top || abs(p + u) > FAR)
					continue;
				best = fewest[p + u + FAR][u + FAST] + 1;
				if (best < fewest[p + FAR][v + FAST]) {
					fewest[p + FAR][v + FAST] = best;
					changed = true;
				}
			}
	return changed;
}

static int ticks_of(int p, int v, int a, int top)
{
	struct incise_ramp ramp = ramp_at(p, v, 0, a, top);
	int ticks = 0;

	while ((ramp.position || ramp.velocity) && ticks < NEVER) {
		incise_ramp_tick(&ramp);
		ticks++;
	}
	return ticks;
}

/* At rest on the target as early as any motion within the limits can be, from anywhere. */
TEST(test_fewest_ticks)
{
	for (int a = 1; a <= 4; a++)
		for (int top = 1; top <= FAST; top++) {
			for (int p = -FAR; p <= FAR; p++)
				for (int v = -FAST; v <= FAST; v++)
					fewest[p + FAR][v + FAST] = p || v ? NEVER : 0;
			while (relax(a, top))
				;
			for (int p = -30; p <= 30; p++)
				for (int v = -top; v <= top; v++) {
					int took = ticks_of(p, v, a, top);
					int least = fewest[p + FAR][v + FAST];

					if (took != least)
						fail_msg(
							"a %d, top %d, from %d at %d: %d "
							"ticks, not %d",
							a, top, p, v, took, least);
				}
		}
}

/* S(v) in 128 bits. */
static wide stop_way(wide v, wide a)
{
	wide n = v / a;

	return (n + 1) * (2 * v - n * a) / 2;
}

/* The fastest v with S(v) ≤ way, by halving. */
static int64_t fastest(wide way, wide a, int64_t most)
{
	int64_t low = 0, high = most;

	while (low < high) {
		int64_t middle = low + (high - low + 1) / 2;

		if (stop_way(middle, a) <= way)
			low = middle;
		else
			high = middle - 1;
	}
	return low;
}

/* Evenly distributed in its logarithm, 1 … most. */
static uint64_t any_up_to(uint64_t most, uint64_t *seed)
{
	uint64_t v = (uint64_t)(int64_t)(0x1p62 * (paper_random(seed) + 1));
	int shift = (int)((paper_random(seed) + 1) * 32);

	v = (v >> shift % 63) % most + 1;
	return paper_random(seed) < -0.9 ? most : v;
}

#define CASES 300000
#define POSITION_MAX (1000000000 * ((int64_t)1 << 32))
#define TOP_MAX (400 * ((uint64_t)1 << 32))

/*
 * One tick from anywhere that a profile can be in: so near a limit of the longest travel, and
 * so fast, that it can just stop.
 */
TEST(test_largest)
{
	uint64_t seed = 3;
	int braked = 0, longest = 0;

	for (int n = 0; n < CASES; n++) {
		uint64_t top = any_up_to(TOP_MAX, &seed);
		uint64_t a = any_up_to(n % 16 ? 2 * top : 1ull << 46, &seed);
		int64_t now = (int64_t)any_up_to(top, &seed), high, low, right;
		wide brake = stop_way(now, a) - now, way, room;
		int s = n % 2 ? -1 : 1;
		struct incise_ramp ramp;

		/* Slower, until there is room to stop. */
		while (brake > 2 * (wide)POSITION_MAX) {
			now /= 2;
			brake = stop_way(now, a) - now;
		}
		room = 2 * (wide)POSITION_MAX - brake;
		way = brake + (wide)(any_up_to(1ull << 45, &seed) - 1);
		if (way > brake + room || paper_random(&seed) < -0.8)
			way = brake + room;
		ramp = ramp_at(s * (POSITION_MAX - (int64_t)way), s * now,
			       s * POSITION_MAX, a, top);
		incise_ramp_tick(&ramp);

		high = now + (int64_t)a > (int64_t)top ? (int64_t)top : now + (int64_t)a;
		low = now - (int64_t)a > 0 ? now - (int64_t)a : 0;
		right = fastest(way, a, high);
		if (s * ramp.velocity != right || right < low ||
		    ramp.brake != (uint64_t)right / a)
			fail_msg("case %d: %lld, not %lld", n, (long long)ramp.velocity,
				 (long long)right);
		braked += right < high;
		longest += way > (wide)POSITION_MAX;
	}
	/* Both sides of the decision, and the longest ways, were met. */
	assert_true(braked > CASES / 100 && braked < CASES - CASES / 100);
	assert_true(longest > CASES / 100);
}

TEST(test_way)
{
	uint64_t seed = 4;

	for (int v = 0; v < 200; v++)
		for (int a = 1; a < 50; a++)
			assert_int_equal(incise_ramp_way((uint64_t)v, (uint64_t)a),
					 stop_of(0, v, a) - v);
	for (int n = 0; n < CASES; n++) {
		uint64_t v = any_up_to(TOP_MAX, &seed), a = any_up_to(2 * v, &seed);
		uint64_t way = incise_ramp_way(v, a);
		wide right = stop_way(v, a) - v;

		if (way != INCISE_RAMP_UNBOUNDED)
			assert_true((wide)way == right);
		else
			assert_true(right >= (wide)1 << 62);
	}
}
