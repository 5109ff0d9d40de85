// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Random numbers and order by seed; see shuffle.h.
 */
#include "shuffle.h"

static uint64_t splitmix(uint64_t *state)
{
	uint64_t z = *state += 0x9e3779b97f4a7c15;

	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
	z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
	return z ^ (z >> 31);
}

double incise_random(uint64_t *state)
{
	return (splitmix(state) >> 11) * 0x1p-52 - 1;
}

void incise_shuffle(size_t *order, size_t n, uint64_t seed)
{
	for (size_t i = 0; i < n; i++)
		order[i] = i;
	for (size_t i = n; i > 1; i--) {
		/* The modulo's bias is below n/2^64. */
		size_t j = splitmix(&seed) % i;
		size_t other = order[j];

		order[j] = order[i - 1];
		order[i - 1] = other;
	}
}
