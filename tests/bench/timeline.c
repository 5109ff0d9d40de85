// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * error of the times that late samples are given, over how much of the
 * stream was seen and over the cost.
 *
 *   window    ├───────────────────────────────────┤ 1 … 120 s, from the first sample on
 *   live                               ├──────────┤ times given at arrival: the last quarter
 *   final     ├───────────────────────────────────┤ times given afterwards: all of it
 */
#include <stdio.h>
#include <stdlib.h>
#include "../../lib/record/time/timeline.h"
#include "program.h"
#include "../../tools/cli/stopwatch.h"
#include "../../tools/bench/noise.h"

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

#define REPEATS 51
#define QUICK_REPEATS 21 /* 20 resolve the 5th and the 95th percentile */

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
	double mean_late_ns; /* of arrivals later than the delay */
	int64_t grain_ns;    /* arrivals come on a grid; 0: on none */
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
		s.mean_late_ns += before_ns - quickest_ns;
	}
	s.mean_late_ns /= s.n;
	return s;
}

/* --- methods: the time of acquisition from arrivals ---
 *
 *     y │  ·    ·      ·  ·         y: arrival less number · nominal period
 *       │----·-------·---·----      least squares: through the middle of the arrivals
 *       │ ·    ·  ·  ·              lowest: level, below all
 *       │__·____·___________·_      the library's: sloping, below all
 *       └──────────────────► number
 */

struct method {
	const char *name;
	size_t bytes; /* of its state, of zeros at first */
	/* Prepare the state with the stream's grain and, as no real program could, its mean
	 * lateness; or NULL. */
	void (*start)(void *state, const struct stream *stream);
	/* The time of a sample when it arrives, ns. */
	double (*take)(void *state, const struct sample *sample);
	/* The best time of one of them afterwards; NULL: that of take() is final. */
	double (*afterwards)(const void *state, uint64_t seq);
	/* To be called once between them, or NULL. */
	void (*finish)(void *state);
	/* Stated uncertainty of the last one taken, or afterwards of one; NULL: none is. */
	double (*sd_ns)(const void *state, uint64_t seq);
};

static double arrival_take(void *state, const struct sample *sample)
{
	(void)state;
	return (double)(sample->arrival_ns - DELAY_NS);
}

struct lowest {
	bool started;
	struct sample sample; /* the lowest */
};

static double lowest_take(void *state, const struct sample *sample)
{
	struct lowest *lowest = state;
	double x_ns = (double)(sample->seq - lowest->sample.seq) * PERIOD_NS;
	int64_t later_ns = sample->arrival_ns - lowest->sample.arrival_ns;

	if (!lowest->started || (double)later_ns < x_ns) {
		*lowest = (struct lowest){true, *sample};
		x_ns = 0;
	}
	return (double)(lowest->sample.arrival_ns - DELAY_NS) + x_ns;
}

/* Means and sums about them, which grow without losing digits: Welford's. */
struct squares {
	uint64_t first;
	int64_t first_ns;
	double n, x, y, xx, xy; /* y: ns later than by the nominal period */
	double late_ns;
};

static void squares_start(void *state, const struct stream *stream)
{
	((struct squares *)state)->late_ns = stream->mean_late_ns;
}

static double squares_at(const void *state, uint64_t seq)
{
	const struct squares *s = state;
	double x_ns = (double)(seq - s->first) * PERIOD_NS;
	double slope = s->xx > 0 ? s->xy / s->xx : 0;

	return (double)(s->first_ns - DELAY_NS) + x_ns + s->y + slope * (x_ns - s->x) -
	       s->late_ns;
}

static double squares_take(void *state, const struct sample *sample)
{
	struct squares *s = state;
	double x_ns, y_ns, dx, dy;

	if (!s->n) {
		s->first = sample->seq;
		s->first_ns = sample->arrival_ns;
	}
	x_ns = (double)(sample->seq - s->first) * PERIOD_NS;
	y_ns = (double)(sample->arrival_ns - s->first_ns) - x_ns;
	s->n++;
	dx = x_ns - s->x;
	dy = y_ns - s->y;
	s->x += dx / s->n;
	s->y += dy / s->n;
	s->xx += dx * (x_ns - s->x);
	s->xy += dx * (y_ns - s->y);
	return squares_at(s, sample->seq);
}

struct line {
	struct incise_timeline timeline;
	int n;
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
};

static void start_with_grain(struct line *line, int64_t grain_ns)
{
	incise_timeline_init(&line->timeline,
			     &(struct incise_timeline_setup){.rate_hz = RATE_HZ,
							     .delay_ns = DELAY_NS,
							     .grain_ns = grain_ns});
}

