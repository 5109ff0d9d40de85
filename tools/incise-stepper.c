// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise stepper SUBCOMMAND: look at the actuator of a rig, and move it by hand. For bring-up:
 * wiring, directions, switches, limits.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "cli/cli.h"
#include "cli/json.h"
#include "stepper/drive.h"
#include "stepper/status.h"
#include "stepper/tune.h"

#define MM_MAX 1e6	   /* beyond any rig's limits */
#define FOLLOW_NS 20000000 /* between readings */
#define SPEED_LEAST 0.01   /* mm/s, to tune */
#define MOTION_S 2	   /* added to twice the time that the limits allow a motion */

struct stepper_job {
	const struct subcommand *subcommand;
	const char *rig;
	double amounts[TUNE_SPEEDS_MAX]; /* the operand: mm or mm/s */
	int n_amounts;
	bool follow, by, unhomed, hold, json;
	double seconds; /* 0: until Ctrl-C */
	int repeat;	/* 0: not given */
	int axis;	/* from 1 on */
};

struct subcommand {
	const char *name;
	const char *operand;	      /* its name, or NULL */
	const struct cli_unit *units; /* of it */
	/* On an open drive; failure ends the program. */
	void (*run)(const struct stepper_job *job, struct stepper_drive *drive);
	unsigned int devices; /* of stepper_drive_open() */
	bool list;	      /* its operand is one or more, with commas */
	const char *takes;    /* letters of options, see check_options() */
};

static const struct cli_option options[] = {
	{CLI_RIG_OPTION(struct stepper_job, rig)},
	{0, "axis", "N", "actuator of the rig, 1 to 3 (default: 1)",
	 CLI_INTEGER(struct stepper_job, axis, 1, INCISE_RIG_AXES_MAX)},
	{'f', "follow", NULL, "status: print a line at each change, until Ctrl-C",
	 CLI_FLAG(struct stepper_job, follow)},
	{0, "by", NULL, "move: by MM from the present position, not to MM",
	 CLI_FLAG(struct stepper_job, by)},
	{0, "unhomed", NULL, "move, tune: also if not homed, by the present count",
	 CLI_FLAG(struct stepper_job, unhomed)},
	{0, "hold", NULL, "move, home: stay powered afterwards, until Ctrl-C",
	 CLI_FLAG(struct stepper_job, hold)},
	{0, "duration", "TIME",
	 "status --follow, enable, jog, --hold: end after this time, for example "
	 "2s",
	 CLI_DURATION(struct stepper_job, seconds, 0.001, 86400)},
	{0, "repeat", "N", "home N times, and report the repeatability",
	 CLI_INTEGER(struct stepper_job, repeat, 1, 1000)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct stepper_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "stepper",
	.synopsis = "status | enable | disable | move MM | jog MM_S | home | clear | "
		    "tune MM_S,... [OPTIONS]",
	.summary =
		"Show the state of a rig's actuator, and move it within its limits:\n"
		"  status    print state, position, inputs, faults and their remedies\n"
		"  enable    power it and hold its position, until Ctrl-C\n"
		"  disable   bring it to rest and switch power off\n"
		"  move MM   move to a position such as 10 or 10mm, then disable\n"
		"  jog MM_S  move at a speed such as -2 or -2mm/s until Ctrl-C, then "
		"disable\n"
		"  home      find the zero position, then disable\n"
		"  clear     clear faults whose cause is gone\n"
		"  tune MM_S,...  move over the travel at each speed, and advise a "
		"threshold for StallGuard of the driver chip\n"
		"Ctrl-C always ends with the motor at rest and without power. Not a "
		"safety device: keep a hand on the emergency stop.",
	.options = options,
	.examples = "incise stepper move 2mm --by",
	.failure = "failed, in fault, or stopped early",
};

/* --- status, disable, clear ------------------------------------------------------------ */

static json_t *report(const struct stepper_job *job, const struct stepper_drive *drive)
{
	json_t *object = json_pack("{ss}", "command", job->subcommand->name);

	json_object_update_new(object, stepper_status_json(drive->stepper, &drive->info,
							   &drive->status));
	return object;
}

/* Print it at once and release it. Never ends the program: the motor may have power. */
static void put_json(json_t *object, size_t form)
{
	json_write(stdout, object, form);
	fflush(stdout);
	json_decref(object);
}

static void put_line(const struct stepper_job *job, const struct stepper_drive *drive,
		     int64_t begin_ns)
{
	double t_s = (double)(drive->status.t_ns - begin_ns) / INCISE_NS_PER_S;

	if (job->json) {
		put_json(report(job, drive), JSON_COMPACT);
		return;
	}
	stepper_status_line(drive->stepper, &drive->status, t_s);
	fflush(stdout);
}

/* Time and velocity are not compared: they change always. */
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
		put_json(report(job, drive), JSON_INDENT(2));
	else
		stepper_status_text(drive->stepper, &drive->info, &drive->status);
	if (!job->json && !job->follow && !strncmp(drive->info.name, "simulated", 9))
		puts("simulated  each command starts at 0: no other one moved this rig");
}

