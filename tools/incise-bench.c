// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench WHAT: a word for each bench_*.h.
 */
#include <getopt.h>
#include <string.h>
#include "bench_capture.h"
#include "bench_loop.h"
#include "bench_pose.h"
#include "bench_precision.h"
#include "bench_stability.h"
#include "bench_timeline.h"
#include "bench_training.h"
#include "bench_vision.h"
#include "cli.h"
#include "compare.h"

enum { OPT_JSON = CLI_LONG, OPT_PLOT, OPT_QUICK, OPT_DURATION, OPT_LOAD, OPT_AGAINST };

static const struct cli_option options[] = {
	{OPT_JSON, "json", NULL, "report as JSON"},
	{OPT_AGAINST, "against", "OLD.json",
	 "compare with an older report of --json: what changed\nbeyond noise"},
	{OPT_PLOT, "plot", "NAME",
	 "draw error over time as NAME.png and NAME.svg;\n"
	 "stability: NAME-map, NAME-guard, NAME-integrators;\n"
	 "loop: NAME-wakeups, NAME-rates;\n"
	 "pose: NAME, NAME-rates; timeline: NAME, NAME-windows"},
	{OPT_DURATION, "duration", "TIME",
	 "of each run of capture, and each of loop's wake-ups:\n10min; default 10s"},
	{OPT_LOAD, "load", "NAME",
	 "loop: wake-ups under one load only: idle, cpu,\nmemory, disk or view"},
	{OPT_QUICK, "quick", NULL, "fewer points and repeats: a look, not a measurement"},
	{0},
};

static const struct cli_verb verb = {
	.name = "bench",
	.synopsis =
		"precision [MODEL.fis] | training | stability | loop [SCENE] | vision | capture "
		"[RUN] | pose | timeline | view [SCENE] | compare OLD.json NEW.json [OPTIONS]",
	.summary =
		"precision: measure error against run time of a model's arithmetics. Without\n"
		"MODEL a model of the paper's size (20 rules) is made.\n"
		"training: measure how long training takes on data of the paper's size.\n"
		"stability: find how stiff a virtual wall may be, simulated and computed; the\n"
		"guard of passivity on and off; integrators of a stiff spring.\n"
		"loop: measure what a tick of the haptic loop costs with all forces, on a plane\n"
		"and on meshes of 20 000 and 500 000 triangles, or of SCENE; how late the machine\n"
		"wakes it, idle and under loads, beside cyclictest; and the error of the force over\n"
		"the loop's rate.\n"
		"vision: measure error and run time of the exposed length in pictures whose truth\n"
		"is known.\n"
		"capture: measure how much of a core it takes to record all streams in real time,\n"
		"and with parts left out; or one RUN of these.\n"
		"pose: measure how far off the pose is that the loop is given, over the rate and\n"
		"the delay of the tracker and what it costs; and what losses of poses do.\n"
		"timeline: measure how far off the times are that samples get which come late, by\n"
		"a clock that drifts, over how much was seen and what it costs.\n"
		"view: measure what the picture of a scene costs, and how far off it is; see\n"
		"'incise bench view --help'.\n"
		"compare: say what changed beyond noise between two reports of --json.",
	.options = options,
	.notes =
		"Exit: 0 measured, 1 failed, simulation and theory differ, or figures got worse,\n"
		"2 bad usage.\n"
		"See incise-bench(1).",
};

struct job {
	bool json, quick;
	double seconds; /* 0: not given */
	const char *plot, *load, *against, *operand;
};

static void precision(const struct job *job)
{
	bench_precision(job->operand, job->json, job->quick, job->plot);
}

static void training(const struct job *job)
{
	bench_training(job->json, job->quick);
}

static void stability(const struct job *job)
{
	bench_stability(job->json, job->quick, job->plot);
}

static void loop(const struct job *job)
{
	const struct bench_loop bench = {
		.scene = job->operand,
		.load = job->load,
		.seconds = job->seconds,
		.json = job->json,
		.quick = job->quick,
		.plot = job->plot,
	};

	bench_loop(&bench);
}

static void vision(const struct job *job)
{
	bench_vision(job->json, job->quick);
}

static void capture(const struct job *job)
{
	bench_capture(job->operand, job->seconds, job->json, job->quick);
}

static void pose(const struct job *job)
{
	bench_pose(job->json, job->quick, job->plot);
}

static void timeline(const struct job *job)
{
	bench_timeline(job->json, job->quick, job->plot);
}

static const struct {
	const char *word;
	bool operand, plot; /* takes one */
	void (*run)(const struct job *job);
} words[] = {
	{"precision", true, true, precision},  {"training", false, false, training},
	{"stability", false, true, stability}, {"loop", true, true, loop},
	{"vision", false, false, vision},      {"capture", true, false, capture},
	{"pose", false, true, pose},	       {"timeline", false, true, timeline},
};
#define WORDS (int)(sizeof(words) / sizeof(*words))

static int compare(const struct job *job, int argc, char **argv)
{
	struct incise_error err = {0};
	json_t *reports[2], *comparison = NULL;

	if (argc != 3)
		cli_usage("expected 'compare' and two reports");
	if (job->plot || job->load || job->against || job->quick || job->seconds > 0)
		cli_usage("'compare' takes no option but --json");
	for (int i = 0; i < 2; i++) {
		reports[i] = compare_load(argv[1 + i], &err);
		if (!reports[i])
			cli_fail_with(&err);
	}
	comparison = compare_reports(reports[0], argv[1], reports[1], argv[2], &err);
	if (!comparison)
		cli_fail_with(&err);
	json_decref(reports[0]);
	json_decref(reports[1]);
	compare_finish(comparison, job->json);
	return 0;
}

int main(int argc, char **argv)
{
	struct job job = {0};
	int opt, what = 0;

	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_JSON:
			job.json = true;
			break;
		case OPT_PLOT:
			job.plot = optarg;
			break;
		case OPT_DURATION:
			job.seconds = cli_duration("duration", optarg, 1, 86400);
			break;
		case OPT_LOAD:
			job.load = optarg;
			break;
		case OPT_QUICK:
			job.quick = true;
			break;
		case OPT_AGAINST:
			job.against = optarg;
			break;
		}
	if (optind < argc && !strcmp(argv[optind], "compare"))
		return compare(&job, argc - optind, argv + optind);
	while (optind < argc && what < WORDS && strcmp(argv[optind], words[what].word))
		what++;
	if (optind < argc && !strcmp(argv[optind], "view"))
		cli_usage("'view' stands right behind 'incise bench', and is built where "
			  "SDL2, libepoxy, cairo and EGL are");
	if (optind >= argc || what == WORDS ||
	    argc - optind > (words[what].operand ? 2 : 1))
		cli_usage(
			"expected 'training', 'stability', 'vision', 'pose', 'timeline', "
			"'precision' and at most one model, 'loop' and at most one scene, "
			"'capture' and at most one run, or 'compare' and two reports");
	if (job.plot && !words[what].plot)
		cli_usage("--plot goes with 'precision', 'stability', 'loop', 'pose' and "
			  "'timeline'");
	if (job.seconds > 0 && words[what].run != capture && words[what].run != loop)
		cli_usage("--duration goes with 'capture' and 'loop'");
	if (job.load && words[what].run != loop)
		cli_usage("--load goes with 'loop'");
	job.operand = argc - optind == 2 ? argv[optind + 1] : NULL;
	if (job.against) {
		compare_against(job.against, job.json);
		job.json = true;
	}
	words[what].run(&job);
	cli_finish();
	return 0;
}
