/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A stream whose times of acquisition are known: a device with a clock of its own, a delay,
 * and jitter of several kinds.
 */
#ifndef TESTS_STREAM_H
#define TESTS_STREAM_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include "../../../lib/base/random.h"

enum jitter {
	NO_JITTER,
	UNIFORM,     /* 0 to size */
	EXPONENTIAL, /* of mean size / 4, cut off at size */
	GAMMA,	     /* sum of two exponential ones of size / 8 */
	BURSTS,	     /* held back until size has passed, then all at once */
	FRAMES,	     /* at the next frame of size of the host */
	STALLS,	     /* 50 us, and each second nothing comes for size */
	WAKES,	     /* read by a thread that sleeps 0 to size */
	JITTERS
};

static const char *const jitter_names[] = {"none",   "uniform", "exponential", "gamma",
					   "bursts", "frames",	"stalls",      "wakes"};

struct stream {
	double rate_hz, drift_ppm,
		warm_ppm; /* nominal, and 20 s after: + warm at the end */
	enum jitter jitter;
	double size_ns, delay_ns;
	bool in_order; /* none overtakes another */
	uint64_t random;
	double wake_ns;
	double start_ns, t_ns, phase_ns, came_ns, length_s;
	uint64_t seq;
};

static inline double stream_random(struct stream *s)
{
	return (double)(incise_random_next(&s->random) >> 11) * 0x1p-53;
}

static inline double stream_normal(struct stream *s)
{
	double u = 1 - stream_random(s);

	return sqrt(-2 * log(u)) * cos(2 * M_PI * stream_random(s));
}

static inline void stream_begin(struct stream *s, uint64_t seed)
{
	s->random = seed;
	s->start_ns = 5e9 + 1e9 * stream_random(s);
	s->phase_ns = s->size_ns * stream_random(s);
	s->t_ns = s->start_ns;
	s->wake_ns = s->start_ns;
	s->came_ns = 0;
	s->seq = 1000;
}

/* Time of the next sample's acquisition and arrival. */
static inline double stream_next(struct stream *s, int64_t *arrival_ns)
{
	double part = (s->t_ns - s->start_ns) / 1e9 / s->length_s, t_ns, came_ns;
	double ppm = s->drift_ppm + s->warm_ppm * part;

	if (s->seq++ > 1000)
		s->t_ns += 1e9 / s->rate_hz / (1 + ppm * 1e-6);
	t_ns = s->t_ns;
	came_ns = t_ns + s->delay_ns;
	switch (s->jitter) {
	case UNIFORM:
		came_ns += s->size_ns * stream_random(s);
		break;
	case EXPONENTIAL:
		came_ns += fmin(-log(1 - stream_random(s)) * s->size_ns / 4, s->size_ns);
		break;
	case GAMMA:
		came_ns += -log((1 - stream_random(s)) * (1 - stream_random(s))) *
			   s->size_ns / 8;
		break;
	case BURSTS:
	case FRAMES:
		came_ns = ceil((came_ns - s->phase_ns) / s->size_ns) * s->size_ns +
			  s->phase_ns;
		came_ns += 20e3 * -log(1 - stream_random(s)); /* the interrupt's */
		break;
	case STALLS:
		came_ns += 50e3 * -log(1 - stream_random(s));
		if (fmod(came_ns, 1e9) < s->size_ns)
			came_ns += s->size_ns - fmod(came_ns, 1e9);
		break;
	case WAKES:
		while (s->wake_ns < came_ns)
			s->wake_ns += s->size_ns * stream_random(s);
		came_ns = s->wake_ns;
		break;
	default:
		break;
	}
	if (s->in_order && came_ns < s->came_ns)
		came_ns = s->came_ns;
	s->came_ns = came_ns;
	*arrival_ns = (int64_t)came_ns;
	return t_ns;
}

#endif
