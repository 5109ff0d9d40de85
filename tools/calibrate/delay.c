// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate delay: the delays between tracker, force channel and camera, from a motion
 * that all of them measure.
 *
 *     force   F = f(depth(t + a))    a: the tracker is later than the force
 *     camera  depth(t + b)           b: the tracker is later than the camera
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibrate_delay.h>
#include <incise/recorder.h>
#include <incise/rig.h>
#include "../cli/folder.h"
#include "../cli/json.h"
#include "../cli/plot.h"
#include "../cli/recording.h"
#include "../cli/uncertainty.h"
#include "calibrate.h"

#define POLL_NS 10000000LL

/* A drift that is this many times its uncertainty is real. */
#define DRIFT_SIGMAS 4
#define DRIFT_MAX_MS 0.3

enum { FORCE, TRACKER, CAMERA, STREAMS };
static const char *const names[] = {"force", "tracker", "camera", NULL};
static const char *const cameras[] = {"auto", "frames", NULL};

struct delay_stream {
	struct incise_delay_point *points; /* force N, others depth mm */
	int n;				   /* 0: there is none */
	struct incise_stream about;
	/* Against the tracker's depth. */
	bool is_fitted;
	struct incise_delay_fit fit;
	/* The delay after the reference, and its budget. */
	bool has_result;
	double late_ms, fits_u_ms, lines_u_ms;
};

struct delay {
	struct calibrate common;
	double time_s, max_delay_ms; /* time_s 0: not given */
	double u_reference_ms;	     /* NAN: not given */
	int reference;
	enum { CAMERA_AUTO, CAMERA_FRAMES } camera;
	struct delay_stream streams[STREAMS];
};

static void parse_u(void *run, char *text)
{
	static const struct cli_option keys[] = {
		{0, "given-u reference", "MS", NULL,
		 CLI_NUMBER(struct delay, u_reference_ms, 0, 1000)},
		{0},
	};

	cli_keys(text, keys, run);
}

static const struct cli_option option_table[] = {
	CALIBRATE_RIG_OPTIONS(struct delay),
	{0, "duration", "TIME", "length of the recording (default: 15s)",
	 CLI_DURATION(struct delay, time_s, 8, 600)},
	{0, "reference-stream", "STREAM",
	 "stream whose delay is taken as known: force (default), tracker or camera",
	 CLI_CHOICE(struct delay, reference, names)},
	{0, "given-u", "reference=MS",
	 "standard uncertainty of the reference stream's own delay, which is not measured: "
	 "the others' is relative to it",
	 CLI_PARSED_BY(parse_u)},
	{0, "max-delay", "MS", "largest delay to look for, in ms (default: 150)",
	 CLI_NUMBER(struct delay, max_delay_ms, 10, 1000)},
	{0, "camera", "WHAT",
	 "frames: record the camera of the simulated rig too; auto (default)",
	 CLI_CHOICE(struct delay, camera, cameras)},
	{0, "from", "NAME.rec", "use this recording instead of a rig",
	 CLI_INPUT(struct delay, common.from)},
	{'o', "output", "NAME.rec", "keep the recording here, for --from",
	 CLI_OUTPUTS(struct delay, common.keep), .extensions = ".rec"},
	CALIBRATE_REPORT_OPTIONS(struct delay),
	{0},
};

