// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Streams of known times; see drifting_stream.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "drifting_stream.h"
#include "noise.h"

#define FIRST 1000
#define LATE_NS (STREAM_LATE_MS * 1e6)
#define INTERRUPT_NS 20e3 /* that a burst is late by, in the mean */

const char *const lateness_kinds[LATE_KINDS] = {"uniform", "exponential", "bursts"};

static void *room(int n, size_t size)
{
	void *memory = calloc((size_t)n + 1, size);

	if (!memory)
		cli_fail("no memory");
	return memory;
}

/* How late the quickest sample's time would be, @phase_ns: of the bursts. */
static double come_ns(enum lateness_kind kind, double quickest_ns, double phase_ns,
		      struct noise *noise)
{
	switch (kind) {
	case LATE_UNIFORM:
		return quickest_ns + LATE_NS * noise_uniform(noise);
	case LATE_EXPONENTIAL:
		return quickest_ns +
		       fmin(LATE_NS / 4 * noise_exponential(noise), LATE_NS);
	default:
		return ceil((quickest_ns - phase_ns) / LATE_NS) * LATE_NS + phase_ns +
		       INTERRUPT_NS * noise_exponential(noise);
	}
}

void drifting_stream_begin(struct drifting_stream *stream, enum lateness_kind kind,
			   double drift_ppm, double seconds, uint64_t seed)
{
	struct noise noise = {seed};
	double period_ns = 1e9 / STREAM_HZ / (1 + drift_ppm * 1e-6);
	double begin_ns = 5e9 + 1e9 * noise_uniform(&noise);
	double phase_ns = LATE_NS * noise_uniform(&noise), before_ns = 0;
	int all = (int)(seconds * STREAM_HZ);

	*stream = (struct drifting_stream){
		.seq = room(all, sizeof(*stream->seq)),
		.arrival_ns = room(all, sizeof(*stream->arrival_ns)),
		.taken_ns = room(all, sizeof(*stream->taken_ns)),
		.grain_ns = kind == LATE_BURSTS ? (int64_t)LATE_NS : 0,
	};
	for (int k = 0; k < all; k++) {
		double taken_ns = begin_ns + k * period_ns;
		double quickest_ns = taken_ns + STREAM_DELAY_NS;
		double arrival_ns = come_ns(kind, quickest_ns, phase_ns, &noise);

		/* One wire: none overtakes another. */
		arrival_ns = fmax(arrival_ns, before_ns);
		before_ns = arrival_ns;
		if (noise_uniform(&noise) < STREAM_LOST && k)
			continue;
		stream->seq[stream->n] = FIRST + (uint64_t)k;
		stream->taken_ns[stream->n] = taken_ns;
		stream->arrival_ns[stream->n++] = llround(arrival_ns);
		stream->mean_late_ns += arrival_ns - quickest_ns;
	}
	stream->mean_late_ns /= stream->n;
}

void drifting_stream_end(struct drifting_stream *stream)
{
	free(stream->seq);
	free(stream->arrival_ns);
	free(stream->taken_ns);
}
