// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Strokes of an actuator against the force sensor; see stepper.h. It is driven as by incise
 * stepper: targets are repeated, and whatever ends it brings the motor to rest.
 *
 *   position   /|\        each stroke: to a point, settle, read; points are four times as
 *             / | \       dense in its first quarter, where the turn shows
 *            /  |  \
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "stepper.h"

#define POINTS 70     /* of a stroke */
#define SETTLE_S 0.05 /* until the force is that of the position */
#define READ_S 0.05
#define CREEP_MM_S 2.0
#define PERIOD_NS 1000000 /* of targets */
#define ARRIVE_S 5.0	  /* for the last bit of a creep */
#define SHARE_FORCE 0.8	  /* of what the channel reads, that strokes go up to */
#define SHARE_RANGE 0.7	  /* and that is expected at the end of the range */

static void open_drive(struct stepper_live *live, const char *rig)
{
	const struct incise_stepper_info *info = &live->drive.info;

	stepper_drive_open(&live->drive, rig, 1, INCISE_RIG_FORCE, "strokes");
	live->force = incise_rig_force(live->drive.rig);
	incise_force_info(live->force, &live->channel);
	incise_force_calibration(&live->channel, &live->calibration);
	live->creep_mm_s = fmin(CREEP_MM_S, 0.1 * info->velocity_mm_s);
	live->drive.period_ns =
		PERIOD_NS < live->drive.period_ns ? PERIOD_NS : live->drive.period_ns;
	if (!live->drive.status.homed && !info->can_home)
		stepper_drive_fail(
			&live->drive,
			"%s has no home input, and is not homed: its limits would mean "
			"nothing; run incise stepper home, or wire a home switch",
			info->name);
}

static double code_mV(const struct stepper_live *live, double code)
{
	return 1000 *
	       (live->channel.offset_V +
		code / (double)(1LL << live->channel.bits) * live->channel.full_scale_V);
}

static double newtons(const struct stepper_live *live, double code)
{
	return (code_mV(live, code) - live->zero_mV) / live->calibration.force_mV_N;
}

/* Read all samples; more than max_N ends the program. */
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
	/* While it has power: without it the spring would push it back. */
	live->retreating = true;
	cli_progress_end();
	cli_warn("%.2f N is more than %.2f N: going back", sum / all, live->max_N);
	stepper_creep(live, live->low_mm);
	stepper_drive_rest(&live->drive);
	stepper_drive_fail(&live->drive,
			   "the force exceeded %.2f N; give a smaller --range, or a "
			   "larger --max-force",
			   live->max_N);
}

static void watch_force(struct stepper_live *live)
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

void stepper_creep(struct stepper_live *live, double to_mm)
{
	struct stepper_drive *drive = &live->drive;
	const double pass_s = (double)drive->period_ns / INCISE_NS_PER_S;
	const double step_mm = drive->info.step_mm;
	const double end_mm =
		floor(drive->info.travel_mm / step_mm * (1 + 1e-12)) * step_mm;
	double at_mm = drive->status.position_mm, waited_s = 0;
	/* Between two targets it accelerates: keep that below creep_mm_s, too. */
	const double each_mm =
		fmax(step_mm, fmin(live->creep_mm_s * pass_s,
				   live->creep_mm_s * live->creep_mm_s /
					   drive->info.acceleration_mm_s2));

	to_mm = fmax(0, fmin(end_mm, to_mm + live->off_mm));
	while (waited_s < ARRIVE_S) {
		double left = to_mm - at_mm;

		at_mm += copysign(fmin(fabs(left), each_mm), left);
		stepper_drive_to(drive, at_mm);
		watch_force(live);
		if (at_mm != to_mm)
			continue;
		if (stepper_drive_arrived(drive, to_mm))
			return;
		waited_s += pass_s;
	}
	stepper_drive_fail(
		drive,
		"%s is at %.4f mm and did not come to rest at %.4f mm; see incise "
		"stepper status",
		drive->info.name, drive->status.position_mm, to_mm);
}

static double read_mean_force(struct stepper_live *live, double seconds)
{
	struct stepper_drive *drive = &live->drive;
	const double here_mm = drive->status.position_mm;
	int64_t begin = incise_clock_now(drive->clock);
	bool settled = false;

	for (;;) {
		double s = (double)(incise_clock_now(drive->clock) - begin) /
			   INCISE_NS_PER_S;

		if (!settled && s >= SETTLE_S + drive->info.settle_s) {
			watch_force(live);
			live->sum_N = live->samples = 0;
			begin = incise_clock_now(drive->clock);
			settled = true;
		} else if (settled && s >= seconds && live->samples)
			return live->sum_N / live->samples;
		else if (settled && s > seconds + ARRIVE_S)
			stepper_drive_fail(drive,
					   "%s: no samples arrive; check its "
					   "cable",
					   live->channel.name);
		stepper_drive_to(drive, here_mm);
		watch_force(live);
	}
}

