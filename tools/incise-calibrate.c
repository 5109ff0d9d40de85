// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate: lists its subcommands; each is a program, incise-calibrate-SUBCOMMAND.
 */
#include "cli/cli.h"

static const struct cli_option options[] = {{0}};

static const struct cli_command command = {
	.name = "calibrate",
	.synopsis =
		"force | depth | tip | delay | stepper | frame | torque | check [OPTIONS]",
	.summary =
		"Measure scale factors, offsets and delays of the rig, and write them to "
		"calibration.conf.\n"
		"  force    mV/N of the force channel, with weights\n"
		"  depth    mm per pixel of the camera, from two points, a line of pairs or "
		"a board\n"
		"  tip      position of the tip in the tracker's sensor, by turning the tool "
		"about its tip\n"
		"  delay    delays of tracker, force and camera, from a motion\n"
		"  stepper  force per microstep of the actuator, its backlash and its limits\n"
		"  frame    place of a haptic device in the scene, from touched points\n"
		"  torque   friction and cogging of a haptic device along a line\n"
		"  check    active calibrations, their age, and any that have expired",
	.options = options,
	.notes = "'incise calibrate force --help' lists the options of force, and so on.",
	.success = "the calibration is active",
	.failure = "failed or refused",
};

int main(int argc, char **argv)
{
	static const char *const names[] = {"force",  "depth",	 "tip",
					    "delay",  "stepper", "frame",
					    "torque", "check",	 NULL};

	cli_parse(&command, argc, argv, NULL);
	if (optind < argc)
		cli_unknown("calibration", argv[optind], names);
	cli_usage(
		"missing subcommand: force, depth, tip, delay, stepper, frame, torque or check");
}
