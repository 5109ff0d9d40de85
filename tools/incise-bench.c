// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench WHAT: a word for each bench_*.h.
 */
#include <getopt.h>
#include <limits.h>
#include <string.h>
#include "bench/bench_capture.h"
#include "bench/bench_extremes.h"
#include "bench/bench_loop.h"
#include "bench/bench_pose.h"
#include "bench/bench_precision.h"
#include "bench/bench_scenes.h"
#include "bench/bench_stability.h"
#include "bench/bench_timeline.h"
#include "bench/bench_training.h"
#include "bench/bench_vision.h"
#include "cli/cli.h"
#include "bench/compare.h"
#include "cli/json.h"

enum {
	OPT_JSON = CLI_LONG,
	OPT_PLOT,
	OPT_QUICK,
	OPT_DURATION,
	OPT_LOAD,
	OPT_PROFILE,
	OPT_SEED,
	OPT_AGAINST,
};

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
	 "of each run of capture, and each of loop's wake-ups,\nsuch as 10min (default: 7s and 5s)"},
	{OPT_LOAD, "load", "NAME",
	 "loop: wake-ups under one load only: idle, cpu,\nmemory, disk or view"},
	{OPT_PROFILE, "profile", "WHICH",
	 "scenes: only run some ticks of one, with the stages\nthat it needs or with all: needed or full; for perf\nstat or callgrind"},
	{OPT_SEED, "seed", "N", "extremes: another set of cases (default: 1)"},
	{OPT_QUICK, "quick", NULL, "fewer points and repeats: a look, not a measurement"},
	{0},
};

static const struct cli_command verb = {
	.name = "bench",
	.synopsis =
		"precision [MODEL.fis] | training | stability | loop [SCENE] | pose | timeline | "
		"vision | capture [RUN] | scenes [SCENE...] | extremes | view [SCENE] | all | "
		"compare OLD.json NEW.json [OPTIONS]",
	.summary =
		"Measure error against run time, and what is stable; tables, JSON, pictures.\n"
		"  precision [MODEL.fis]  arithmetics of a model, without MODEL of the paper's size\n"
		"  training               error on unseen cuts over the seconds that training takes\n"
		"  stability              how stiff a virtual wall may be, simulated and computed;\n"
		"                         the guard of passivity; integrators of a stiff spring\n"
		"  loop [SCENE]           cost of a tick; how late the machine wakes the loop, idle\n"
		"                         and under loads, beside cyclictest; error over its rate\n"
		"  pose                   error of the pose over the tracker's rate, delay and cost\n"
		"  timeline               error of times of samples that come late, by a clock that\n"
		"                         drifts, over how much was seen and the cost\n"
		"  vision                 error of the exposed length over the time per picture\n"
		"  capture [RUN]          how much of a core it takes to record all streams\n"
		"  scenes [SCENE...]      what each scene leaves out, and what that saves\n"
		"  extremes               numbers and bytes that nobody should send, at each door of\n"
		"                         the library; walls of 10 N/m to 1 GN/m\n"
		"  view [SCENE]           the picture of a scene: see 'incise bench view --help'\n"
		"  all                    all of these, and one report: see 'incise bench all --help'\n"
		"compare says what changed beyond noise between two reports of --json.",
	.options = options,
	.notes =
		"Exit: 0 measured, 1 failed, simulation and theory or the forces of two ways differ,\n"
		"or figures got worse, 2 bad usage.\n"
		"See incise-bench(1).",
};

struct job {
	bool json, quick;
	double seconds; /* 0: not given */
	long seed;	/* the same */
	const char *plot, *load, *profile, *against;
	const char *operand; /* the first, or NULL */
	char **operands;
	int n_operands;
};

static void precision(const struct job *job)
{
	bench_precision(job->operand, job->json, job->quick, job->plot);
}

