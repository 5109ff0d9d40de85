// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Times of acquisition from times of arrival; see timeline.h. ns.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "timeline.h"

/* 146 years: sums of two and a count of samples stay below 2^63. */
#define TIME_MAX (INT64_MAX / 2)
/* After a clock that ran back this far, or on a line this long, a new line starts. */
#define BACK_MAX_NS 1000000000LL
#define LINE_MAX_NS 1e15
#define KNOTS INCISE_TIMELINE_KNOTS
#define STEP_NS 16e9
/* The end of a line adds up to three knots, the start of the next one adds one. */
#define KNOTS_SPARE 4

/*
 * --- knots of the line, for readers of the recording --------------------------------------
 *
 *     start        middle of       middle of           middle of    last
 *     of line      64 blocks       64 blocks           the last 64  sample
 *       o──────────────o───────────────o── · · · ───────o────────────o
 *       extrapolated   a knot each 16 s                 extrapolated
 *
 * A line is most certain in the middle of its blocks, so a knot is made there. When the array is
 * full, every second knot is dropped and the step doubles: 68 min at 16 s.
 */

static int64_t later(int64_t t_ns, double step_ns)
{
	double sum_ns = (double)t_ns + step_ns;

	if (sum_ns >= (double)TIME_MAX)
		return TIME_MAX;
	if (sum_ns <= -(double)TIME_MAX)
		return -TIME_MAX;
	return t_ns + (int64_t)step_ns;
}

/* The line at x, as a knot. */
static struct incise_timeline_knot knot_at(const struct incise_timeline *timeline,
					   double x_ns, bool starts)
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
		.starts = starts,
	};
}

/* A knot is kept only if its number and time increase, so that time never runs back. */
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

/* Add the knots of a line that ends now: at most 3. */
static int append_end(const struct incise_timeline *timeline,
		      struct incise_timeline_knot *knots, int n)
{
	const struct incise_envelope *env = &timeline->envelope;
	double last_ns =
		(double)(timeline->last_seq - timeline->base_seq) * timeline->period_ns;
	if (!timeline->knot_started)
		n = append(knots, n, knot_at(timeline, 0, true));
	else if (env->x_ns - timeline->knot_x_ns < timeline->knot_step_ns / 4 &&
		 !knots[n - 1].starts)
		n--; /* too near for a slope */
	if (env->x_ns >= 0 && env->x_ns < last_ns)
		n = append(knots, n, knot_at(timeline, env->x_ns, false));
	return append(knots, n, knot_at(timeline, last_ns, false));
}

static void thin(struct incise_timeline *timeline)
{
	struct incise_timeline_knot *knots = timeline->knots;
	int n = timeline->knot_count, kept = 1;

	for (int i = 1; i < n; i++) {
		bool ends = i + 1 == n || knots[i + 1].starts;

		if (i % 2 == 0 || knots[i].starts || ends)
			knots[kept++] = knots[i];
	}
	timeline->knot_step_ns *= 2;
	if (kept > KNOTS - KNOTS / 4) {
		/* plugged in too often to keep all */
		memmove(knots, knots + KNOTS / 2,
			(size_t)(kept - KNOTS / 2) * sizeof(*knots));
		kept -= KNOTS / 2;
		knots[0].starts = true;
	}
	timeline->knot_count = kept;
}

/* The line was drawn again: add a knot if one is due. */
static void extend(struct incise_timeline *timeline)
{
	const struct incise_envelope *env = &timeline->envelope;

	if (timeline->knot_step_ns <= 0)
		timeline->knot_step_ns = STEP_NS;
	if (env->restarts != timeline->restarts) {
		/* The level has changed for good: a new line starts. */
		timeline->restarts = env->restarts;
		timeline->lines++;
		if (timeline->knot_started && timeline->knot_count + KNOTS_SPARE <= KNOTS)
			timeline->knot_count =
				append(timeline->knots, timeline->knot_count,
				       knot_at(timeline, env->blocks[0].x_ns, true));
		timeline->knot_x_ns = env->blocks[0].x_ns;
		return;
	}
	if (!incise_envelope_full(env))
		return;
	if (timeline->knot_started &&
	    env->x_ns - timeline->knot_x_ns < timeline->knot_step_ns)
		return;
	if (timeline->knot_count + KNOTS_SPARE > KNOTS)
		thin(timeline);
	if (!timeline->knot_started)
		timeline->knot_count = append(timeline->knots, timeline->knot_count,
					      knot_at(timeline, 0, true));
	timeline->knot_started = true;
	timeline->knot_count = append(timeline->knots, timeline->knot_count,
				      knot_at(timeline, env->x_ns, false));
	timeline->knot_x_ns = env->x_ns;
}