static void plan_strokes(struct stepper_live *live)
{
	const struct incise_stepper_info *info = &live->drive.info;
	const double top = (1 << live->channel.bits) - 1;

	live->zero_mV = live->calibration.force_zero_mV;
	/* Without a zero use the present reading: only differences count. */
	if (isnan(live->zero_mV)) {
		live->zero_mV = 0;
		live->retreating = true; /* nothing moves: no limit */
		for (int i = 0; i < 40; i++) {
			incise_clock_wait_until(live->drive.clock,
						incise_clock_now(live->drive.clock) +
							5000000);
			read_force(live);
		}
		live->retreating = false;
		if (!live->samples)
			stepper_drive_fail(&live->drive,
					   "%s: no samples arrive; check its cable",
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
				   "--range ends at %g mm, but the travel of %s at %g "
				   "mm; give a smaller one",
				   live->high_mm, info->name, info->travel_mm);
	if (live->high_mm - live->low_mm < 100 * info->step_mm)
		stepper_drive_fail(
			&live->drive,
			"a range of %g mm is less than 100 steps; give a larger "
			"--range",
			live->high_mm - live->low_mm);
}

/* On a terminal a person must confirm that nothing is in the way. */
static void confirm_strokes(struct stepper_live *live)
{
	int c;

	if (!isatty(STDIN_FILENO) || !isatty(STDERR_FILENO))
		return;
	fprintf(stderr,
		"Let the handle press on the force sensor, and do not hold it. %s "
		"will\n"
		"%sgo %d times from %g to %g mm and back, with up to %.2f N. Keep a "
		"hand on the\n"
		"emergency stop. Press Enter to start, Ctrl-C to end: ",
		live->drive.info.name,
		live->drive.info.can_home ? "look for its home, then " : "",
		live->strokes, live->low_mm, live->high_mm, live->max_N);
	while ((c = getchar()) != '\n')
		if (c == EOF)
			stepper_drive_fail(&live->drive,
					   "not confirmed; nothing was moved");
}

static void start_strokes(struct stepper_live *live)
{
	struct stepper_drive *drive = &live->drive;
	struct incise_error err = {0};

	confirm_strokes(live);
	stepper_drive_power(drive);
	if (drive->info.can_home) {
		cli_progress("home: Ctrl-C stops");
		if (incise_stepper_home(drive->stepper, &cli_stop, NULL, &err))
			stepper_drive_fail(drive, "%s", err.text);
		stepper_drive_look(drive);
	}
	live->begin_ns = incise_clock_now(drive->clock);
	stepper_creep(live, live->low_mm);
}

void stepper_begin(struct stepper_live *live, const struct calibrate *calibrate)
{
	live->calibration = calibrate->found;
	open_drive(live, calibrate->rig);
	plan_strokes(live);
	start_strokes(live);
}

void stepper_strokes(struct stepper_live *live, stepper_take *take, void *context)
{
	const double step_mm = live->drive.info.step_mm;
	const double range_mm = live->high_mm - live->low_mm;

	for (int k = 0; k < 2 * live->strokes; k++)
		for (int i = k > 0; i < POINTS; i++) {
			double share = (double)i / (POINTS - 1) * 7 / 4, mm, N;

			share = share < 1 ? share / 4 : 0.25 + (share - 1);
			mm = k % 2 ? live->high_mm - share * range_mm
				   : live->low_mm + share * range_mm;
			stepper_creep(live, round(mm / step_mm) * step_mm);
			N = read_mean_force(live, READ_S);
			take(context,
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

#define LOOK_S 0.1
/*
 * --- the largest step rate -------------------------------------------------------------
 *
 * Strokes at rising speed, each way by itself. If the force at a stroke's end is far from the
 * line of its branch, the nut is far from its count, and the count is corrected first. Then
 * the force at one and the same position, approached slowly from below, shows single steps.
 *
 *   position  fast ╱─look slow  ╱─ look     fast ╲       ╱─ look
 *                 ╱      ╲_____╱                  ╲look─╱
 */

#define TWICE 2	   /* strokes at a rate that loses none */
#define RISE 1.4   /* from one to the next, until one loses steps */
#define CLOSE 0.03 /* between the last that kept and the first that lost */
#define STROKES_MAX 80
#define RUN 0.6 /* of a stroke for speeding up and slowing down */

/* The force at the middle, approached from below. */
static double read_middle(struct stepper_live *live)
{
	stepper_creep(live, live->low_mm);
	stepper_creep(live, (live->low_mm + live->high_mm) / 2);
	return read_mean_force(live, LOOK_S);
}

/* One way at a speed; returns the largest speed. */
static double drive_stroke(struct stepper_live *live, int way, double mm_s)
{
	struct stepper_drive *drive = &live->drive;
	const double a = drive->info.acceleration_mm_s2;
	const double pass_s = (double)drive->period_ns / INCISE_NS_PER_S;
	const double to_mm = (way > 0 ? live->high_mm : live->low_mm) + live->off_mm;
	/* A timeout, for a drive that stands still without a fault. */
	const double most_s =
		5 * (live->high_mm - live->low_mm) / mm_s + 2 * mm_s / a + 5;
	double fastest = 0, left_mm;
	int64_t begin;

	stepper_creep(live, way > 0 ? live->low_mm : live->high_mm);
	begin = incise_clock_now(drive->clock);
	for (;;) {
		left_mm = way * (to_mm - drive->status.position_mm);
		/* It must slow down two periods from here. */
		if (left_mm <= mm_s * mm_s / (2 * a) + 2 * mm_s * pass_s)
			break;
		stepper_drive_at(drive, way * mm_s);
		fastest = fmax(fastest, fabs(drive->status.velocity_mm_s));
		watch_force(live);
		if ((double)(incise_clock_now(drive->clock) - begin) >
		    most_s * INCISE_NS_PER_S)
			stepper_drive_fail(
				drive,
				"%s is commanded at %g mm/s but stays at %.4f mm; see "
				"incise stepper status",
				drive->info.name, way * mm_s, drive->status.position_mm);
	}
	do {
		stepper_drive_at(drive, 0);
		fastest = fmax(fastest, fabs(drive->status.velocity_mm_s));
		watch_force(live);
	} while (!stepper_drive_rests(drive) &&
		 (double)(incise_clock_now(drive->clock) - begin) <
			 most_s * INCISE_NS_PER_S);
	return fastest;
}

/* Correct the count by a loss. */
static void correct_count(struct stepper_live *live, double lost_mm)
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

/* Loss since the last time, after a stroke this way, mm. */
static double find_loss(struct stepper_live *live, int way, double was_N,
			const struct incise_calibrate_stepper *fit, double seen_mm)
{
	double at_mm = live->drive.status.position_mm - live->off_mm;
	double line_N = (way > 0 ? fit->up_N : fit->down_N) + fit->N_mm * at_mm;
	double far_mm = (line_N - read_mean_force(live, LOOK_S)) / fit->N_mm, near_mm;
	bool far = fabs(far_mm) >
		   fit->dead_mm + fit->rest_mm + seen_mm + 2 * fit->drift_N / fit->N_mm;

	if (far)
		correct_count(live, far_mm);
	near_mm = (was_N - read_middle(live)) / fit->N_mm;
	if (fabs(near_mm) > seen_mm) {
		correct_count(live, near_mm);
		/* The correction may have been smaller than the dead travel. */
		near_mm += (was_N - read_middle(live)) / fit->N_mm;
	}
	if (far)
		return far_mm;
	return fabs(near_mm) > seen_mm ? near_mm : 0;
}

/* Whether a speed loses steps; sets *mm_s to the speed reached. */
static bool try_speed(struct stepper_live *live, double *mm_s, double was_N,
		      const struct incise_calibrate_stepper *fit,
		      struct stepper_rate *rate, double *lost_mm)
{
	double fastest = 0;

	for (int i = 0; i < TWICE; i++)
		for (int way = 1; way >= -1; way -= 2) {
			double off;

			fastest = fmax(fastest, drive_stroke(live, way, *mm_s));
			rate->strokes++;
			off = find_loss(live, way, was_N, fit, rate->seen_mm);
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

void stepper_find_rate(struct stepper_live *live,
		       const struct incise_calibrate_stepper *fit,
		       struct stepper_rate *rate)
{
	const struct incise_stepper_info *info = &live->drive.info;
	const double range_mm = live->high_mm - live->low_mm;
	/* Not slower than it creeps, as then the creeping loses steps as well. */
	double most, at, kept = live->creep_mm_s, loss = NAN, was_N, lost_mm;

	if (incise_stepper_jog(live->drive.stepper, 0) == -EOPNOTSUPP) {
		rate->why = "it takes positions only, no speeds";
		return;
	}
	rate->tried = true;
	rate->seen_mm =
		fmax(4 * info->step_mm, 5 * M_SQRT2 * fit->residual_sd_N / fit->N_mm);
	most = fmin(info->velocity_mm_s, sqrt(RUN * range_mm * info->acceleration_mm_s2));
	rate->limit_1_s = most / info->step_mm;
	was_N = read_middle(live);
	at = fmin(most, 2 * live->creep_mm_s);
	while (rate->strokes < STROKES_MAX) {
		double mm_s = at;
		bool loses_steps = try_speed(live, &mm_s, was_N, fit, rate, &lost_mm);

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
		/* Without a home the count may drift out of the travel. */
		if (live->high_mm + live->off_mm > info->travel_mm ||
		    live->low_mm + live->off_mm < -0.05 * range_mm)
			break;
		if (!isnan(loss) && loss - kept < CLOSE * loss)
			break;
		at = isnan(loss) ? fmin(most, at * RISE) : (kept + loss) / 2;
	}
	cli_progress_end();
	rate->off_mm = live->off_mm;
	stepper_creep(live, live->low_mm);
}
