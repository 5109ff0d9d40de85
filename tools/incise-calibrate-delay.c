// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate delay: how late tracker, force channel and camera are against each other,
 * from a motion that all of them see.
 *
 *     force   F = f(depth(t + a))    a: the tracker is later than the force
 *     camera  depth(t + b)           b: the tracker is later than the camera
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibrate_delay.h>
#include "calibrate/calibrate_report.h"
#include "calibrate/calibrate_result.h"
#include "calibrate/delay_streams.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "cli/recording.h"

/* A drift that is this many times its uncertainty is real. */
#define DRIFT_SIGMAS 4
#define DRIFT_MAX_MS 0.3

enum { OPT_TIME = CALIBRATE_OWN, OPT_REFERENCE, OPT_RANGE, OPT_CAMERA };

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "read as found, and written (default: calibration.conf)"},
	{OPT_TIME, "time", "TIME", "record so long (default: 15s)"},
	{OPT_REFERENCE, "reference", "STREAM",
	 "whose delay is right: force (default), tracker, camera"},
	{OPT_RANGE, "range", "MS", "look for a delay up to so many ms (default: 150)"},
	{OPT_CAMERA, "camera", NULL, "of the virtual rig, record its camera too"},
	{CALIBRATE_FROM, "from", "NAME.rec", "take a recording that is there, not a rig"},
	{CALIBRATE_KEEP, "keep", "NAME.rec", "keep the recording, for --from"},
	{CALIBRATE_REPORT, "report", "DIR", "report.txt, report.json and pictures"},
	{CALIBRATE_DRY_RUN, "dry-run", NULL, "do all but write calibration.conf"},
	{CALIBRATE_JSON, "json", NULL, "tell the result as one JSON object"},
	{0},
};

static const struct cli_command command = {
	.name = "calibrate delay",
	.synopsis = "[--rig RIG | --from NAME.rec] [OPTIONS]",
	.summary =
		"Measure how late tracker, force channel and camera are against each other. "
		"Press\nthe blade's tip on something springy that it does not cut, foam or "
		"rubber, and\nlift it off again, two or three times a second, unevenly.",
	.options = options,
	.notes =
		"Example: incise calibrate delay --rig rig.conf --time 15s --report delay\n"
		"Exit codes: 0 done and in force, 1 failed or refused, 2 bad usage.",
};

struct wish {
	struct calibrate_wish common;
	double time_s, range_ms;
	int reference;
	bool camera;
};

/* One stream against the tracker's depth. */
struct pair {
	bool there;
	struct incise_delay_fit fit;
};

static int reference_of(const char *text)
{
	for (int i = 0; i < DELAY_STREAMS; i++)
		if (!strcmp(text, delay_stream_names[i]))
			return i;
	cli_usage("--reference: '%s' is none of force, tracker and camera", text);
}

static void take_options(struct wish *wish, int argc, char **argv)
{
	struct calibrate_wish *common = &wish->common;
	size_t length;
	int id;

	while ((id = cli_next(&command, argc, argv)) != CLI_END) {
		if (calibrate_option(common, id))
			continue;
		if (id == OPT_TIME)
			wish->time_s = cli_duration("time", optarg, 8, 600);
		else if (id == OPT_REFERENCE)
			wish->reference = reference_of(optarg);
		else if (id == OPT_RANGE)
			wish->range_ms = cli_number("range", optarg, 10, 1000);
		else
			wish->camera = true;
	}
	if (optind < argc)
		cli_usage("'%s' is too much: a recording goes with --from", argv[optind]);
	if (common->from && wish->time_s > 0)
		cli_usage("--time: a recording has its own");
	if (!common->from && !(wish->time_s > 0) && !isatty(STDIN_FILENO))
		cli_usage("without a terminal, --time or --from is needed");
	length = common->keep ? strlen(common->keep) : 0;
	if (common->keep && (length < 5 || strcmp(common->keep + length - 4, ".rec")))
		cli_usage("--keep: '%s' is not a name that ends in .rec", common->keep);
}

/* --- recording now --------------------------------------------------------------------- */

/* What is there of a recording, whole or interrupted. */
static void remove_recording(const char *path)
{
	char *part;

	if (asprintf(&part, "%s.part", path) < 0)
		cli_fail("no memory");
	recording_remove(path);
	recording_remove(part);
	free(part);
}

static void record_now(const struct wish *wish, struct delay_stream *streams)
{
	const char *base = getenv("TMPDIR");
	char *folder = NULL, *path = NULL;
	double time_s = wish->time_s > 0 ? wish->time_s : 15;
	struct incise_error err = {0};
	int rc;

	if (isatty(STDIN_FILENO)) {
		fprintf(stderr,
			"Hold the tool free of all; Enter begins. After a second "
			"press on something springy\nand lift off again, quickly and "
			"unevenly. ");
		while (getchar() != '\n' && !feof(stdin) && !cli_stop)
			;
	}
	if (wish->common.keep) {
		if (delay_streams_record(wish->common.rig, &wish->common.found, time_s,
					 wish->camera, wish->common.keep, &err))
			cli_fail_with(&err);
		delay_streams_read(streams, wish->common.keep);
		return;
	}
	if (asprintf(&folder, "%s/incise-XXXXXX", base && *base ? base : "/tmp") < 0)
		cli_fail("no memory");
	if (!mkdtemp(folder))
		cli_fail("%s: %s", folder, strerror(errno));
	if (asprintf(&path, "%s/delay.rec", folder) < 0)
		cli_fail("no memory");
	rc = delay_streams_record(wish->common.rig, &wish->common.found, time_s,
				  wish->camera, path, &err);
	if (!rc)
		delay_streams_read(streams, path);
	remove_recording(path);
	rmdir(folder);
	free(path);
	free(folder);
	if (rc)
		cli_fail_with(&err);
}

