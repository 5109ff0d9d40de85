// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Times of a recorded FASTRAK compared with the truth, from its bytes to the rows of the
 * recording, for records that are lost, held up by the host, paced from outside, or too many.
 * Everything is drawn from a seed, on a simulated clock.
 *
 *     measured ── 8 ms ──► at the host ── up to some ms, or while the host stalls ──► read
 *
 * The invariant: the time of a row differs from the truth by no more than K times its stated
 * standard uncertainty. K is 4: the largest error of an even distribution is √12 = 3.5
 * standard deviations, and of a normal one 4 are exceeded once in 16000.
 */
#include "../unit.h"
#include "recorded.h"
#include <incise/backend.h>
#include <incise/verify.h>
#include "../../../lib/base/random.h"
#include "../../../lib/device/polhemus/polhemus_stream.h"
#include "../../../lib/record/read/rows.h"
#include "../cases.h"

#define K 4
#define S 1000000000LL
#define LATENCY_NS (8 * MS)
#define RECORDS_MAX 8000
#define SPANS_MAX 8
#define SEEDS 60
#define SEEDS_FULL 200 /* with CASES=all */

struct span {
	int64_t from_ns, to_ns; /* after the first record */
};

/* Random in all that is not set. */
struct scenario {
	double hz;		       /* of the device; 120 is expected of it */
	bool external;		       /* paced by pulses from outside */
	double to_hz;		       /* from the middle on; 0: the same */
	double ppm;		       /* by which its clock is fast */
	double jitter_ms;	       /* mean of the exponential lateness of the host */
	double grid_ms;		       /* arrivals are on a grid; 0: are not */
	double wobble;		       /* of the pulses from outside, in periods */
	struct span mutes[SPANS_MAX];  /* records in them are lost, without a trace */
	struct span stalls[SPANS_MAX]; /* the host reads nothing */
	struct span pauses[SPANS_MAX]; /* no pulses come: nothing is measured */
	double seconds;
};

static struct {
	int64_t truth_ns[RECORDS_MAX], read_ns[RECORDS_MAX];
	bool lost[RECORDS_MAX];
	int n, next;
	bool external;
	int64_t grid_ns;
	const struct span *stalls;
	int64_t start_ns;
	struct polhemus_stream stream;
	const struct incise_tracker_ops *real;
	uint64_t random;
} device;

/* Of 0 to 1. */
static double draw(void)
{
	return (double)(incise_random_next(&device.random) >> 11) * 0x1p-53;
}

static const struct span *within(const struct span *spans, int64_t t_ns)
{
	for (int i = 0; i < SPANS_MAX; i++)
		if (t_ns >= spans[i].from_ns && t_ns < spans[i].to_ns)
			return &spans[i];
	return NULL;
}

/* All records of the scenario: when they are measured, and when the host reads them. */
static void plan(const struct scenario *s, int64_t start_ns)
{
	double t_ns = 0, end_ns = s->seconds * 1e9;
	int64_t last_ns = 0;

	device.n = device.next = 0;
	device.external = s->external;
	device.grid_ns = (int64_t)(s->grid_ms * 1e6);
	device.stalls = s->stalls;
	device.start_ns = start_ns;
	while (t_ns < end_ns && device.n < RECORDS_MAX) {
		double hz = s->to_hz > 0 && t_ns > end_ns / 2 ? s->to_hz : s->hz;
		int64_t own_ns = (int64_t)(t_ns + s->wobble * draw() * 1e9 / hz), at_ns;
		const struct span *stall;
		int i = device.n;

		t_ns += 1e9 / hz / (1 + s->ppm * 1e-6);
		if (within(s->pauses, own_ns))
			continue;
		device.n++;
		device.truth_ns[i] = start_ns + own_ns;
		device.lost[i] = within(s->mutes, own_ns) != NULL;
		at_ns = own_ns + LATENCY_NS;
		if (s->grid_ms > 0)
			at_ns = (int64_t)(ceil((double)at_ns / (s->grid_ms * 1e6)) *
					  s->grid_ms * 1e6);
		at_ns += (int64_t)(-log(1 - draw()) * s->jitter_ms * 1e6);
		stall = within(s->stalls, at_ns);
		if (stall)
			at_ns = stall->to_ns;
		if (at_ns < last_ns)
			at_ns = last_ns;
		last_ns = at_ns;
		device.read_ns[i] = start_ns + at_ns;
	}
}

