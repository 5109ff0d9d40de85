// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error of times over window and cost; see bench_timeline.h.
 *
 *   window    ├───────────────────────────────────┤ 1 … 120 s, from the first sample on
 *   live                               ├──────────┤ times given at arrival: the last quarter
 *   final     ├───────────────────────────────────┤ times given afterwards: all of it
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "bench_timeline.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"
#include "../cli/stopwatch.h"
#include "timeline_picture.h"

static const double windows_s[] = {1, 2, 5, 10, 30, 60, 120};
#define WINDOWS (int)(sizeof(windows_s) / sizeof(*windows_s))

static const double drifts_ppm[] = {-200, 0, 200};
#define DRIFTS (int)(sizeof(drifts_ppm) / sizeof(*drifts_ppm))

/* Streams of each window: so many at least, and so many seconds together. */
#define STREAMS 20
#define STREAMS_S 240
#define QUICK_STREAMS 4
#define QUICK_STREAMS_S 24

/* Of all samples one in so many is asked how sure it is. */
#define ASK_EVERY 16

/* Of the truth that shall be within twice the stated uncertainty, were it normal. */
#define WITHIN 0.9545

#define REPEATS 51
#define QUICK_REPEATS 5

struct bench {
	struct timeline_table table;
	struct harness_time times[WINDOWS][TIME_METHODS];
	struct machine machine;
	int repeats;
	bool quick;
};

static int streams_of(const struct bench *b, double window_s)
{
	int least = b->quick ? QUICK_STREAMS : STREAMS;
	double seconds = b->quick ? QUICK_STREAMS_S : STREAMS_S;

	return (int)fmax(least, seconds / window_s);
}

/* Errors of a method over some streams, ns. */
struct errors {
	double *error;
	int n;
	double sum, sum2;
	double asked, within, stated2;
};

static void add_error(struct errors *e, double error)
{
	e->error[e->n++] = fabs(error);
	e->sum += error;
	e->sum2 += error * error;
}

static void ask(struct errors *e, double error, double sd)
{
	e->asked++;
	e->within += fabs(error) <= 2 * sd;
	e->stated2 += sd * sd;
}

static void follow(const struct time_method *method, const struct drifting_stream *stream,
		   struct errors *e)
{
	void *state = method->begin(stream);

	for (int k = 0; k < stream->n; k++) {
		double t_ns = method->take(state, stream->seq[k], stream->arrival_ns[k]);

		if (method->afterwards || k < stream->n - stream->n / 4)
			continue;
		add_error(e, t_ns - stream->taken_ns[k]);
		if (method->sd_ns && k % ASK_EVERY == 0)
			ask(e, t_ns - stream->taken_ns[k],
			    method->sd_ns(state, stream->seq[k]));
	}
	if (method->finish)
		method->finish(state);
	for (int k = 0; method->afterwards && k < stream->n; k++) {
		double error =
			method->afterwards(state, stream->seq[k]) - stream->taken_ns[k];

		add_error(e, error);
		if (method->sd_ns && k % ASK_EVERY == 0)
			ask(e, error, method->sd_ns(state, stream->seq[k]));
	}
	method->end(state);
}

static void finish(struct errors *e, struct timeline_row *row)
{
	stopwatch_sort(e->error, e->n);
	row->rms_us = sqrt(e->sum2 / e->n) * 1e-3;
	row->mean_us = e->sum / e->n * 1e-3;
	row->p99_us = stopwatch_quantile(e->error, e->n, 0.99) * 1e-3;
	row->max_us = e->error[e->n - 1] * 1e-3;
	row->within = row->stated_us = NAN;
	if (e->asked > 0) {
		row->within = e->within / e->asked;
		row->stated_us = sqrt(e->stated2 / e->asked) * 1e-3;
	}
}

/*
 * Samples of a stream are off together: chance is that of so many streams, and three of its
 * deviations are allowed.
 */
static void judge(struct timeline_row *row, double arrival_us, int streams)
{
	double least = WITHIN - 3 * sqrt(WITHIN * (1 - WITHIN) / streams);

	if (!isfinite(row->rms_us))
		snprintf(row->failed, sizeof(row->failed), "a time is not a number");
	else if (row->rms_us > arrival_us)
		snprintf(
			row->failed, sizeof(row->failed),
			"worse than arrivals as they are: off by %.3g us, where these are "
			"by %.3g us",
			row->rms_us, arrival_us);
	else if (row->within < least)
		snprintf(row->failed, sizeof(row->failed),
			 "surer than it may be: %.1f %% of the truth is within twice the "
			 "uncertainty that it states",
			 row->within * 100);
}