static void run_disable(const struct stepper_job *job, struct stepper_drive *drive)
{
	/* As if this program had powered it. */
	drive->powered = true;
	stepper_drive_rest(drive);
	if (job->json)
		put_json(report(job, drive), JSON_INDENT(2));
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
		put_json(report(job, drive), JSON_INDENT(2));
	else if (before) {
		/* This is done now. */
		if (strstr(text, ", then clear"))
			*strstr(text, ", then clear") = 0;
		printf("%s: cleared; it was %s\n", drive->info.name, text);
	} else
		printf("%s: no fault to clear\n", drive->info.name);
}

/* --- enable, move, jog, home ----------------------------------------------------------- */

static void run_enable(const struct stepper_job *job, struct stepper_drive *drive)
{
	stepper_drive_power(drive);
	if (!job->json) {
		printf("powered, held at %.4f mm; Ctrl-C disables it, and so does the "
		       "end of this program, within %g ms\n",
		       drive->status.position_mm, drive->info.deadman_s * 1e3);
		fflush(stdout);
	}
	stepper_drive_hold(drive, job->seconds);
	if (job->json)
		put_json(report(job, drive), JSON_INDENT(2));
}

/* Print the result of a motion. */
static void put_moved(const struct stepper_job *job, const struct stepper_drive *drive,
		      double from_mm, double seconds)
{
	const struct incise_stepper_status *s = &drive->status;
	json_t *object;

	cli_progress_end();
	if (job->json) {
		object = report(job, drive);
		json_object_set_new(object, "from_mm", json_number(from_mm));
		json_object_set_new(object, "seconds", json_number(seconds));
		put_json(object, JSON_INDENT(2));
		return;
	}
	printf("moved %.4f mm in %.3f s, now at %.4f mm (step %lld)%s\n",
	       s->position_mm - from_mm, seconds, s->position_mm,
	       stepper_steps(&drive->info, s->position_mm),
	       s->homed ? "" : ", not homed");
	fflush(stdout);
}

static void maybe_hold(const struct stepper_job *job, struct stepper_drive *drive)
{
	if (job->hold)
		stepper_drive_hold(drive, job->seconds);
}

/* The target within the travel; outside of it fails. */
static double destination(const struct stepper_job *job, struct stepper_drive *drive)
{
	double mm = job->amounts[0], from_mm = drive->status.position_mm;
	/* A travel need not be of whole steps. */
	double slack_mm = 0.5 * drive->info.step_mm;

	if (job->by)
		mm += from_mm;
	else if (!drive->status.homed && !job->unhomed)
		stepper_drive_fail(
			drive,
			"%s is not homed, so %g mm is not a known position; run "
			"'incise stepper home', or add --by or --unhomed",
			drive->info.name, mm);
	if (mm < -slack_mm || mm > drive->info.travel_mm + slack_mm)
		stepper_drive_fail(
			drive,
			"from %g mm to %g mm: out of the travel of %s, 0 to %g mm%s",
			from_mm, mm, drive->info.name, drive->info.travel_mm,
			drive->status.homed ? "; give a position within it"
					    : "; it is not homed: run 'incise stepper "
					      "home'");
	return fmax(0, fmin(drive->info.travel_mm, mm));
}

/* Longest time of a motion from rest to rest within the limits. */
static double motion_s(const struct incise_stepper_info *info, double mm)
{
	double s = fabs(mm) / info->velocity_mm_s +
		   2 * info->velocity_mm_s / info->acceleration_mm_s2;

	if (info->jerk_mm_s3 > 0)
		s += 2 * info->acceleration_mm_s2 / info->jerk_mm_s3;
	return 2 * s + MOTION_S;
}