static void line_start(void *state, const struct stream *stream)
{
	start_with_grain(state, stream->grain_ns);
}

static void untold_start(void *state, const struct stream *stream)
{
	(void)stream;
	start_with_grain(state, 0);
}

static double line_take(void *state, const struct sample *sample)
{
	struct line *line = state;

	return (double)incise_timeline_sample(&line->timeline, sample->seq,
					      sample->arrival_ns);
}

static double line_live_sd(const void *state, uint64_t seq)
{
	const struct line *line = state;
	struct incise_timeline_report report;

	(void)seq;
	incise_timeline_report(&line->timeline, &report);
	return report.offset_sd_ns;
}

static void line_finish(void *state)
{
	struct line *line = state;

	line->n = incise_timeline_knots(&line->timeline, line->knots);
}

static double line_at(const void *state, uint64_t seq)
{
	const struct line *line = state;

	return line->n ? (double)incise_timeline_at(line->knots, line->n, seq) : NAN;
}

static double line_final_sd(const void *state, uint64_t seq)
{
	const struct line *line = state;

	return line->n ? incise_timeline_sd(line->knots, line->n, seq) : NAN;
}

#define SQUARES sizeof(struct squares)
#define LINE sizeof(struct line)
#define METHODS 8
static const struct method methods[METHODS] = {
	{"arrival", 0, NULL, arrival_take, NULL, NULL, NULL},
	{"lowest", sizeof(struct lowest), NULL, lowest_take, NULL, NULL, NULL},
	{"squares", SQUARES, NULL, squares_take, NULL, NULL, NULL},
	{"squares_known", SQUARES, squares_start, squares_take, NULL, NULL, NULL},
	{"squares_final", SQUARES, squares_start, squares_take, squares_at, NULL, NULL},
	{"line_live", LINE, line_start, line_take, NULL, NULL, line_live_sd},
	{"line_untold", LINE, untold_start, line_take, NULL, NULL, line_live_sd},
	{"line_final", LINE, line_start, line_take, line_at, line_finish, line_final_sd},
};

static void *state_of(const struct method *method, const struct stream *stream)
{
	void *state = cli_alloc(1, method->bytes);

	if (method->start)
		method->start(state, stream);
	return state;
}

/* --- measurement --- */

/* Rows of a window stand together, a row per method. */
struct row {
	const char *name, *late;
	double drift_ppm, window_s;
	double rms_us, p99_us, max_us, mean_us;
	double stated_us, within; /* uncertainty, share of truth within twice it */
	struct harness_time time; /* of a sample */
	char failed[160];
};

static struct row rows[N(lateness_names) * N(drifts_ppm) * N(windows_s) * METHODS];
static struct harness_time times[N(windows_s)][METHODS];

static int streams_of(bool quick, double window_s)
{
	return quick ? (int)fmax(QUICK_STREAMS, QUICK_STREAMS_S / window_s)
		     : (int)fmax(STREAMS, STREAMS_S / window_s);
}

/* Errors of a method over some streams, ns. */
struct errors {
	double *error;
	int n;
	double sum, sum2;
	double asked, within, stated2;
};

/* The error of a sample's time; one in some with its stated uncertainty. */
static void add_error(struct errors *e, const struct method *method, const void *state,
		      const struct stream *stream, int k, double t_ns)
{
	double error = t_ns - stream->sample[k].taken_ns, sd;

	e->error[e->n++] = fabs(error);
	e->sum += error;
	e->sum2 += error * error;
	if (!method->sd_ns || k % ASK_EVERY)
		return;
	sd = method->sd_ns(state, stream->sample[k].seq);
	e->asked++;
	e->within += fabs(error) <= 2 * sd;
	e->stated2 += sd * sd;
}

static void follow(const struct method *method, const struct stream *stream,
		   struct errors *e)
{
	void *state = state_of(method, stream);

	for (int k = 0; k < stream->n; k++) {
		double t_ns = method->take(state, &stream->sample[k]);

		if (!method->afterwards && k >= stream->n - stream->n / 4)
			add_error(e, method, state, stream, k, t_ns);
	}
	if (method->finish)
		method->finish(state);
	for (int k = 0; method->afterwards && k < stream->n; k++)
		add_error(e, method, state, stream, k,
			  method->afterwards(state, stream->sample[k].seq));
	free(state);
}