/* The line has ended: add its last knots. */
static void end_line(struct incise_timeline *timeline)
{
	if (timeline->knot_step_ns <= 0)
		timeline->knot_step_ns = STEP_NS;
	if (timeline->knot_count + KNOTS_SPARE > KNOTS)
		thin(timeline);
	timeline->knot_count =
		append_end(timeline, timeline->knots, timeline->knot_count);
	timeline->knot_started = false;
	timeline->knot_x_ns = 0;
}

int incise_timeline_knots(const struct incise_timeline *timeline,
			  struct incise_timeline_knot *knots)
{
	int n = timeline->knot_count;

	memcpy(knots, timeline->knots, (size_t)n * sizeof(*knots));
	if (timeline->started && timeline->last_seq > timeline->base_seq)
		n = append_end(timeline, knots, n);
	return n < 2 ? 0 : n;
}

/* Index of the knot before seq, or of the first; the segment's end is the next knot. */
static int segment_of(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	int low = 0, high = n - 1;

	while (high - low > 1) {
		int middle = low + (high - low) / 2;

		if (knots[middle].seq <= seq)
			low = middle;
		else
			high = middle;
	}
	return low;
}

int64_t incise_timeline_at(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	const struct incise_timeline_knot *a = &knots[segment_of(knots, n, seq)];
	double slope, count;

	/* Between the end of a line and the start of the next, the first one continues. */
	if (a > knots && a[1].starts && seq < a[1].seq)
		a--;
	slope = (double)(a[1].t_ns - a->t_ns) / (double)(a[1].seq - a->seq);
	count = seq >= a->seq ? (double)(seq - a->seq) : -(double)(a->seq - seq);
	return later(a->t_ns, count * slope);
}

double incise_timeline_sd(const struct incise_timeline_knot *knots, int n, uint64_t seq)
{
	const struct incise_timeline_knot *a = &knots[segment_of(knots, n, seq)];

	return fmax(a->sd_ns, a[1].sd_ns);
}

/* Least squares through n knots: ns per sample, and the standard deviation of that. */
static double slope_of(const struct incise_timeline_knot *knots, int n, double *slope_sd)
{
	double x0 = 0, y0 = 0, xx = 0, xy = 0, rr = 0, sd2 = 0, slope;

	for (int i = 0; i < n; i++) {
		x0 += (double)(knots[i].seq - knots->seq) / n;
		y0 += (double)(knots[i].t_ns - knots->t_ns) / n;
	}
	for (int i = 0; i < n; i++) {
		double x = (double)(knots[i].seq - knots->seq) - x0;
		double y = (double)(knots[i].t_ns - knots->t_ns) - y0;

		xx += x * x;
		xy += x * y;
	}
	slope = xy / xx;
	for (int i = 0; i < n; i++) {
		double x = (double)(knots[i].seq - knots->seq) - x0;
		double r = (double)(knots[i].t_ns - knots->t_ns) - y0 - slope * x;

		rr += r * r / n;
		sd2 += knots[i].sd_ns * knots[i].sd_ns / n;
	}
	*slope_sd = sqrt(fmax(rr, sd2) / xx);
	return slope;
}

/* Share by which periods are longer than the nominal one, from the present line's knots. */
static bool measure_slope(const struct incise_timeline *timeline, double *slope,
			  double *slope_sd)
{
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
	int n = incise_timeline_knots(timeline, knots), first = n - 1;

	while (first > 0 && !knots[first].starts)
		first--;
	n -= first;
	if (first < 0 || n < 2)
		return false;
	*slope = slope_of(&knots[first], n, slope_sd) / timeline->period_ns - 1;
	*slope_sd /= timeline->period_ns;
	if (n < 5) { /* of one line or two */
		*slope = timeline->envelope.slope;
		*slope_sd = timeline->envelope.slope_sd;
	}
	return true;
}

/* --- samples ------------------------------------------------------------------------ */

static int64_t limited(int64_t ns)
{
	return ns < -TIME_MAX ? -TIME_MAX : ns > TIME_MAX ? TIME_MAX : ns;
}

void incise_timeline_init(struct incise_timeline *timeline,
			  const struct incise_timeline_setup *setup)
{
	memset(timeline, 0, sizeof(*timeline));
	timeline->setup = *setup;
	timeline->setup.delay_ns = limited(setup->delay_ns);
	timeline->setup.delay_sd_ns = llabs(limited(setup->delay_sd_ns));
	if (setup->grain_ns < 0 || setup->grain_ns > BACK_MAX_NS)
		timeline->setup.grain_ns = 0;
	/* Times in a recording are never negative; see incise-recording(5). */
	timeline->last_ns = -1;
	if (setup->rate_hz >= 1e-3 && setup->rate_hz <= 1e7)
		timeline->period_ns = 1e9 / setup->rate_hz;
	if (timeline->period_ns > 0)
		incise_envelope_init(&timeline->envelope, timeline->period_ns,
				     (double)timeline->setup.grain_ns);
}

