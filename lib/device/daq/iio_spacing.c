// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Samples that are missing, found by the kernel's time stamps; see iio_spacing.h.
 */
#include <math.h>
#include "iio_spacing.h"

/* Stamps are nanoseconds since the start; above this (146 years) they cannot be. */
#define STAMP_MAX (INT64_MAX / 2)
/* Periods in a gap; longer ones are counted as this. */
#define GAP_MAX 1e12

void iio_spacing_init(struct iio_spacing *spacing, struct daq_feed *feed, double rate_hz)
{
	*spacing = (struct iio_spacing){
		.feed = feed,
		.period_ns = llround(1e9 / rate_hz),
	};
}

static double period(const struct iio_spacing *s)
{
	double nominal = (double)s->period_ns;
	double span = (double)(s->last_ns - s->first_ns);

	if (fabs(span - nominal * (double)s->n) < nominal / 2)
		return nominal;
	/* Nonsense of a device must not become a period. */
	return fmin(fmax(span / (double)s->n, nominal * 0.8), nominal * 1.25);
}

/* A sample of which @true_ns is the stamp without lateness. */
static void pass(struct iio_spacing *s, int64_t t_ns, int64_t true_ns, int32_t code)
{
	double steps = (double)(true_ns - s->last_ns) / period(s);
	uint64_t lost = 0;

	/* What lies just between two is the shorter gap. */
	if (steps > 1.5)
		lost = (uint64_t)ceil(fmin(steps, GAP_MAX) - 0.5) - 1;
	daq_feed_lose(s->feed, lost);
	daq_feed_put(s->feed, t_ns, code);
	s->n += lost + 1;
	s->last_ns = true_ns;
}

void iio_spacing_flush(struct iio_spacing *s)
{
	if (s->holds)
		pass(s, s->held_ns, s->held_ns, s->held_code);
	s->holds = false;
}

void iio_spacing_put(struct iio_spacing *s, int64_t t_ns, int32_t code)
{
	int64_t T;

	/* A stamp that cannot be stands for the time that it should have. */
	if (t_ns < 0 || t_ns > STAMP_MAX)
		t_ns = s->holds ? s->held_ns + s->period_ns : s->last_ns + s->period_ns;
	if (!s->begun) {
		s->begun = true;
		s->first_ns = s->last_ns = t_ns;
		daq_feed_put(s->feed, t_ns, code);
		return;
	}
	T = (int64_t)period(s);
	if (s->holds) {
		int64_t true_ns = t_ns - T < s->held_ns ? t_ns - T : s->held_ns;

		/* Never ahead of its predecessor: stamps that run backwards. */
		pass(s, s->held_ns, true_ns > s->last_ns ? true_ns : s->last_ns,
		     s->held_code);
		s->holds = false;
	}
	if (t_ns - s->last_ns <= T + T / 2) {
		pass(s, t_ns, t_ns, code);
		return;
	}
	s->holds = true;
	s->held_ns = t_ns;
	s->held_code = code;
}
