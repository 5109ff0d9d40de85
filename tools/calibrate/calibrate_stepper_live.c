// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Strokes of an actuator against the force sensor; see calibrate_stepper.h. The way of driving
 * is that of incise stepper: targets given again and again, and whatever ends it brings the
 * motor to rest.
 *
 *   position   /|\        each stroke: to a point, settle, read; points are four times as
 *             / | \       dense in its first quarter, where the turn shows
 *            /  |  \
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "calibrate_stepper.h"
#include "../cli/cli.h"

#define POINTS 70     /* of a stroke */
#define SETTLE_S 0.05 /* until the force is that of the position */
#define READ_S 0.05
#define CREEP_MM_S 2.0
#define PERIOD_NS 1000000 /* of targets */
#define ARRIVE_S 5.0	  /* for the last bit of a creep */
#define SHARE_FORCE 0.8	  /* of what the channel reads, that strokes go up to */
#define SHARE_RANGE 0.7	  /* and that is expected at the end of the range */

void stepper_live_open(struct stepper_live *live, const char *rig)
{
	const struct incise_stepper_info *info = &live->drive.info;

	stepper_drive_open(&live->drive, rig, INCISE_RIG_FORCE, "strokes");
	live->force = incise_rig_force(live->drive.rig);
	incise_force_info(live->force, &live->channel);
	live->creep_mm_s = fmin(CREEP_MM_S, 0.1 * info->velocity_mm_s);
	live->drive.period_ns =
		PERIOD_NS < live->drive.period_ns ? PERIOD_NS : live->drive.period_ns;
	if (!live->drive.status.homed && !info->can_home)
		stepper_drive_fail(
			&live->drive,
			"%s has no home input, and its count is not the machine's: "
			"limits would mean nothing; run incise stepper home, or wire one",
			info->name);
}

static double code_mV(const struct stepper_live *live, double code)
{
	return 1000 * (live->channel.offset_V +
		       code / (1 << live->channel.bits) * live->channel.full_scale_V);
}

static double newtons(const struct stepper_live *live, double code)
{
	return (code_mV(live, code) - live->zero_mV) / live->calibration.force_mV_N;
}

/* All samples there are; more force than may be ends it. */
static void read_force(struct stepper_live *live)
{
	struct incise_force_sample samples[256];
	double sum = 0;
	char text[300];
	int n, all = 0;

	while ((n = incise_force_read(live->force, samples, 256)) > 0) {
		for (int i = 0; i < n; i++)
			sum += newtons(live, samples[i].code);
		all += n;
	}
	if (n < 0) {
		incise_force_cause(live->force, text, sizeof(text));
		stepper_drive_fail(&live->drive, "%s: %s", live->channel.name,
				   *text ? text : strerror(-n));
	}
	live->sum_N += sum;
	live->samples += all;
	if (!all || live->retreating || !(fabs(sum / all) > live->max_N))
		return;
	/* Before power goes, which a spring would not wait for. */
	live->retreating = true;
	cli_progress_end();
	cli_warn("%.2f N is more than %.2f N: going back", sum / all, live->max_N);
	stepper_live_creep(live, live->low_mm);
	stepper_drive_rest(&live->drive);
	stepper_drive_fail(&live->drive,
			   "the force was more than %.2f N on the way; give a smaller "
			   "--range, or a larger --max-force",
			   live->max_N);
}

void stepper_live_watch(struct stepper_live *live)
{
	if (cli_stop) {
		stepper_drive_rest(&live->drive);
		stepper_drive_fail(&live->drive,
				   "%s: at rest at %.4f mm, without power; nothing has "
				   "changed",
				   strsignal(cli_stop), live->drive.status.position_mm);
	}
	read_force(live);
}

void stepper_live_creep(struct stepper_live *live, double to_mm)
{
	struct stepper_drive *drive = &live->drive;
	const double pass_s = (double)drive->period_ns / INCISE_NS_PER_S;
	const double step_mm = drive->info.step_mm;
	const double end_mm =
		floor(drive->info.travel_mm / step_mm * (1 + 1e-12)) * step_mm;
	double at_mm = drive->status.position_mm, waited_s = 0;
	/* From target to target it goes as fast as it can: at the most creep_mm_s as well. */
	const double each_mm =
		fmax(step_mm, fmin(live->creep_mm_s * pass_s,
				   live->creep_mm_s * live->creep_mm_s /
					   drive->info.acceleration_mm_s2));

	to_mm = fmax(0, fmin(end_mm, to_mm + live->off_mm));
	while (waited_s < ARRIVE_S) {
		double left = to_mm - at_mm;

		at_mm += copysign(fmin(fabs(left), each_mm), left);
		stepper_drive_to(drive, at_mm);
		stepper_live_watch(live);
		if (at_mm != to_mm)
			continue;
		if (stepper_drive_rests(drive) &&
		    fabs(drive->status.position_mm - to_mm) <=
			    fmax(0.6 * step_mm, drive->info.within_mm))
			return;
		waited_s += pass_s;
	}
	stepper_drive_fail(
		drive,
		"%s is at %.4f mm and did not come to rest at %.4f mm; see incise "
		"stepper status",
		drive->info.name, drive->status.position_mm, to_mm);
}