static void training(const struct job *job)
{
	bench_training(job->json, job->quick, job->plot);
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
	bench_vision(job->json, job->quick, job->plot);
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

static void scenes(const struct job *job)
{
	if (job->profile && job->n_operands != 1)
		cli_usage("--profile is of one scene, got %d", job->n_operands);
	if (job->profile)
		bench_scenes_profile(job->operand, !strcmp(job->profile, "full"));
	else
		bench_scenes(job->operands, job->n_operands, job->json, job->quick,
			     job->plot);
}

static void extremes(const struct job *job)
{
	bench_extremes(job->seed ? (uint64_t)job->seed : 1, job->json, job->quick,
		       job->plot);
}

/* Options that not every word takes. */
enum { PLOT = 1, DURATION = 2, LOAD = 4, PROFILE = 8, SEED = 16 };

static const struct {
	const char *word;
	int operands, options; /* at most; of those above */
	void (*run)(const struct job *job);
} words[] = {
	{"precision", 1, PLOT, precision},
	{"training", 0, PLOT, training},
	{"stability", 0, PLOT, stability},
	{"loop", 1, PLOT | DURATION | LOAD, loop},
	{"pose", 0, PLOT, pose},
	{"timeline", 0, PLOT, timeline},
	{"vision", 0, PLOT, vision},
	{"capture", 1, DURATION, capture},
	{"scenes", BENCH_SCENES_MOST, PLOT | PROFILE, scenes},
	{"extremes", 0, PLOT | SEED, extremes},
};
#define WORDS (int)(sizeof(words) / sizeof(*words))

static int compare(const struct job *job, int argc, char **argv)
{
	struct incise_error err = {0};
	json_t *reports[2], *comparison = NULL;

	if (argc != 3)
		cli_usage("expected 'compare' and two reports");
	if (job->plot || job->load || job->profile || job->against || job->quick ||
	    job->seed || job->seconds > 0)
		cli_usage("'compare' takes no option but --json");
	for (int i = 0; i < 2; i++) {
		reports[i] = json_read(argv[1 + i], &err);
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

/* An option that was given goes with the word, or is bad usage. */
static void allow(int what, bool given, int option, const char *name)
{
	if (given && !(words[what].options & option))
		cli_usage("--%s does not go with '%s'", name, words[what].word);
}

static int word_of(int argc, char **argv)
{
	if (argc < 1)
		cli_usage("expected what to measure, such as 'precision'");
	for (int i = 0; i < WORDS; i++) {
		if (strcmp(argv[0], words[i].word))
			continue;
		if (argc - 1 > words[i].operands)
			cli_usage("'%s' takes at most %d operand%s, got %d",
				  words[i].word, words[i].operands,
				  words[i].operands == 1 ? "" : "s", argc - 1);
		return i;
	}
	if (!strcmp(argv[0], "view") || !strcmp(argv[0], "all"))
		cli_usage("'%s' stands right behind 'incise bench'%s", argv[0],
			  *argv[0] == 'a' ? ""
					  : ", and is built where SDL2, libepoxy, cairo "
					    "and EGL are");
	cli_usage("'%s' is nothing that can be measured", argv[0]);
}

static void parse(struct job *job, int argc, char **argv)
{
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
			job->seconds = cli_duration("duration", optarg, 1, 86400);
			break;
		case OPT_LOAD:
			job->load = optarg;
			break;
		case OPT_PROFILE:
			job->profile = optarg;
			if (strcmp(optarg, "needed") && strcmp(optarg, "full"))
				cli_usage("--profile: '%s' is neither needed nor full",
					  optarg);
			break;
		case OPT_SEED:
			job->seed = cli_integer("seed", optarg, 1, LONG_MAX);
			break;
		case OPT_QUICK:
			job->quick = true;
			break;
		case OPT_AGAINST:
			job->against = optarg;
			break;
		}
}

int main(int argc, char **argv)
{
	struct job job;
	int what;

	parse(&job, argc, argv);
	argc -= optind;
	argv += optind;
	if (argc && !strcmp(argv[0], "compare"))
		return compare(&job, argc, argv);
	what = word_of(argc, argv);
	allow(what, job.plot, PLOT, "plot");
	allow(what, job.seconds > 0, DURATION, "duration");
	allow(what, job.load, LOAD, "load");
	allow(what, job.profile, PROFILE, "profile");
	allow(what, job.seed, SEED, "seed");
	job.operands = argv + 1;
	job.n_operands = argc - 1;
	job.operand = argc > 1 ? argv[1] : NULL;
	if (job.against) {
		compare_against(job.against, job.json);
		job.json = true;
	}
	words[what].run(&job);
	cli_finish();
	return 0;
}
