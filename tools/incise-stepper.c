// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise stepper COMMAND: look at the actuator of a rig, and move it by hand. For bring-up:
 * wiring, directions, switches, limits.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "cli/cli.h"
#include "stepper/stepper_command.h"
#include "cli/stepper_counters.h"
#include "stepper/stepper_status.h"

enum { OPT_BY = CLI_LONG, OPT_UNHOMED, OPT_HOLD, OPT_FOR, OPT_REPEAT, OPT_JSON };

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'f', "follow", NULL, "status: a line at each change, until Ctrl-C"},
	{OPT_BY, "by", NULL, "move: by MM from where it stands, not to MM"},
	{OPT_UNHOMED, "unhomed", NULL,
	 "move: to MM of a count that is not the machine's"},
	{OPT_HOLD, "hold", NULL, "move, home: stay powered afterwards, until Ctrl-C"},
	{OPT_FOR, "for", "TIME",
	 "status --follow, enable, jog, --hold: end after this time, e.g. 2s"},
	{OPT_REPEAT, "repeat", "N", "home: N times, and say how well it repeats"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_command command = {
	.name = "stepper",
	.synopsis = "status | enable | disable | move MM | jog MM_S | home | clear "
		    "[OPTIONS]",
	.summary =
		"Look at a rig's actuator, and move it by hand within its limits:\n"
		"  status   state, position, inputs, faults and what to do about them\n"
		"  enable   power it and hold it where it stands, until Ctrl-C\n"
		"  disable  bring it to rest and take power away\n"
		"  move MM  to a position such as 10 or 10mm, then disable\n"
		"  jog MM_S at a speed such as -2 or -2mm/s until Ctrl-C, then disable\n"
		"  home     find the machine's 0, then disable\n"
		"  clear    forget faults whose cause is gone\n"
		"Ctrl-C always ends with the motor at rest and without power. Not a safety\n"
		"device: keep a hand on the emergency stop.",
	.options = options,
	.notes = "Example:\n  incise stepper move 2mm --by\n\n"
		 "Exit: 0 done, 1 failed, a fault, or stopped before it was done, 2 bad "
		 "usage.\nSee incise-stepper(1).",
};

/* Largest that anyone can mean; the rig's own limits are narrower. */
#define MM_MAX 1e6
#define FOLLOW_NS 20000000 /* between looks */

json_t *stepper_report(const struct stepper_job *job, const struct stepper_drive *drive)
{
	json_t *object = json_pack("{ss}", "command", job->command->name);

	json_object_update_new(object, stepper_status_json(drive->stepper, &drive->info,
							   &drive->status));
	return object;
}

void stepper_put(json_t *object, size_t form)
{
	json_dumpf(object, stdout, form | JSON_REAL_PRECISION(12));
	putchar('\n');
	fflush(stdout);
	json_decref(object);
}

static void put_line(const struct stepper_job *job, const struct stepper_drive *drive,
		     int64_t begin_ns)
{
	double t_s = (double)(drive->status.t_ns - begin_ns) / INCISE_NS_PER_S;

	if (job->json) {
		stepper_put(stepper_report(job, drive), JSON_COMPACT);
		return;
	}
	stepper_status_line(drive->stepper, &drive->status, t_s);
	fflush(stdout);
}

/* Its time and what follows from it change always. */
static bool changed(const struct incise_stepper_status *a,
		    const struct incise_stepper_status *b)
{
	return a->state != b->state || a->position_mm != b->position_mm ||
	       a->faults != b->faults || a->inputs != b->inputs || a->homed != b->homed ||
	       a->late != b->late;
}

static void follow(const struct stepper_job *job, struct stepper_drive *drive)
{
	int64_t begin = incise_clock_now(drive->clock), now = begin;
	struct incise_stepper_status shown;
	int64_t first_ns = drive->status.t_ns;

	cli_catch_signals();
	put_line(job, drive, first_ns);
	shown = drive->status;
	while (!cli_stop && !ferror(stdout) &&
	       (!job->seconds || now - begin < job->seconds * INCISE_NS_PER_S)) {
		incise_clock_wait_until(drive->clock, now + FOLLOW_NS);
		now = incise_clock_now(drive->clock);
		stepper_drive_look(drive);
		if (!changed(&shown, &drive->status))
			continue;
		put_line(job, drive, first_ns);
		shown = drive->status;
	}
}

static void run_status(const struct stepper_job *job, struct stepper_drive *drive)
{
	if (job->follow)
		follow(job, drive);
	else if (job->json)
		stepper_put(stepper_report(job, drive), JSON_INDENT(2));
	else
		stepper_status_text(drive->stepper, &drive->info, &drive->status);
}

static void run_disable(const struct stepper_job *job, struct stepper_drive *drive)
{
	/* As if it was us who powered it. */
	drive->powered = true;
	stepper_drive_rest(drive);
	if (job->json)
		stepper_put(stepper_report(job, drive), JSON_INDENT(2));
	else
		printf("%s: %s at %.4f mm%s\n", drive->info.name,
		       incise_stepper_state_name(drive->status.state),
		       drive->status.position_mm,
		       drive->status.state == INCISE_STEPPER_STATE_READY
			       ? ", as it is always powered"
			       : "");
}

static void run_clear(const struct stepper_job *job, struct stepper_drive *drive)
{
	struct incise_error err = {0};
	unsigned int before = drive->status.faults;
	char text[400];

	stepper_why(drive->stepper, before, text, sizeof(text));
	if (incise_stepper_clear(drive->stepper, &err))
		stepper_drive_fail(drive, "%s", err.text);
	stepper_drive_look(drive);
	if (job->json)
		stepper_put(stepper_report(job, drive), JSON_INDENT(2));
	else if (before) {
		/* What to do about it has been done. */
		if (strstr(text, ", then clear"))
			*strstr(text, ", then clear") = 0;
		printf("%s: cleared; it was %s\n", drive->info.name, text);
	} else
		printf("%s: there was no fault\n", drive->info.name);
}

static const struct cli_unit lengths[] = {{"mm", 1}, {"um", 1e-3}, {0}};
static const struct cli_unit speeds[] = {{"mm/s", 1}, {"um/s", 1e-3}, {0}};

static const struct stepper_command commands[] = {
	{"status", NULL, NULL, run_status, true, "ft"},
	{"enable", NULL, NULL, stepper_enable, false, "t"},
	{"disable", NULL, NULL, run_disable, false, ""},
	{"move", "MM", lengths, stepper_move, false, "buht"},
	{"jog", "MM_S", speeds, stepper_jog, false, "t"},
	{"home", NULL, NULL, stepper_home, false, "htn"},
	{"clear", NULL, NULL, run_clear, false, ""},
};
#define COMMANDS (sizeof(commands) / sizeof(*commands))

/* An option that another command takes would do nothing here: that is a mistake. */
static void check_options(const struct stepper_job *job)
{
	const struct {
		bool given;
		char letter;
		const char *name;
	} given[] = {
		{job->follow, 'f', "follow"},	{job->by, 'b', "by"},
		{job->unhomed, 'u', "unhomed"}, {job->hold, 'h', "hold"},
		{job->seconds > 0, 't', "for"}, {job->repeat > 0, 'n', "repeat"},
	};

	for (size_t i = 0; i < sizeof(given) / sizeof(*given); i++)
		if (given[i].given && !strchr(job->command->takes, given[i].letter))
			cli_usage("%s does not take --%s", job->command->name,
				  given[i].name);
	if (job->by && job->unhomed)
		cli_usage("--by needs no --unhomed: it goes from where it stands");
	if (job->seconds && strchr(job->command->takes, 'h') && !job->hold)
		cli_usage("--for is how long to hold it: add --hold");
	if (job->seconds && job->command->run == run_status && !job->follow)
		cli_usage("--for is how long to follow it: add --follow");
}

static const struct stepper_command *command_named(const char *name)
{
	for (size_t i = 0; i < COMMANDS; i++)
		if (!strcmp(name, commands[i].name))
			return &commands[i];
	cli_usage(
		"there is no command '%.40s': status, enable, disable, move, jog, home or "
		"clear",
		name);
}

static void parse(struct stepper_job *job, int argc, char **argv)
{
	int opt, operands;

	*job = (struct stepper_job){0};
	cli_negative_numbers(argc, argv);
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case 'r':
			job->rig = optarg;
			break;
		case 'f':
			job->follow = true;
			break;
		case OPT_BY:
			job->by = true;
			break;
		case OPT_UNHOMED:
			job->unhomed = true;
			break;
		case OPT_HOLD:
			job->hold = true;
			break;
		case OPT_FOR:
			job->seconds = cli_duration("for", optarg, 0.001, 86400);
			break;
		case OPT_REPEAT:
			job->repeat = (int)cli_integer("repeat", optarg, 1, 1000);
			break;
		case OPT_JSON:
			job->json = true;
			break;
		}
	operands = argc - optind;
	if (!operands)
		cli_usage("which command: status, enable, disable, move, jog, home or "
			  "clear?");
	job->command = command_named(argv[optind]);
	if (job->command->operand && operands != 2)
		cli_usage("%s needs one %s, got %d", job->command->name,
			  job->command->operand, operands - 1);
	if (!job->command->operand && operands != 1)
		cli_usage("%s takes no '%s'", job->command->name, argv[optind + 1]);
	if (job->command->operand)
		job->amount = cli_quantity(job->command->operand, argv[optind + 1],
					   job->command->units, -MM_MAX, MM_MAX);
	check_options(job);
}

int main(int argc, char **argv)
{
	struct stepper_drive drive;
	struct stepper_job job;

	parse(&job, argc, argv);
	stepper_drive_open(&drive, job.rig, job.command->watch, job.command->name);
	job.command->run(&job, &drive);
	/* Status shows all of them; what moved it shows what was amiss on the way. */
	if (!job.json && drive.drove)
		stepper_counters_line(drive.stepper);
	stepper_drive_end(&drive);
	if (cli_stop == SIGPIPE)
		return 1;
	cli_finish();
	return 0;
}
