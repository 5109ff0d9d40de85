// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise haptic SCENE: the real-time loop, tracker in, force out. By hand with a report at the
 * end, or for months as a service.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/calibration.h>
#include "cli/cli.h"
#include "haptic/haptic_actuator.h"
#include "haptic/haptic_report.h"
#include "haptic/haptic_self_test.h"
#include "haptic/haptic_supervisor.h"

enum {
	OPT_MODEL = CLI_LONG,
	OPT_ARITH,
	OPT_TOOL,
	OPT_DURATION,
	OPT_HOME,
	OPT_RECOVER,
	OPT_POLICY,
	OPT_PRIORITY,
	OPT_CPU,
	OPT_NO_RT,
	OPT_OVERRUNS,
	OPT_STATE,
	OPT_LOG,
	OPT_JSON
};

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "calibration.conf, for where the tip is (default: where the\n"
	 "tracker takes it to be)"},
	{OPT_MODEL, "model", "FILE", "use this model instead of the scene's"},
	{OPT_ARITH, "arith", "KIND", "fixed or double, instead of the scene's"},
	{OPT_TOOL, "tool", "KIND",
	 "what the hand holds: auto (blade or handle, by the scalpel's turn), blade,\n"
	 "handle or tube (default: auto)"},
	{OPT_DURATION, "duration", "TIME",
	 "stop after this time, e.g. 10s (default: at SIGINT)"},
	{OPT_HOME, "home", NULL, "find the actuator's 0 first, unless it is known"},
	{OPT_RECOVER, "recover", NULL,
	 "clear first what a program that died left latched in the actuator"},
	{OPT_POLICY, "policy", "POLICY", "fifo or deadline (default: fifo)"},
	{OPT_PRIORITY, "priority", "N", "of fifo, 1 to 84 (default: 80)"},
	{OPT_CPU, "cpu", "N", "run the loop's thread on this CPU alone (default: any)"},
	{OPT_NO_RT, "no-rt", NULL, "run without real time: ticks may be late"},
	{OPT_OVERRUNS, "overruns", "N",
	 "end after this many overruns in a row; 0: never (default: 100)"},
	{OPT_STATE, "state", "FILE",
	 "page that others read, none for no page (default: NAME.state of the\n"
	 "scene's name, in /run/incise or $XDG_RUNTIME_DIR/incise)"},
	{OPT_LOG, "log", "FILE", "write every tick as CSV at the end; needs --duration"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{'v', "verbose", NULL, "say on stderr what happens meanwhile"},
	{0},
};

static const struct cli_command command = {
	.name = "haptic",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Run the haptic loop of a scene: read the pose, evaluate the force, drive the\n"
		"actuator, at the scene's rate. Not a safety device, not a medical device.",
	.options = options,
	.notes =
		"SCENE is a file, or a name such as liver: ./liver.scene, else the one in\n"
		"/etc/incise/scenes, else the one that is installed.\n\n"
		"Example:\n  incise haptic scenes/liver.scene --rig sim: --duration 10s\n\n"
		"Exit: 0 ended as asked, 1 failed, 2 bad usage. See incise-haptic(1).",
};

struct job {
	struct haptic haptic;
	struct incise_realtime_setup realtime;
	const char *rig, *log, *calibration, *state;
	double duration;
	bool json, home, recover, no_rt;
};

static int one_of(const char *option, const char *text, const char *const *names, int n,
		  const char *list)
{
	for (int i = 0; i < n; i++)
		if (!strcmp(text, names[i]))
			return i;
	cli_usage("--%s: '%s' is none of %s", option, text, list);
}

static enum incise_tool tool_named(const char *name)
{
	static const char *const names[] = {"auto", "blade", "handle", "tube"};

	return (enum incise_tool)one_of("tool", name, names, 4,
					"auto, blade, handle, tube");
}

static enum incise_realtime_policy policy_named(const char *name)
{
	static const char *const names[] = {"fifo", "deadline"};

	return (enum incise_realtime_policy)one_of("policy", name, names, 2,
						   "fifo, deadline");
}

