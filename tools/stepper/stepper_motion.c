// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The commands of incise stepper that power the motor: enable, move, jog, home.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "stepper_command.h"
#include "stepper_status.h"

/* A motion may take twice what its limits make of it, and this. */
#define MOTION_S 2

void stepper_enable(const struct stepper_job *job, struct stepper_drive *drive)
{
	stepper_drive_power(drive);
	if (!job->json) {
		printf("powered, held at %.4f mm; Ctrl-C disables it, and so does the end of "
		       "this program within %g ms\n",
		       drive->status.position_mm, drive->info.deadman_s * 1e3);
		fflush(stdout);
	}
	stepper_drive_hold(drive, job->seconds);
	if (job->json)
		stepper_put(stepper_report(job, drive), JSON_INDENT(2));
}

/* After a motion: where it is, when it is done in full. */
static void put_moved(const struct stepper_job *job, const struct stepper_drive *drive,
		      double from_mm, double seconds)
{
	const struct incise_stepper_status *s = &drive->status;
	json_t *object;

	cli_progress_end();
	if (job->json) {
		object = stepper_report(job, drive);
		json_object_set_new(object, "from_mm", json_number(from_mm));
		json_object_set_new(object, "seconds", json_number(seconds));
		stepper_put(object, JSON_INDENT(2));
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

/* Where the way goes, within the travel, or the end of the program. */
static double destination(const struct stepper_job *job, struct stepper_drive *drive)
{
	double mm = job->amount, from_mm = drive->status.position_mm;
	/* A travel need not be of whole steps; the last one is half a step away at most. */
	double slack_mm = 0.5 * drive->info.step_mm;

	if (job->by)
		mm += from_mm;
	else if (!drive->status.homed && !job->unhomed)
		stepper_drive_fail(
			drive,
			"%s is not homed, so %g mm is no place of it: run `incise stepper "
			"home`, or move --by, or with --unhomed",
			drive->info.name, mm);
	if (mm < -slack_mm || mm > drive->info.travel_mm + slack_mm)
		stepper_drive_fail(
			drive,
			"from %g mm to %g mm: that lies outside the travel of %s, "
			"0 to %g mm%s",
			from_mm, mm, drive->info.name, drive->info.travel_mm,
			drive->status.homed ? ""
					    : "; its count is not the machine's: run "
					      "`incise stepper home`");
	return fmax(0, fmin(drive->info.travel_mm, mm));
}

/* Whether it rests at a target, or at the microstep nearest to it. */
static bool arrived(const struct stepper_drive *drive, double to_mm)
{
	return stepper_drive_rests(drive) &&
	       fabs(drive->status.position_mm - to_mm) <=
		       fmax(0.6 * drive->info.step_mm, drive->info.within_mm);
}

/* What the limits make of a motion, from rest to rest at most. */
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

void stepper_move(const struct stepper_job *job, struct stepper_drive *drive)
{
	double to_mm = destination(job, drive), from_mm = drive->status.position_mm;
	double within_s = motion_s(&drive->info, to_mm - from_mm), seconds;
	double step_mm = drive->info.step_mm, arrived_s = INFINITY;
	int64_t begin;

	/* The travel's end, when that is between two steps, is the one before it. */
	to_mm = fmin(to_mm,
		     floor(drive->info.travel_mm / step_mm * (1 + 1e-12)) * step_mm);
	stepper_drive_power(drive);
	begin = incise_clock_now(drive->clock);
	do {
		stepper_drive_to(drive, to_mm);
		seconds = (double)(incise_clock_now(drive->clock) - begin) /
			  INCISE_NS_PER_S;
		arrived_s = arrived(drive, to_mm) ? fmin(arrived_s, seconds) : INFINITY;
		/* A drive that follows its targets is given the time to be there. */
	} while (!cli_stop && seconds < within_s &&
		 !(seconds >= arrived_s + drive->info.settle_s));
	if (!arrived(drive, to_mm) && cli_stop)
		fail_stopped(drive);
	if (!arrived(drive, to_mm))
		stepper_drive_fail(
			drive,
			"%s is at %.4f mm after %.1f s and did not come to rest at "
			"%.4f mm; see incise stepper status",
			drive->info.name, drive->status.position_mm, seconds, to_mm);
	put_moved(job, drive, from_mm, seconds);
	maybe_hold(job, drive);
}

void stepper_jog(const struct stepper_job *job, struct stepper_drive *drive)
{
	double mm_s = job->amount, end_mm = mm_s > 0 ? drive->info.travel_mm : 0;
	double from_mm = drive->status.position_mm, seconds;
	int64_t begin;
	bool ended;

	if (fabs(mm_s) > drive->info.velocity_mm_s)
		stepper_drive_fail(drive, "%g mm/s is faster than the %g mm/s of %s",
				   mm_s, drive->info.velocity_mm_s, drive->info.name);
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
		printf("that is the end of the travel, 0 to %g mm%s\n",
		       drive->info.travel_mm,
		       drive->status.homed ? ""
					   : " of a count that is not the machine's");
}

/* Where homing found the edge, each time; steps in the count that the first one made. */
struct edges {
	json_t *before_mm, *before_steps; /* each in the count before it */
	double after_mm;
	long long off, lowest, highest;
	int n;	      /* of which the edge is known */
	bool unknown; /* the drive homed by itself and did not tell */
};

/* A drive that homed by itself: it is at its 0, and that is all that is known. */
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
		printf("%s homes by itself and does not tell where the edge was in the count "
		       "before%s\n",
		       drive->info.name,
		       job->repeat > 1 ? ": how well it repeats is not known" : "");
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
	/* Each homing names the edge anew, by what it was off. */
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
	printf("home edge at step %lld, %.4f mm, of the count before; now at %.4f mm\n",
	       before, (double)before * info->step_mm, edge.after_mm);
	fflush(stdout);
}

static json_t *home_json(const struct stepper_job *job, const struct stepper_drive *drive,
			 const struct edges *edges)
{
	long long spread = edges->highest - edges->lowest;
	bool known = edges->n > 1 && !edges->unknown;
	double spread_mm = known ? (double)spread * drive->info.step_mm : NAN;
	json_t *object = stepper_report(job, drive);

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
		printf("%d times within %lld steps, %.4f mm\n", edges->n, spread,
		       (double)spread * drive->info.step_mm);
	printf("homed, at %.4f mm\n", drive->status.position_mm);
	fflush(stdout);
	json_decref(edges->before_mm);
	json_decref(edges->before_steps);
}

void stepper_home(const struct stepper_job *job, struct stepper_drive *drive)
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
		stepper_put(home_json(job, drive, &edges), JSON_INDENT(2));
	else
		put_home(&edges, drive);
	maybe_hold(job, drive);
}
