// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The line of a whole recording; see timeline_knots.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "timeline_knots.h"

#define KNOTS INCISE_TIMELINE_KNOTS
#define TIME_MAX (INT64_MAX / 2)
#define STEP_NS 16e9
/* Three may come with the end of a line, one with the beginning of the next. */
#define ROOM 4

static int64_t later(int64_t t_ns, double step_ns)
{
	double sum_ns = (double)t_ns + step_ns;

	if (sum_ns >= (double)TIME_MAX)
		return TIME_MAX;
	if (sum_ns <= -(double)TIME_MAX)
		return -TIME_MAX;
	return t_ns + (int64_t)step_ns;
}

/* Where the line is at x, as a knot. */
static struct incise_timeline_knot knot_at(const struct incise_timeline *timeline,
					   double x_ns, bool begins)
{
	const struct incise_envelope *env = &timeline->envelope;
	uint64_t count = (uint64_t)(x_ns / timeline->period_ns + 0.5);
	double at_ns = (double)count * timeline->period_ns;
	double delay_sd_ns = (double)timeline->setup.delay_sd_ns;
	double sd_ns = incise_envelope_sd(env, at_ns);
	/* on the way to the next knot */
	double bend_ns = incise_envelope_bend(timeline->knot_step_ns);

	return (struct incise_timeline_knot){
		.seq = timeline->base_seq + count,
		.t_ns = later(timeline->base_ns,
			      at_ns + incise_envelope_at(env, at_ns) - env->gap_ns -
				      (double)timeline->setup.delay_ns),
		.sd_ns = sqrt(delay_sd_ns * delay_sd_ns + sd_ns * sd_ns +
			      bend_ns * bend_ns),
		.begins = begins,
	};
}

/* Only what goes on both in number and time is kept, so that time never runs back. */
static int append(struct incise_timeline_knot *knots, int n,
		  struct incise_timeline_knot knot)
{
	if (n) {
		const struct incise_timeline_knot *last = &knots[n - 1];
		int64_t least;

		if (knot.seq <= last->seq)
			return n;
		least = later(last->t_ns, (double)(knot.seq - last->seq));
		if (knot.t_ns < least)
			knot.t_ns = least;
	}
	knots[n] = knot;
	return n + 1;
}

/* The knots that the line would get, were it to end now: at most 3. */
static int append_end(const struct incise_timeline *timeline,
		      struct incise_timeline_knot *knots, int n)
{
	const struct incise_envelope *env = &timeline->envelope;
	double last_ns =
		(double)(timeline->last_seq - timeline->base_seq) * timeline->period_ns;
	bool begun = timeline->knot_begun;

	if (!begun)
		n = append(knots, n, knot_at(timeline, 0, true));
	else if (env->x_ns - timeline->knot_x_ns < timeline->knot_step_ns / 4 &&
		 !knots[n - 1].begins)
		n--; /* too near to tell a slope from it */
	if (env->x_ns >= 0 && env->x_ns < last_ns)
		n = append(knots, n, knot_at(timeline, env->x_ns, false));
	return append(knots, n, knot_at(timeline, last_ns, false));
}

static void thin(struct incise_timeline *timeline)
{
	struct incise_timeline_knot *knots = timeline->knots;
	int n = timeline->knot_count, kept = 1;

	for (int i = 1; i < n; i++) {
		bool ends = i + 1 == n || knots[i + 1].begins;

		if (i % 2 == 0 || knots[i].begins || ends)
			knots[kept++] = knots[i];
	}
	timeline->knot_step_ns *= 2;
	if (kept > KNOTS - KNOTS / 4) {
		/* plugged in too often to remember all of it */
		memmove(knots, knots + KNOTS / 2,
			(size_t)(kept - KNOTS / 2) * sizeof(*knots));
		kept -= KNOTS / 2;
		knots[0].begins = true;
	}
	timeline->knot_count = kept;
}

void incise_timeline_extend(struct incise_timeline *timeline)
{
	const struct incise_envelope *env = &timeline->envelope;

	if (timeline->knot_step_ns <= 0)
		timeline->knot_step_ns = STEP_NS;
	if (env->restarts != timeline->restarts) {
		/* The level has changed for good: a bend is no more, a new line begins. */
		timeline->restarts = env->restarts;
		timeline->lines++;
		if (timeline->knot_begun && timeline->knot_count + ROOM <= KNOTS)
			timeline->knot_count =
				append(timeline->knots, timeline->knot_count,
				       knot_at(timeline, env->blocks[0].x_ns, true));
		timeline->knot_x_ns = env->blocks[0].x_ns;
		return;
	}
	if (!incise_envelope_full(env))
		return;
	if (timeline->knot_begun &&
	    env->x_ns - timeline->knot_x_ns < timeline->knot_step_ns)
		return;
	if (timeline->knot_count + ROOM > KNOTS)
		thin(timeline);
	if (!timeline->knot_begun)
		timeline->knot_count = append(timeline->knots, timeline->knot_count,
					      knot_at(timeline, 0, true));
	timeline->knot_begun = true;
	timeline->knot_count = append(timeline->knots, timeline->knot_count,
				      knot_at(timeline, env->x_ns, false));
	timeline->knot_x_ns = env->x_ns;
}

