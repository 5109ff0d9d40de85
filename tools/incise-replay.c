// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise replay NAME.rec SCENE: the haptic loop on a recording, predicted beside measured.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <incise/replay.h>
#include "cli/calibration.h"
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/loop_report.h"
#include "cli/plot.h"
#include "cli/recording.h"
#include "cli/scene_argument.h"
#include "cli/file.h"

#define PLOT_POINTS 20000 /* so that the plot of an hour is drawn as fast as any */

struct replay_job {
	const char *recording, *csv, *plot, *calibration;
	struct scene_argument scene;
	struct incise_replay_options how;
	bool json;
};

static const char *const times[] = {"arrival", "acquisition", NULL};

static const struct cli_option options[] = {
	{'o', "output", "FILE.csv",
	 "write predicted and measured force of every tick as CSV; - is standard "
	 "output",
	 CLI_OUTPUT(struct replay_job, csv), .extensions = ".csv"},
	{'o', "output", "NAME.png",
	 "draw predicted and measured force as NAME.png and NAME.svg",
	 CLI_OUTPUTS(struct replay_job, plot), .extensions = ".png .svg"},
	{0, "real-time", NULL, "wait for each tick (default: as fast as possible)",
	 CLI_FLAG(struct replay_job, how.real_time)},
	{0, "poses", "WHEN",
	 "give poses to the loop at their arrival, as live, or at their "
	 "acquisition (default: arrival)",
	 CLI_CHOICE(struct replay_job, how.at, times)},
	{'c', "calibration", "FILE",
	 "use this calibration of force instead of that of the recording; none: "
	 "nominal values",
	 CLI_INPUT(struct replay_job, calibration)},
	SCENE_ARGUMENT_OPTIONS(struct replay_job, scene),
	{0, "tool", "KIND",
	 "tool in the hand: auto, blade, handle or tube (default: auto)",
	 CLI_CHOICE(struct replay_job, how.tool, loop_tool_names)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct replay_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "replay",
	.synopsis = "NAME.rec SCENE [OPTIONS]",
	.summary = "Run the haptic loop of a scene on a recording, and compare the force "
		   "that it renders with the measured one.",
	.options = options,
	.examples = "incise replay liver.rec scenes/liver.scene -o liver.csv",
};

static void parse_replay(struct replay_job *job, int argc, char **argv)
{
	*job = (struct replay_job){.how.stop = &cli_stop};
	cli_parse(&command, argc, argv, job);
	if (optind == argc)
		cli_usage("missing NAME.rec (recording)");
	job->recording = file_operand(argv[optind], FILE_RECORDING);
	scene_argument_operand(&job->scene, argc, argv, optind + 1);
	if (job->json && job->csv && !strcmp(job->csv, "-"))
		cli_usage("--json and -o - would both write to standard output");
}

/* Measured beside predicted force, and depth, over time. */
struct plot {
	const char *folder, *name;
	char file[80];		   /* of the data */
	FILE *data;		   /* NULL: nothing is drawn */
	int drawn;		   /* of PLOT_POINTS, the last; -1: none */
	bool has_force, has_depth; /* of the recording */
};

static void begin_plot(struct plot *plot, const char *path)
{
	plot->drawn = -1;
	plot_place("output", path, &plot->folder, &plot->name);
	if (snprintf(plot->file, sizeof(plot->file), "%s.dat", plot->name) >=
	    (int)sizeof(plot->file))
		cli_usage("--output: the name '%s' is too long; give a shorter one",
			  plot->name);
	plot->data = plot_data(plot->folder, plot->file);
}

static void add_to_plot(struct plot *plot, const struct incise_replay_tick *tick)
{
	int point = (int)(tick->done * PLOT_POINTS);

	if (point == plot->drawn)
		return;
	plot->drawn = point;
	plot->has_force |= isfinite(tick->measured_N);
	plot->has_depth |= isfinite(tick->depth_mm);
	/* gnuplot leaves out nan. */
	fprintf(plot->data, "%.4f %.5f %.5f %.4f %.4f\n", tick->t_s, tick->measured_N,
		tick->predicted_N, tick->depth_mm, tick->tick->depth_mm);
}

static void draw_plot(struct plot *plot, const char *recording, const char *scene)
{
	const char *slash = strrchr(scene, '/');
	FILE *script;
	int n = 0;

	plot_data_end(plot->data, plot->folder);
	script = plot_begin(plot->folder, plot->name, 1000, 740);
	fprintf(script,
		"layout = panels(80, 20, below(1), above(1), 0, between)\n"
		"data = '%s'\nset xlabel 'time / s'\nset key off\nset autoscale fix\n"
		"set offsets 0, 0, graph 0.05, graph 0.02\nset xrange [0:*]\n"
		"set multiplot layout 2,1 @layout title ",
		plot->file);
	plot_put_text(script, recording);
	fputs(".' replayed through '.", script);
	plot_put_text(script, slash ? slash + 1 : scene);
	fputs(" noenhanced\nset title '(a) force'\nset ylabel 'force / N'\n", script);
	if (plot->has_force)
		plot_add(script, &n, "data using 1:2 with lines lc rgb grey lw 0.8");
	plot_add(script, &n, "data using 1:3 with lines lt 2");
	fputs("\nset title '(b) depth'\nset ylabel 'depth / mm'\nset yrange [0:*]\n",
	      script);
	n = 0;
	if (plot->has_depth)
		plot_add(script, &n, "data using 1:4 with lines lc rgb grey lw 2.5");
	plot_add(script, &n, "data using 1:5 with lines lt 1");
	fputs("\neval key_panel\n", script);
	n = 0;
	if (plot->has_force || plot->has_depth)
		plot_add(script, &n, "NaN with lines lc rgb grey title 'recorded'");
	plot_add(script, &n, "NaN with lines lt 2 title 'predicted force'");
	plot_add(script, &n, "NaN with lines lt 1 title 'depth in the loop'");
	fputs("\nunset multiplot\n", script);
	plot_draw_or_fail(script, plot->folder, plot->name);
}

/* The ticks' way out, and the progress. */
struct sink {
	FILE *out; /* or NULL */
	bool bar;  /* false: it would run through rows on the same terminal */
	struct cli_bar progress;
	const char *name;
	double normal_max_N;
	struct plot plot;
};

static int put_tick(void *context, const struct incise_replay_tick *tick,
		    struct incise_error *err)
{
	char flags[INCISE_TICK_FLAGS + 1];
	struct sink *sink = context;

	sink->normal_max_N = fmax(sink->normal_max_N, fabs(tick->predicted_N));
	if (sink->bar)
		cli_progress_bar(sink->name, tick->done, &sink->progress);
	if (sink->plot.data)
		add_to_plot(&sink->plot, tick);
	if (!sink->out)
		return 0;
	fprintf(sink->out, "%.6f,%d,%.4f,%.3f,%.6f,", tick->t_s, tick->cut,
		tick->tick->depth_mm, tick->tick->velocity_mm_s, tick->predicted_N);
	/* printf would print a sign of NaN. */
	if (isnan(tick->measured_N))
		fputs("nan", sink->out);
	else
		fprintf(sink->out, "%.6f", tick->measured_N);
	fprintf(sink->out, ",%d,%s\n", tick->clipped,
		loop_flags_text(tick->tick->flags, flags));
	/* On a full disk it ends at once, not after an hour. */
	return ferror(sink->out) ? incise_error_set(err, EIO, "%s: cannot be written: %s",
						    sink->name, strerror(errno))
				 : 0;
}

static double relative(const struct incise_replay_report *report)
{
	return report->range_N > 0 ? report->rms_N / report->range_N : NAN;
}

static void report_replay_json(const struct replay_job *job, double rate_hz,
			       const struct incise_loop_stats *stats,
			       const struct incise_replay_report *r)
{
	char crc[9];

	snprintf(crc, sizeof(crc), "%08x", r->crc);
	json_print(json_pack(
		"{so so sI sf so sf sf sI si sI so so so so so so so ss so so so}",
		"path", json_text(job->recording), "scene", json_text(job->scene.path),
		"ticks", (json_int_t)stats->ticks, "rate_hz", rate_hz, "seconds",
		json_number(r->seconds), "tracker_hz", r->tracker.rate_hz,
		"tracker_latency_ms", r->tracker.latency_ns * 1e-6, "poses",
		(json_int_t)r->poses, "cuts", r->cuts, "compared",
		(json_int_t)r->compared, "rms_error_N", json_number(r->rms_N),
		"rms_error_relative", json_number(relative(r)), "max_error_N",
		json_number(r->max_N), "max_error_t_s",
		r->compared ? json_number(r->max_t_s) : json_null(), "force_max_N",
		json_number(stats->force_max_N), "flags", loop_flags_json(stats->flagged),
		"spells", loop_flags_json(r->spells), "crc32c", crc, "lateness_us",
		job->how.real_time ? loop_lateness_json(stats) : json_null(), "late",
		job->how.real_time ? json_integer((json_int_t)r->late) : json_null(),
		"texture_felt", json_number(stats->texture_felt)));
}

/* Print the reasons why there was less force than the tissue's. */
static void held_line(const struct incise_loop_stats *stats,
		      const struct incise_replay_report *report)
{
	static const struct {
		enum incise_tick_flag flag;
		const char *why;
	} reasons[] = {
		{INCISE_TICK_STALE, "no fresh pose"},
		{INCISE_TICK_STARTING, "starting or fading"},
		{INCISE_TICK_CLAMPED, "the largest force"},
		{INCISE_TICK_SLEWED, "the largest slew"},
		{INCISE_TICK_NOT_FINITE, "a force that was not a number"},
	};
	const char *between = "held       ";

	for (size_t i = 0; i < sizeof(reasons) / sizeof(*reasons); i++) {
		int bit = __builtin_ctz(reasons[i].flag);

		if (!stats->flagged[bit])
			continue;
		printf("%s%s %llu ticks (%llu x)", between, reasons[i].why,
		       (unsigned long long)stats->flagged[bit],
		       (unsigned long long)report->spells[bit]);
		between = "; ";
	}
	if (*between == ';')
		putchar('\n');
}

static void report_replay_text(const struct replay_job *job,
			       const struct incise_scene *scene, double normal_max_N,
			       double rate_hz, const struct incise_loop_stats *stats,
			       const struct incise_replay_report *r)
{
	printf("%s: %.1f s, %s at %g Hz, %s, %s\n", job->recording, r->seconds,
	       cli_count(stats->ticks, "tick"), rate_hz, cli_count(r->poses, "pose"),
	       cli_count(r->cuts, "cut"));
	if (r->compared) {
		printf("predicted  error %.4f N rms", r->rms_N);
		if (!isnan(relative(r)))
			printf(" (%.2f %% of the range)", 100 * relative(r));
		printf(", at most %.4f N at %.3f s, in %s\n", r->max_N, r->max_t_s,
		       cli_count(r->compared, "tick"));
	} else {
		printf("predicted  no cut in this recording: nothing to compare\n");
	}
	printf("force      largest %.3f N%s, along the normal %.3f N, %llu ticks in contact, "
	       "%llu outside the model's support\n",
	       stats->force_max_N,
	       stats->flagged[__builtin_ctz(INCISE_TICK_CLAMPED)] ? " (limit)" : "",
	       normal_max_N,
	       (unsigned long long)stats->flagged[__builtin_ctz(INCISE_TICK_CONTACT)],
	       (unsigned long long)
		       stats->flagged[__builtin_ctz(INCISE_TICK_EXTRAPOLATED)]);
	held_line(stats, r);
	loop_texture_line(stats, scene);
	if (job->how.real_time) {
		loop_lateness_line(stats);
		printf("late       %llu ticks by a period or more\n",
		       (unsigned long long)r->late);
	}
	printf("crc32c     %08x\n", r->crc);
}

int main(int argc, char **argv)
{
	static struct incise_loop_stats stats;
	struct calibration_used calibration;
	struct incise_replay_report report;
	struct incise_recording *recording;
	struct incise_outfile *file = NULL;
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct sink sink = {0};
	struct replay_job job;
	double rate_hz;
	int rc;

	parse_replay(&job, argc, argv);
	if (job.calibration) {
		calibration_use(&calibration, job.calibration, NULL);
		job.how.calibration = &calibration.values;
	}
	scene = scene_argument_load(&job.scene);
	rate_hz = incise_scene_rate_hz(scene);
	recording = recording_open(job.recording);
	sink.name = job.recording;
	sink.bar = !job.csv || strcmp(job.csv, "-");
	if (job.csv) {
		sink.name = job.csv;
		sink.out = whole_file_begin(job.csv, &file);
		fputs("t_s,cut,depth_mm,velocity_mm_s,predicted_N,measured_N,clipped,"
		      "flags\n",
		      sink.out);
	}
	if (job.plot)
		begin_plot(&sink.plot, job.plot);
	job.how.ticked = put_tick;
	job.how.context = &sink;
	cli_catch_signals();
	rc = incise_replay(recording, scene, &job.how, &stats, &report, &err);
	cli_progress_end();
	if (file && (rc || cli_stop))
		incise_outfile_abort(file);
	else if (file)
		rc = incise_outfile_commit(file, &err);
	cli_check(rc, &err);
	if (cli_stop)
		cli_fail("%s: interrupted %.1f s after its beginning%s", job.recording,
			 report.seconds, job.csv ? "; nothing was written" : "");
	if (job.plot)
		draw_plot(&sink.plot, job.recording, incise_scene_file(scene, 0));
	if (job.json) {
		report_replay_json(&job, rate_hz, &stats, &report);
	} else if (sink.bar) {
		report_replay_text(&job, scene, sink.normal_max_N, rate_hz, &stats,
				   &report);
		cli_written();
	}
	cli_finish();
	incise_recording_close(recording);
	incise_scene_free(scene);
	return 0;
}