static _Noreturn void fail_stopped(struct stepper_drive *drive)
{
	stepper_drive_rest(drive);
	stepper_drive_fail(drive, "%s: at rest at %.4f mm, without power",
			   strsignal(cli_stop), drive->status.position_mm);
}

static void run_move(const struct stepper_job *job, struct stepper_drive *drive)
{
	double to_mm = destination(job, drive), from_mm = drive->status.position_mm;
	double within_s = motion_s(&drive->info, to_mm - from_mm), seconds;
	double step_mm = drive->info.step_mm, arrived_s = INFINITY;
	int64_t begin;

	/* The last whole step of the travel. */
	to_mm = fmin(to_mm,
		     floor(drive->info.travel_mm / step_mm * (1 + 1e-12)) * step_mm);
	stepper_drive_power(drive);
	begin = incise_clock_now(drive->clock);
	do {
		stepper_drive_to(drive, to_mm);
		seconds = (double)(incise_clock_now(drive->clock) - begin) /
			  INCISE_NS_PER_S;
		arrived_s = stepper_drive_arrived(drive, to_mm) ? fmin(arrived_s, seconds)
								: INFINITY;
		/* A drive that follows its targets needs time to settle. */
	} while (!cli_stop && seconds < within_s &&
		 !(seconds >= arrived_s + drive->info.settle_s));
	if (!stepper_drive_arrived(drive, to_mm) && cli_stop)
		fail_stopped(drive);
	if (!stepper_drive_arrived(drive, to_mm))
		stepper_drive_fail(
			drive,
			"%s is at %.4f mm after %.1f s%s and did not come to rest at "
			"%.4f mm; see incise stepper status",
			drive->info.name, drive->status.position_mm, seconds,
			drive->status.state == INCISE_STEPPER_STATE_MOVING &&
					drive->status.velocity_mm_s == 0
				? " by its last position, from before it came to rest,"
				: "",
			to_mm);
	put_moved(job, drive, from_mm, seconds);
	maybe_hold(job, drive);
}

static void check_speed(struct stepper_drive *drive, double mm_s)
{
	if (fabs(mm_s) > drive->info.velocity_mm_s)
		stepper_drive_fail(drive,
				   "%g mm/s is faster than %g mm/s, the limit "
				   "of %s; give a lower speed",
				   mm_s, drive->info.velocity_mm_s, drive->info.name);
}

static void run_jog(const struct stepper_job *job, struct stepper_drive *drive)
{
	double mm_s = job->amounts[0], end_mm = mm_s > 0 ? drive->info.travel_mm : 0;
	double from_mm = drive->status.position_mm, seconds;
	int64_t begin;
	bool ended;

	check_speed(drive, mm_s);
	stepper_drive_power(drive);
	begin = incise_clock_now(drive->clock);
	do {
		stepper_drive_at(drive, mm_s);
		seconds = (double)(incise_clock_now(drive->clock) - begin) /
			  INCISE_NS_PER_S;
		ended = stepper_drive_rests(drive) &&
			fabs(drive->status.position_mm - end_mm) < drive->info.step_mm;
	} while (!cli_stop && !ended && (!job->seconds || seconds < job->seconds));
	stepper_drive_rest(drive);
	put_moved(job, drive, from_mm, seconds);
	if (ended && !job->json)
		printf("end of the travel, 0 to %g mm%s\n", drive->info.travel_mm,
		       drive->status.homed ? "" : " (not homed)");
}

/* Home edges as found; offsets in steps of the count after the first homing. */
struct edges {
	json_t *before_mm, *before_steps; /* each in the count before its homing */
	double after_mm;
	long long off, lowest, highest;
	int n;	      /* known edges */
	bool unknown; /* the drive homed by itself and does not report its edge */
};

/* A drive that homed by itself: only its 0 is known. */
static void put_unknown_edge(struct edges *edges, const struct stepper_job *job,
			     const struct stepper_drive *drive)
{
	bool first = !edges->unknown;

	edges->unknown = true;
	json_array_append_new(edges->before_mm, json_null());
	json_array_append_new(edges->before_steps, json_null());
	if (job->json)
		return;
	cli_progress_end();
	if (first)
		printf("%s homes by itself and does not report where the edge was "
		       "before%s\n",
		       drive->info.name,
		       job->repeat > 1 ? ", so the repeatability is unknown" : "");
	fflush(stdout);
}

static void find_edge(struct edges *edges, const struct stepper_job *job,
		      struct stepper_drive *drive)
{
	const struct incise_stepper_info *info = &drive->info;
	struct incise_stepper_edge_found edge;
	struct incise_error err = {0};
	long long before;

