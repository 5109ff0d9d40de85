// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Vectors in integers; see vector.h.
 */
#include "vector.h"

void incise_fx_cross(int32_t to[3], const int32_t u[3], const int32_t v[3])
{
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		to[i] = (int32_t)incise_fx_rounded(
			(int64_t)u[j] * v[k] - (int64_t)u[k] * v[j], 30);
	}
}

uint32_t incise_fx_length(const int32_t a[3])
{
	uint64_t sum = 0;
	uint32_t root;

	/* 3 · 2^62 < 2^64 */
	for (int i = 0; i < 3; i++)
		sum += (uint64_t)((int64_t)a[i] * a[i]);
	root = incise_fx_root(sum);
	/* (root + 1/2)² = root² + root + 1/4 */
	return root + (sum - (uint64_t)root * root > root);
}

bool incise_fx_is_short(const int32_t a[3], int32_t most)
{
	uint64_t sum = 0;

	/* 3 · 2^62 < 2^64 */
	for (int i = 0; i < 3; i++)
		sum += (uint64_t)((int64_t)a[i] * a[i]);
	/* The root rounded is at most that: below (most + 1/2)². */
	return sum <= (uint64_t)most * (uint64_t)most + (uint64_t)most;
}

bool incise_fx_unit(int32_t *to, const int64_t *a, int n, int64_t least)
{
	int64_t largest = 0, scaled[4];
	uint64_t sum = 0, per;
	uint32_t length;
	int shift;

	for (int i = 0; i < n; i++) {
		int64_t size = a[i] < 0 ? -a[i] : a[i];

		largest = size > largest ? size : largest;
	}
	if (largest == 0)
		return false;
	/* To 2^29 … 2^30: all bits of the result count. */
	shift = 34 - __builtin_clzll((unsigned long long)largest);
	for (int i = 0; i < n; i++) {
		scaled[i] = shift > 0 ? incise_fx_rounded(a[i], shift)
				      : a[i] * ((int64_t)1 << -shift);
		sum += (uint64_t)(scaled[i] * scaled[i]);
	}
	length = incise_fx_root(sum);
	if (shift > 0 ? (int64_t)length << shift <= least
		      : (int64_t)length >> -shift <= least)
		return false;
	/* One division for all: the length is 2^29 … 2^31, so that this is 2^31 … 2^33. */
	per = div_u64((uint64_t)1 << 62, length);
	for (int i = 0; i < n; i++) {
		int64_t size = scaled[i] < 0 ? -scaled[i] : scaled[i], rest;

		/* 2^30 · 2^33; a component is below the length, but for 1. */
		to[i] = (int32_t)(((uint64_t)size * per) >> 32);
		/* To the nearest of size · 2^30 / length: it is one below that at most. */
		rest = (size << 30) + length / 2 - (int64_t)to[i] * length;
		to[i] += rest >= length;
		to[i] = to[i] > INCISE_FIXED_UNIT ? INCISE_FIXED_UNIT : to[i];
		to[i] = scaled[i] < 0 ? -to[i] : to[i];
	}
	return true;
}

bool incise_fx_is_unit(const int32_t *a, int n)
{
	int64_t sum = 0;

	for (int i = 0; i < n; i++) {
		/* 4 · (2^30 + 2^6)² < 2^63 */
		if (a[i] > INCISE_FIXED_UNIT + 64 || a[i] < -INCISE_FIXED_UNIT - 64)
			return false;
		sum += (int64_t)a[i] * a[i];
	}
	sum -= (int64_t)1 << 60;
	return sum <= INCISE_FX_UNIT_SLACK && sum >= -INCISE_FX_UNIT_SLACK;
}

/*
 * v + w t + u × t with t = 2 u × v, u the quaternion's vector. |t| ≤ 2: each product is below
 * 2^30.1 · 2^31.1 in Q60, two of them below 2^62.3.
 */
void incise_fx_rotate(int32_t to[3], const int32_t q[4], const int32_t unit[3])
{
	const int32_t *u = q + 1;
	int64_t t[3];

	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		t[i] = incise_fx_rounded(
			(int64_t)u[j] * unit[k] - (int64_t)u[k] * unit[j], 29);
	}
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;
		int64_t turned = unit[i] + incise_fx_rounded(q[0] * t[i], 30) +
				 incise_fx_rounded(u[j] * t[k] - u[k] * t[j], 30);

		to[i] = (int32_t)incise_fx_hold(turned, INCISE_FIXED_UNIT + 64);
	}
}

bool incise_fixed_attitude(int32_t to[4], const int32_t quaternion[4])
{
	/* 0.9 and 1.1, squared, in Q60. */
	const int64_t least = ((int64_t)1 << 60) / 100 * 81,
		      most = ((int64_t)1 << 60) / 100 * 121;
	const int32_t largest = INCISE_FIXED_UNIT / 10 * 11;
	int64_t length2 = 0, q[4];

	for (int i = 0; i < 4; i++) {
		/* 4 · (1.1 · 2^30)² < 2^62.3 */
		if (quaternion[i] > largest || quaternion[i] < -largest)
			return false;
		length2 += (int64_t)quaternion[i] * quaternion[i];
		q[i] = quaternion[i];
	}
	return length2 > least && length2 < most && incise_fx_unit(to, q, 4, 0);
}