double stepper_live_force(struct stepper_live *live, double seconds)
{
	struct stepper_drive *drive = &live->drive;
	const double here_mm = drive->status.position_mm;
	int64_t begin = incise_clock_now(drive->clock);
	bool settled = false;

	for (;;) {
		double s = (double)(incise_clock_now(drive->clock) - begin) /
			   INCISE_NS_PER_S;

		if (!settled && s >= SETTLE_S + drive->info.settle_s) {
			stepper_live_watch(live);
			live->sum_N = live->samples = 0;
			begin = incise_clock_now(drive->clock);
			settled = true;
		} else if (settled && s >= seconds && live->samples)
			return live->sum_N / live->samples;
		else if (settled && s > seconds + ARRIVE_S)
			stepper_drive_fail(drive, "%s gives no samples; see its cable",
					   live->channel.name);
		stepper_drive_to(drive, here_mm);
		stepper_live_watch(live);
	}
}

void stepper_live_plan(struct stepper_live *live)
{
	const struct incise_stepper_info *info = &live->drive.info;
	const double top = (1 << live->channel.bits) - 1;

	live->zero_mV = live->calibration.force_zero_mV;
	/* Without a zero that of this moment has to do: only differences are looked at. */
	if (isnan(live->zero_mV)) {
		live->zero_mV = 0;
		live->retreating = true; /* nothing moves, and nothing is judged */
		for (int i = 0; i < 40; i++) {
			incise_clock_wait_until(live->drive.clock,
						incise_clock_now(live->drive.clock) +
							5000000);
			read_force(live);
		}
		live->retreating = false;
		if (!live->samples)
			stepper_drive_fail(&live->drive,
					   "%s gives no samples; see its cable",
					   live->channel.name);
		live->zero_mV =
			live->sum_N / live->samples * live->calibration.force_mV_N;
		live->sum_N = live->samples = 0;
	}
	live->low_N = newtons(live, 0);
	live->high_N = newtons(live, top);
	live->code_N = newtons(live, 1) - newtons(live, 0);
	if (isnan(live->max_N))
		live->max_N = SHARE_FORCE * live->high_N;
	if (isnan(live->low_mm))
		live->low_mm = 0;
	if (isnan(live->high_mm))
		live->high_mm =
			fmin(info->travel_mm, live->low_mm + SHARE_RANGE * live->high_N /
								     info->spring_N_mm);
	if (live->high_mm > info->travel_mm + 0.5 * info->step_mm)
		stepper_drive_fail(&live->drive,
				   "--range ends at %g mm, and the travel of %s at %g mm",
				   live->high_mm, info->name, info->travel_mm);
	if (live->high_mm - live->low_mm < 100 * info->step_mm)
		stepper_drive_fail(
			&live->drive,
			"a range of %g mm is less than 100 steps; give a larger "
			"--range",
			live->high_mm - live->low_mm);
}

/* On a terminal, somebody has to say that nothing is in the way. */
static void confirm(struct stepper_live *live)
{
	int c;

	if (!isatty(STDIN_FILENO) || !isatty(STDERR_FILENO))
		return;
	fprintf(stderr,
		"The handle is to press the force sensor, and nobody is to hold it. %s will\n"
		"%sgo %d times from %g to %g mm and back, with up to %.2f N. Keep a hand on the\n"
		"emergency stop. Enter starts it, Ctrl-C ends it: ",
		live->drive.info.name,
		live->drive.info.can_home ? "search its home, then " : "", live->strokes,
		live->low_mm, live->high_mm, live->max_N);
	while ((c = getchar()) != '\n')
		if (c == EOF)
			stepper_drive_fail(&live->drive,
					   "not confirmed; nothing was moved");
}

void stepper_live_start(struct stepper_live *live)
{
	struct stepper_drive *drive = &live->drive;
	struct incise_error err = {0};

	confirm(live);
	stepper_drive_power(drive);
	if (drive->info.can_home) {
		cli_progress("home: Ctrl-C stops");
		if (incise_stepper_home(drive->stepper, &cli_stop, &err))
			stepper_drive_fail(drive, "%s", err.text);
		stepper_drive_look(drive);
	}
	live->begin_ns = incise_clock_now(drive->clock);
	stepper_live_creep(live, live->low_mm);
}

void stepper_live_strokes(struct stepper_live *live, struct stepper_series *series)
{
	const double step_mm = live->drive.info.step_mm;
	const double range_mm = live->high_mm - live->low_mm;

	series->step_mm = step_mm;
	for (int k = 0; k < 2 * live->strokes; k++)
		for (int i = k > 0; i < POINTS; i++) {
			double share = (double)i / (POINTS - 1) * 7 / 4, mm, N;

			share = share < 1 ? share / 4 : 0.25 + (share - 1);
			mm = k % 2 ? live->high_mm - share * range_mm
				   : live->low_mm + share * range_mm;
			stepper_live_creep(live, round(mm / step_mm) * step_mm);
			N = stepper_live_force(live, READ_S);
			stepper_series_add(series,
					   (double)(incise_clock_now(live->drive.clock) -
						    live->begin_ns) /
						   INCISE_NS_PER_S,
					   live->drive.status.position_mm, N);
			if (incise_clock_is_real(live->drive.clock))
				cli_progress("stroke %d of %d, %s: %9.4f mm %8.4f N, "
					     "Ctrl-C stops",
					     k / 2 + 1, live->strokes,
					     k % 2 ? "down" : "up",
					     live->drive.status.position_mm, N);
		}
	cli_progress_end();
}