/* Append a row per method. */
static void measure(struct bench *b, enum lateness_kind late, double drift_ppm,
		    int window)
{
	struct timeline_row *rows = &b->table.row[b->table.n];
	int streams = streams_of(b, windows_s[window]);
	int most = (int)(streams * windows_s[window] * STREAM_HZ);
	struct errors errors[TIME_METHODS] = {{0}};

	for (int i = 0; i < TIME_METHODS; i++) {
		errors[i].error = calloc(most + 1, sizeof(*errors[i].error));
		if (!errors[i].error)
			cli_fail("no memory");
	}
	for (int k = 0; k < streams; k++) {
		struct drifting_stream stream;

		drifting_stream_begin(
			&stream, late, drift_ppm, windows_s[window],
			(uint64_t)(1 + k + 1000 * (b->table.n / TIME_METHODS)));
		for (int i = 0; i < TIME_METHODS; i++)
			follow(&time_methods[i], &stream, &errors[i]);
		drifting_stream_end(&stream);
	}
	for (int i = 0; i < TIME_METHODS; i++) {
		rows[i] = (struct timeline_row){
			.name = time_methods[i].name,
			.late = late,
			.drift_ppm = drift_ppm,
			.window_s = windows_s[window],
			.time = b->times[window][i],
		};
		finish(&errors[i], &rows[i]);
		judge(&rows[i], rows[TIME_METHOD_ARRIVAL].rms_us, streams);
		free(errors[i].error);
	}
	b->table.n += TIME_METHODS;
}

static void measure_rows(struct bench *b)
{
	b->table = (struct timeline_table){
		.row = calloc((size_t)LATE_KINDS * DRIFTS * WINDOWS * TIME_METHODS,
			      sizeof(*b->table.row)),
		.windows = WINDOWS,
		.drifts = DRIFTS,
	};
	if (!b->table.row)
		cli_fail("no memory");
	for (int i = 0; i < LATE_KINDS * DRIFTS * WINDOWS && !cli_stop; i++) {
		enum lateness_kind late = i / WINDOWS / DRIFTS;
		double drift_ppm = drifts_ppm[i / WINDOWS % DRIFTS];

		cli_progress("%s, %g ppm, %g s", lateness_kinds[late], drift_ppm,
			     windows_s[i % WINDOWS]);
		measure(b, late, drift_ppm, i % WINDOWS);
	}
	cli_progress_end();
}

/* ---- cost ---- */

struct timed {
	const struct time_method *method;
	const struct drifting_stream *stream;
	double sum;
};

static void run_timed(void *context)
{
	struct timed *timed = context;
	const struct drifting_stream *stream = timed->stream;
	void *state = timed->method->begin(stream);

	for (int k = 0; k < stream->n; k++)
		timed->sum +=
			timed->method->take(state, stream->seq[k], stream->arrival_ns[k]);
	if (timed->method->finish)
		timed->method->finish(state);
	for (int k = 0; timed->method->afterwards && k < stream->n; k++)
		timed->sum += timed->method->afterwards(state, stream->seq[k]);
	timed->method->end(state);
}

static void measure_times(struct bench *b)
{
	struct harness_variant ways[WINDOWS * TIME_METHODS];
	struct timed timed[WINDOWS * TIME_METHODS];
	struct drifting_stream streams[WINDOWS];

	for (int w = 0; w < WINDOWS; w++)
		drifting_stream_begin(&streams[w], LATE_UNIFORM, 200, windows_s[w], 1);
	for (int i = 0; i < WINDOWS * TIME_METHODS; i++) {
		const struct drifting_stream *stream = &streams[i / TIME_METHODS];

		timed[i] = (struct timed){&time_methods[i % TIME_METHODS], stream, 0};
		ways[i] = (struct harness_variant){
			.run = run_timed, .context = &timed[i], .units = stream->n};
	}
	harness_times(ways, WINDOWS * TIME_METHODS, b->repeats, b->times[0]);
	for (int w = 0; w < WINDOWS; w++)
		drifting_stream_end(&streams[w]);
}

/* ---- report ---- */

