// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise haptic SCENE: the real-time loop, tracker in, force out. By hand with a report at the
 * end, or for months as a service.
 */
#include <string.h>
#include <incise/realtime.h>
#include "cli/cli.h"
#include "cli/loop_report.h"
#include "haptic/run.h"

static const char *const policies[] = {"fifo", "deadline", NULL};

static void parse_policy(void *member, char *text)
{
	struct incise_realtime_setup *realtime = member;
	char *colon = strncmp(text, "fifo:", 5) ? NULL : text + 4;

	if (colon) {
		*colon = '\0';
		realtime->priority = (int)cli_integer("policy", colon + 1, 1,
						      INCISE_REALTIME_PRIORITY_MAX);
	}
	realtime->policy = cli_choice("policy", text, policies);
}

static const struct cli_option options[] = {
	{CLI_RIG_OPTION(struct haptic_job, rig)},
	HAPTIC_TIP_OPTION,
	SCENE_ARGUMENT_OPTIONS(struct haptic_job, haptic.argument),
	{0, "tool", "KIND",
	 "tool in the hand at the start: auto (blade or handle, by the scalpel's "
	 "turn, or a tube with a station of its own), blade, handle or tube "
	 "(default: auto); on a terminal the keys a, b, h, t change it",
	 CLI_CHOICE(struct haptic_job, haptic.tool, loop_tool_names)},
	{0, "procedure", NULL,
	 "on the simulated rig, in simulated time: a script cuts, enlarges the cut "
	 "and inserts a tube",
	 CLI_FLAG(struct haptic_job, scripted)},
	{0, "in-kernel", NULL,
	 "let the kernel module render the force, and only watch it: the force "
	 "outlives this program; starts incise feed, unless it runs",
	 CLI_FLAG(struct haptic_job, in_kernel)},
	HAPTIC_HOLD_OPTIONS,
	{0, "policy", "POLICY",
	 "fifo, fifo:N of priority N, 1 to 84, or deadline (default: fifo:80)",
	 CLI_PARSED(struct haptic_job, realtime, parse_policy)},
	{0, "cpu", "N",
	 "run the loop's thread, or with --in-kernel the module's timers, on this CPU "
	 "only (default: any)",
	 CLI_INTEGER(struct haptic_job, realtime.cpu, 0, 1023)},
	{0, "no-rt", NULL, "run with normal scheduling: ticks may be late",
	 CLI_FLAG(struct haptic_job, no_rt)},
	{0, "overruns", "N",
	 "end after this many overruns in a row; 0: never (default: 100)",
	 CLI_INTEGER(struct haptic_job, haptic.loop.overruns_most, 0, 1000000)},
	{0, "state", "FILE",
	 "status file that other programs read, none for no file (default: "
	 "NAME.state, by the scene's name, in /run/incise, $XDG_RUNTIME_DIR/incise "
	 "or /tmp/incise-UID)",
	 CLI_TEXT(struct haptic_job, state)},
	{'o', "output", "FILE.csv",
	 "write every tick as CSV at the end; needs --duration",
	 CLI_OUTPUT(struct haptic_job, log), .extensions = ".csv"},
	SESSION_OPTIONS(struct haptic_job, session),
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct haptic_job, json)},
	{'v', "verbose", NULL, "print events on stderr",
	 CLI_FLAG(struct haptic_job, verbose)},
	{0},
};

static const struct cli_command command = {
	.name = "haptic",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Run the haptic loop of a scene: read the pose, evaluate the force and "
		"drive the actuators, at the scene's rate. Not a safety device, not a "
		"medical device.",
	.options = options,
	.notes =
		"SCENE is a file, or a name such as liver: ./liver.scene, else the one in "
		"/etc/incise/scenes, else the installed one.",
	.more = scene_argument_installed,
	.examples = "incise haptic liver --rig sim: --duration 10s",
	.success = "ended as requested",
};

/* All that is of the feeder, as it was given here. */
static void watch_kernel(struct haptic_job *job)
{
	static char *arguments[24];
	struct haptic *haptic = &job->haptic;
	int n = 1;

	if (job->scripted)
		cli_usage("--procedure runs on the simulated rig: leave out --in-kernel");
	if (haptic->argument.arith && strcmp(haptic->argument.arith, "fixed"))
		cli_usage("--arith does not go with --in-kernel: the kernel computes "
			  "in fixed point");
	if (job->realtime.policy || job->realtime.priority != INCISE_REALTIME_PRIORITY)
		cli_usage("--policy and --priority do not go with --in-kernel: "
			  "this program then only watches");
	haptic->mode = HAPTIC_WATCH;
	/* A watcher that is late takes no force away. */
	haptic->loop.overruns_most = 0;
	job->feeder = arguments;
	arguments[n++] = cli_text("%s", haptic->argument.path);
	if (job->rig)
		arguments[n++] = cli_text("--rig=%s", job->rig);
	if (job->calibration)
		arguments[n++] = cli_text("--calibration=%s", job->calibration);
	if (haptic->argument.model)
		arguments[n++] = cli_text("--model=%s", haptic->argument.model);
	if (haptic->argument.no_texture)
		arguments[n++] = cli_text("--no-texture");
	if (job->state)
		arguments[n++] = cli_text("--state=%s", job->state);
	arguments[n++] = cli_text("--tool=%s", loop_tool_names[haptic->tool]);
	if (job->realtime.cpu != INCISE_REALTIME_ANY_CPU)
		arguments[n++] = cli_text("--cpu=%d", job->realtime.cpu);
	job->realtime.cpu = INCISE_REALTIME_ANY_CPU;
	if (job->home)
		arguments[n++] = cli_text("--home");
	if (job->recover)
		arguments[n++] = cli_text("--recover");
	if (job->no_rt)
		arguments[n++] = cli_text("--no-rt");
	if (job->verbose)
		arguments[n++] = cli_text("--verbose");
}

static void parse_haptic(struct haptic_job *job, int argc, char **argv)
{
	job->realtime = (struct incise_realtime_setup){
		.priority = INCISE_REALTIME_PRIORITY, .cpu = INCISE_REALTIME_ANY_CPU};
	job->haptic.loop.overruns_most = 100;
	cli_parse(&command, argc, argv, job);
	if (job->verbose)
		cli_be_verbose();
	scene_argument_operand(&job->haptic.argument, argc, argv, optind);
	if (job->scripted && (job->rig || job->haptic.tool != INCISE_TOOL_AUTO))
		cli_usage(
			"--procedure has its own rig and tools: leave out %s; for another "
			"hand leave out --procedure: section 4 of the page that 'incise "
			"help lesson' names",
			job->rig ? "--rig" : "--tool");
	if (job->scripted && !job->duration)
		job->duration = PROCEDURE_S;
	if (job->in_kernel)
		watch_kernel(job);
	session_options_check(&job->session);
	if (job->log && !job->duration)
		cli_usage("-o %s needs --duration: it keeps all ticks in memory",
			  job->log);
	if (job->json && job->log && !strcmp(job->log, "-"))
		cli_usage("--json and -o - would both write to standard output");
	if (job->no_rt && job->realtime.cpu != INCISE_REALTIME_ANY_CPU)
		cli_usage("--cpu does not go with --no-rt: only a real-time thread is "
			  "given its own CPU");
}

int main(int argc, char **argv)
{
	struct haptic_job job = {0};

	/* Before there is another thread. */
	incise_realtime_prepare();
	parse_haptic(&job, argc, argv);
	return haptic_run(&job);
}
