// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * error of the times that late samples are given, over how much of the
 * stream was seen.
 *
 *   window    ├───────────────────────────────────┤ 1 … 120 s, from the first sample on
 *   live                               ├──────────┤ times given at arrival: the last quarter
 *   final     ├───────────────────────────────────┤ times given afterwards: all of it
 */
#include <stdio.h>
#include <stdlib.h>
#include "../../lib/signal/timeline.h"
#include "program.h"
#include "noise.h"

static const double windows_s[] = {1, 2, 5, 10, 30, 60, 120};
static const double drifts_ppm[] = {-200, 0, 200};

/* Streams of each window: so many at least, and so many seconds together. */
#define STREAMS 20
#define STREAMS_S 240
#define QUICK_STREAMS 4
#define QUICK_STREAMS_S 24

/* One in so many samples is asked for its uncertainty. */
#define ASK_EVERY 16

/* Share of the truth within twice the stated uncertainty, were it normal. */
#define WITHIN 0.9545

/* --- streams of known times: a device with a clock of its own, whose samples come late by
 * chance, and some not at all ---
 *
 *   taken     |    |    |    |    |    |    |     a period of the device's clock
 *   arrives    \delay, and up to 20 ms more
 *             ····|·|·······|·|||·······|··
 */

#define RATE_HZ 240
#define PERIOD_NS (1e9 / RATE_HZ)
#define DELAY_NS 4200000
#define LATE_MS 20
#define LATE_NS (LATE_MS * 1e6)
#define LOST 0.01
#define FIRST 1000
#define INTERRUPT_NS 20e3 /* mean lateness of a burst */

enum lateness {
	UNIFORM,     /* by anything up to 20 ms */
	EXPONENTIAL, /* by 5 ms in the mean, and no more than 20 ms */
	BURSTS,	     /* all that has come goes on together, each 20 ms */
};
static const char *const lateness_names[] = {"uniform", "exponential", "bursts"};

struct stream {
	struct sample {
		uint64_t seq;
		int64_t arrival_ns;
		double taken_ns; /* the truth */
	} * sample;
	int n;
	int64_t grain_ns; /* arrivals come on a grid; 0: on none */
};

/* Arrival of a sample that could come at @quickest_ns; @phase_ns: of the bursts. */
static double arrival_ns(enum lateness lateness, double quickest_ns, double phase_ns,
			 uint64_t *noise)
{
	if (lateness == UNIFORM)
		return quickest_ns + LATE_NS * noise_uniform(noise);
	if (lateness == EXPONENTIAL)
		return quickest_ns +
		       fmin(LATE_NS / 4 * noise_exponential(noise), LATE_NS);
	return ceil((quickest_ns - phase_ns) / LATE_NS) * LATE_NS + phase_ns +
	       INTERRUPT_NS * noise_exponential(noise);
}

static struct stream stream_begin(enum lateness lateness, double drift_ppm,
				  double seconds, uint64_t seed)
{
	uint64_t noise = seed;
	double period_ns = PERIOD_NS / (1 + drift_ppm * 1e-6);
	double begin_ns = 5e9 + 1e9 * noise_uniform(&noise);
	double phase_ns = LATE_NS * noise_uniform(&noise), before_ns = 0;
	int all = (int)(seconds * RATE_HZ);
	struct stream s = {
		.sample = cli_alloc(all, sizeof(*s.sample)),
		.grain_ns = lateness == BURSTS ? (int64_t)LATE_NS : 0,
	};

	for (int k = 0; k < all; k++) {
		double taken_ns = begin_ns + k * period_ns;
		double quickest_ns = taken_ns + DELAY_NS;

		/* One wire: none overtakes another. */
		before_ns = fmax(arrival_ns(lateness, quickest_ns, phase_ns, &noise),
				 before_ns);
		if (noise_uniform(&noise) < LOST && k)
			continue;
		s.sample[s.n++] = (struct sample){FIRST + (uint64_t)k, llround(before_ns),
						  taken_ns};
	}
	return s;
}

/* --- methods: the time of acquisition from arrivals ---
 *
 *     y │  ·    ·      ·  ·         y: arrival less number · nominal period
 *       │ ·    ·  ·  ·
 *       │__·____·___________·_      the library's line: sloping, below all
 *       └──────────────────► number
 */

static const struct method {
	const char *name;
	bool line;	 /* else arrivals less the delay */
	bool told;	 /* of the grain */
	bool afterwards; /* the best times in the end, not those given at arrival */
} methods[] = {
	{"arrival", false, false, false},
	{"line_live", true, true, false},
	{"line_untold", true, false, false},
	{"line_final", true, true, true},
};
#define METHODS N(methods)

/* --- measurement --- */

/* Rows of a window stand together, a row per method. */
struct row {
	const char *name, *late;
	double drift_ppm, window_s;
	double rms_us, max_us, mean_us;
	double stated_us, within; /* uncertainty, share of truth within twice it */
	char failed[160];
};

static struct row rows[N(lateness_names) * N(drifts_ppm) * N(windows_s) * METHODS];

static int streams_of(bool quick, double window_s)
{
	return quick ? (int)fmax(QUICK_STREAMS, QUICK_STREAMS_S / window_s)
		     : (int)fmax(STREAMS, STREAMS_S / window_s);
}

/* Errors of a method over some streams, ns. */
struct errors {
	double n, sum, sum2, max;
	double asked, within, stated2;
};

/* The error of a sample's time; one in some with its stated uncertainty. */
static void add_error(struct errors *e, double error, double sd_ns)
{
	e->n++;
	e->sum += error;
	e->sum2 += error * error;
	e->max = fmax(e->max, fabs(error));
	if (isnan(sd_ns))
		return;
	e->asked++;
	e->within += fabs(error) <= 2 * sd_ns;
	e->stated2 += sd_ns * sd_ns;
}

