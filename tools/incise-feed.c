// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise feed SCENE: the kernel module renders the scene's force, and this process only hands it the
 * tracker's poses. It is locked in memory, and needs no other program.
 */
#include <incise/realtime.h>
#include "cli/cli.h"
#include "cli/loop_report.h"
#include "haptic/run.h"

static const struct cli_option options[] = {
	{CLI_RIG_OPTION(struct haptic_job, rig)},
	HAPTIC_TIP_OPTION,
	{0, "model", "FILE", "use this model instead of the scene's",
	 CLI_INPUT(struct haptic_job, haptic.argument.model)},
	SCENE_ARGUMENT_NO_TEXTURE(struct haptic_job, haptic.argument),
	{0, "tool", "KIND",
	 "tool in the hand at the start: auto, blade, handle or tube (default: auto)",
	 CLI_CHOICE(struct haptic_job, haptic.tool, loop_tool_names)},
	HAPTIC_HOLD_OPTIONS,
	{0, "cpu", "N", "let the module's timers fire on this CPU (default: any)",
	 CLI_INTEGER(struct haptic_job, timer_cpu, 0, 1023)},
	{0, "no-rt", NULL, "run with normal scheduling: poses may be late",
	 CLI_FLAG(struct haptic_job, no_rt)},
	{0, "state", "FILE",
	 "status file of the loop; its own is NAME.feed.state for NAME.state, none "
	 "for no file (default: as of incise haptic)",
	 CLI_TEXT(struct haptic_job, state)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct haptic_job, json)},
	{'v', "verbose", NULL, "print events on stderr",
	 CLI_FLAG(struct haptic_job, verbose)},
	{0},
};

static const struct cli_command command = {
	.name = "feed",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Let the kernel module render the force of a scene, and send it the "
		"tracker's poses. The force continues while other programs stop, start or "
		"crash, and ramps to zero when this one ends. Not a safety device, not a "
		"medical device.",
	.options = options,
	.notes = "SCENE is as for incise haptic. Needs steppers of the kernel module "
		 "incise_stepper (incise info stepper).",
	.examples = "incise feed neck --rig rig.conf",
	.success = "ended as requested",
};

int main(int argc, char **argv)
{
	struct haptic_job job = {
		.haptic.mode = HAPTIC_FEED,
		.haptic.loop.overruns_most = 0,
		.timer_cpu = -1,
		.realtime = {.priority = INCISE_REALTIME_PRIORITY,
			     .cpu = INCISE_REALTIME_ANY_CPU},
	};

	/* Before there is another thread. */
	incise_realtime_prepare();
	cli_parse(&command, argc, argv, &job);
	if (job.verbose)
		cli_be_verbose();
	scene_argument_operand(&job.haptic.argument, argc, argv, optind);
	return haptic_run(&job);
}
