// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate: lists its subcommands; each is a program, incise-calibrate-SUBCOMMAND.
 */
#include "cli/cli.h"

static const struct cli_option options[] = {{0}};

static const struct cli_command command = {
	.name = "calibrate",
	.synopsis = "force | depth | tip | delay | stepper | check [OPTIONS]",
	.summary =
		"Measure what turns readings into mm, N and s, and write it to calibration.conf.\n"
		"force: mV/N of the force channel, with weights.\n"
		"depth: mm per pixel of the camera, from two points or a board.\n"
		"tip: where the tip is in the tracker's sensor, by turning it about a point.\n"
		"delay: how late tracker, force and camera are, from a motion.\n"
		"stepper: force per microstep of the actuator, its backlash and its limits.\n"
		"check: what is calibrated, how old it is, and what is due.",
	.options = options,
	.notes = "'incise calibrate WORD --help' lists the options of each.\n"
		 "Exit codes: 0 done, 1 failed or refused, 2 bad usage.",
};

int main(int argc, char **argv)
{
	static const char *const names[] = {"force",   "depth", "tip", "delay",
					    "stepper", "check", NULL};

	cli_parse(&command, argc, argv, NULL);
	if (optind < argc)
		cli_unknown("calibration", argv[optind], names);
	cli_usage("a subcommand is missing: force, depth, tip, delay, stepper or check");
}