static void take_option(struct job *job, int opt)
{
	switch (opt) {
	case 'r':
		job->rig = optarg;
		break;
	case 'c':
		job->calibration = optarg;
		break;
	case OPT_MODEL:
		job->haptic.argument.model = optarg;
		break;
	case OPT_ARITH:
		scene_argument_arith(&job->haptic.argument, optarg);
		break;
	case OPT_TOOL:
		job->haptic.tool = tool_named(optarg);
		break;
	case OPT_DURATION:
		job->duration = cli_duration("duration", optarg, 0.01, 86400);
		break;
	case OPT_HOME:
		job->home = true;
		break;
	case OPT_RECOVER:
		job->recover = true;
		break;
	case OPT_POLICY:
		job->realtime.policy = policy_named(optarg);
		break;
	case OPT_PRIORITY:
		job->realtime.priority = (int)cli_integer("priority", optarg, 1,
							  INCISE_REALTIME_PRIORITY_MAX);
		break;
	case OPT_CPU:
		job->realtime.cpu = (int)cli_integer("cpu", optarg, 0, 1023);
		break;
	case OPT_NO_RT:
		job->no_rt = true;
		break;
	case OPT_OVERRUNS:
		job->haptic.loop.overruns_most =
			(unsigned int)cli_integer("overruns", optarg, 0, 1000000);
		break;
	case OPT_STATE:
		job->state = optarg;
		break;
	case OPT_LOG:
		job->log = optarg;
		break;
	case OPT_JSON:
		job->json = true;
		break;
	case 'v':
		cli_be_verbose();
		break;
	}
}

static void parse(struct job *job, int argc, char **argv)
{
	int opt;

	job->realtime = (struct incise_realtime_setup){
		.priority = INCISE_REALTIME_PRIORITY, .cpu = INCISE_REALTIME_ANY_CPU};
	job->haptic.loop.overruns_most = 100;
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		take_option(job, opt);
	scene_argument_operand(&job->haptic.argument, argc, argv, optind);
	if (job->log && !job->duration)
		cli_usage("--log keeps all ticks in memory: it needs --duration");
	if (job->json && job->log && !strcmp(job->log, "-"))
		cli_usage("--json and --log - would both write to standard output");
}

/* Whoever looks at the page later is to find why it failed. */
static _Noreturn void fail(struct job *job, const struct incise_error *err)
{
	incise_state_run(job->haptic.state, INCISE_RUN_FAULT, err->text);
	incise_state_free(job->haptic.state);
	cli_fail_with(err);
}

/* ---- the page ---- */

static bool is_folder(const char *path)
{
	struct stat status;

	return !stat(path, &status) && S_ISDIR(status.st_mode) && !access(path, W_OK);
}

/* Where the page is by default; false: nowhere. */
static bool state_path(const char *scene, char *path, size_t size)
{
	const char *own = getenv("XDG_RUNTIME_DIR"), *slash = strrchr(scene, '/');
	char folder[3000] = "/run/incise", name[256];

	snprintf(name, sizeof(name), "%s", slash ? slash + 1 : scene);
	if (strlen(name) > 6 && !strcmp(name + strlen(name) - 6, ".scene"))
		name[strlen(name) - 6] = 0;
	if (!is_folder(folder)) {
		if (!own || *own != '/')
			return false;
		snprintf(folder, sizeof(folder), "%s/incise", own);
		mkdir(folder, 0700);
		if (!is_folder(folder))
			return false;
	}
	return snprintf(path, size, "%s/%s.state", folder, name) < (int)size;
}

static void open_state(struct job *job, bool real)
{
	struct haptic *haptic = &job->haptic;
	struct incise_state_setup setup = {
		.rate_hz = haptic->loop.rate_hz,
		.rig = incise_rig_spec(haptic->rig),
		.policy = haptic->scheduling,
	};
	struct incise_error err = {0};
	char path[4096];

	if (job->state && !strcmp(job->state, "none"))
		return;
	if (job->state)
		snprintf(path, sizeof(path), "%s", job->state);
	/* In simulated time there is nothing to look at. */
	else if (!real || !state_path(haptic->argument.path, path, sizeof(path)))
		return;
	haptic->state = incise_state_new(path, &setup, &err);
	if (!haptic->state)
		fail(job, &err);
	haptic->loop.state = haptic->state;
	if (!incise_state_in_memory(haptic->state))
		cli_warn(
			"%s is on a disk, which may hold up the loop: /run or /dev/shm are "
			"better places",
			path);
	incise_state_scene(haptic->state, haptic->argument.path, haptic->plan);
}

/* ---- start ---- */

static void enter_real_time(struct job *job)
{
	struct haptic *haptic = &job->haptic;
	static char text[40];
	struct incise_error err = {0};

	haptic->scheduling = "SCHED_OTHER";
	if (job->no_rt) {
		cli_note("without real time, as asked: ticks may be late");
		return;
	}
	job->realtime.period_ns = llrint(INCISE_NS_PER_S / haptic->loop.rate_hz);
	haptic->realtime = incise_realtime_new(&job->realtime, &err);
	if (!haptic->realtime)
		cli_fail("%s; or give --no-rt to run without", err.text);
	if (job->realtime.policy == INCISE_REALTIME_DEADLINE)
		haptic->scheduling = "SCHED_DEADLINE";
	else
		snprintf(text, sizeof(text), "SCHED_FIFO %d", job->realtime.priority);
	if (job->realtime.policy == INCISE_REALTIME_FIFO)
		haptic->scheduling = text;
}

