// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What is asked of incise capture; see capture_wish.h.
 */
#include <getopt.h>
#include <limits.h>
#include <string.h>
#include "capture_wish.h"
#include "../cli/cli.h"

enum { OPT_DURATION = CLI_LONG, OPT_CAMERA, OPT_TRIGGER, OPT_CUTS, OPT_FORCE, OPT_JSON };

static const struct cli_option options[] = {
	{'o', "output", "NAME.rec", "folder to record into; it must not exist"},
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "calibration.conf (default: the figures of the paper)"},
	{OPT_DURATION, "duration", "TIME",
	 "end after 10s, 500ms, 2min, 1h (default: at Ctrl-C;\n"
	 "on the virtual rig at the end of its cuts)"},
	{OPT_CAMERA, "camera", "WHAT",
	 "off; pictures: record them; depth: and find the scalpel in\n"
	 "them; auto: what rig.conf has (default; a rig of sim:… has\n"
	 "no camera then)"},
	{OPT_TRIGGER, "trigger", "WHAT",
	 "wait for the stylus's button, or for a force such as 0.2N;\n"
	 "the second before is recorded too"},
	{OPT_CUTS, "cuts", NULL,
	 "mark beginning and end of each cut in the table events"},
	{OPT_FORCE, "force", NULL,
	 "replace NAME.rec once the new one is complete; drop what\n"
	 "an interrupted recording left as NAME.rec.part"},
	{OPT_JSON, "json", NULL, "report as one JSON object"},
	{0},
};

static const struct cli_command command = {
	.name = "capture",
	.synopsis = "-o NAME.rec [--rig RIG] [OPTIONS]",
	.summary =
		"Record tracker, force channel and camera of a rig in sync. Hold the tool free\n"
		"for the first half second: the zero of the force is measured then. On a\n"
		"terminal the keys m and 1 to 9 set markers, t triggers, q ends.",
	.options = options,
	.notes =
		"Example: incise capture -o liver.rec --rig sim:clock=simulated\n"
		"Exit codes: 0 recorded without loss; 1 failed, samples lost, a device died or\n"
		"the disk was nearly full; 2 bad usage.",
};

static enum capture_camera camera_of(const char *text)
{
	static const char *const names[] = {"auto", "off", "pictures", "depth"};

	for (int i = 0; i < 4; i++)
		if (!strcmp(text, names[i]))
			return (enum capture_camera)i;
	cli_usage("--camera: '%s' is none of auto, off, pictures and depth", text);
}

static void take_trigger(struct capture_wish *wish, const char *text)
{
	static const struct cli_unit units[] = {{"N", 1}, {"mN", 1e-3}, {0}};

	wish->trigger_button = !strcmp(text, "button");
	wish->trigger_force_N =
		wish->trigger_button ? 0
				     : cli_quantity("--trigger", text, units, 1e-3, 1e4);
}

void capture_wish_take(struct capture_wish *wish, int argc, char **argv)
{
	size_t length;
	int id;

	while ((id = cli_next(&command, argc, argv)) != CLI_END) {
		switch (id) {
		case 'o':
			wish->output = optarg;
			break;
		case 'r':
			wish->rig = optarg;
			break;
		case 'c':
			wish->calibration = optarg;
			break;
		case OPT_DURATION:
			wish->duration_s = cli_duration("duration", optarg, 0.01, 1e6);
			break;
		case OPT_CAMERA:
			wish->camera = camera_of(optarg);
			break;
		case OPT_TRIGGER:
			take_trigger(wish, optarg);
			break;
		case OPT_CUTS:
			wish->cuts = true;
			break;
		case OPT_FORCE:
			wish->force = true;
			break;
		case OPT_JSON:
			wish->json = true;
			break;
		}
	}
	if (optind < argc)
		cli_usage("'%s' is too much: the recording's name goes with -o",
			  argv[optind]);
	if (!wish->output)
		cli_usage("where to? give -o NAME.rec");
	for (length = strlen(wish->output); length > 1 && wish->output[length - 1] == '/';
	     length--)
		wish->output[length - 1] = 0;
	if (length < 5 || strcmp(wish->output + length - 4, ".rec") ||
	    wish->output[length - 5] == '/')
		cli_usage("-o: '%s' is not a name that ends in .rec", wish->output);
	if (length > PATH_MAX - 16)
		cli_usage("-o: the path is too long");
}