/* --- fits ------------------------------------------------------------------------------ */

static void fit_pair(const struct wish *wish, const struct delay_stream *streams,
		     int other, struct pair *pair)
{
	const struct delay_stream *depth = &streams[DELAY_TRACKER];
	const struct incise_delay_fit *fit = &pair->fit;
	struct incise_error err = {0};

	if (!streams[other].n)
		return;
	if (incise_calibrate_delay(
		    depth->points, depth->n, streams[other].points, streams[other].n,
		    other == DELAY_FORCE ? INCISE_DELAY_FORCE : INCISE_DELAY_ALIKE,
		    wish->range_ms, &pair->fit, &err))
		cli_fail("tracker and %s: %s", delay_stream_names[other], err.text);
	pair->there = true;
	if (fabs(fit->drift_ms) > DRIFT_MAX_MS &&
	    fabs(fit->drift_ms) > DRIFT_SIGMAS * fit->drift_sd_ms)
		cli_fail("tracker and %s: the delay drifts by %.2f ms in %.0f s (u %.2f "
			 "ms): the time of one of them is wrong; see incise info on the "
			 "recording",
			 delay_stream_names[other], fit->drift_ms, fit->span_s,
			 fit->drift_sd_ms);
}

/* What the line through arrivals leaves unknown of a stream's times, ms. */
static double line_u(const struct delay_stream *stream)
{
	double all = stream->about.offset_sd_ms, delay = stream->about.delay_sd_ms;

	if (!isfinite(all))
		return 0;
	return isnan(delay) ? all : sqrt(fmax(0, all * all - delay * delay));
}

/* How much later a stream is than the reference, and its budget. */
struct lateness {
	double ms, fits_u, lines_u;
};

static struct lateness lateness_of(const struct delay_stream *streams,
				   const struct pair *pairs, int stream, int reference)
{
	struct lateness late = {0};
	int ends[] = {stream, reference};

	for (int e = 0; e < 2; e++) {
		double u = line_u(&streams[ends[e]]);

		late.lines_u = hypot(late.lines_u, u);
		/* of the tracker itself there is no pair: it is what all are held to */
		if (ends[e] == DELAY_TRACKER)
			continue;
		late.ms += (e ? 1 : -1) * pairs[ends[e]].fit.delay_ms;
		late.fits_u = hypot(late.fits_u, pairs[ends[e]].fit.sd_ms);
	}
	return late;
}

/* --- the report ------------------------------------------------------------------------ */