/* Its number is in its position, in steps of 0.125 cm, which a float holds. */
static size_t record_of(int i, unsigned char *bytes)
{
	const float values[7] = {
		(float)(i % 1000) * 0.125F, (float)(i / 1000) * 0.125F, 0, 1, 0, 0, 0};

	memcpy(bytes, "01 ", 3);
	memcpy(bytes + 3, values, sizeof(values));
	memcpy(bytes + 31, " \r\n", 3);
	bytes[31] = '0';
	return 34;
}

static int number_of(const double position_mm[3])
{
	return (int)lround(position_mm[0] / 1.25) +
	       1000 * (int)lround(position_mm[1] / 1.25);
}

/* The host's reads up to @now_ns. */
static void advance(int64_t now_ns)
{
	while (device.next < device.n && device.read_ns[device.next] <= now_ns) {
		unsigned char bytes[34 * 200];
		int64_t t_ns = device.read_ns[device.next];
		size_t n = 0;

		for (; device.next < device.n && device.read_ns[device.next] == t_ns &&
		       n + 34 <= sizeof(bytes);
		     device.next++)
			if (!device.lost[device.next])
				n += record_of(device.next, bytes + n);
		if (n)
			polhemus_stream_put(&device.stream, bytes, n, t_ns);
	}
}

static struct incise_clock *the_clock;

static int read_device(struct incise_tracker *tracker,
		       struct incise_tracker_sample *samples, int n)
{
	advance(incise_clock_now(the_clock));
	return incise_ring_take(&device.stream.ring, samples, n);
}

static void info_of_device(const struct incise_tracker *tracker,
			   struct incise_tracker_info *info)
{
	*info = (struct incise_tracker_info){
		.name = "FASTRAK",
		.rate_hz = 120,
		.latency_ns = LATENCY_NS,
		.stations = 1,
		.external_sync = device.external,
		.grain_ns = device.grid_ns,
	};
}

static uint64_t lost_by_device(const struct incise_tracker *tracker)
{
	return polhemus_stream_lost(&device.stream);
}

static void close_device(struct incise_tracker *tracker)
{
	tracker->ops = device.real;
	tracker->ops->close(tracker);
}

static const struct incise_tracker_ops device_ops = {
	.read = read_device,
	.info = info_of_device,
	.lost = lost_by_device,
	.close = close_device,
};

/* Record the scenario as a.rec. */
static void capture(const struct scenario *s)
{
	struct incise_rig *rig = open_rig("sim:clock=simulated,force_hz=100");
	struct incise_tracker *tracker = incise_rig_tracker(rig);
	const struct polhemus_layout layout = {
		.family = POLHEMUS_FASTRAK, .stations = 1, .switch_bytes = 1};
	const struct incise_tracker_setup setup = {
		.n_stations = 1,
		.stations = {1},
		.hemisphere = {1, 0, 0},
		.sync = s->external ? INCISE_TRACKER_EXTERNAL : INCISE_TRACKER_INTERNAL,
	};
	struct incise_recorder *recorder;

	the_clock = incise_rig_clock(rig);
	plan(s, incise_clock_now(the_clock) + 100 * MS);
	assert_int_equal(polhemus_stream_init(&device.stream, &setup, &layout), 0);
	polhemus_gaps_start(&device.stream.gaps, incise_clock_now(the_clock));
	device.real = tracker->ops;
	tracker->ops = &device_ops;
	recorder = start_recorder("a.rec", rig);
	succeeds(!poll_for(recorder, rig, (int64_t)((s->seconds + 0.3) * 1e9), &err) &&
		 !incise_recorder_close(recorder, &err));
	incise_rig_close(rig);
	polhemus_stream_free(&device.stream);
}

struct errors {
	int rows, beyond; /* rows beyond K times their uncertainty */
	double worst_ms;
	double worst_ratio; /* error by uncertainty */
	int worst_at;
	double trusted; /* share of rows with an uncertainty below 5 ms */
};