	if (incise_stepper_home(drive->stepper, &cli_stop, &edge, &err))
		stepper_drive_fail(drive, "%s", err.text);
	stepper_drive_look(drive);
	edges->after_mm = edge.after_mm;
	if (isnan(edge.before_mm)) {
		put_unknown_edge(edges, job, drive);
		return;
	}
	before = stepper_steps(info, edge.before_mm);
	/* Each homing renumbers the count by the offset that it found. */
	if (edges->n++)
		edges->off += before - stepper_steps(info, edge.after_mm);
	if (edges->off < edges->lowest)
		edges->lowest = edges->off;
	if (edges->off > edges->highest)
		edges->highest = edges->off;
	json_array_append_new(edges->before_mm,
			      json_number((double)before * info->step_mm));
	json_array_append_new(edges->before_steps, json_integer(before));
	if (job->json)
		return;
	cli_progress_end();
	printf("home edge at step %lld, %.4f mm, of the previous count; now at %.4f "
	       "mm\n",
	       before, (double)before * info->step_mm, edge.after_mm);
	fflush(stdout);
}

static json_t *home_json(const struct stepper_job *job, const struct stepper_drive *drive,
			 const struct edges *edges)
{
	long long spread = edges->highest - edges->lowest;
	bool known = edges->n > 1 && !edges->unknown;
	double spread_mm = known ? (double)spread * drive->info.step_mm : NAN;
	json_t *object = report(job, drive);

	json_object_set_new(object, "edges_before_mm", edges->before_mm);
	json_object_set_new(object, "edges_before_steps", edges->before_steps);
	json_object_set_new(object, "edge_mm", json_number(edges->after_mm));
	json_object_set_new(object, "spread_mm", json_number(spread_mm));
	json_object_set_new(object, "spread_steps",
			    known ? json_integer(spread) : json_null());
	return object;
}

static void put_home(const struct edges *edges, const struct stepper_drive *drive)
{
	long long spread = edges->highest - edges->lowest;

	if (edges->n > 1 && !edges->unknown)
		printf("%d times within %s, %.4f mm\n", edges->n,
		       cli_count(spread, "step"), (double)spread * drive->info.step_mm);
	printf("homed, at %.4f mm\n", drive->status.position_mm);
	fflush(stdout);
	json_decref(edges->before_mm);
	json_decref(edges->before_steps);
}

static void run_home(const struct stepper_job *job, struct stepper_drive *drive)
{
	struct edges edges = {.before_mm = json_array(), .before_steps = json_array()};
	int times = job->repeat ? job->repeat : 1;

	stepper_drive_power(drive);
	for (int i = 0; i < times; i++) {
		cli_progress("home: %d of %d, Ctrl-C stops", i + 1, times);
		find_edge(&edges, job, drive);
	}
	cli_progress_end();
	if (job->json)
		put_json(home_json(job, drive, &edges), JSON_INDENT(2));
	else
		put_home(&edges, drive);
	maybe_hold(job, drive);
}

static void run_tune(const struct stepper_job *job, struct stepper_drive *drive)
{
	json_t *object = NULL;

	for (int i = 0; i < job->n_amounts; i++)
		check_speed(drive, job->amounts[i]);
	if (!drive->status.homed && !job->unhomed)
		stepper_drive_fail(
			drive,
			"%s is not homed, so its travel is not known; run "
			"'incise stepper home', or put the nut at its lower end "
			"and add --unhomed",
			drive->info.name);
	stepper_drive_power(drive);
	if (job->json)
		object = report(job, drive);
	stepper_tune(drive, job->amounts, job->n_amounts, object);
	if (cli_stop)
		fail_stopped(drive);
	if (job->json)
		put_json(object, JSON_INDENT(2));
}

/* --- subcommands ----------------------------------------------------------------------- */

static const struct cli_unit lengths[] = {{"mm", 1}, {"um", 1e-3}, {0}};
static const struct cli_unit speeds[] = {{"mm/s", 1}, {"um/s", 1e-3}, {0}};