static json_t *pair_json(const struct pair *pair)
{
	const struct incise_delay_fit *fit = &pair->fit;

	if (!pair->there)
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

	if (!pair->there)
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

/* Both streams, the tracker's depth where it was when the other saw it. */
static void draw(const struct calibrate_wish *wish, const struct delay_stream *streams,
		 const struct pair *pairs)
{
	const char *folder, *name;
	char *path;
	FILE *script;

	if (!plot_possible()) {
		cli_warn("no pictures: gnuplot is not installed, apt-get install "
			 "gnuplot-nox");
		return;
	}
	if (asprintf(&path, "%s/fit", wish->report) < 0)
		cli_fail("no memory");
	plot_place("report", path, &folder, &name);
	for (int i = 0; i < DELAY_STREAMS; i++) {
		int stride = 1 + streams[i].n / 4000;
		FILE *data;
		char file[40];

		snprintf(file, sizeof(file), "%s.dat", delay_stream_names[i]);
		data = plot_data(folder, file);
		for (int k = 0; k < streams[i].n; k += stride)
			fprintf(data, "%.5f %.5f\n",
				(streams[i].points[k].t_ns -
				 streams[DELAY_TRACKER].points[0].t_ns) *
					1e-9,
				streams[i].points[k].value);
		plot_data_end(data, folder);
	}
	script = plot_begin(folder, "fit", 1000, 500);
	fprintf(script,
		"set xlabel 'time, s'\nset ylabel 'depth, mm'\nset y2label 'force, N'\n"
		"set y2tics\nset key top right\n"
		"plot 'tracker.dat' using ($1-%g):2 with lines ls 1 title 'tracker, "
		"moved', 'force.dat' using 1:2 axes x1y2 with lines ls 2 title 'force'",
		pairs[DELAY_FORCE].there ? pairs[DELAY_FORCE].fit.delay_ms * 1e-3 : 0);
	if (pairs[DELAY_CAMERA].there)
		fprintf(script,
			", 'camera.dat' using ($1+%g):2 with points pt 7 ps 0.4 lc 3 "
			"title 'camera, moved'",
			(pairs[DELAY_CAMERA].fit.delay_ms -
			 pairs[DELAY_FORCE].fit.delay_ms) *
				1e-3);
	putc('\n', script);
	if (!plot_draw(script, folder, "fit"))
		cli_warn("fit.png could not be drawn");
	free(path);
}

static void state(const struct wish *wish, const struct delay_stream *streams,
		  const struct pair *pairs, struct incise_calibration_record *record)
{
	const struct incise_calibration *c = &wish->common.found;
	const double found[][2] = {{c->force_delay_ms, c->force_delay_sd_ms},
				   {c->tracker_delay_ms, c->tracker_delay_sd_ms},
				   {c->camera_delay_ms, c->camera_delay_sd_ms}};
	struct incise_outfile *file;
	FILE *out = calibrate_report_text(wish->common.report, &file);

	if (out) {
		fprintf(out, "Delays against the %s\n\n",
			delay_stream_names[wish->reference]);
		report_pair(out, "force", &pairs[DELAY_FORCE]);
		report_pair(out, "camera", &pairs[DELAY_CAMERA]);
	}
	for (int i = 0; i < DELAY_STREAMS; i++) {
		struct lateness late;
		double u, delay = streams[i].about.delay_ms;
		char key[32];

		if (i == wish->reference || (i != DELAY_TRACKER && !pairs[i].there))
			continue;
		late = lateness_of(streams, pairs, i, wish->reference);
		u = hypot(late.fits_u, late.lines_u);
		snprintf(key, sizeof(key), "%s_delay_ms", delay_stream_names[i]);
		calibrate_value(record, key, "ms", found[i][0], delay + late.ms, u);
		snprintf(key, sizeof(key), "%s_delay_sd_ms", delay_stream_names[i]);
		calibrate_value(record, key, "ms", found[i][1], u, 0);
		if (out)
			fprintf(out,
				"\n%s_delay_ms = %.3f ms: %.3f ms of the recording and "
				"%.3f ms measured; u = %.3f ms, U = %.3f ms (k = 2)\n"
				"  budget            type  u, ms   sensitivity\n"
				"  fit of the motion A     %.4f  1\n"
				"  lines of arrivals B     %.4f  1\n",
				delay_stream_names[i], delay + late.ms, delay, late.ms, u,
				2 * u, late.fits_u, late.lines_u);
	}
	if (out)
		fprintf(out, "\npass\n");
	whole_file_end(file);
	if (out)
		draw(&wish->common, streams, pairs);
}

int main(int argc, char **argv)
{
	struct incise_calibration_record record = {
		.kind = "delay", .low = NAN, .high = NAN, .pass = true};
	struct delay_stream streams[DELAY_STREAMS];
	struct pair pairs[DELAY_STREAMS] = {0};
	struct wish wish = {.range_ms = 150, .reference = DELAY_FORCE};
	const char *raw;

	take_options(&wish, argc, argv);
	calibrate_begin(&wish.common);
	cli_catch_signals();
	if (wish.common.from)
		delay_streams_read(streams, wish.common.from);
	else
		record_now(&wish, streams);
	if (wish.reference == DELAY_CAMERA && !streams[DELAY_CAMERA].n)
		cli_fail("--reference camera: the recording has no depth by a camera");
	fit_pair(&wish, streams, DELAY_FORCE, &pairs[DELAY_FORCE]);
	fit_pair(&wish, streams, DELAY_CAMERA, &pairs[DELAY_CAMERA]);
	if (!pairs[DELAY_FORCE].there && !pairs[DELAY_CAMERA].there)
		cli_fail("there is nothing beside the tracker to compare with");
	raw = wish.common.keep ? wish.common.keep : wish.common.from;
	if (raw)
		snprintf(record.raw, sizeof(record.raw), "%s", raw);
	snprintf(record.device, sizeof(record.device), "%s",
		 streams[DELAY_TRACKER].about.device);
	snprintf(record.method, sizeof(record.method),
		 "least squares of one motion of %.0f s, against the %s",
		 pairs[DELAY_FORCE].there ? pairs[DELAY_FORCE].fit.span_s
					  : pairs[DELAY_CAMERA].fit.span_s,
		 delay_stream_names[wish.reference]);
	state(&wish, streams, pairs, &record);
	snprintf(record.verdict, sizeof(record.verdict),
		 "correlation %.3f with the force, %.3f with the camera",
		 pairs[DELAY_FORCE].fit.correlation, pairs[DELAY_CAMERA].fit.correlation);
	calibrate_end(&wish.common, &record,
		      json_pack("{ss so so}", "reference",
				delay_stream_names[wish.reference], "force",
				pair_json(&pairs[DELAY_FORCE]), "camera",
				pair_json(&pairs[DELAY_CAMERA])));
	for (int i = 0; i < DELAY_STREAMS; i++)
		free(streams[i].points);
	return 0;
}
