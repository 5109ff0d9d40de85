// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * An actuator driven by hand; see drive.h.
 */
#include <errno.h>
#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "drive.h"
#include "status.h"

/* An ordinary process may be late by more than one period. */
#define PERIODS_PER_DEADMAN 10
#define PERIOD_NS 5000000      /* at most */
#define LEAST_PERIOD_NS 100000 /* at least */
#define SHOW_NS 100000000      /* between progress */
#define STOPPING_NS 2000000000 /* for it to come to rest by a fault */

void stepper_drive_open(struct stepper_drive *drive, const char *rig, int axis,
			unsigned int devices, const char *doing)
{
	struct incise_error err = {0};

	*drive = (struct stepper_drive){.doing = doing};
	if (devices == STEPPER_DRIVE_OR_WATCH) {
		drive->rig = incise_rig_open(cli_rig(rig), INCISE_RIG_STEPPER, &err);
		devices = err.code == EBUSY ? INCISE_RIG_WATCH : 0;
	}
	if (!drive->rig)
		drive->rig = cli_open_rig(rig, INCISE_RIG_STEPPER | devices);
	drive->clock = incise_rig_clock(drive->rig);
	drive->stepper = incise_rig_axis(drive->rig, axis - 1, NULL);
	if (!drive->stepper)
		stepper_drive_fail(drive, "--axis %d: the rig has fewer actuators", axis);
	incise_stepper_info(drive->stepper, &drive->info);
	drive->period_ns = (int64_t)fmax(
		LEAST_PERIOD_NS, fmin(PERIOD_NS, drive->info.deadman_s * INCISE_NS_PER_S /
							 PERIODS_PER_DEADMAN));
	stepper_drive_look(drive);
}

void stepper_drive_fail(struct stepper_drive *drive, const char *fmt, ...)
{
	char text[600];
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	/* An error of disabling adds nothing to this failure. */
	if (drive->powered)
		incise_stepper_disable(drive->stepper, NULL);
	incise_rig_close(drive->rig);
	cli_fail("%s: %s", drive->doing, text);
}

void stepper_drive_look(struct stepper_drive *drive)
{
	int rc = incise_stepper_status(drive->stepper, &drive->status);

	if (rc == -ENODEV)
		stepper_drive_fail(drive, "%s: %s", drive->info.name,
				   incise_stepper_fault_text(INCISE_STEPPER_FAULT_GONE));
	if (rc)
		stepper_drive_fail(drive, "%s: reading its status: %s", drive->info.name,
				   strerror(-rc));
}

static void on_pipe(int number)
{
	cli_stop = number;
}

void stepper_drive_power(struct stepper_drive *drive)
{
	struct incise_error err = {0};

	cli_catch_signals();
	/* A closed pipe ends the motion as Ctrl-C does. */
	sigaction(SIGPIPE, &(struct sigaction){.sa_handler = on_pipe}, NULL);
	/* Optional: on a busy machine an ordinary process may be too late. */
	if (incise_clock_is_real(drive->clock))
		sched_setscheduler(0, SCHED_FIFO, &(struct sched_param){1});
	/* Set before it is powered, so that every way out powers it off. */
	drive->powered = drive->drove = true;
	if (incise_stepper_enable(drive->stepper, &err))
		stepper_drive_fail(drive, "%s", err.text);
	stepper_drive_look(drive);
}

bool stepper_drive_rests(const struct stepper_drive *drive)
{
	return drive->status.state == INCISE_STEPPER_STATE_READY &&
	       drive->status.velocity_mm_s == 0;
}

bool stepper_drive_arrived(const struct stepper_drive *drive, double to_mm)
{
	return stepper_drive_rests(drive) &&
	       fabs(drive->status.position_mm - to_mm) <=
		       fmax(0.6 * drive->info.step_mm, drive->info.within_mm);
}

static void pass(struct stepper_drive *drive, int64_t ns)
{
	/* A signal ends the wait; callers check cli_stop. */
	incise_clock_wait_until(drive->clock, incise_clock_now(drive->clock) + ns);
	stepper_drive_look(drive);
}

static unsigned int stopping_faults(const struct stepper_drive *drive)
{
	return drive->status.faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL;
}

/* It stopped, or is stopping, by itself: print where, why and what to do. */
static _Noreturn void fail_with_fault(struct stepper_drive *drive)
{
	unsigned int faults;
	char text[400];

	for (int64_t ns = 0; drive->status.state == INCISE_STEPPER_STATE_STOPPING &&
			     ns < STOPPING_NS && incise_clock_is_real(drive->clock);
	     ns += drive->period_ns)
		pass(drive, drive->period_ns);
	faults = stopping_faults(drive);
	stepper_drive_fail(drive, "%s stopped at %.4f mm: %s", drive->info.name,
			   drive->status.position_mm,
			   faults ? stepper_why(drive->stepper, faults, text,
						sizeof(text))
				  : "power was switched off; try again");
}

void stepper_drive_rest(struct stepper_drive *drive)
{
	struct incise_error err = {0};
	int rc = incise_stepper_disable(drive->stepper, &err);

	drive->powered = false;
	if (rc && rc != -ENODEV)
		stepper_drive_fail(drive, "%s", err.text);
	stepper_drive_look(drive);
	/* The virtual one goes back to 0. */
	while (drive->status.state == INCISE_STEPPER_STATE_MOVING)
		pass(drive, drive->period_ns);
	/* On its way to rest it may have met a fault, as a deadman of a program that stood
	 * still. */
	if (drive->drove && !rc && stopping_faults(drive))
		fail_with_fault(drive);
}

void stepper_drive_end(struct stepper_drive *drive)
{
	cli_progress_end();
	if (drive->powered)
		stepper_drive_rest(drive);
	incise_rig_close(drive->rig);
	drive->rig = NULL;
}

/* After a target was given. */
static void follow_drive(struct stepper_drive *drive, int rc)
{
	int64_t now = incise_clock_now(drive->clock);

	if (rc == -EOPNOTSUPP)
		stepper_drive_fail(drive, "%s cannot jog; use incise stepper move",
				   drive->info.name);
	if (rc && rc != -EIO)
		stepper_drive_fail(drive, "%s: %s", drive->info.name, strerror(-rc));
	if (rc)
		stepper_drive_look(drive);
	else
		pass(drive, drive->period_ns);
	if (rc || stopping_faults(drive) ||
	    (drive->status.state != INCISE_STEPPER_STATE_READY &&
	     drive->status.state != INCISE_STEPPER_STATE_MOVING))
		fail_with_fault(drive);
	if (incise_clock_is_real(drive->clock) && now - drive->shown_ns >= SHOW_NS) {
		cli_progress("%s: %9.4f mm %8.3f mm/s, Ctrl-C stops", drive->doing,
			     drive->status.position_mm, drive->status.velocity_mm_s);
		drive->shown_ns = now;
	}
}

void stepper_drive_to(struct stepper_drive *drive, double position_mm)
{
	follow_drive(drive, incise_stepper_set(drive->stepper, position_mm));
}

void stepper_drive_at(struct stepper_drive *drive, double velocity_mm_s)
{
	follow_drive(drive, incise_stepper_jog(drive->stepper, velocity_mm_s));
}

void stepper_drive_hold(struct stepper_drive *drive, double seconds)
{
	double here_mm = drive->status.position_mm;
	int64_t begin = incise_clock_now(drive->clock);
	int64_t ns = (int64_t)(seconds * INCISE_NS_PER_S);

	while (!cli_stop && (!ns || incise_clock_now(drive->clock) - begin < ns))
		stepper_drive_to(drive, here_mm);
}
