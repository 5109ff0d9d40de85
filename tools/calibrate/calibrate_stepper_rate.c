// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The largest step rate that loses no step: strokes at rising speed, each way by itself. Where
 * the force at a stroke's end is far from the line of its branch, the nut is far from where its
 * count says, and the count is put right before it goes anywhere. Then the force at one and the
 * same position, which is come to slowly and from below, tells single steps.
 *
 *   position  fast ╱─look slow  ╱─ look     fast ╲       ╱─ look
 *                 ╱      ╲_____╱                  ╲look─╱
 */
#include <errno.h>
#include <math.h>
#include "calibrate_stepper.h"
#include "../cli/cli.h"

#define READ_S 0.1
#define TWICE 2	   /* a rate that is to be good is tried so often */
#define RISE 1.4   /* from one to the next, until one loses steps */
#define CLOSE 0.03 /* between the last that kept and the first that lost */
#define STROKES_MAX 80
#define RUN 0.6 /* of a stroke for speeding up and slowing down */

/* The force at the middle, come to from below. */
static double look(struct stepper_live *live)
{
	stepper_live_creep(live, live->low_mm);
	stepper_live_creep(live, (live->low_mm + live->high_mm) / 2);
	return stepper_live_force(live, READ_S);
}

/* One way, at a speed; returns the largest that it had. */
static double stroke(struct stepper_live *live, int way, double mm_s)
{
	struct stepper_drive *drive = &live->drive;
	const double a = drive->info.acceleration_mm_s2;
	const double pass_s = (double)drive->period_ns / INCISE_NS_PER_S;
	const double to_mm = (way > 0 ? live->high_mm : live->low_mm) + live->off_mm;
	/* Many times what it takes: it ends where a drive stands still without a fault. */
	const double most_s =
		5 * (live->high_mm - live->low_mm) / mm_s + 2 * mm_s / a + 5;
	double fastest = 0, left_mm;
	int64_t begin;

	stepper_live_creep(live, way > 0 ? live->low_mm : live->high_mm);
	begin = incise_clock_now(drive->clock);
	for (;;) {
		left_mm = way * (to_mm - drive->status.position_mm);
		/* Where it has to slow down, two looks ahead. */
		if (left_mm <= mm_s * mm_s / (2 * a) + 2 * mm_s * pass_s)
			break;
		stepper_drive_at(drive, way * mm_s);
		fastest = fmax(fastest, fabs(drive->status.velocity_mm_s));
		stepper_live_watch(live);
		if ((double)(incise_clock_now(drive->clock) - begin) >
		    most_s * INCISE_NS_PER_S)
			stepper_drive_fail(
				drive,
				"%s is told to go at %g mm/s and stays at %.4f mm; "
				"see incise stepper status",
				drive->info.name, way * mm_s, drive->status.position_mm);
	}
	do {
		stepper_drive_at(drive, 0);
		fastest = fmax(fastest, fabs(drive->status.velocity_mm_s));
		stepper_live_watch(live);
	} while (!stepper_drive_rests(drive) &&
		 (double)(incise_clock_now(drive->clock) - begin) <
			 most_s * INCISE_NS_PER_S);
	return fastest;
}

/* Count where the nut is, as far as it is known. */
static void put_right(struct stepper_live *live, double lost_mm)
{
	struct stepper_drive *drive = &live->drive;
	struct incise_error err = {0};

	live->off_mm += lost_mm;
	if (!drive->info.can_home)
		return;
	if (incise_stepper_home(drive->stepper, &cli_stop, NULL, &err))
		stepper_drive_fail(drive, "%s", err.text);
	stepper_drive_look(drive);
	live->off_mm = 0;
}