void incise_timeline_end_line(struct incise_timeline *timeline)
{
	if (timeline->knot_step_ns <= 0)
		timeline->knot_step_ns = STEP_NS;
	if (timeline->knot_count + ROOM > KNOTS)
		thin(timeline);
	timeline->knot_count =
		append_end(timeline, timeline->knots, timeline->knot_count);
	timeline->knot_begun = false;
	timeline->knot_x_ns = 0;
}

int incise_timeline_knots(const struct incise_timeline *timeline,
			  struct incise_timeline_knot *knots)
{
	int n = timeline->knot_count;

	memcpy(knots, timeline->knots, (size_t)n * sizeof(*knots));
	if (timeline->begun && timeline->last_seq > timeline->base_seq)
		n = append_end(timeline, knots, n);
	return n < 2 ? 0 : n;
}

int64_t incise_timeline_at(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	const struct incise_timeline_knot *a, *b;
	double slope, count;
	int low = 0, high = n - 1;

	while (high - low > 1) {
		int middle = low + (high - low) / 2;

		if (knots[middle].seq <= seq)
			low = middle;
		else
			high = middle;
	}
	/* Between the end of a line and the beginning of the next, the former goes on. */
	if (low && knots[high].begins && seq < knots[high].seq) {
		low--;
		high--;
	}
	a = &knots[low];
	b = &knots[high];
	slope = (double)(b->t_ns - a->t_ns) / (double)(b->seq - a->seq);
	count = seq >= a->seq ? (double)(seq - a->seq) : -(double)(a->seq - seq);
	return later(a->t_ns, count * slope);
}

/* Least squares through the knots from first on. */
static double slope_of(const struct incise_timeline_knot *knots, int first, int n,
		       struct incise_timeline_line *line, double *slope_sd)
{
	double x0 = 0, y0 = 0, xx = 0, xy = 0, rr = 0, sd2 = 0, slope;
	int m = n - first;

	for (int i = first; i < n; i++) {
		x0 += (double)(knots[i].seq - knots[first].seq) / m;
		y0 += (double)(knots[i].t_ns - knots[first].t_ns) / m;
	}
	for (int i = first; i < n; i++) {
		double x = (double)(knots[i].seq - knots[first].seq) - x0;
		double y = (double)(knots[i].t_ns - knots[first].t_ns) - y0;

		xx += x * x;
		xy += x * y;
	}
	slope = xy / xx;
	for (int i = first; i < n; i++) {
		double x = (double)(knots[i].seq - knots[first].seq) - x0;
		double r = (double)(knots[i].t_ns - knots[first].t_ns) - y0 - slope * x;

		rr += r * r / m;
		sd2 += knots[i].sd_ns * knots[i].sd_ns / m;
	}
	line->seq = knots[first].seq;
	line->ns = later(knots[first].t_ns, y0 - slope * x0);
	line->period_ns = slope;
	line->sd_ns = sqrt(sd2 + rr);
	*slope_sd = sqrt(fmax(rr, sd2) / xx);
	return slope;
}

static int all_of_it(const struct incise_timeline *timeline,
		     struct incise_timeline_line *line, double *slope_sd)
{
	struct incise_timeline_knot knots[KNOTS + 3];
	int n = incise_timeline_knots(timeline, knots), first = n - 1;

	if (n < 2)
		return -ENODATA;
	while (first > 0 && !knots[first].begins)
		first--;
	if (n - first < 2)
		return -ENODATA;
	slope_of(knots, first, n, line, slope_sd);
	return n - first;
}

int incise_timeline_line(const struct incise_timeline *timeline,
			 struct incise_timeline_line *line)
{
	double slope_sd;
	int n = all_of_it(timeline, line, &slope_sd);

	return n < 0 ? n : 0;
}

bool incise_timeline_slope(const struct incise_timeline *timeline, double *slope,
			   double *slope_sd)
{
	struct incise_timeline_line line;
	int n = all_of_it(timeline, &line, slope_sd);

	if (n < 0)
		return false;
	*slope = line.period_ns / timeline->period_ns - 1;
	*slope_sd /= timeline->period_ns;
	if (n < 5) { /* one line's, or two */
		*slope = timeline->envelope.slope;
		*slope_sd = timeline->envelope.slope_sd;
	}
	return true;
}
