// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * When a sample of a card was taken that stamps nothing; see comedi_stamps.h.
 */
#include <math.h>
#include "comedi_stamps.h"

#define WINDOW_NS 1000000000LL
#define WINDOW_BLOCKS 8
#define DRIFT_MOST 1e-3

void comedi_stamps_init(struct comedi_stamps *s, double period_ns)
{
	*s = (struct comedi_stamps){.period_ns = period_ns, .last_ns = -1};
}

void comedi_stamps_begin(struct comedi_stamps *s, int64_t t_ns)
{
	s->begin_ns = s->window_ns = t_ns;
	s->shift_ns = 0;
	s->n = 0;
	s->least_ns = INFINITY;
	s->has_usual = false;
	s->blocks = 0;
}

static double since_begin(const struct comedi_stamps *s, uint64_t n)
{
	return s->shift_ns + s->period_ns * (double)n;
}

void comedi_stamps_block(struct comedi_stamps *s, int64_t t_ns, uint64_t n, bool last)
{
	double delay = (double)(t_ns - s->begin_ns) - since_begin(s, s->n + n);

	/* A sample is not taken after it has come. */
	if (delay < 0) {
		s->shift_ns += delay;
		s->usual_ns -= fmin(s->usual_ns, -delay);
		s->least_ns += -delay;
		delay = 0;
	}
	if (!last)
		return;
	s->least_ns = fmin(s->least_ns, delay);
	if (++s->blocks < WINDOW_BLOCKS || t_ns - s->window_ns < WINDOW_NS)
		return;
	if (s->has_usual) {
		double most = DRIFT_MOST * (double)(t_ns - s->window_ns);

		s->shift_ns += fmin(fmax(s->least_ns - s->usual_ns, -most), most);
	} else {
		s->usual_ns = s->least_ns;
	}
	s->has_usual = true;
	s->window_ns = t_ns;
	s->least_ns = INFINITY;
	s->blocks = 0;
}

int64_t comedi_stamps_next(struct comedi_stamps *s)
{
	int64_t t_ns = s->begin_ns + (int64_t)since_begin(s, ++s->n);

	if (t_ns <= s->last_ns)
		t_ns = s->last_ns + 1;
	return s->last_ns = t_ns;
}