static void measure(struct errors *out)
{
	struct incise_recording *recording = incise_recording_open("a.rec", &err);
	struct incise_rows rows;
	int rc;

	*out = (struct errors){0};
	succeeds(recording &&
		 !incise_rows_open(&rows, recording, "tracker", "seq, t_ns, x_mm, y_mm",
				   recording->meta.tracker, &err));
	while ((rc = incise_rows_next(&rows, &err)) > 0) {
		double position_mm[3] = {incise_rows_real(&rows, 2),
					 incise_rows_real(&rows, 3)};
		int i = number_of(position_mm);
		double error_ms = fabs((double)(rows.t_ns - device.truth_ns[i])) * 1e-6;
		double sd_ms =
			1e3 * incise_row_times_sd(&rows.times, incise_rows_seq(&rows));

		assert_true(i >= 0 && i < device.n && !device.lost[i]);
		out->rows++;
		/* Times are whole ns. */
		out->beyond += error_ms > K * sd_ms + 2e-6;
		out->trusted += sd_ms < 5;
		out->worst_ms = fmax(out->worst_ms, error_ms);
		if (sd_ms > 0 && error_ms / sd_ms > out->worst_ratio) {
			out->worst_ratio = error_ms / sd_ms;
			out->worst_at = i;
		}
	}
	succeeds(!rc);
	out->trusted /= out->rows;
	incise_rows_close(&rows);
	incise_recording_close(recording);
}

static void run(const struct scenario *s, struct errors *out)
{
	capture(s);
	measure(out);
}

/* --- what was found --------------------------------------------------------------------- */

/* What a scenario must come to: the invariant, and no error beyond @worst_ms. */
static void hold(const struct scenario *s, double worst_ms, const char *name)
{
	struct errors errors;

	run(s, &errors);
	print_message("%s: %d rows, %.2f ms wrong at most, %.2f times what is stated (at "
		      "%d), %.4f known to 5 ms\n",
		      name, errors.rows, errors.worst_ms, errors.worst_ratio,
		      errors.worst_at, errors.trusted);
	if (errors.worst_ms > worst_ms || errors.beyond)
		fail_msg(
			"%s: %.1f ms wrong, %d of %d rows beyond %d times what they state",
			name, errors.worst_ms, errors.beyond, errors.rows, K);
	assert_int_equal(system("rm -r a.rec"), 0);
}

/* 0.5 s of poses were as early as the loss was long. */
TEST(losses_that_time_shows, IN_FOLDER)
{
	static const int64_t lengths_ms[] = {8, 17, 25, 42, 100, 300, 700, 950};
	char name[40];

	for (size_t i = 0; i < 8; i++) {
		struct scenario s = {
			.hz = 120,
			.ppm = 40,
			.jitter_ms = 0.2,
			.mutes = {{1996 * MS, (1996 + lengths_ms[i]) * MS}},
			.seconds = 5,
		};

		snprintf(name, sizeof(name), "mute for %d ms", (int)lengths_ms[i]);
		/* A few rows until it is counted may as well be late. */
		hold(&s, (double)lengths_ms[i] + 1, name);
		/* Nothing counts it before the end. */
		s.seconds = (double)s.mutes[0].to_ns * 1e-9 + 0.4;
		snprintf(name, sizeof(name), "mute for %d ms, and the end",
			 (int)lengths_ms[i]);
		hold(&s, (double)lengths_ms[i] + 1, name);
	}
}

TEST(stalls_of_the_host, IN_FOLDER)
{
	static const int64_t lengths_ms[] = {5, 12, 30, 200, 1200};
	char name[40];

	for (size_t i = 0; i < 5; i++)
		for (int external = 0; external < 2; external++) {
			struct scenario s = {
				.hz = external ? 60 : 120,
				.external = external,
				.ppm = -30,
				.jitter_ms = 0.2,
				.stalls = {{2 * S, 2 * S + lengths_ms[i] * MS}},
				.seconds = 5,
			};

			snprintf(name, sizeof(name), "stall of %d ms%s",
				 (int)lengths_ms[i], external ? ", external" : "");
			hold(&s, external ? 30 : 3, name);
		}
}

