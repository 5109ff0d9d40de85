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
#include "calibrate/calibrate.h"
#include "cli/folder.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "cli/recording.h"
#include "cli/uncertainty.h"

/* A drift that is this many times its uncertainty is real. */
#define DRIFT_SIGMAS 4
#define DRIFT_MAX_MS 0.3

#define POLL_NS 10000000LL

enum { FORCE, TRACKER, CAMERA, STREAMS };
static const char *const stream_names[] = {"force", "tracker", "camera", NULL};

struct options {
	struct calibrate_options common;
	double time_s, max_delay_ms; /* time_s 0: not given */
	double u_reference_ms;	     /* NAN: not given */
	int reference;
	bool camera;
};

static const struct cli_option option_table[] = {
	{CLI_RIG_OPTION(struct options, common.rig)},
	{CALIBRATE_FILE_OPTION(struct options)},
	{0, "duration", "TIME", "length of the recording (default: 15s)",
	 CLI_DURATION(struct options, time_s, 8, 600)},
	{0, "reference-stream", "STREAM",
	 "stream whose delay is taken as known: force (default), tracker or camera",
	 CLI_CHOICE(struct options, reference, stream_names)},
	{0, "u-reference", "MS",
	 "standard uncertainty of that stream's own delay, which is not measured: "
	 "the others' is relative to it",
	 CLI_NUMBER(struct options, u_reference_ms, 0, 1000)},
	{0, "max-delay", "MS", "largest delay to look for, in ms (default: 150)",
	 CLI_NUMBER(struct options, max_delay_ms, 10, 1000)},
	{0, "with-camera", NULL, "on the simulated rig, record its camera too",
	 CLI_FLAG(struct options, camera)},
	{0, "from", "NAME.rec", "use this recording instead of a rig",
	 CLI_INPUT(struct options, common.from)},
	{0, "keep", "NAME.rec", "keep the recording here, for --from",
	 CLI_OUTPUTS(struct options, common.keep)},
	{0, "report", "DIR", "write report.txt, report.json and plots into this folder",
	 CLI_OUTPUTS(struct options, common.report)},
	{0, "dry-run", NULL, "do everything except writing calibration.conf",
	 CLI_FLAG(struct options, common.dry_run)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct options, common.json)},
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
	.examples = "incise calibrate delay --rig rig.conf --duration 15s --report delay",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

struct stream {
	struct incise_delay_point *points; /* force N, others depth mm */
	int n;				   /* 0: there is none */
	struct incise_stream about;
};

/* One stream against the tracker's depth. */
struct pair {
	bool known;
	struct incise_delay_fit fit;
};

static void parse(struct options *options, int argc, char **argv)
{
	struct calibrate_options *common = &options->common;

	cli_parse(&command, argc, argv, options);
	cli_no_operands(argc, argv, "--from");
	if (common->from && options->time_s > 0)
		cli_usage("--duration does not go with --from: a recording has its own");
	if (!common->from && !(options->time_s > 0) && !isatty(STDIN_FILENO))
		cli_usage("missing --duration or --from (needed without a terminal)");
	if (common->keep &&
	    (strlen(common->keep) < 5 || !cli_ends_with(common->keep, ".rec")))
		cli_usage("--keep: expected a name that ends in .rec, found '%s'",
			  common->keep);
	if (common->keep)
		cli_output(common->keep);
	calibrate_begin(common);
}

/* --- streams ------------------------------------------------------------------------- */