static double live_sd_ns(const struct incise_timeline *timeline)
{
	struct incise_timeline_report report;

	incise_timeline_report(timeline, &report);
	return report.offset_sd_ns;
}

static void follow(const struct method *method, const struct stream *stream,
		   struct errors *e)
{
	const struct incise_timeline_setup setup = {
		.rate_hz = RATE_HZ,
		.delay_ns = DELAY_NS,
		.grain_ns = method->told ? stream->grain_ns : 0};
	static struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
	struct incise_timeline *timeline = cli_alloc(1, sizeof(*timeline));
	int n;

	incise_timeline_init(timeline, &setup);
	for (int k = 0; k < stream->n; k++) {
		const struct sample *sample = &stream->sample[k];
		bool asked = method->line && k % ASK_EVERY == 0;
		int64_t t_ns = sample->arrival_ns - DELAY_NS;

		if (method->line)
			t_ns = incise_timeline_sample(timeline, sample->seq,
						      sample->arrival_ns);
		if (!method->afterwards && k >= stream->n - stream->n / 4)
			add_error(e, (double)t_ns - sample->taken_ns,
				  asked ? live_sd_ns(timeline) : NAN);
	}
	n = method->afterwards ? incise_timeline_knots(timeline, knots) : 0;
	for (int k = 0; k < stream->n && n; k++) {
		const struct sample *sample = &stream->sample[k];

		add_error(e,
			  (double)incise_timeline_at(knots, n, sample->seq) -
				  sample->taken_ns,
			  k % ASK_EVERY ? NAN
					: incise_timeline_sd(knots, n, sample->seq));
	}
	free(timeline);
}

static void set_errors(struct row *row, const struct errors *e)
{
	row->rms_us = sqrt(e->sum2 / e->n) * 1e-3;
	row->mean_us = e->sum / e->n * 1e-3;
	row->max_us = e->max * 1e-3;
	row->within = e->asked > 0 ? e->within / e->asked : NAN;
	row->stated_us = e->asked > 0 ? sqrt(e->stated2 / e->asked) * 1e-3 : NAN;
}

/* Samples of a stream are off together: chance is that of so many streams, and three of its
 * deviations are allowed. */
static void judge(struct row *row, double arrival_us, int streams)
{
	double least = WITHIN - 3 * sqrt(WITHIN * (1 - WITHIN) / streams);

	if (!isfinite(row->rms_us))
		snprintf(row->failed, sizeof(row->failed), "a time is not a number");
	else if (row->rms_us > arrival_us)
		snprintf(row->failed, sizeof(row->failed),
			 "worse than arrival times: error %.3g us, theirs "
			 "%.3g us",
			 row->rms_us, arrival_us);
	else if (row->within < least)
		snprintf(
			row->failed, sizeof(row->failed),
			"stated uncertainty too small: %.1f %% of the true times are within "
			"twice of it",
			row->within * 100);
}

/* A row per method; of the seeds of each window none is that of another. */
static void measure(bool quick, enum lateness lateness, double drift_ppm, double window_s,
		    struct row *row)
{
	int streams = streams_of(quick, window_s);
	uint64_t seed = 1 + 1000 * (uint64_t)((row - rows) / METHODS);
	struct errors errors[METHODS] = {{0}};

	for (int k = 0; k < streams; k++) {
		struct stream stream =
			stream_begin(lateness, drift_ppm, window_s, seed + (uint64_t)k);

		for (int i = 0; i < METHODS; i++)
			follow(&methods[i], &stream, &errors[i]);
		free(stream.sample);
	}
	for (int i = 0; i < METHODS; i++) {
		row[i] = (struct row){.name = methods[i].name,
				      .late = lateness_names[lateness],
				      .drift_ppm = drift_ppm,
				      .window_s = window_s};
		set_errors(&row[i], &errors[i]);
		judge(&row[i], row->rms_us, streams);
	}
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name), COLUMN(row, "late", late),
		    COLUMN(row, "window_s", window_s),
		    COLUMN(row, "drift_ppm", drift_ppm),
		    COLUMN(row, "rms_error_us", rms_us),
		    COLUMN(row, "max_error_us", max_us),
		    COLUMN(row, "mean_error_us", mean_us),
		    COLUMN(row, "stated_us", stated_us),
		    COLUMN(row, "within_2sd", within), COLUMN(row, "failed", failed)},
	.metrics = {METRIC(EXACT, row, rms_us, "us",
			   "{name}, {late}, {drift_ppm:%+g} ppm, {window_s} s, rms",
			   "window_s=1|30")},
};

static void run(struct bench_run *run)
{
	int i = 0;

	for (int late = 0; late < N(lateness_names); late++)
		for (int d = 0; d < N(drifts_ppm); d++)
			for (int w = 0; w < N(windows_s); w++, i += METHODS) {
				cli_progress("%s, %g ppm, %g s", lateness_names[late],
					     drifts_ppm[d], windows_s[w]);
				measure(run->quick, (enum lateness)late, drifts_ppm[d],
					windows_s[w], &rows[i]);
			}
	cli_progress_end();
	bench_values(run, "{si sf si}", "rate_hz", RATE_HZ, "lost", LOST, "streams",
		     streams_of(run->quick, 120));
	bench_rows(run, &rows_table, rows, N(rows));
}

const struct bench bench_program = {
	.name = "timeline",
	.summary = "error of reconstructed timestamps over the window",
	.run = run,
};
