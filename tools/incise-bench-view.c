// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench view [SCENE]: what the picture costs, how far off it is, whether it takes all
 * cuts and lets the loop be. A program of its own: it maps what draws, as other benches do not.
 */
#include <getopt.h>
#include <stdio.h>
#include "bench/bench_view_error.h"
#include "bench/bench_view_frames.h"
#include "bench/bench_view_live.h"
#include "cli/cli.h"
#include "bench/compare.h"
#include "bench/metrics.h"
#include "cli/json.h"
#include "bench/machine.h"
#include "cli/file.h"
#include "cli/plot.h"
#include "cli/scene_argument.h"

enum { OPT_JSON = CLI_LONG, OPT_PLOT, OPT_QUICK, OPT_DURATION, OPT_AGAINST };

static const struct cli_option options[] = {
	{OPT_JSON, "json", NULL, "report as JSON"},
	{OPT_AGAINST, "against", "OLD.json",
	 "compare with an older report of --json: what changed\nbeyond noise"},
	{OPT_PLOT, "plot", "NAME", "draw error over run time as NAME.png and NAME.svg"},
	{OPT_DURATION, "duration", "TIME",
	 "of each run beside a loop, and of that of cuts,\nsuch as 10min (default: 4s)"},
	{OPT_QUICK, "quick", NULL, "fewer frames and runs: a look, not a measurement"},
	{0},
};

static const struct cli_command verb = {
	.name = "bench view",
	.synopsis = "[SCENE] [OPTIONS]",
	.summary =
		"Measure the picture of a scene, drawn without a screen while a cut bleeds: time\n"
		"per frame by sizes of texture and picture; error against a finer texture and more\n"
		"frames, over that time; whether cuts of a loop of 5 kHz are all seen; how late a\n"
		"loop is with and without it. Without SCENE that is paper 2's neck.",
	.options = options,
	.notes = "Exit: 0 measured, 1 failed or figures got worse, 2 bad usage.\n"
		 "See incise-bench-view(1).",
};

#define UNTIL_S 14.0 /* of the procedure: cut, bleeding, enlarging */
#define QUICK_UNTIL_S 1.5
#define ERROR_UNTIL_S 8.0
#define QUICK_ERROR_UNTIL_S 2.5
#define LIVE_S 4.0
#define QUICK_LIVE_S 0.5

/* As scenes/neck.scene, so that figures of a release do not hang on what is installed. */
static const char neck[] =
	"rate_hz = 1000.0;\n"
	"surface = { kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0];\n"
	"  to_mm = [160.0, 0.0, -55.0]; radius_mm = 55.0; };\n"
	"tissue = { reaction_N_mm = 0.14; plane_N_mm = 0.17; damping_N_s_mm = 0.0005;\n"
	"  insertion_N_mm = 0.28; aligned = 0.2; spread_N_mm = 0.22; };\n"
	"effects = { average_ticks = 8; guard = true; };\n"
	"tool = { handle_mm = 120.0; };\n"
	"limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n"
	"picture = { wound = true; bleeding = true; skin = \"neck\"; larynx = true;\n"
	"  blood_ul_s_mm2 = 0.3; gravity = [0.0, -0.5, -0.9]; };\n";

struct job {
	const char *scene, *plot, *against, *folder, *name;
	bool json, quick;
	double seconds;
};

struct measured {
	struct machine machine;
	struct frame_rows frames;
	struct shown_rows shown;
	struct absorbed absorbed;
	struct beside beside;
};

static void measure(const struct job *job, struct measured *m)
{
	struct view_script script;

	machine_init(&m->machine);
	/* First: this one locks what memory there is. */
	bench_view_beside(job->scene, job->seconds, job->quick, &m->beside);
	view_script_begin(&script, job->scene,
			  job->quick ? QUICK_ERROR_UNTIL_S : UNTIL_S);
	bench_view_frames(&script, job->quick ? QUICK_UNTIL_S : UNTIL_S, job->quick,
			  &m->frames);
	bench_view_error(&script, job->quick ? QUICK_ERROR_UNTIL_S : ERROR_UNTIL_S,
			 job->quick, &m->frames, &m->shown);
	view_script_end(&script);
	bench_view_absorbed(job->scene, job->seconds, &m->absorbed);
}

static void report(const struct job *job, const struct measured *m)
{
	if (job->json) {
		json_t *figures = json_array();

		frame_rows_figures(&m->frames, figures);
		shown_rows_figures(&m->shown, figures);
		absorbed_figures(&m->absorbed, figures);
		beside_figures(&m->beside, figures);
		json_print(json_pack(
			"{so ss sb so so so so so}", "machine", machine_json(&m->machine),
			"renderer", m->frames.renderer, "quick", job->quick, "frames",
			frame_rows_json(&m->frames), "shown", shown_rows_json(&m->shown),
			"absorbed", absorbed_json(&m->absorbed), "beside",
			beside_json(&m->beside), "figures", figures));
	} else {
		printf("%s, %s\n\n", m->machine.cpu, m->machine.kernel);
		frame_rows_print(&m->frames);
		shown_rows_print(&m->shown);
		absorbed_print(&m->absorbed);
		beside_print(&m->beside);
	}
	if (job->plot)
		shown_rows_draw(&m->shown, job->folder, job->name);
}

static void parse(struct job *job, int argc, char **argv)
{
	struct scene_argument argument = {0};
	int opt;

	*job = (struct job){0};
	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_JSON:
			job->json = true;
			break;
		case OPT_PLOT:
			job->plot = optarg;
			break;
		case OPT_DURATION:
			job->seconds = cli_duration("duration", optarg, 0.5, 86400);
			break;
		case OPT_QUICK:
			job->quick = true;
			break;
		case OPT_AGAINST:
			job->against = optarg;
			break;
		}
	if (argc - optind > 1)
		cli_usage("expected at most one scene");
	if (optind < argc)
		scene_argument_operand(&argument, argc, argv, optind);
	job->scene = argument.path;
	if (!(job->seconds > 0))
		job->seconds = job->quick ? QUICK_LIVE_S : LIVE_S;
	if (job->plot)
		plot_place("plot", job->plot, &job->folder, &job->name);
}

int main(int argc, char **argv)
{
	static struct measured measured;
	struct memory_file own = {0};
	struct job job;

	parse(&job, argc, argv);
	if (job.against) {
		compare_against(job.against, job.json);
		job.json = true;
	}
	incise_realtime_prepare();
	cli_catch_signals();
	if (!job.scene) {
		own = memory_file_begin("neck");
		fputs(neck, own.file);
		memory_file_written(&own);
		job.scene = own.path;
	}
	measure(&job, &measured);
	report(&job, &measured);
	if (own.file)
		fclose(own.file);
	cli_finish();
	return 0;
}
