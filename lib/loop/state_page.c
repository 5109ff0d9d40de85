// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Contents of a state page that its writer and its readers share: ticks in fixed widths, and
 * counts of times in log-linear buckets.
 *
 *   ns   0 1 … 31 │ 32 33 … 63 │ 64 66 … 126 │ 128 132 … │ … │ 17.2 s and more
 *        1 wide     1 wide       2             4               open
 */
#include <errno.h>
#include <math.h>
#include "../base/vector.h"
#include "state_page.h"

#define PER_OCTAVE 32
#define BITS 5	    /* of PER_OCTAVE */
#define OPEN_BIT 34 /* 2^34 ns is the first time in the open bucket */

_Static_assert(INCISE_STATE_BUCKETS == PER_OCTAVE * (OPEN_BIT - BITS + 1) + 1,
	       "all octaves and the open bucket");

int incise_state_bucket(int64_t ns)
{
	int octave;

	if (ns < PER_OCTAVE)
		return ns < 0 ? 0 : (int)ns;
	if (ns >> OPEN_BIT)
		return INCISE_STATE_BUCKETS - 1;
	/* The highest bit selects the octave, the next five bits the bucket in it. */
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

	/* Counts of a damaged page saturate. */
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

/* The fields of a tick that are of one type in both structures. */
#define COPY_TICK(to, from)                                          \
	do {                                                         \
		(to)->t_ns = (from)->t_ns;                           \
		v3_copy((to)->position_mm, (from)->position_mm);     \
		v3_copy((to)->tool_mm, (from)->tool_mm);             \
		v3_copy((to)->proxy_mm, (from)->proxy_mm);           \
		v3_copy((to)->normal, (from)->normal);               \
		for (int i = 0; i < 4; i++)                          \
			(to)->quaternion[i] = (from)->quaternion[i]; \
		(to)->depth_mm = (from)->depth_mm;                   \
		(to)->velocity_mm_s = (from)->velocity_mm_s;         \
		v3_copy((to)->command_N, (from)->command_N);         \
	} while (0)

void incise_state_pack(struct state_tick *to, const struct incise_tick *from)
{
	COPY_TICK(to, from);
	to->actuated_N = from->actuated_N[0];
	to->rendered_N = from->rendered_N[0];
	to->flags = from->flags;
	to->phase = (uint16_t)from->phase;
	to->tool = (uint16_t)from->tool;
}

int incise_state_unpack(struct incise_tick *to, const struct state_tick *from)
{
	if (from->phase > INCISE_PHASE_INSERTION || from->tool > INCISE_TOOL_TUBE)
		return -EIO;
	COPY_TICK(to, from);
	to->unfelt_N = 0;
	for (int i = 0; i < INCISE_RIG_AXES_MAX; i++) {
		to->actuated_N[i] = i ? 0 : from->actuated_N;
		to->rendered_N[i] = i ? 0 : from->rendered_N;
	}
	to->flags = from->flags & ((1u << INCISE_TICK_FLAGS) - 1);
	to->phase = (enum incise_phase)from->phase;
	to->tool = (enum incise_tool)from->tool;
	return 0;
}
