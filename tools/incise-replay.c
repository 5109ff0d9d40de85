// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise replay NAME.rec SCENE: the haptic loop on a recording, predicted beside measured.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <incise/calibration.h>
#include <incise/replay.h>
#include "cli/cli.h"
#include "cli/json.h"
#include "cli/loop_report.h"
#include "cli/replay_picture.h"
#include "cli/scene_argument.h"
#include "cli/file.h"

enum {
	OPT_CSV = CLI_LONG,
	OPT_PLOT,
	OPT_AT,
	OPT_REAL_TIME,
	OPT_MODEL,
	OPT_ARITH,
	OPT_TOOL,
	OPT_JSON
};

static const struct cli_option options[] = {
	{OPT_CSV, "csv", "FILE",
	 "write every tick, predicted beside measured force; - is standard\noutput"},
	{OPT_PLOT, "plot", "NAME",
	 "draw predicted beside measured force as NAME.png and NAME.svg"},
	{OPT_REAL_TIME, "real-time", NULL,
	 "wait for each tick (default: as fast as it goes)"},
	{OPT_AT, "at", "WHEN",
	 "give poses to the loop at their arrival, as live, or at their\n"
	 "acquisition (default: arrival)"},
	{'c', "calibration", "FILE.conf",
	 "take this calibration of force, not that of the recording"},
	{OPT_MODEL, "model", "FILE", "use this model instead of the scene's"},
	{OPT_ARITH, "arith", "KIND", "fixed or double, instead of the scene's"},
	{OPT_TOOL, "tool", "KIND",
	 "what the hand held: auto, blade, handle or tube (default: auto)"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_command command = {
	.name = "replay",
	.synopsis = "NAME.rec SCENE [OPTIONS]",
	.summary =
		"Run the haptic loop of a scene on a recording: the force that it would have\n"
		"asked for, beside the one that was measured.",
	.options = options,
	.notes = "Example: incise replay liver.rec scenes/liver.scene --csv liver.csv\n"
		 "Exit codes: 0 success, 1 failure, 2 bad usage.",
};

struct job {
	const char *recording, *csv, *plot, *calibration;
	struct scene_argument scene;
	struct incise_replay_options how;
	bool json;
};

/* The number of a word, for options whose words are few. */
static int word(const char *option, const char *text, const char *const *words)
{
	for (int i = 0; words[i]; i++)
		if (!strcmp(text, words[i]))
			return i;
	cli_usage("--%s: '%s' is none that it can be; see --help", option, text);
}

static void parse(struct job *job, int argc, char **argv)
{
	static const char *const whens[] = {"arrival", "acquisition", NULL};
	static const char *const tools[] = {"auto", "blade", "handle", "tube", NULL};
	int opt;

	*job = (struct job){.how.stop = &cli_stop};
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_CSV:
			job->csv = optarg;
			break;
		case OPT_PLOT:
			job->plot = optarg;
			break;
		case OPT_REAL_TIME:
			job->how.real_time = true;
			break;
		case OPT_AT:
			job->how.at = (enum incise_replay_at)word("at", optarg, whens);
			break;
		case 'c':
			job->calibration = optarg;
			break;
		case OPT_MODEL:
			job->scene.model = optarg;
			break;
		case OPT_ARITH:
			scene_argument_arith(&job->scene, optarg);
			break;
		case OPT_TOOL:
			job->how.tool = (enum incise_tool)word("tool", optarg, tools);
			break;
		case OPT_JSON:
			job->json = true;
			break;
		}
	if (argc - optind != 2)
		cli_usage("expected a recording and a scene, got %d names",
			  argc - optind);
	job->recording = argv[optind];
	scene_argument_operand(&job->scene, argc, argv, optind + 1);
	if (job->json && job->csv && !strcmp(job->csv, "-"))
		cli_usage("--json and --csv - would both write to standard output");
}

/* Where ticks go to, and how far it is. */
struct table {
	FILE *out; /* or NULL */
	bool bar;  /* one would run through rows on the same terminal */
	int percent;
	const char *name;
	struct replay_picture *picture; /* or NULL */
};

static void show_progress(struct table *table, double done)
{
	static const char full[] = "##############################";
	int percent = (int)(100 * done), n = (int)(done * (sizeof(full) - 1));

	if (!table->bar || percent == table->percent)
		return;
	table->percent = percent;
	cli_progress("%s [%-*.*s] %d %%", table->name, (int)sizeof(full) - 1, n, full,
		     percent);
}

static int put_tick(void *context, const struct incise_replay_tick *told,
		    struct incise_error *err)
{
	char flags[INCISE_TICK_FLAGS + 1];
	struct table *table = context;

	show_progress(table, told->done);
	if (table->picture)
		replay_picture_add(table->picture, told);
	if (!table->out)
		return 0;
	fprintf(table->out, "%.6f,%d,%.4f,%.3f,%.6f,", told->t_s, told->cut,
		told->tick->depth_mm, told->tick->velocity_mm_s, told->predicted_N);
	/* Not printf's word: a NaN's sign says nothing. */
	if (isnan(told->measured_N))
		fputs("nan", table->out);
	else
		fprintf(table->out, "%.6f", told->measured_N);
	fprintf(table->out, ",%d,%s\n", told->clipped,
		loop_flags_text(told->tick->flags, flags));
	/* A full disk is no reason to go on for an hour. */
	return ferror(table->out)
		       ? incise_error_set(err, EIO, "%s: cannot be written: %s",
					  table->name, strerror(errno))
		       : 0;
}

static double relative(const struct incise_replay_report *report)
{
	return report->range_N > 0 ? report->rms_N / report->range_N : NAN;
}

static void report_json(const struct job *job, double rate_hz,
			const struct incise_loop_stats *stats,
			const struct incise_replay_report *r)
{
	char crc[9];

	snprintf(crc, sizeof(crc), "%08x", r->crc);
	json_print(json_pack(
		"{so so sI sf so sf sf sI si sI so so so so so so so ss so so}", "path",
		json_text(job->recording), "scene", json_text(job->scene.path), "ticks",
		(json_int_t)stats->ticks, "rate_hz", rate_hz, "seconds",
		json_number(r->seconds), "tracker_hz", r->tracker.rate_hz,
		"tracker_latency_ms", r->tracker.latency_ns * 1e-6, "poses",
		(json_int_t)r->poses, "cuts", r->cuts, "compared",
		(json_int_t)r->compared, "rms_N", json_number(r->rms_N), "nrmse",
		json_number(relative(r)), "max_N", json_number(r->max_N), "max_t_s",
		r->compared ? json_number(r->max_t_s) : json_null(), "force_max_N",
		json_number(stats->force_max_N), "flags", loop_flags_json(stats->flagged),
		"spells", loop_flags_json(r->spells), "crc32c", crc, "lateness_us",
		job->how.real_time ? loop_lateness_json(stats) : json_null(), "late",
		job->how.real_time ? json_integer((json_int_t)r->late) : json_null()));
}

/* Why there was less force than the tissue's, or none, as far as it was met. */
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
		{INCISE_TICK_GUARDED, "the guard"},
		{INCISE_TICK_NOT_FINITE, "a force that was no number"},
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

static void report_text(const struct job *job, double rate_hz,
			const struct incise_loop_stats *stats,
			const struct incise_replay_report *r)
{
	printf("%s: %.1f s, %llu ticks at %g Hz, %llu poses, %d cuts\n", job->recording,
	       r->seconds, (unsigned long long)stats->ticks, rate_hz,
	       (unsigned long long)r->poses, r->cuts);
	if (r->compared) {
		printf("predicted  off by %.4f N rms", r->rms_N);
		if (!isnan(relative(r)))
			printf(" (%.2f %% of the range)", 100 * relative(r));
		printf(", at most %.4f N at %.3f s, in %llu ticks\n", r->max_N,
		       r->max_t_s, (unsigned long long)r->compared);
	} else {
		printf("predicted  beside nothing: no force was measured in a cut\n");
	}
	printf("force      largest %.3f N, %llu ticks in contact, %llu outside the model's "
	       "support\n",
	       stats->force_max_N,
	       (unsigned long long)stats->flagged[__builtin_ctz(INCISE_TICK_CONTACT)],
	       (unsigned long long)
		       stats->flagged[__builtin_ctz(INCISE_TICK_EXTRAPOLATED)]);
	held_line(stats, r);
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
	struct incise_calibration calibration;
	struct incise_replay_report report;
	struct incise_recording *recording;
	struct incise_outfile *file = NULL;
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct table table = {.percent = -1};
	struct replay_picture picture;
	struct job job;
	double rate_hz;
	int rc;

	parse(&job, argc, argv);
	if (job.calibration &&
	    incise_calibration_load(job.calibration, &calibration, &err))
		cli_fail_with(&err);
	if (job.calibration)
		job.how.calibration = &calibration;
	scene = scene_argument_load(&job.scene);
	rate_hz = incise_scene_rate_hz(scene);
	recording = incise_recording_open(job.recording, &err);
	if (!recording)
		cli_fail_with(&err);
	table.name = job.recording;
	table.bar = !job.csv || strcmp(job.csv, "-");
	if (job.csv) {
		table.name = job.csv;
		table.out = whole_file_begin(job.csv, &file);
		fputs("t_s,cut,depth_mm,velocity_mm_s,predicted_N,measured_N,clipped,"
		      "flags\n",
		      table.out);
	}
	if (job.plot) {
		replay_picture_begin(&picture, job.plot);
		table.picture = &picture;
	}
	job.how.ticked = put_tick;
	job.how.context = &table;
	cli_catch_signals();
	rc = incise_replay(recording, scene, &job.how, &stats, &report, &err);
	cli_progress_end();
	if (file && (rc || cli_stop))
		incise_outfile_abort(file);
	else if (file)
		rc = incise_outfile_commit(file, &err);
	if (rc)
		cli_fail_with(&err);
	if (cli_stop)
		cli_fail("%s: interrupted %.1f s after its beginning%s", job.recording,
			 report.seconds, job.csv ? "; nothing was written" : "");
	if (job.plot)
		replay_picture_draw(&picture);
	if (job.json)
		report_json(&job, rate_hz, &stats, &report);
	else if (table.bar)
		report_text(&job, rate_hz, &stats, &report);
	cli_finish();
	incise_recording_close(recording);
	incise_scene_free(scene);
	return 0;
}