static const struct subcommand subcommands[] = {
	{"status", NULL, NULL, run_status, INCISE_RIG_WATCH, false, "ft"},
	{"enable", NULL, NULL, run_enable, 0, false, "t"},
	{"disable", NULL, NULL, run_disable, STEPPER_DRIVE_OR_WATCH, false, ""},
	{"move", "MM", lengths, run_move, 0, false, "buht"},
	{"jog", "MM_S", speeds, run_jog, 0, false, "t"},
	{"home", NULL, NULL, run_home, 0, false, "htn"},
	{"clear", NULL, NULL, run_clear, 0, false, ""},
	{"tune", "MM_S", speeds, run_tune, 0, true, "u"},
};
#define SUBCOMMANDS (sizeof(subcommands) / sizeof(*subcommands))

/* An option that only other subcommands take is bad usage. */
static void check_options(const struct stepper_job *job)
{
	const struct {
		bool given;
		char letter;
		const char *name;
	} given[] = {
		{job->follow, 'f', "follow"},	     {job->by, 'b', "by"},
		{job->unhomed, 'u', "unhomed"},	     {job->hold, 'h', "hold"},
		{job->seconds > 0, 't', "duration"}, {job->repeat > 0, 'n', "repeat"},
	};

	for (size_t i = 0; i < sizeof(given) / sizeof(*given); i++)
		if (given[i].given && !strchr(job->subcommand->takes, given[i].letter))
			cli_usage("--%2$s does not go with %1$s", job->subcommand->name,
				  given[i].name);
	if (job->by && job->unhomed)
		cli_usage("--unhomed is not needed with --by, which moves relative to "
			  "the present position");
	if (job->seconds && strchr(job->subcommand->takes, 'h') && !job->hold)
		cli_usage("--duration needs --hold: it is the time to hold the position");
	if (job->seconds && job->subcommand->run == run_status && !job->follow)
		cli_usage("--duration needs --follow: it is the time to follow the "
			  "status");
}

static const struct subcommand *subcommand_named(const char *name)
{
	const char *names[SUBCOMMANDS + 1] = {NULL};

	for (size_t i = 0; i < SUBCOMMANDS; i++)
		if (!strcmp(name, subcommands[i].name))
			return &subcommands[i];
	for (size_t i = 0; i < SUBCOMMANDS; i++)
		names[i] = subcommands[i].name;
	cli_unknown("subcommand", name, names);
}

/* One amount, or for a list up to TUNE_SPEEDS_MAX of them that are not 0 or less. */
static void parse_amounts(struct stepper_job *job, char *text)
{
	const struct subcommand *sub = job->subcommand;
	char *rest = text, *piece;

	while ((piece = sub->list ? strsep(&rest, ",") : text)) {
		if (job->n_amounts == TUNE_SPEEDS_MAX)
			cli_usage("%s: expected at most %d speeds", sub->name,
				  TUNE_SPEEDS_MAX);
		job->amounts[job->n_amounts++] =
			cli_quantity(sub->operand, piece, sub->units,
				     sub->list ? SPEED_LEAST : -MM_MAX, MM_MAX);
		if (!sub->list)
			break;
	}
}

static void parse_stepper(struct stepper_job *job, int argc, char **argv)
{
	const struct subcommand *sub;
	int operands;

	cli_negative_numbers(argc, argv);
	cli_parse(&command, argc, argv, job);
	operands = argc - optind;
	if (!operands)
		cli_usage("missing subcommand: status, enable, disable, move, jog, "
			  "home, clear or tune");
	sub = job->subcommand = subcommand_named(argv[optind]);
	if (sub->operand && operands < 2)
		cli_usage("%s: missing %s, for example 'incise stepper %s 2'", sub->name,
			  sub->operand, sub->name);
	if (sub->operand && operands > 2)
		cli_usage("unexpected argument '%s'; %s takes one %s", argv[optind + 2],
			  sub->name, sub->operand);
	if (!sub->operand && operands != 1)
		cli_usage("unexpected argument '%2$s'; %1$s takes none", sub->name,
			  argv[optind + 1]);
	if (sub->operand)
		parse_amounts(job, argv[optind + 1]);
	check_options(job);
}

int main(int argc, char **argv)
{
	struct stepper_drive drive;
	struct stepper_job job = {.axis = 1};

	parse_stepper(&job, argc, argv);
	stepper_drive_open(&drive, job.rig, job.axis, job.subcommand->devices,
			   job.subcommand->name);
	job.subcommand->run(&job, &drive);
	/* Status prints all counters; a motion only those of trouble on the way. */
	if (!job.json && drive.drove)
		stepper_counters_line(drive.stepper);
	stepper_drive_end(&drive);
	if (cli_stop == SIGPIPE)
		return 1;
	cli_finish();
	return 0;
}