static void read_stream(struct stream *stream, struct incise_recording *recording,
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

static void read_streams(struct stream streams[STREAMS], const char *path)
{
	static const char *const values[] = {"force", "depth", "camera"};
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
		streams[i] = (struct stream){0};
		for (int k = 0; k < info.n_streams; k++)
			if (!strcmp(info.streams[k].name, stream_names[i]))
				streams[i].about = info.streams[k];
		read_stream(&streams[i], recording, values[i]);
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
 * one or --with-camera is given. 0, or -1 with *err: then a part of it may be left there.
 */
static int record(const struct options *options, double time_s, const char *path,
		  struct incise_error *err)
{
	unsigned int devices = INCISE_RIG_TRACKER | INCISE_RIG_FORCE | INCISE_RIG_CAMERA |
			       (options->camera ? 0 : INCISE_RIG_IF_NAMED);
	struct incise_recorder_setup setup = {.calibration = &options->common.found,
					      .planned_s = time_s};
	struct incise_rig *rig =
		incise_rig_open(cli_rig(options->common.rig), devices, err);
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

static void record_now(const struct options *options, struct stream *streams)
{
	const char *keep = options->common.keep, *base = getenv("TMPDIR");
	char *folder, *path;
	double time_s = options->time_s > 0 ? options->time_s : 15;
	struct incise_error err = {0};
	int rc;

	if (isatty(STDIN_FILENO)) {
		fprintf(stderr,
			"Hold the tool clear of everything and press Enter. After a "
			"second, press on something\n"
			"springy and lift off again, quickly and at an uneven pace. ");
		while (getchar() != '\n' && !feof(stdin) && !cli_stop)
			;
	}
	if (keep) {
		path = recording_target(keep);
		if (record(options, time_s, path, &err))
			cli_fail_with(&err);
		recording_replace(path, keep);
		free(path);
		read_streams(streams, keep);
		return;
	}
	folder = cli_text("%s/incise-XXXXXX", base && *base ? base : "/tmp");
	if (!mkdtemp(folder))
		cli_fail("%s: %s", folder, strerror(errno));
	path = cli_text("%s/delay.rec", folder);
	rc = record(options, time_s, path, &err);
	if (!rc)
		read_streams(streams, path);
	folder_remove(folder);
	free(path);
	free(folder);
	if (rc)
		cli_fail_with(&err);
}

/* --- fits ---------------------------------------------------------------------------- */

static void fit_pair(const struct options *options, const struct stream *streams,
		     int other, struct pair *pair)
{
	const struct stream *depth = &streams[TRACKER];
	const struct incise_delay_fit *fit = &pair->fit;
	struct incise_error err = {0};

	if (!streams[other].n)
		return;
	if (incise_calibrate_delay(
		    depth->points, depth->n, streams[other].points, streams[other].n,
		    other == FORCE ? INCISE_DELAY_FORCE : INCISE_DELAY_ALIKE,
		    options->max_delay_ms, &pair->fit, &err))
		cli_fail("tracker and %s: %s", stream_names[other], err.text);
	pair->known = true;
	if (fabs(fit->drift_ms) > DRIFT_MAX_MS &&
	    fabs(fit->drift_ms) > DRIFT_SIGMAS * fit->drift_sd_ms)
		cli_fail("tracker and %s: the delay drifts by %.2f ms in %.0f s (u "
			 "%.2f ms): the clock of one of them is wrong; see 'incise "
			 "info' on the recording",
			 stream_names[other], fit->drift_ms, fit->span_s,
			 fit->drift_sd_ms);
}

/* Uncertainty of a stream's times by the line through its arrivals, ms. */
static double line_u(const struct stream *stream)
{
	double all = stream->about.offset_sd_ms, delay = stream->about.delay_sd_ms;

	if (!isfinite(all))
		return 0;
	return isnan(delay) ? all : sqrt(fmax(0, all * all - delay * delay));
}

/* The delay of a stream after the reference, and its budget. */
struct lateness {
	double ms, fits_u, lines_u;
};

static struct lateness lateness_of(const struct stream *streams, const struct pair *pairs,
				   int stream, int reference)
{
	struct lateness late = {0};
	int ends[] = {stream, reference};

	for (int e = 0; e < 2; e++) {
		double u = line_u(&streams[ends[e]]);

		late.lines_u = hypot(late.lines_u, u);
		/* the tracker is the other side of each pair */
		if (ends[e] == TRACKER)
			continue;
		late.ms += (e ? 1 : -1) * pairs[ends[e]].fit.delay_ms;
		late.fits_u = hypot(late.fits_u, pairs[ends[e]].fit.sd_ms);
	}
	return late;
}

/* --- the report ---------------------------------------------------------------------- */

static json_t *pair_json(const struct pair *pair)
{
	const struct incise_delay_fit *fit = &pair->fit;

	if (!pair->known)
		return json_null();
	return json_pack("{so so so so so so so so so so si}", "tracker_later_ms",
			 json_number(fit->delay_ms), "u_ms", json_number(fit->sd_ms),
			 "low_ms", json_number(fit->low_ms), "high_ms",
			 json_number(fit->high_ms), "drift_ms",
			 json_number(fit->drift_ms), "drift_sd_ms",
			 json_number(fit->drift_sd_ms), "correlation",
			 json_number(fit->correlation), "second_peak",
			 json_number(fit->second), "contact_mm",
			 json_number(fit->contact_mm), "span_s", json_number(fit->span_s),
			 "blocks", fit->blocks);
}

static void report_pair(FILE *out, const char *name, const struct pair *pair)
{
	const struct incise_delay_fit *fit = &pair->fit;

	if (!pair->known)
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

/* All streams, the tracker's depth shifted by its delay. */
static void draw(const char *folder, const struct stream *streams,
		 const struct pair *pairs)
{
	FILE *script;
	int n = 0;

	if (!calibrate_can_plot(folder))
		return;
	for (int i = 0; i < STREAMS; i++) {
		int stride = 1 + streams[i].n / 4000;
		FILE *data;
		char file[40];

		snprintf(file, sizeof(file), "%s.dat", stream_names[i]);
		data = plot_data(folder, file);
		for (int k = 0; k < streams[i].n; k += stride)
			fprintf(data, "%.5f %.5f\n",
				(streams[i].points[k].t_ns -
				 streams[TRACKER].points[0].t_ns) *
					1e-9,
				streams[i].points[k].value);
		plot_data_end(data, folder);
	}
	script = plot_begin(folder, "fit", 1000, 520);
	fputs("set title 'Streams of the rig, each moved by its measured delay'\n"
	      "set xlabel 'time / s'\nset ylabel 'depth / mm'\nset autoscale xfix\n"
	      "eval key_below\n",
	      script);
	if (streams[FORCE].n)
		fputs("set border 11\nset y2label 'force / N'\nset y2tics\n", script);
	plot_add(
		script, &n,
		"'tracker.dat' using ($1-%g):2 with lines lt 1 title 'depth by the tracker'",
		pairs[FORCE].known ? pairs[FORCE].fit.delay_ms * 1e-3 : 0);
	if (streams[FORCE].n)
		plot_add(script, &n,
			 "'force.dat' using 1:2 axes x1y2 with lines lt 2 title 'force'");
	if (pairs[CAMERA].known)
		plot_add(script, &n,
			 "'camera.dat' using ($1+%g):2 with points lt 3 ps 0.5 "
			 "title 'depth by the camera'",
			 (pairs[CAMERA].fit.delay_ms - pairs[FORCE].fit.delay_ms) * 1e-3);
	putc('\n', script);
	if (!plot_draw(script, folder, "fit"))
		cli_warn("fit.png: could not be drawn; see whether gnuplot works");
}

/* The verdicts of fit_pair() and the library, with the limits. */
static void fill_verdict(const struct pair *pairs,
			 struct incise_calibration_record *record)
{
	int used = 0;

	for (int i = 0; i < STREAMS; i++)
		if (pairs[i].known)
			used += snprintf(
				record->verdict + used, sizeof(record->verdict) - used,
				"%stracker and %s: correlation %.3f, drift %.3f ms",
				used ? "; " : "", stream_names[i],
				pairs[i].fit.correlation, pairs[i].fit.drift_ms);
	snprintf(record->verdict + used, sizeof(record->verdict) - used,
		 "; limits: correlation %g, drift %g ms or %d u",
		 INCISE_DELAY_CORRELATION_MIN, DRIFT_MAX_MS, DRIFT_SIGMAS);
}

static void state_reference(const struct options *options,
			    struct incise_calibration_record *record)
{
	const char *name = stream_names[options->reference];
	char key[32], question[120];

	snprintf(key, sizeof(key), "%s_delay_sd_ms", name);
	snprintf(question, sizeof(question),
		 "Standard uncertainty of the own delay of the %s (a converter that "
		 "timestamps: 0.01)",
		 name);
	calibrate_stated(&options->common, record, options->u_reference_ms, key, "ms",
			 question);
}

static void fill_record(const struct options *options, const struct stream *streams,
			const struct pair *pairs,
			struct incise_calibration_record *record)
{
	const struct incise_calibration *c = &options->common.found;
	const double found[][2] = {{c->force_delay_ms, c->force_delay_sd_ms},
				   {c->tracker_delay_ms, c->tracker_delay_sd_ms},
				   {c->camera_delay_ms, c->camera_delay_sd_ms}};
	struct incise_outfile *file;
	FILE *out = calibrate_report_text(options->common.report, &file);

	fill_verdict(pairs, record);
	if (out) {
		fprintf(out, "Delays against the %s\n\n",
			stream_names[options->reference]);
		report_pair(out, "force", &pairs[FORCE]);
		report_pair(out, "camera", &pairs[CAMERA]);
	}
	for (int i = 0; i < STREAMS; i++) {
		struct lateness late;
		double u, delay = streams[i].about.delay_ms;
		char key[32], text[UNCERTAINTY_TEXT];

		if (i == options->reference || (i != TRACKER && !pairs[i].known))
			continue;
		late = lateness_of(streams, pairs, i, options->reference);
		u = hypot(late.fits_u, late.lines_u);
		snprintf(key, sizeof(key), "%s_delay_ms", stream_names[i]);
		calibrate_value(record, key, "ms", found[i][0], delay + late.ms, u);
		snprintf(key, sizeof(key), "%s_delay_sd_ms", stream_names[i]);
		calibrate_value(record, key, "ms", found[i][1], u, 0);
		if (out)
			fprintf(out,
				"\n%s_delay_ms = %s (k = 2): %.3f ms of the recording and "
				"%.3f ms measured; u = %.2g ms\n"
				"  budget            type  u, ms   sensitivity\n"
				"  fit of the motion A     %.4f  1\n"
				"  lines of arrivals B     %.4f  1\n",
				stream_names[i],
				uncertainty_text(delay + late.ms, 2 * u, "ms", text),
				delay, late.ms, u, late.fits_u, late.lines_u);
	}
	state_reference(options, record);
	if (out)
		calibrate_result_text(&options->common, record, out);
	whole_file_end(file);
	if (out)
		draw(options->common.report, streams, pairs);
}

int main(int argc, char **argv)
{
	struct incise_calibration_record record = {
		.kind = "delay", .low = NAN, .high = NAN, .pass = true};
	struct stream streams[STREAMS];
	struct pair pairs[STREAMS] = {0};
	struct options options = {
		.max_delay_ms = 150,
		.reference = FORCE,
		.u_reference_ms = NAN,
	};
	const char *raw;

	parse(&options, argc, argv);
	cli_catch_signals();
	if (options.common.from)
		read_streams(streams, options.common.from);
	else
		record_now(&options, streams);
	if (options.reference == CAMERA && !streams[CAMERA].n)
		cli_fail("--reference-stream camera: the recording has no depth from a "
			 "camera; choose force or tracker");
	fit_pair(&options, streams, FORCE, &pairs[FORCE]);
	fit_pair(&options, streams, CAMERA, &pairs[CAMERA]);
	if (!pairs[FORCE].known && !pairs[CAMERA].known)
		cli_fail("the recording has neither force nor camera depth to compare "
			 "with the tracker; record one of them");
	raw = options.common.keep ? options.common.keep : options.common.from;
	if (raw)
		snprintf(record.raw, sizeof(record.raw), "%s", raw);
	snprintf(record.device, sizeof(record.device), "%s",
		 streams[TRACKER].about.device);
	snprintf(record.method, sizeof(record.method),
		 "least squares of one motion of %.0f s, against the %s",
		 pairs[FORCE].known ? pairs[FORCE].fit.span_s : pairs[CAMERA].fit.span_s,
		 stream_names[options.reference]);
	fill_record(&options, streams, pairs, &record);
	calibrate_end(&options.common, &record,
		      json_pack("{ss so so}", "reference",
				stream_names[options.reference], "force",
				pair_json(&pairs[FORCE]), "camera",
				pair_json(&pairs[CAMERA])));
	for (int i = 0; i < STREAMS; i++)
		free(streams[i].points);
	return 0;
}