/* A rate that was not configured ends the tracker's stream at its start; later it is an event. */
TEST(other_rates_are_named, IN_FOLDER)
{
	static const struct {
		struct scenario s;
		int ended, events;
	} cases[] = {
		{{.hz = 240, .jitter_ms = 0.2, .seconds = 3}, 1, 0},
		{{.hz = 60, .jitter_ms = 0.2, .seconds = 6}, 1, 0},
		{{.hz = 150, .jitter_ms = 0.2, .seconds = 6}, 1, 0},
		{{.hz = 100, .jitter_ms = 0.2, .seconds = 6}, 1, 0},
		{{.hz = 120, .to_hz = 240, .jitter_ms = 0.2, .seconds = 6}, 0, 1},
		{{.hz = 120, .to_hz = 60, .jitter_ms = 0.2, .seconds = 10}, 0, 1},
		/* and these are right, whatever the host does */
		{{.hz = 120, .jitter_ms = 1.5, .grid_ms = 1, .seconds = 6}, 0, 0},
		{{.hz = 60, .external = true, .jitter_ms = 0.2, .seconds = 6}, 0, 0},
		{{.hz = 120,
		  .jitter_ms = 0.2,
		  .mutes = {{S, 2 * S}, {2500 * MS, 2600 * MS}},
		  .stalls = {{0, 900 * MS}, {3 * S, 4 * S}},
		  .seconds = 6},
		 0,
		 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double ended, events;

		capture(&cases[i].s);
		ended = ask("a.rec/recording.db",
			    "SELECT count(*) FROM streams WHERE name = 'tracker' AND "
			    "ended LIKE '%records/s instead of 120%'");
		events = ask("a.rec/recording.db",
			     "SELECT count(*) FROM events WHERE kind = 'rate'");
		if (ended != cases[i].ended || events != cases[i].events)
			fail_msg("case %zu: ended %g, %g events", i, ended, events);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

/* What verify finds about times: rows of which it says so. */
static void count_times(void *user, const struct incise_verify_finding *finding)
{
	if (finding->kind == INCISE_VERIFY_TIMES) {
		assert_true(finding->last_seq >= finding->first_seq);
		*(uint64_t *)user += finding->count;
	}
}

/* A recording of a rate that was not configured is none that is complete; all others are. */
TEST(verify_says_so, IN_FOLDER)
{
	static const struct {
		struct scenario s;
		bool complete;
		int least, most; /* rows */
	} cases[] = {
		{{.hz = 120, .jitter_ms = 0.2, .seconds = 4}, true, 0, 0},
		{{.hz = 60, .external = true, .jitter_ms = 0.2, .seconds = 4},
		 true,
		 0,
		 0},
		{{.hz = 120,
		  .jitter_ms = 0.2,
		  .stalls = {{2 * S, 2300 * MS}},
		  .seconds = 4},
		 true,
		 0,
		 0},
		/* counted at once */
		{{.hz = 120,
		  .jitter_ms = 0.2,
		  .mutes = {{2 * S, 2700 * MS}},
		  .seconds = 4},
		 false,
		 0,
		 0},
		/* one of a host that looks each 19 ms, which is counted some windows later */
		{{.hz = 120,
		  .grid_ms = 19,
		  .mutes = {{4996 * MS, 5004 * MS}},
		  .seconds = 8},
		 false,
		 30,
		 240},
		{{.hz = 240, .jitter_ms = 0.2, .seconds = 4}, false, 200, 300},
		{{.hz = 120, .to_hz = 240, .jitter_ms = 0.2, .seconds = 4},
		 false,
		 450,
		 720},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_verify_report report;
		uint64_t rows = 0;
		struct incise_verify_watch watch = {.found = count_times, .user = &rows};

		capture(&cases[i].s);
		succeeds(!incise_verify("a.rec", &watch, &report, &err));
		if (report.complete != cases[i].complete || !report.intact ||
		    (int)rows < cases[i].least || (int)rows > cases[i].most)
			fail_msg("case %zu: %d rows, complete %d", i, (int)rows,
				 report.complete);
		assert_int_equal(system("rm -r a.rec"), 0);
	}
}

TEST(another_rate, IN_FOLDER)
{
	static const struct {
		struct scenario s;
		const char *name;
	} cases[] = {
		/* 60 Hz where the device can do 120: t_ns was up to 3.27 s wrong. */
		{{.hz = 60, .external = true, .jitter_ms = 0.3, .seconds = 6}, "pulses"},
		/* Everything after the pause was 1.2 s wrong. */
		{{.hz = 100,
		  .external = true,
		  .jitter_ms = 0.3,
		  .pauses = {{2 * S, 3200 * MS}},
		  .seconds = 6},
		 "pulses that pause"},
		{{.hz = 240, .jitter_ms = 0.2, .seconds = 5}, "240 Hz"},
		{{.hz = 60, .jitter_ms = 0.2, .seconds = 5}, "60 Hz"},
		{{.hz = 120, .to_hz = 240, .jitter_ms = 0.2, .seconds = 8}, "120 to 240"},
		{{.hz = 120, .to_hz = 60, .jitter_ms = 0.2, .seconds = 8},
		 "120 to 60 Hz"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		hold(&cases[i].s, 5, cases[i].name);
}

/* --- any of it ---------------------------------------------------------------------------- */

static double between(double a, double b)
{
	return a + (b - a) * draw();
}

/* Up to @most spans of up to @longest_s, mostly short ones. */
static void draw_spans(struct span *spans, int most, double longest_s, double seconds)
{
	int n = (int)between(0, most + 1);

	for (int i = 0; i < n; i++) {
		double length_s = longest_s * pow(draw(), 3);

		spans[i].from_ns = (int64_t)(between(0.2, seconds) * 1e9);
		spans[i].to_ns = spans[i].from_ns + (int64_t)(length_s * 1e9);
	}
}

static void draw_scenario(struct scenario *s)
{
	static const double rates_hz[] = {240, 180, 100, 60, 30};

	*s = (struct scenario){
		.hz = 120,
		.seconds = between(1.5, 8),
		.external = draw() < 0.3,
		.ppm = between(-300, 300),
		.jitter_ms = 0.5 * pow(draw(), 2),
		.grid_ms = draw() < 0.5 ? 1 : 0,
	};
	if (s->external) {
		s->hz = between(15, 119);
		s->wobble = draw() < 0.5 ? 0 : between(0, 0.3);
		draw_spans(s->pauses, 3, 1.5, s->seconds);
	} else if (draw() < 0.2) {
		s->hz = rates_hz[(int)between(0, 5)];
	} else if (draw() < 0.2) {
		s->to_hz = rates_hz[(int)between(0, 5)];
	}
	draw_spans(s->mutes, 5, 1.2, s->seconds);
	draw_spans(s->stalls, 4, 0.9, s->seconds);
}

/* A tracker of another rate than rig.conf says, which the recording names: 1 of 1000 rows may be worse. */
static bool has_other_rate(const struct scenario *s)
{
	return !s->external && (s->hz != 120 || s->to_hz > 0);
}

/* The invariant, over whatever is drawn. */
TEST(no_time_is_worse_than_it_states, IN_FOLDER)
{
	const char *only = getenv("SEED");
	int first = only ? atoi(only) : 1,
	    last = only ? first : cases_of(SEEDS_FULL, SEEDS);
	long rows = 0, beyond = 0, other = 0;

	for (int seed = first; seed <= last; seed++) {
		struct scenario s;
		struct errors errors;

		device.random = (uint64_t)seed * 1000003;
		draw_scenario(&s);
		run(&s, &errors);
		assert_int_equal(system("rm -r a.rec"), 0);
		rows += errors.rows;
		if (has_other_rate(&s))
			other += errors.beyond;
		else
			beyond += errors.beyond;
		if (!errors.beyond && !only)
			continue;
		print_message(
			"seed %d: %.0f to %.0f Hz%s, %.1f s, jitter %.2f ms: %d of %d "
			"rows, %.1f ms wrong, %.1f times what is stated, at %d\n",
			seed, s.hz, s.to_hz, s.external ? ", external" : "", s.seconds,
			s.jitter_ms, errors.beyond, errors.rows, errors.worst_ms,
			errors.worst_ratio, errors.worst_at);
	}
	print_message(
		"%ld of %ld rows of %d scenarios beyond %d times what they state, and "
		"%ld of trackers of another rate\n",
		beyond, rows, last - first + 1, K, other);
	assert_int_equal(beyond, 0);
	assert_true(1000 * other <= rows);
}