/* By how far the nut is behind its count since the last time, after a stroke this way. */
static double lost(struct stepper_live *live, int way, double was_N,
		   const struct incise_calibrate_stepper *fit, double seen_mm)
{
	double at_mm = live->drive.status.position_mm - live->off_mm;
	double line_N = (way > 0 ? fit->up_N : fit->down_N) + fit->N_mm * at_mm;
	double far_mm = (line_N - stepper_live_force(live, READ_S)) / fit->N_mm, near_mm;
	bool far = fabs(far_mm) >
		   fit->dead_mm + fit->rest_mm + seen_mm + 2 * fit->drift_N / fit->N_mm;

	if (far)
		put_right(live, far_mm);
	near_mm = (was_N - look(live)) / fit->N_mm;
	if (fabs(near_mm) > seen_mm) {
		put_right(live, near_mm);
		/* From a wrong place it may have come to it by less than its dead travel. */
		near_mm += (was_N - look(live)) / fit->N_mm;
	}
	if (far)
		return far_mm;
	return fabs(near_mm) > seen_mm ? near_mm : 0;
}

/* Whether a speed loses steps; *mm_s becomes what it really was. */
static bool loses(struct stepper_live *live, double *mm_s, double was_N,
		  const struct incise_calibrate_stepper *fit, struct stepper_rate *rate,
		  double *lost_mm)
{
	double fastest = 0;

	for (int i = 0; i < TWICE; i++)
		for (int way = 1; way >= -1; way -= 2) {
			double off;

			fastest = fmax(fastest, stroke(live, way, *mm_s));
			rate->strokes++;
			off = lost(live, way, was_N, fit, rate->seen_mm);
			if (incise_clock_is_real(live->drive.clock))
				cli_progress("%.0f steps/s: %s, Ctrl-C stops",
					     fastest / live->drive.info.step_mm,
					     off != 0 ? "lost steps" : "lost none");
			if (off != 0) {
				*lost_mm = fabs(off);
				*mm_s = fastest;
				return true;
			}
		}
	*mm_s = fastest;
	return false;
}

void stepper_live_rate(struct stepper_live *live,
		       const struct incise_calibrate_stepper *fit,
		       struct stepper_rate *rate)
{
	const struct incise_stepper_info *info = &live->drive.info;
	const double range_mm = live->high_mm - live->low_mm;
	/* Slower than it creeps would tell nothing: the creeping would lose as well. */
	double most, at, kept = live->creep_mm_s, loss = NAN, was_N, lost_mm;

	*rate = (struct stepper_rate){.lost_1_s = NAN};
	if (incise_stepper_jog(live->drive.stepper, 0) == -EOPNOTSUPP) {
		rate->why = "it cannot be driven at a speed";
		return;
	}
	rate->tried = true;
	rate->seen_mm =
		fmax(4 * info->step_mm, 5 * M_SQRT2 * fit->residual_sd_N / fit->N_mm);
	most = fmin(info->velocity_mm_s, sqrt(RUN * range_mm * info->acceleration_mm_s2));
	rate->limit_1_s = most / info->step_mm;
	was_N = look(live);
	at = fmin(most, 2 * live->creep_mm_s);
	while (rate->strokes < STROKES_MAX) {
		double mm_s = at;
		bool loses_steps = loses(live, &mm_s, was_N, fit, rate, &lost_mm);

		if (loses_steps) {
			loss = at;
			rate->lost_1_s = mm_s / info->step_mm;
			rate->lost_mm = lost_mm;
		} else {
			kept = at;
			rate->kept_1_s = mm_s / info->step_mm;
		}
		if (isnan(loss) && kept >= most)
			break;
		/* Without a home the count has run away from the travel that it bounds. */
		if (live->high_mm + live->off_mm > info->travel_mm ||
		    live->low_mm + live->off_mm < -0.05 * range_mm)
			break;
		if (!isnan(loss) && loss - kept < CLOSE * loss)
			break;
		at = isnan(loss) ? fmin(most, at * RISE) : (kept + loss) / 2;
	}
	cli_progress_end();
	rate->off_mm = live->off_mm;
	stepper_live_creep(live, live->low_mm);
}