static void set_errors(struct row *row, struct errors *e)
{
	stopwatch_sort(e->error, e->n);
	row->rms_us = sqrt(e->sum2 / e->n) * 1e-3;
	row->mean_us = e->sum / e->n * 1e-3;
	row->p99_us = stopwatch_quantile(e->error, e->n, 0.99) * 1e-3;
	row->max_us = e->error[e->n - 1] * 1e-3;
	row->within = e->asked > 0 ? e->within / e->asked : NAN;
	row->stated_us = e->asked > 0 ? sqrt(e->stated2 / e->asked) * 1e-3 : NAN;
	free(e->error);
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
static void measure(bool quick, enum lateness lateness, double drift_ppm, int window,
		    struct row *row)
{
	double window_s = windows_s[window];
	int streams = streams_of(quick, window_s);
	int most = (int)(streams * window_s * RATE_HZ);
	uint64_t seed = 1 + 1000 * (uint64_t)((row - rows) / METHODS);
	struct errors errors[METHODS] = {{0}};

	for (int i = 0; i < METHODS; i++)
		errors[i].error = cli_alloc(most, sizeof(*errors[i].error));
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
				      .window_s = window_s,
				      .time = times[window][i]};
		set_errors(&row[i], &errors[i]);
		judge(&row[i], row->rms_us, streams);
	}
}

struct timed {
	const struct method *method;
	const struct stream *stream;
	double sum;
};

static void run_timed(void *context)
{
	struct timed *timed = context;
	const struct stream *stream = timed->stream;
	const struct method *method = timed->method;
	void *state = state_of(method, stream);

	for (int k = 0; k < stream->n; k++)
		timed->sum += method->take(state, &stream->sample[k]);
	if (method->finish)
		method->finish(state);
	for (int k = 0; method->afterwards && k < stream->n; k++)
		timed->sum += method->afterwards(state, stream->sample[k].seq);
	free(state);
}

static void measure_times(int repeats)
{
	struct harness_variant variants[N(windows_s) * METHODS];
	struct timed timed[N(variants)];
	struct stream streams[N(windows_s)];

	for (int w = 0; w < N(windows_s); w++)
		streams[w] = stream_begin(UNIFORM, 200, windows_s[w], 1);
	for (int i = 0; i < N(variants); i++) {
		const struct stream *stream = &streams[i / METHODS];

		timed[i] = (struct timed){&methods[i % METHODS], stream, 0};
		variants[i] = (struct harness_variant){
			.run = run_timed,
			.context = &timed[i],
			.units = stream->n,
			.time = &times[i / METHODS][i % METHODS],
		};
	}
	harness_times(variants, N(variants), repeats);
	for (int w = 0; w < N(windows_s); w++)
		free(streams[w].sample);
}

/* --- report --- */

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name), COLUMN(row, "late", late),
		    COLUMN(row, "window_s", window_s),
		    COLUMN(row, "drift_ppm", drift_ppm),
		    COLUMN(row, "rms_error_us", rms_us),
		    COLUMN(row, "p99_error_us", p99_us),
		    COLUMN(row, "max_error_us", max_us),
		    COLUMN(row, "mean_error_us", mean_us),
		    COLUMN(row, "stated_us", stated_us),
		    COLUMN(row, "within_2sd", within),
		    COLUMN(row, "ns_per_sample", time.ns.median),
		    COLUMN(row, "ns_p5", time.ns.p5), COLUMN(row, "ns_p95", time.ns.p95),
		    COLUMN(row, "failed", failed)},
	.metrics = {METRIC(EXACT, row, rms_us, "us",
			   "{name}, {late}, {drift_ppm:%+g} ppm, {window_s} s, rms",
			   "window_s=1|30"),
		    METRIC(TIME, row, time, "ns", "{name}, {window_s} s",
			   "late=uniform,drift_ppm=-200")},
};

static void run(struct bench_run *run)
{
	int repeats = run->quick ? QUICK_REPEATS : REPEATS, i = 0;

	measure_times(repeats);
	for (int late = 0; late < N(lateness_names); late++)
		for (int d = 0; d < N(drifts_ppm); d++)
			for (int w = 0; w < N(windows_s); w++, i += METHODS) {
				cli_progress("%s, %g ppm, %g s", lateness_names[late],
					     drifts_ppm[d], windows_s[w]);
				measure(run->quick, (enum lateness)late, drifts_ppm[d], w,
					&rows[i]);
			}
	cli_progress_end();
	bench_values(run, "{si sf si si}", "rate_hz", RATE_HZ, "lost", LOST, "streams",
		     streams_of(run->quick, 120), "repeats", repeats);
	bench_rows(run, &rows_table, rows, N(rows));
}

const struct bench bench_program = {
	.name = "timeline",
	.summary = "error of reconstructed timestamps over window and run\n"
		   "time",
	.run = run,
};
