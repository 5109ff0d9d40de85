// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Times of acquisition; see incise/timeline.h.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "timeline.h"
#include "timeline_knots.h"

/* 146 years: sums of two and a count of samples stay below 2^63. */
#define TIME_MAX (INT64_MAX / 2)
/* A clock that ran back so far, or a line that is so long, is another's. */
#define BACK_MAX_NS 1000000000LL
#define LINE_MAX_NS 1e15

static int64_t limited(int64_t ns)
{
	return ns < -TIME_MAX ? -TIME_MAX : ns > TIME_MAX ? TIME_MAX : ns;
}

void incise_timeline_begin(struct incise_timeline *timeline,
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

struct incise_timeline *incise_timeline_new(const struct incise_timeline_setup *setup)
{
	struct incise_timeline *timeline = malloc(sizeof(*timeline));

	if (timeline)
		incise_timeline_begin(timeline, setup);
	return timeline;
}

void incise_timeline_free(struct incise_timeline *timeline)
{
	free(timeline);
}

void incise_timeline_init(struct incise_timeline *timeline, int64_t latency_ns)
{
	incise_timeline_begin(timeline, &(struct incise_timeline_setup){
						.stamped = true,
						.rate_hz = NAN,
						.delay_ns = latency_ns,
					});
}

void incise_timeline_replug(struct incise_timeline *timeline)
{
	struct incise_envelope *env = &timeline->envelope;
	double slope = env->prior_slope, slope_sd = env->prior_slope_sd;

	if (!timeline->begun)
		return;
	incise_timeline_end_line(timeline);
	timeline->begun = false;
	incise_envelope_init(env, timeline->period_ns, (double)timeline->setup.grain_ns);
	/* It is the same device, of the same rate. */
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

/* The sample's place on the line, NaN when it has none. */
static double on_line(struct incise_timeline *timeline, uint64_t seq, int64_t arrival_ns)
{
	struct incise_envelope *env = &timeline->envelope;
	double x_ns = 0, y_ns = 0, line_ns;

	if (timeline->period_ns <= 0)
		return NAN;
	if (timeline->begun && seq <= timeline->last_seq)
		return NAN;
	if (timeline->begun) {
		x_ns = (double)(seq - timeline->base_seq) * timeline->period_ns;
		y_ns = (double)(arrival_ns - timeline->base_ns) - x_ns;
		if (x_ns > LINE_MAX_NS || fabs(y_ns) > LINE_MAX_NS ||
		    arrival_ns < timeline->last_arrival_ns - BACK_MAX_NS)
			incise_timeline_replug(timeline);
	}
	if (!timeline->begun) {
		timeline->begun = true;
		timeline->lines++;
		timeline->base_seq = seq;
		timeline->base_ns = arrival_ns;
		x_ns = 0;
		y_ns = 0;
	}
	timeline->last_seq = seq;
	timeline->last_arrival_ns = arrival_ns;
	if (incise_envelope_take(env, x_ns, y_ns))
		incise_timeline_extend(timeline);
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
	if (!timeline->setup.stamped && !isnan(line_ns)) {
		int64_t drawn_ns = timeline->base_ns + (int64_t)line_ns;

		/* nothing is acquired after it came, even were the line wrong */
		if (drawn_ns < t_ns)
			t_ns = drawn_ns;
	}
	t_ns = limited(limited(t_ns) - timeline->setup.delay_ns);
	if (t_ns <= timeline->last_ns)
		t_ns = timeline->last_ns + 1;
	timeline->last_ns = t_ns;
	return t_ns;
}

int64_t incise_timeline_acquired(struct incise_timeline *timeline, int64_t arrival_ns)
{
	return incise_timeline_sample(timeline, timeline->samples, arrival_ns);
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
		.offset_sd_ns = timeline->setup.stamped
					? (double)timeline->setup.delay_sd_ns
					: NAN,
	};
	if (timeline->jitter_n > 1)
		report->jitter_ns =
			sqrt(timeline->jitter_sum2 / (timeline->jitter_n - 1));
	/* A device that is further from its rate than a line is let: how far is not known. */
	if (incise_timeline_slope(timeline, &slope, &slope_sd) &&
	    fabs(slope) < 0.99 * INCISE_ENVELOPE_SLOPE_MAX) {
		/* periods are longer by the slope, so the rate is lower */
		report->rate_hz = 1e9 / (timeline->period_ns * (1 + slope));
		report->drift_ppm = (1 / (1 + slope) - 1) * 1e6;
		report->drift_sd_ppm = slope_sd * 1e6;
	}
	if (!timeline->setup.stamped && timeline->begun) {
		double x_ns = (double)(timeline->last_seq - timeline->base_seq) *
			      timeline->period_ns;

		report->offset_ns += env->gap_ns;
		report->offset_sd_ns = hypot((double)timeline->setup.delay_sd_ns,
					     incise_envelope_sd(env, x_ns));
	}
}