void incise_timeline_replug(struct incise_timeline *timeline)
{
	struct incise_envelope *env = &timeline->envelope;
	double slope = env->prior_slope, slope_sd = env->prior_slope_sd;

	if (!timeline->started)
		return;
	end_line(timeline);
	timeline->started = false;
	incise_envelope_init(env, timeline->period_ns, (double)timeline->setup.grain_ns);
	/* The same device has the same rate. */
	env->prior_slope = slope;
	env->prior_slope_sd = slope_sd;
	timeline->restarts = 0;
}

static void measure_jitter(struct incise_timeline *timeline, double excess_ns)
{
	double step = excess_ns - timeline->jitter_mean_ns;

	timeline->jitter_n++;
	timeline->jitter_mean_ns += step / timeline->jitter_n;
	timeline->jitter_sum2 += step * (excess_ns - timeline->jitter_mean_ns);
	timeline->jitter_max_ns = fmax(timeline->jitter_max_ns, excess_ns);
	timeline->late += excess_ns > timeline->period_ns;
}

/* The sample's place on the line; NaN: it has none. */
static double on_line(struct incise_timeline *timeline, uint64_t seq, int64_t arrival_ns)
{
	struct incise_envelope *env = &timeline->envelope;
	double x_ns = 0, y_ns = 0, line_ns;

	if (timeline->period_ns <= 0)
		return NAN;
	if (timeline->started && seq <= timeline->last_seq)
		return NAN;
	if (timeline->started) {
		x_ns = (double)(seq - timeline->base_seq) * timeline->period_ns;
		y_ns = (double)(arrival_ns - timeline->base_ns) - x_ns;
		if (x_ns > LINE_MAX_NS || fabs(y_ns) > LINE_MAX_NS ||
		    arrival_ns < timeline->last_arrival_ns - BACK_MAX_NS)
			incise_timeline_replug(timeline);
	}
	if (!timeline->started) {
		timeline->started = true;
		timeline->lines++;
		timeline->base_seq = seq;
		timeline->base_ns = arrival_ns;
		x_ns = 0;
		y_ns = 0;
	}
	timeline->last_seq = seq;
	timeline->last_arrival_ns = arrival_ns;
	if (incise_envelope_add(env, x_ns, y_ns))
		extend(timeline);
	line_ns = incise_envelope_at(env, x_ns);
	measure_jitter(timeline, y_ns - line_ns);
	return x_ns + line_ns - env->gap_ns;
}

int64_t incise_timeline_sample(struct incise_timeline *timeline, uint64_t seq,
			       int64_t arrival_ns)
{
	int64_t t_ns = limited(arrival_ns);
	double line_ns = on_line(timeline, seq, t_ns);

	timeline->samples++;
	if (!timeline->setup.timestamped && !isnan(line_ns)) {
		int64_t drawn_ns = timeline->base_ns + (int64_t)line_ns;

		/* No sample is acquired after its arrival, even if the line is wrong. */
		if (drawn_ns < t_ns)
			t_ns = drawn_ns;
	}
	t_ns = limited(limited(t_ns) - timeline->setup.delay_ns);
	if (t_ns <= timeline->last_ns)
		t_ns = timeline->last_ns + 1;
	timeline->last_ns = t_ns;
	return t_ns;
}

void incise_timeline_report(const struct incise_timeline *timeline,
			    struct incise_timeline_report *report)
{
	const struct incise_envelope *env = &timeline->envelope;
	double slope, slope_sd;

	*report = (struct incise_timeline_report){
		.samples = timeline->samples,
		.rate_hz = NAN,
		.drift_ppm = NAN,
		.drift_sd_ppm = NAN,
		.jitter_ns = NAN,
		.jitter_max_ns = timeline->jitter_n > 0 ? timeline->jitter_max_ns : NAN,
		.late = timeline->late,
		.lines = timeline->lines,
		.offset_ns = (double)timeline->setup.delay_ns,
		.offset_sd_ns = timeline->setup.timestamped
					? (double)timeline->setup.delay_sd_ns
					: NAN,
	};
	if (timeline->jitter_n > 1)
		report->jitter_ns =
			sqrt(timeline->jitter_sum2 / (timeline->jitter_n - 1));
	/* At the limit of the line's slope the true rate is not known. */
	if (measure_slope(timeline, &slope, &slope_sd) &&
	    fabs(slope) < 0.99 * INCISE_ENVELOPE_SLOPE_MAX) {
		/* periods are longer by the slope, so the rate is lower */
		report->rate_hz = 1e9 / (timeline->period_ns * (1 + slope));
		report->drift_ppm = (1 / (1 + slope) - 1) * 1e6;
		report->drift_sd_ppm = slope_sd * 1e6;
	}
	if (!timeline->setup.timestamped && timeline->started) {
		double x_ns = (double)(timeline->last_seq - timeline->base_seq) *
			      timeline->period_ns;

		report->offset_ns += env->gap_ns;
		report->offset_sd_ns = hypot((double)timeline->setup.delay_sd_ns,
					     incise_envelope_sd(env, x_ns));
	}
}
