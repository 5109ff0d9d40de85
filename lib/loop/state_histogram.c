// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Counts of times in log-linear buckets; see incise/state.h.
 *
 *   ns   0 1 … 31 │ 32 33 … 63 │ 64 66 … 126 │ 128 132 … │ … │ 17.2 s and more
 *        1 wide     1 wide       2             4               open
 */
#include <math.h>
#include <incise/state.h>

#define PER_OCTAVE 32
#define BITS 5	    /* of PER_OCTAVE */
#define OPEN_BIT 34 /* of the first time that is in the open bucket: 2^34 ns */

_Static_assert(INCISE_STATE_BUCKETS == PER_OCTAVE * (OPEN_BIT - BITS + 1) + 1,
	       "all octaves and the open bucket");

int incise_state_bucket(int64_t ns)
{
	int octave;

	if (ns < PER_OCTAVE)
		return ns < 0 ? 0 : (int)ns;
	if (ns >> OPEN_BIT)
		return INCISE_STATE_BUCKETS - 1;
	/* Of the highest bit; below it the next five choose. */
	octave = 63 - __builtin_clzll((unsigned long long)ns) - BITS;
	return octave * PER_OCTAVE + (int)(ns >> octave);
}

double incise_state_edge(int bucket)
{
	int octave = bucket / PER_OCTAVE - 1;

	if (bucket < PER_OCTAVE)
		return bucket < 0 ? 0 : bucket;
	if (bucket >= INCISE_STATE_BUCKETS - 1)
		return INFINITY;
	return (double)(((int64_t)(bucket % PER_OCTAVE + PER_OCTAVE + 1) << octave) - 1);
}

uint64_t incise_state_total(const struct incise_state_histogram *histogram)
{
	uint64_t total = 0;

	/* A page that nobody should have written is full, and does not wrap. */
	for (int i = 0; i < INCISE_STATE_BUCKETS; i++)
		if (__builtin_add_overflow(total, histogram->count[i], &total))
			return UINT64_MAX;
	return total;
}

double incise_state_quantile(const struct incise_state_histogram *histogram, double share)
{
	uint64_t total = incise_state_total(histogram);
	double wanted = share * (double)total, seen = 0;
	int last = 0;

	if (!total)
		return 0;
	for (int i = 0; i < INCISE_STATE_BUCKETS; i++) {
		if (!histogram->count[i])
			continue;
		seen += (double)histogram->count[i];
		last = i;
		if (seen >= wanted)
			break;
	}
	return incise_state_edge(last);
}