static const struct cli_command command = {
	.name = "calibrate delay",
	.synopsis = "[--rig RIG | --from NAME.rec] [OPTIONS]",
	.summary =
		"Measure the delays of tracker, force channel and camera relative to each "
		"other. Press the tip of the blade on something springy that it does not "
		"cut, for example foam or rubber, and lift it off again, two or three "
		"times a second, at an uneven pace.",
	.options = option_table,
	.examples = "incise calibrate delay --rig rig.conf --duration 15s -o delay",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

static void check_delay_options(void *run, int argc, char **argv)
{
	struct delay *delay = run;
	const struct calibrate *common = &delay->common;

	cli_no_operands(argc, argv, "--from");
	calibrate_check_source(common, delay->time_s, "a recording");
	if (common->keep)
		cli_output(common->keep);
	cli_catch_signals();
}

/* --- streams ------------------------------------------------------------------------- */

static void read_stream(struct delay_stream *stream, struct incise_recording *recording,
			const char *values_of)
{
	struct incise_recording_value *values;
	struct incise_error err = {0};
	int n = incise_recording_values(recording, values_of, &values, &err);

	if (n < 0)
		cli_fail_with(&err);
	stream->points = cli_alloc((size_t)n + 1, sizeof(*stream->points));
	for (int i = 0; i < n; i++)
		stream->points[i] = (struct incise_delay_point){.t_ns = values[i].t_ns,
								.value = values[i].value};
	stream->n = n;
	free(values);
}

static void read_streams(void *run, const char *path)
{
	static const char *const values[] = {"force", "depth", "camera"};
	struct delay *delay = run;
	struct incise_recording_info info;
	struct incise_error err = {0};
	struct incise_recording *recording = recording_open(path);

	if (incise_recording_info(recording, &info, &err))
		cli_fail_with(&err);
	if (!info.n_streams)
		cli_fail("%s: written by an older incise, without the delays of its "
			 "times; record again",
			 path);
	for (int i = 0; i < STREAMS; i++) {
		for (int k = 0; k < info.n_streams; k++)
			if (!strcmp(info.streams[k].name, names[i]))
				delay->streams[i].about = info.streams[k];
		read_stream(&delay->streams[i], recording, values[i]);
	}
	incise_recording_close(recording);
}

/* Poll until the time is over, a signal comes or it fails: 0 or not. */
static int poll_for(struct incise_recorder *recorder, struct incise_clock *clock,
		    double time_s, struct incise_error *err)
{
	int64_t start = incise_clock_now(clock), now = start;
	struct incise_recorder_stats stats;
	int rc = 0;

	while (!rc && !cli_stop && (now - start) * 1e-9 < time_s) {
		incise_clock_wait_until(clock, now + POLL_NS);
		now = incise_clock_now(clock);
		rc = incise_recorder_poll(recorder, err);
		incise_recorder_stats(recorder, &stats);
		cli_progress("%s  %.0f s left, depth %.1f mm, force %.2f N",
			     (now - start) * 1e-9 < 1 ? "hold the tool clear "
						      : "press and lift, unevenly",
			     time_s - (now - start) * 1e-9, stats.depth_mm,
			     stats.force_N);
	}
	cli_progress_end();
	return rc;
}

/*
 * Record the rig for @time_s into @path, which ends in .rec, with its camera if rig.conf names
 * one or --camera=frames is given. 0, or -1 with *err: then a part of it may be left there.
 */
static int record(const struct delay *delay, double time_s, const char *path,
		  struct incise_error *err)
{
	unsigned int devices = INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA |
			       (delay->camera == CAMERA_FRAMES ? 0 : INCISE_RIG_IF_NAMED);
	struct incise_recorder_setup setup = {.calibration = &delay->common.found,
					      .planned_s = time_s};
	struct incise_rig *rig =
		incise_rig_open(cli_rig(delay->common.rig), devices, err);
	struct incise_error second = {0};
	struct incise_recorder *recorder;
	struct incise_vision_setup vision;
	int rc;

	if (!rig)
		return -1;
	if (incise_rig_camera(rig) && !incise_rig_vision(rig, &vision))
		setup.vision = &vision;
	recorder = incise_recorder_new(path, rig, &setup, err);
	rc = recorder ? poll_for(recorder, incise_rig_clock(rig), time_s, err) : -1;
	if (recorder && incise_recorder_close(recorder, rc ? &second : err))
		rc = -1;
	incise_rig_close(rig);
	if (!rc && cli_stop) {
		incise_error_set(err, EINTR,
				 "stopped; the previous calibration stays "
				 "active");
		rc = -1;
	}
	return rc ? -1 : 0;
}

static void record_streams(void *run)
{
	struct delay *delay = run;
	const char *keep = delay->common.keep;
	double time_s = delay->time_s > 0 ? delay->time_s : 15;
	char folder[300], *path;
	struct incise_error err = {0};
	int rc;

	if (isatty(STDIN_FILENO)) {
		fprintf(stderr,
			"Hold the tool clear of everything and press Enter. After a "
			"second, press on something\n"
			"springy and lift off again, quickly and at an uneven pace. ");
		calibrate_await_enter();
	}
	if (keep) {
		path = recording_target(keep);
		if (record(delay, time_s, path, &err))
			cli_fail_with(&err);
		recording_replace(path, keep);
		free(path);
		read_streams(delay, keep);
		return;
	}
	folder_make(folder, sizeof(folder), "for the recording");
	path = cli_text("%s/delay.rec", folder);
	rc = record(delay, time_s, path, &err);
	if (!rc)
		read_streams(delay, path);
	folder_remove(folder);
	free(path);
	if (rc)
		cli_fail_with(&err);
}

/* --- the fit ------------------------------------------------------------------------- */

static void fit_stream(struct delay *delay, int other)
{
	const struct delay_stream *depth = &delay->streams[TRACKER];
	struct delay_stream *s = &delay->streams[other];
	const struct incise_delay_fit *fit = &s->fit;
	struct incise_error err = {0};

	if (!s->n)
		return;
	if (incise_calibrate_delay(depth->points, depth->n, s->points, s->n,
				   other == FORCE ? INCISE_DELAY_FORCE
						  : INCISE_DELAY_ALIKE,
				   delay->max_delay_ms, &s->fit, &err))
		cli_fail("tracker and %s: %s", names[other], err.text);
	s->is_fitted = true;
	if (fabs(fit->drift_ms) > DRIFT_MAX_MS &&
	    fabs(fit->drift_ms) > DRIFT_SIGMAS * fit->drift_sd_ms)
		cli_fail("tracker and %s: the delay drifts by %.2f ms in %.0f s (u "
			 "%.2f ms): the clock of one of them is wrong; see 'incise "
			 "info' on the recording",
			 names[other], fit->drift_ms, fit->span_s, fit->drift_sd_ms);
}

/* Uncertainty of a stream's times by the line through its arrivals, ms. */
static double line_u(const struct delay_stream *stream)
{
	double all = stream->about.offset_sd_ms, delay = stream->about.delay_sd_ms;

	if (!isfinite(all))
		return 0;
	return isnan(delay) ? all : sqrt(fmax(0, all * all - delay * delay));
}

static void find_lateness(struct delay *delay, int stream)
{
	struct delay_stream *s = &delay->streams[stream];
	int ends[] = {stream, delay->reference};

	for (int e = 0; e < 2; e++) {
		const struct delay_stream *end = &delay->streams[ends[e]];

		s->lines_u_ms = hypot(s->lines_u_ms, line_u(end));
		/* the tracker is the other side of each pair */
		if (ends[e] == TRACKER)
			continue;
		s->late_ms += (e ? 1 : -1) * end->fit.delay_ms;
		s->fits_u_ms = hypot(s->fits_u_ms, end->fit.sd_ms);
	}
	s->has_result = true;
}

static void add_values(struct delay *delay)
{
	for (int i = 0; i < STREAMS; i++) {
		struct delay_stream *s = &delay->streams[i];
		char key[32];
		double u;

		if (i == delay->reference || (i != TRACKER && !s->is_fitted))
			continue;
		find_lateness(delay, i);
		u = hypot(s->fits_u_ms, s->lines_u_ms);
		calibrate_words(key, "%s_delay_ms", names[i]);
		calibrate_value(&delay->common, key, "ms", s->about.delay_ms + s->late_ms,
				u);
		calibrate_words(key, "%s_delay_sd_ms", names[i]);
		calibrate_value(&delay->common, key, "ms", u, 0);
	}
}

static void state_reference(struct delay *delay)
{
	const char *name = names[delay->reference];
	char key[32], question[120];

	calibrate_words(key, "%s_delay_sd_ms", name);
	calibrate_words(
		question,
		"Standard uncertainty of the own delay of the %s (a converter that "
		"timestamps: 0.01)",
		name);
	calibrate_stated(&delay->common, delay->u_reference_ms, key, "ms", question);
}

/* The verdicts of fit_stream() and the library, with the limits. */
static void set_verdict(struct delay *delay)
{
	char *verdict = delay->common.record.verdict;
	const size_t size = sizeof(delay->common.record.verdict);
	int used = 0;

	for (int i = 0; i < STREAMS; i++)
		if (delay->streams[i].is_fitted)
			used += snprintf(
				verdict + used, size - used,
				"%stracker and %s: correlation %.3f, drift %.3f ms",
				used ? "; " : "", names[i],
				delay->streams[i].fit.correlation,
				delay->streams[i].fit.drift_ms);
	snprintf(verdict + used, size - used,
		 "; limits: correlation %g, drift %g ms or %d u",
		 INCISE_DELAY_CORRELATION_MIN, DRIFT_MAX_MS, DRIFT_SIGMAS);
}

static int fit_streams(void *run, struct incise_error *err)
{
	struct delay *delay = run;
	const struct delay_stream *streams = delay->streams;
	struct incise_calibration_record *record = &delay->common.record;

	if (delay->reference == CAMERA && !streams[CAMERA].n)
		return incise_error_set(
			err, EINVAL,
			"--reference-stream camera: the recording has no depth from a "
			"camera; choose force or tracker");
	fit_stream(delay, FORCE);
	fit_stream(delay, CAMERA);
	if (!streams[FORCE].is_fitted && !streams[CAMERA].is_fitted)
		return incise_error_set(
			err, ENODATA,
			"the recording has neither force nor camera depth to compare "
			"with the tracker; record one of them");
	calibrate_words(record->device, "%s", streams[TRACKER].about.device);
	calibrate_words(record->method,
			"least squares of one motion of %.0f s, against the %s",
			streams[streams[FORCE].is_fitted ? FORCE : CAMERA].fit.span_s,
			names[delay->reference]);
	set_verdict(delay);
	add_values(delay);
	state_reference(delay);
	return 0;
}

/* --- the report ---------------------------------------------------------------------- */

static void print_fit(FILE *out, const char *name, const struct delay_stream *stream)
{
	const struct incise_delay_fit *fit = &stream->fit;

	if (!stream->is_fitted)
		return;
	fprintf(out,
		"tracker later than %s by %.3f ms, u = %.3f ms, 95 %% interval %.3f to "
		"%.3f ms\n"
		"  correlation %.4f, second peak %.2f of it, over %.1f s in %d blocks\n"
		"  drift from beginning to end %.3f ms (u %.3f ms, %.1f ppm)\n",
		name, fit->delay_ms, fit->sd_ms, fit->low_ms, fit->high_ms,
		fit->correlation, fit->second, fit->span_s, fit->blocks, fit->drift_ms,
		fit->drift_sd_ms, 1e3 * fit->drift_ms / fit->span_s);
	if (!isnan(fit->contact_mm))
		fprintf(out, "  contact begins at a depth of %.2f mm\n", fit->contact_mm);
}

static void print_delay_report(const void *run, FILE *out)
{
	const struct delay *delay = run;

	fprintf(out, "Delays against the %s\n\n", names[delay->reference]);
	print_fit(out, "force", &delay->streams[FORCE]);
	print_fit(out, "camera", &delay->streams[CAMERA]);
	for (int i = 0; i < STREAMS; i++) {
		const struct delay_stream *s = &delay->streams[i];
		double u = hypot(s->fits_u_ms, s->lines_u_ms);
		char text[UNCERTAINTY_TEXT];

		if (!s->has_result)
			continue;
		fprintf(out,
			"\n%s_delay_ms = %s (k = 2): %.3f ms of the recording and "
			"%.3f ms measured; u = %.2g ms\n"
			"  budget            type  u, ms   sensitivity\n"
			"  fit of the motion A     %.4f  1\n"
			"  lines of arrivals B     %.4f  1\n",
			names[i],
			uncertainty_text(s->about.delay_ms + s->late_ms, 2 * u, "ms",
					 text),
			s->about.delay_ms, s->late_ms, u, s->fits_u_ms, s->lines_u_ms);
	}
}

static json_t *fit_json(const struct delay_stream *stream)
{
	json_t *object;

	if (!stream->is_fitted)
		return json_null();
	object = json_object();
	json_set_number(object, "tracker_later_ms", stream->fit.delay_ms);
	json_set_number(object, "u_ms", stream->fit.sd_ms);
	json_set_number(object, "low_ms", stream->fit.low_ms);
	json_set_number(object, "high_ms", stream->fit.high_ms);
	json_set_number(object, "drift_ms", stream->fit.drift_ms);
	json_set_number(object, "drift_sd_ms", stream->fit.drift_sd_ms);
	json_set_number(object, "correlation", stream->fit.correlation);
	json_set_number(object, "second_peak", stream->fit.second);
	json_set_number(object, "contact_mm", stream->fit.contact_mm);
	json_set_number(object, "span_s", stream->fit.span_s);
	json_set_integer(object, "blocks", stream->fit.blocks);
	return object;
}

static json_t *make_delay_json(const void *run)
{
	const struct delay *delay = run;

	return calibrate_json(&delay->common,
			      json_pack("{ss so so}", "reference",
					names[delay->reference], "force",
					fit_json(&delay->streams[FORCE]), "camera",
					fit_json(&delay->streams[CAMERA])));
}

static void put_data(const struct delay *delay, int i, const char *folder)
{
	const struct delay_stream *s = &delay->streams[i];
	int stride = 1 + s->n / 4000;
	FILE *data;
	char file[40];

	snprintf(file, sizeof(file), "%s.dat", names[i]);
	data = plot_data(folder, file);
	for (int k = 0; k < s->n; k += stride)
		fprintf(data, "%.5f %.5f\n",
			(s->points[k].t_ns - delay->streams[TRACKER].points[0].t_ns) *
				1e-9,
			s->points[k].value);
	plot_data_end(data, folder);
}

/* All streams, the tracker's depth shifted by its delay. */
static void draw_streams(const void *run, const char *folder)
{
	const struct delay *delay = run;
	const struct delay_stream *force = &delay->streams[FORCE];
	const struct delay_stream *camera = &delay->streams[CAMERA];
	FILE *script;
	int n = 0;

	for (int i = 0; i < STREAMS; i++)
		put_data(delay, i, folder);
	script = plot_begin(folder, "fit", 1000, 520);
	fputs("set title 'Streams of the rig, each moved by its measured delay'\n"
	      "set xlabel 'time / s'\nset ylabel 'depth / mm'\nset autoscale xfix\n"
	      "eval key_below\n",
	      script);
	if (force->n)
		fputs("set border 11\nset y2label 'force / N'\nset y2tics\n", script);
	plot_add(
		script, &n,
		"'tracker.dat' using ($1-%g):2 with lines lt 1 title 'depth by the tracker'",
		force->is_fitted ? force->fit.delay_ms * 1e-3 : 0);
	if (force->n)
		plot_add(script, &n,
			 "'force.dat' using 1:2 axes x1y2 with lines lt 2 title 'force'");
	if (camera->is_fitted)
		plot_add(script, &n,
			 "'camera.dat' using ($1+%g):2 with points lt 3 ps 0.5 "
			 "title 'depth by the camera'",
			 (camera->fit.delay_ms - force->fit.delay_ms) * 1e-3);
	putc('\n', script);
	calibrate_draw(script, folder, "fit");
}

int calibrate_delay(int argc, char **argv)
{
	static const struct calibrate_kind kind = {
		.name = "delay",
		.command = &command,
		.check = check_delay_options,
		.read = read_streams,
		.measure = record_streams,
		.fit = fit_streams,
		.text = print_delay_report,
		.json = make_delay_json,
		.draw = draw_streams,
	};
	static struct delay delay = {
		.max_delay_ms = 150, .reference = FORCE, .u_reference_ms = NAN};

	return calibrate_run(&kind, argc, argv, &delay);
}
