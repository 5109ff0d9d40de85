// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Arithmetic and vectors in integers compared with 128 bits and with long double, on random numbers
 * of all sizes and at the ends of their ranges.
 */
#include "../unit.h"
#include "../../../driver/kunit/trial.h"
#include "../../../lib/fixed/vector.h"

#define CASES 200000
#define UNIT 1073741824.0L

/* Of any size, one in eight at an end. */
static int64_t any(uint64_t *seed, int bits)
{
	uint64_t random = incise_fx_trial_next(seed);
	int64_t most = bits < 63 ? ((int64_t)1 << bits) - 1 : INT64_MAX;

	if (!(random & 7))
		return random & 8 ? most : -most;
	return (int64_t)incise_fx_trial_next(seed) >> (63 - bits) >>
	       (random >> 8) % (unsigned)bits;
}

TEST(test_rounding)
{
	uint64_t seed = 1;

	for (int k = 0; k < CASES; k++) {
		int shift = 1 + (int)(incise_fx_trial_next(&seed) % 60);
		int64_t v = any(&seed, 62), got = incise_fx_rounded(v, shift);
		int64_t mirrored = incise_fx_rounded(-v, shift);
		__int128 off = (__int128)got * ((__int128)1 << shift) - v;

		assert_true((off < 0 ? -off : off) <= (__int128)1 << (shift - 1));
		assert_int_equal(got, -mirrored);
	}
	assert_int_equal(incise_fx_rounded(3, 1), 2);
	assert_int_equal(incise_fx_rounded(-3, 1), -2);
}

TEST(test_products_and_quotients)
{
	uint64_t seed = 2;

	for (int k = 0; k < CASES; k++) {
		int32_t a = (int32_t)any(&seed, 31), b = (int32_t)any(&seed, 31);
		int64_t wide = any(&seed, 62);
		long double want = (long double)a * incise_fx_hold32(wide) / 65536;

		want = fmaxl(-INT32_MAX, fminl(INT32_MAX, want));
		/* To the nearest, and long double holds both sides. */
		assert_true(fabsl(incise_fx_times(a, wide) - want) <= 0.5L);
		b = b > 0 ? b : b < 0 ? -b : 1;
		assert_true(fabsl(incise_fx_quotient(a, b) -
				  (long double)a * 65536 / b) <= 0.5L + 1e-6L);
	}
	assert_int_equal(incise_fx_hold32(INT64_MIN), -INT32_MAX);
	assert_int_equal(incise_fx_times(INT32_MIN, INT64_MIN), INT32_MAX);
}

TEST(test_roots_and_lengths)
{
	uint64_t seed = 3;

	for (int k = 0; k < CASES; k++) {
		uint64_t v = incise_fx_trial_next(&seed) >> k % 64;
		__uint128_t root = incise_fx_root(v);
		int32_t a[3];
		long double want = 0;

		assert_true(root * root <= v && (root + 1) * (root + 1) > v);
		for (int i = 0; i < 3; i++) {
			a[i] = (int32_t)any(&seed, 31);
			want += (long double)a[i] * a[i];
		}
		assert_true(fabsl(incise_fx_length(a) - sqrtl(want)) <= 0.5L + 1e-9L);
	}
	assert_int_equal(incise_fx_root(UINT64_MAX), UINT32_MAX);
}

/* A unit vector is off by no more than an LSB in each component, whatever the size. */
TEST(test_units)
{
	uint64_t seed = 4;

	for (int k = 0; k < CASES; k++) {
		int n = 3 + (k & 1);
		int64_t a[4], least = any(&seed, 40);
		int32_t unit[4] = {7, 7, 7, 7};
		long double length = 0;

		for (int i = 0; i < n; i++) {
			a[i] = any(&seed, 61);
			length += (long double)a[i] * a[i];
		}
		length = sqrtl(length);
		if (!incise_fx_unit(unit, a, n, least < 0 ? 0 : least)) {
			assert_true(length <= (least < 0 ? 0 : least) + 1);
			assert_int_equal(unit[0], 7);
			continue;
		}
		assert_true(incise_fx_is_unit(unit, n));
		for (int i = 0; i < n; i++)
			/* Scaled to 2^29 at least, rounded there, and once more at the end. */
			assert_true(fabsl(unit[i] - a[i] / length * UNIT) <= 4);
	}
	assert_false(
		incise_fx_is_unit((const int32_t[3]){INCISE_FIXED_UNIT, 1 << 20, 0}, 3));
	assert_false(incise_fx_is_unit((const int32_t[3]){INT32_MIN, 0, 0}, 3));
}

static void any_unit(uint64_t *seed, int32_t *unit, int n)
{
	int64_t a[4];

	do {
		for (int i = 0; i < n; i++)
			a[i] = incise_fx_trial_number(seed);
	} while (!incise_fx_unit(unit, a, n, 1000));
}

TEST(test_turns_and_products)
{
	uint64_t seed = 5;

	for (int k = 0; k < CASES; k++) {
		int32_t u[3], v[3], q[4], cross[3], turned[3];
		long double dot = 0, w, t[3];

		any_unit(&seed, u, 3);
		any_unit(&seed, v, 3);
		any_unit(&seed, q, 4);
		incise_fx_cross(cross, u, v);
		incise_fx_rotate(turned, q, u);
		w = q[0] / UNIT;
		for (int i = 0; i < 3; i++) {
			int j = (i + 1) % 3, l = (i + 2) % 3;

			dot += (long double)u[i] * v[i] / UNIT;
			assert_true(fabsl(cross[i] - ((long double)u[j] * v[l] -
						      (long double)u[l] * v[j]) /
							     UNIT) <= 0.5L + 1e-6L);
			t[i] = 2 *
			       ((long double)q[1 + j] * u[l] -
				(long double)q[1 + l] * u[j]) /
			       UNIT;
		}
		assert_true(fabsl(incise_fx_dot(u, v) - dot) <= 0.5L + 1e-6L);
		for (int i = 0; i < 3; i++) {
			int j = (i + 1) % 3, l = (i + 2) % 3;
			long double want = u[i] + w * t[i] +
					   (q[1 + j] * t[l] - q[1 + l] * t[j]) / UNIT;

			/* t is rounded, and passed on thrice; two roundings. */
			assert_true(fabsl(turned[i] - want) <= 3);
		}
	}
}

TEST(test_places)
{
	uint64_t seed = 6;

	for (int k = 0; k < CASES; k++) {
		int32_t a[3], b[3], unit[3], off[3], sum[3],
			length = (int32_t)any(&seed, 31);
		long double along = 0;

		any_unit(&seed, unit, 3);
		for (int i = 0; i < 3; i++) {
			a[i] = (int32_t)any(&seed, 31);
			b[i] = (int32_t)any(&seed, 31);
		}
		incise_fx_sub(off, a, b);
		incise_fx_add(sum, a, length, unit);
		for (int i = 0; i < 3; i++) {
			long double want = a[i] + (long double)length * unit[i] / UNIT;

			assert_int_equal(off[i], incise_fx_hold((int64_t)a[i] - b[i],
								INCISE_FX_AWAY_MAX));
			along += (long double)off[i] * unit[i] / UNIT;
			want = fmaxl(-INT32_MAX, fminl(INT32_MAX, want));
			assert_true(fabsl(sum[i] - want) <= 0.5L + 1e-6L);
		}
		assert_true(fabsl(incise_fx_along(off, unit) - along) <= 0.5L + 1e-6L);
	}
}