/* A lateness and a drift: a line per method, columns per window. */
static void print_block(const struct timeline_row *block)
{
	const struct timeline_row *last = &block[(WINDOWS - 1) * TIME_METHODS];

	printf("\n%s lateness, %+g ppm\n%-16s", lateness_kinds[block->late],
	       block->drift_ppm, "rms / us after");
	for (int w = 0; w < WINDOWS; w++)
		printf(" %7g s ", windows_s[w]);
	printf(" at the last: 99 %%  largest   stated  within 2 %8s\n", "ns");
	for (int i = 0; i < TIME_METHODS; i++) {
		printf("%-16s", block[i].name);
		for (int w = 0; w < WINDOWS; w++)
			printf(" %8.1f%c", block[w * TIME_METHODS + i].rms_us,
			       *block[w * TIME_METHODS + i].failed ? '*' : ' ');
		printf("        %9.1f %8.1f ", last[i].p99_us, last[i].max_us);
		if (isnan(last[i].within))
			printf("%8s %9s", "-", "-");
		else
			printf("%8.1f %7.1f %%", last[i].stated_us, last[i].within * 100);
		printf(" %8.1f\n", last[i].time.ns.median);
	}
}

static void print_report(const struct bench *b)
{
	const struct machine *m = &b->machine;
	int block = WINDOWS * TIME_METHODS;

	printf("%d Hz, up to %d ms late, %g %% lost; %d streams or more of each; times of %d "
	       "runs in turn\n%s; %s; %s\n",
	       STREAM_HZ, STREAM_LATE_MS, STREAM_LOST * 100, streams_of(b, 120),
	       b->repeats, m->cpu, m->kernel, m->compiler);
	for (int i = 0; i + block <= b->table.n; i += block)
		print_block(&b->table.row[i]);
	putchar('\n');
	for (int i = 0; i < b->table.n; i++) {
		const struct timeline_row *row = &b->table.row[i];

		if (*row->failed)
			printf("* %s, %s, %+g ppm, %g s: %s\n", row->name,
			       lateness_kinds[row->late], row->drift_ppm, row->window_s,
			       row->failed);
	}
}

static json_t *row_json(const struct timeline_row *row)
{
	return json_pack("{ss ss so so so so so so so so so so so so}", "name", row->name,
			 "late", lateness_kinds[row->late], "window_s",
			 json_number(row->window_s), "drift_ppm",
			 json_number(row->drift_ppm), "rms_us", json_number(row->rms_us),
			 "p99_us", json_number(row->p99_us), "max_us",
			 json_number(row->max_us), "mean_us", json_number(row->mean_us),
			 "stated_us", json_number(row->stated_us), "within_2sd",
			 json_number(row->within), "ns_per_sample",
			 json_number(row->time.ns.median), "ns_p5",
			 json_number(row->time.ns.p5), "ns_p95",
			 json_number(row->time.ns.p95), "failed",
			 *row->failed ? json_text(row->failed) : json_null());
}

static void print_json(const struct bench *b)
{
	json_t *rows = json_array(), *figures = json_array();

	for (int i = 0; i < b->table.n; i++) {
		const struct timeline_row *row = &b->table.row[i];

		json_array_append_new(rows, row_json(row));
		if (row->window_s == 1 || row->window_s == 30)
			metrics_exact(figures, row->rms_us, "us",
				      "%s, %s, %+g ppm, %g s, rms", row->name,
				      lateness_kinds[row->late], row->drift_ppm,
				      row->window_s);
	}
	for (int w = 0; w < WINDOWS; w++)
		for (int i = 0; i < TIME_METHODS; i++)
			metrics_time(figures, &b->times[w][i], "ns", "%s, %g s",
				     time_methods[i].name, windows_s[w]);
	json_print(json_pack("{so sb si sf si si so so}", "machine",
			     machine_json(&b->machine), "quick", b->quick, "rate_hz",
			     STREAM_HZ, "lost", STREAM_LOST, "streams",
			     streams_of(b, 120), "repeats", b->repeats, "rows", rows,
			     "figures", figures));
}

void bench_timeline(bool json, bool quick, const char *plot)
{
	struct bench *b = calloc(1, sizeof(*b));
	const char *folder, *name;

	if (!b)
		cli_fail("no memory");
	if (plot)
		plot_place("plot", plot, &folder, &name);
	b->quick = quick;
	b->repeats = quick ? QUICK_REPEATS : REPEATS;
	machine_init(&b->machine);
	measure_times(b);
	measure_rows(b);
	if (json)
		print_json(b);
	else
		print_report(b);
	cli_finish();
	if (plot) {
		timeline_picture_cost(&b->table, folder, name);
		timeline_picture_windows(&b->table, folder, name);
	}
	free(b->table.row);
	free(b);
}
