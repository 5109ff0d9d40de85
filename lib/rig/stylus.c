// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A haptic device as the tool of a rig; see stylus.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "stylus.h"

#define SAMPLES 32
#define PLACE_MOST_MM 1e6
/* A force may begin in so much of the workspace along each axis, about its middle. */
#define MIDDLE 0.5
/* An age is late beyond the assumed one by a quarter and half a millisecond, as a mean of so many ticks. */
#define LATE_SHARE 1.25
#define LATE_NS 500000
#define AGE_TICKS 64

static struct incise_stylus *of_stylus(struct incise_tracker *tracker)
{
	return (struct incise_stylus *)tracker;
}

static INCISE_REALTIME void multiply_turns(double q[4], const double a[4],
					   const double b[4])
{
	double cross[3];

	v3_cross(cross, a + 1, b + 1);
	q[0] = a[0] * b[0] - v3_dot(a + 1, b + 1);
	for (int i = 1; i < 4; i++)
		q[i] = a[0] * b[i] + b[0] * a[i] + cross[i - 1];
}

static INCISE_REALTIME bool is_pressed(const struct incise_haptic_sample *sample,
				       int button)
{
	return button > 0 && sample->buttons >> (button - 1) & 1;
}

/* --- poses --------------------------------------------------------------------------- */

/* While pressed the tool stays; let go it is where it stayed. */
static INCISE_REALTIME void use_clutch(struct incise_stylus *stylus,
				       const struct incise_haptic_sample *sample,
				       double position_mm[3])
{
	bool pressed = is_pressed(sample, stylus->setup.clutch);

	if (pressed && !stylus->clutched)
		v3_copy(stylus->held_mm, position_mm);
	if (pressed || stylus->clutched) {
		for (int i = 0; i < 3; i++)
			stylus->setup.origin_mm[i] += stylus->held_mm[i] - position_mm[i];
		v3_copy(position_mm, stylus->held_mm);
	}
	stylus->clutched = pressed;
}

static INCISE_REALTIME bool is_plain(const struct incise_haptic_sample *sample)
{
	double size2 = 0;

	for (int i = 0; i < 3; i++)
		if (!(fabs(sample->position_mm[i]) < PLACE_MOST_MM))
			return false;
	for (int i = 0; i < 4; i++)
		size2 += sample->quaternion[i] * sample->quaternion[i];
	return size2 > 0.98 && size2 < 1.02;
}

static INCISE_REALTIME void place_sample(struct incise_stylus *stylus,
					 const struct incise_haptic_sample *from,
					 struct incise_tracker_sample *to)
{
	*to = (struct incise_tracker_sample){
		.t_ns = from->t_ns + stylus->latency_ns,
		.seq = from->seq,
		.status = ' ',
		.station = 1,
		.button = from->buttons,
		.quaternion = {1},
	};
	if (!is_plain(from)) {
		to->status = '~';
		return;
	}
	v3_rotate(to->position_mm, stylus->setup.turn, from->position_mm);
	v3_add(to->position_mm, to->position_mm, 1, stylus->setup.origin_mm);
	/* Such a place is not the handle's: it moves nothing, nor the frame by the clutch. */
	if (from->flags & (INCISE_HAPTIC_NOT_READY | INCISE_HAPTIC_CHANGED))
		to->status = '!';
	else
		use_clutch(stylus, from, to->position_mm);
	multiply_turns(to->quaternion, stylus->setup.turn, from->quaternion);
	stylus->last = *from;
	stylus->seen = true;
}

static INCISE_REALTIME int read_stylus(struct incise_tracker *tracker,
				       struct incise_tracker_sample *samples, int n)
{
	struct incise_stylus *stylus = of_stylus(tracker);
	struct incise_haptic_sample from[SAMPLES];
	int got;

	if (n > SAMPLES)
		n = SAMPLES;
	got = incise_haptic_read(stylus->haptic, from, n);
	for (int i = 0; i < got; i++)
		place_sample(stylus, &from[i], &samples[i]);
	return got;
}

static void describe_poses(const struct incise_tracker *tracker,
			   struct incise_tracker_info *info)
{
	const struct incise_stylus *stylus = (const struct incise_stylus *)tracker;

	*info = (struct incise_tracker_info){
		.rate_hz = stylus->info.rate_hz,
		.latency_ns = stylus->latency_ns,
		.stations = 1,
		.scalpel_station = 1,
		.haptic = &stylus->info,
	};
	snprintf(info->name, sizeof(info->name), "%s", stylus->info.name);
	/* A recording keeps the note: its settings change how a force feels. */
	snprintf(info->note, sizeof(info->note), "%.190s%s%.100s", stylus->info.filters,
		 *stylus->info.filters && *stylus->info.note ? "; " : "",
		 stylus->info.note);
}

static uint64_t count_lost(const struct incise_tracker *tracker)
{
	return incise_haptic_lost(((const struct incise_stylus *)tracker)->haptic);
}

static int tell_cause(struct incise_tracker *tracker, char *text, size_t size)
{
	return incise_haptic_cause(of_stylus(tracker)->haptic, text, size);
}

/* The rig closes the device. */
static void close_face(struct incise_tracker *tracker)
{
	(void)tracker;
}