static void advise(const struct incise_realtime_setup *setup)
{
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	int n = incise_realtime_checks(setup, checks, INCISE_REALTIME_CHECKS);

	for (int i = 0; i < n && i < INCISE_REALTIME_CHECKS; i++)
		if (!checks[i].ok)
			cli_note("real time: %s%s%s", checks[i].found,
				 *checks[i].fix ? "; better: " : "", checks[i].fix);
}

static void take_calibration(struct job *job)
{
	struct incise_calibration calibration;
	struct incise_error err = {0};

	incise_calibration_nominal(&calibration);
	if (job->calibration &&
	    incise_calibration_load(job->calibration, &calibration, &err))
		cli_fail_with(&err);
	memcpy(job->haptic.tip_mm, calibration.tip_mm, sizeof(calibration.tip_mm));
}

/* Before any device is opened: what is refused then has not moved anything. */
static bool has_real_clock(const char *spec)
{
	struct incise_error err = {0};
	struct incise_rig *rig = incise_rig_open(spec, 0, &err);
	bool real;

	if (!rig)
		cli_fail_with(&err);
	real = incise_clock_is_real(incise_rig_clock(rig));
	incise_rig_close(rig);
	return real;
}

/* All but power: scene, real time, devices, plan, self-test. */
static void set_up(struct job *job)
{
	struct haptic *haptic = &job->haptic;
	const char *spec = cli_rig(job->rig);
	struct incise_error err = {0};
	struct self_test test;
	bool real;

	take_calibration(job);
	haptic->scene = scene_argument_load(&haptic->argument);
	haptic->loop.rate_hz = incise_scene_rate_hz(haptic->scene);
	haptic->loop.duration_ns = (int64_t)(job->duration * INCISE_NS_PER_S);
	haptic->scheduling = "simulated time";
	real = has_real_clock(spec);
	if (real)
		enter_real_time(job);
	haptic->rig =
		incise_rig_open(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, &err);
	if (!haptic->rig)
		cli_fail_with(&err);
	if (haptic_self_test(haptic->scene, incise_rig_tracker(haptic->rig), &test, &err))
		cli_fail("%s: %s", haptic->argument.path, err.text);
	haptic->plan = haptic_plan(haptic, haptic->scene, &err);
	if (!haptic->plan)
		cli_fail_with(&err);
	open_state(job, real);
	if (haptic->realtime)
		advise(&job->realtime);
	cli_note(
		"self-test: %u ticks in the tissue, at most %.3f N; no force %.0f ms after the "
		"last pose (at most %.0f)",
		test.contact, test.force_max_N, test.silent_ms, test.silent_max_ms);
}

static void finish(struct job *job)
{
	struct haptic *haptic = &job->haptic;

	incise_plan_free(haptic->plan);
	incise_rig_close(haptic->rig);
	incise_scene_free(haptic->scene);
	incise_realtime_free(haptic->realtime);
	free(haptic->loop.log);
}

int main(int argc, char **argv)
{
	static struct incise_loop_stats stats;
	struct incise_outfile *file = NULL;
	struct incise_error err = {0};
	struct haptic *haptic;
	struct job job = {0};
	int rc;

	/* Before there is another thread. */
	incise_realtime_prepare();
	parse(&job, argc, argv);
	haptic = &job.haptic;
	haptic->stats = &stats;
	haptic->loop.stop = &cli_stop;
	set_up(&job);
	if (job.log) {
		/* A path that cannot be is said before the run, not after. */
		file = incise_outfile_open(job.log, &err);
		if (!file)
			fail(&job, &err);
		haptic_make_log(job.duration, &haptic->loop);
	}
	cli_catch_signals();
	haptic_catch_reload();
	if (haptic_take_hold(haptic->rig, job.home, job.recover, &err)) {
		/* Steps that are made in this program do not lose their power with it. */
		incise_rig_close(haptic->rig);
		fail(&job, &err);
	}
	cli_progress("%s: %g Hz, Ctrl-C ends", haptic->argument.path,
		     haptic->loop.rate_hz);
	rc = haptic_supervise(haptic, &err);
	cli_progress_end();
	haptic_let_go(haptic->rig);
	incise_state_run(haptic->state, rc ? INCISE_RUN_FAULT : INCISE_RUN_STOPPED,
			 rc	    ? err.text
			 : cli_stop ? strsignal(cli_stop)
				    : "");
	incise_state_free(haptic->state);
	if (job.log)
		haptic_write_log(file, haptic->loop.log, stats.logged);
	if (job.json)
		haptic_report_json(haptic);
	else if (!job.log || strcmp(job.log, "-"))
		haptic_report_text(haptic);
	cli_finish();
	finish(&job);
	if (rc)
		cli_fail("%s: %s", haptic->argument.path, err.text);
	return 0;
}