static const struct incise_tracker_ops poses = {
	.read = read_stylus,
	.info = describe_poses,
	.lost = count_lost,
	.close = close_face,
	.cause = tell_cause,
};

/* --- force --------------------------------------------------------------------------- */

static INCISE_REALTIME bool is_in_middle(const struct incise_stylus *stylus)
{
	const struct incise_haptic_info *info = &stylus->info;

	for (int i = 0; i < 3; i++) {
		double half_mm = (info->high_mm[i] - info->low_mm[i]) / 2;
		double middle_mm = info->low_mm[i] + half_mm;

		if (half_mm > 0 &&
		    !(fabs(stylus->last.position_mm[i] - middle_mm) <= MIDDLE * half_mm))
			return false;
	}
	return true;
}

/* A period is the time for which a pose is used. */
static INCISE_REALTIME int64_t assumed_ns(const struct incise_stylus *stylus)
{
	return stylus->latency_ns + (int64_t)(INCISE_NS_PER_S / stylus->info.rate_hz);
}

static INCISE_REALTIME void count_age(struct incise_stylus *stylus, int64_t now_ns)
{
	double age_ns =
		(double)incise_haptic_ages_add(&stylus->ages, stylus->last.t_ns, now_ns);

	stylus->age_ns += (age_ns - stylus->age_ns) / AGE_TICKS;
}

/* The reason to be off now, wherever the handle is. */
static INCISE_REALTIME enum incise_haptic_off find_reason(
	const struct incise_stylus *stylus)
{
	const struct incise_haptic_sample *last = &stylus->last;

	if (!stylus->seen ||
	    last->flags & (INCISE_HAPTIC_NOT_READY | INCISE_HAPTIC_PROTECTED |
			   INCISE_HAPTIC_CHANGED))
		return INCISE_HAPTIC_UNREADY;
	if (stylus->clutched)
		return INCISE_HAPTIC_CLUTCH;
	if (stylus->setup.enable && !is_pressed(last, stylus->setup.enable))
		return INCISE_HAPTIC_ENABLE;
	if (stylus->age_ns > LATE_SHARE * (double)assumed_ns(stylus) + LATE_NS)
		return INCISE_HAPTIC_LATE;
	return INCISE_HAPTIC_ON;
}

enum incise_haptic_off incise_stylus_off(struct incise_stylus *stylus, int64_t now_ns)
{
	enum incise_haptic_off reason;

	if (stylus->seen)
		count_age(stylus, now_ns);
	reason = find_reason(stylus);
	if (reason != INCISE_HAPTIC_ON)
		stylus->off = reason;
	else if (stylus->off != INCISE_HAPTIC_ON)
		stylus->off =
			is_in_middle(stylus) ? INCISE_HAPTIC_ON : INCISE_HAPTIC_OUTSIDE;
	return stylus->off;
}

const char *incise_haptic_off_text(enum incise_haptic_off off)
{
	static const char *const texts[] = {
		[INCISE_HAPTIC_ON] = "on, once the tool is out of the tissue",
		[INCISE_HAPTIC_OUTSIDE] =
			"off: move the handle to the middle of its workspace",
		[INCISE_HAPTIC_CLUTCH] = "off: the clutch is pressed",
		[INCISE_HAPTIC_ENABLE] = "off: press the enabling button",
		[INCISE_HAPTIC_UNREADY] = "off: the device is not ready",
		[INCISE_HAPTIC_LATE] = "off: poses are older than the plan assumes",
	};

	return texts[off];
}

int incise_stylus_push(struct incise_stylus *stylus, const double force_N[3])
{
	const double *turn = stylus->setup.turn;
	const double back[4] = {turn[0], -turn[1], -turn[2], -turn[3]};
	double own_N[3];

	v3_rotate(own_N, back, force_N);
	return incise_haptic_push(stylus->haptic, own_N, NULL);
}

/* --- the stylus ---------------------------------------------------------------------- */

struct incise_stylus *incise_stylus_new(struct incise_haptic *haptic,
					const struct incise_haptic_setup *setup)
{
	struct incise_stylus *stylus = calloc(1, sizeof(*stylus));

	if (!stylus)
		return NULL;
	stylus->setup = *setup;
	stylus->tracker.ops = &poses;
	stylus->haptic = haptic;
	incise_haptic_info(haptic, &stylus->info);
	stylus->off = INCISE_HAPTIC_OUTSIDE;
	stylus->latency_ns = stylus->info.latency_ns;
	stylus->age_ns = (double)assumed_ns(stylus);
	return stylus;
}

void incise_stylus_assume(struct incise_stylus *stylus, int64_t latency_ns)
{
	stylus->latency_ns = latency_ns;
	stylus->ages = (struct incise_haptic_ages){0};
}

void incise_stylus_ages(const struct incise_stylus *stylus,
			struct incise_haptic_ages *ages)
{
	*ages = stylus->ages;
	ages->lost = incise_haptic_lost(stylus->haptic);
	if (stylus->haptic->ops->cuts)
		ages->cuts = stylus->haptic->ops->cuts(stylus->haptic, ages->last_cut);
	ages->assumed_ms = (double)assumed_ns(stylus) * 1e-6;
}
