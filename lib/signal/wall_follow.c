// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Points of wall time; see wall_follow.h.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/clock.h>
#include "wall_follow.h"

/* A quartz without a source, over the change of temperature in a room. */
#define HELD_PPB 10000.0
/* A computer's own clock that nothing sets right: crystals are within 100 ppm. */
#define FREE_PPB 500000.0
/* The time of a suspend comes from a clock that may have steps of 1 s. */
#define SUSPEND_NS 2e9
/* CLOCK_BOOTTIME and CLOCK_MONOTONIC differ by suspends alone. */
#define SUSPEND_LEAST_NS 1000000
/* CLOCK_REALTIME and CLOCK_MONOTONIC advance together, but for rounding. */
#define STEP_LEAST_NS 2000
/* A mapping that moves by more than this, and this share, restarts. */
#define RESTART_LEAST_NS 100e3
#define RESTART_SHARE 1e-4
/* Rates are found over one to two of these. */
#define ANCHOR_NS (16 * INCISE_NS_PER_S)
/* Over less the readings' own noise is more than the rate. */
#define RATE_LEAST_NS (INCISE_NS_PER_S / 10)
#define ANCHOR_LEAST_NS (4 * INCISE_NS_PER_S)

static void say(struct incise_wall_result *result, const char *fmt, ...)
	__attribute__((format(printf, 2, 3)));

static void say(struct incise_wall_result *result, const char *fmt, ...)
{
	va_list args;

	if (result->n_events == INCISE_WALL_EVENTS)
		return;
	va_start(args, fmt);
	vsnprintf(result->events[result->n_events++], sizeof(result->events[0]), fmt,
		  args);
	va_end(args);
}

/* The first reading that continues the time of the last point, -1: none. */
static int choose_wall_follow(const struct incise_wall_follow *follow,
			      const struct incise_wall_reading *readings, int n)
{
	const struct incise_wall_point *last = &follow->last;
	bool known = follow->started && isfinite(last->uncertainty_ns);
	int other = -1;

	for (int i = 0; i < n; i++) {
		const struct incise_wall_reading *r = &readings[i];

		if (!r->good || !isfinite(r->bound_ns) || follow->distrust[i].waits)
			continue;
		if (!known || !strcmp(r->reference, last->reference))
			return i;
		/* Another grandmaster; but not another kind of time. */
		if (other < 0 && !strcmp(r->source, last->source))
			other = i;
	}
	return other;
}

static int plain_wall_follow(const struct incise_wall_reading *readings, int n)
{
	for (int i = 0; i < n; i++)
		if (!strcmp(readings[i].source, "plain"))
			return i;
	return -1;
}

/* CLOCK_MONOTONIC per CLOCK_MONOTONIC_RAW since the last point, less 1. */
static double mono_per_raw(const struct incise_wall_follow *follow,
			   const struct incise_wall_clocks *now)
{
	int64_t mono_ns = now->mono_ns - follow->clocks.mono_ns;
	int64_t raw_ns = now->raw_ns - follow->clocks.raw_ns;

	return raw_ns > 0 ? (double)(mono_ns - raw_ns) / (double)raw_ns : 0;
}

/* After a step or a suspend no source is believed before it has measured again. */
static void distrust(struct incise_wall_follow *follow,
		     const struct incise_wall_reading *readings, int n)
{
	for (int i = 0; i < n && i < INCISE_WALL_SOURCES; i++) {
		follow->distrust[i].waits = true;
		follow->distrust[i].updated = readings[i].updated;
	}
}

static void trust(struct incise_wall_follow *follow,
		  const struct incise_wall_reading *readings, int n)
{
	for (int i = 0; i < n && i < INCISE_WALL_SOURCES; i++)
		if (readings[i].good &&
		    readings[i].updated != follow->distrust[i].updated)
			follow->distrust[i].waits = false;
}

/* No crystal is so far off: the clock is being slewed. */
static void set_rate(struct incise_wall_follow *follow, double tai_per_raw)
{
	if (fabs(tai_per_raw) < FREE_PPB * 1e-9)
		follow->tai_per_raw = tai_per_raw;
}

/* TAI per CLOCK_MONOTONIC_RAW, by points of sources over some time. */
static void measure_rate(struct incise_wall_follow *follow, int64_t raw_ns,
			 int64_t tai_ns, bool anew)
{
	int64_t since_ns;

	if (!follow->anchored || anew) {
		follow->anchored = true;
		follow->anchor_raw_ns = follow->next_raw_ns = raw_ns;
		follow->anchor_tai_ns = follow->next_tai_ns = tai_ns;
		return;
	}
	since_ns = raw_ns - follow->anchor_raw_ns;
	if (since_ns >= ANCHOR_LEAST_NS)
		set_rate(follow, (double)((tai_ns - follow->anchor_tai_ns) - since_ns) /
					 (double)since_ns);
	if (raw_ns - follow->next_raw_ns < ANCHOR_NS)
		return;
	follow->anchor_raw_ns = follow->next_raw_ns;
	follow->anchor_tai_ns = follow->next_tai_ns;
	follow->next_raw_ns = raw_ns;
	follow->next_tai_ns = tai_ns;
}

/* The last point continued to @now; sleep_ns: of a suspend. */
static void hold_wall_follow(const struct incise_wall_follow *follow,
			     const struct incise_wall_clocks *now, int64_t sleep_ns,
			     struct incise_wall_point *point)
{
	double raw_ns = (double)(now->raw_ns - follow->clocks.raw_ns);
	double rate_ppb = fmax(HELD_PPB, follow->last.rate_uncertainty_ppb);

	*point = follow->last;
	point->t_ns = now->mono_ns;
	point->tai_ns += now->raw_ns - follow->clocks.raw_ns + sleep_ns +
			 llrint(raw_ns * follow->tai_per_raw);
	point->uncertainty_ns += raw_ns * rate_ppb * 1e-9 + (double)now->half_ns +
				 (sleep_ns ? SUSPEND_NS : 0);
	point->rate_uncertainty_ppb = rate_ppb;
	point->held = true;
	*point->restart = 0;
	if (now->utc_offset_s != follow->clocks.utc_offset_s)
		point->utc_offset_s += now->utc_offset_s - follow->clocks.utc_offset_s;
}

static void take_wall_follow(const struct incise_wall_clocks *now,
			     const struct incise_wall_reading *reading,
			     struct incise_wall_point *point)
{
	*point = (struct incise_wall_point){
		.t_ns = now->mono_ns,
		.tai_ns = reading->tai_ns,
		.uncertainty_ns = reading->bound_ns + (double)now->half_ns,
		.rate_uncertainty_ppb = reading->rate_uncertainty_ppb,
		.utc_offset_s = reading->utc_offset_s,
	};
	snprintf(point->source, sizeof(point->source), "%s", reading->source);
	snprintf(point->reference, sizeof(point->reference), "%s", reading->reference);
	snprintf(point->leap, sizeof(point->leap), "%s", reading->leap);
}

/*
 * Movement of the mapping at a point, ns: against both clocks, as a program that sets the clock
 * right slews CLOCK_MONOTONIC, with TAI or away from it.
 */
static double movement(const struct incise_wall_follow *follow,
		       const struct incise_wall_clocks *now,
		       const struct incise_wall_point *point, int64_t sleep_ns)
{
	int64_t tai_ns = point->tai_ns - follow->last.tai_ns - sleep_ns;
	int64_t mono_ns = now->mono_ns - follow->clocks.mono_ns;
	int64_t raw_ns = now->raw_ns - follow->clocks.raw_ns;
	double by_mono = (double)(tai_ns - mono_ns);
	double by_raw = (double)(tai_ns - raw_ns) - (double)raw_ns * follow->tai_per_raw;

	return fabs(by_mono) < fabs(by_raw) ? by_mono : by_raw;
}

static void bound_text(const struct incise_wall_point *point, char *text, size_t size)
{
	if (isfinite(point->uncertainty_ns))
		snprintf(text, size, "within %.3g ms", point->uncertainty_ns * 1e-6);
	else
		snprintf(text, size, "with an unknown error");
}

/* Events of the source that the point comes from. */
static void say_source(const struct incise_wall_follow *follow,
		       const struct incise_wall_point *point,
		       struct incise_wall_result *result)
{
	const struct incise_wall_point *last = &follow->last;
	bool same = follow->started && !strcmp(point->source, last->source) &&
		    !strcmp(point->reference, last->reference);
	char bound[40];

	bound_text(point, bound, sizeof(bound));
	if (point->held && !last->held)
		say(result,
		    "%s: no valid time from it; the time is held, and its "
		    "uncertainty grows",
		    point->source);
	else if (!point->held && (!same || last->held))
		say(result, "%s: time of %s, %s", point->source, point->reference, bound);
	if (!follow->started && strcmp(point->leap, "kernel") != 0 &&
	    strcmp(point->leap, "ptp") != 0)
		say(result, "TAI is UTC + %d s, by the %s of leap seconds",
		    point->utc_offset_s,
		    strcmp(point->leap, "assumed") != 0 ? point->leap : "assumed number");
}

void incise_wall_follow(struct incise_wall_follow *follow,
			const struct incise_wall_clocks *now,
			const struct incise_wall_reading *readings, int n,
			struct incise_wall_result *result)
{
	const struct incise_wall_clocks *before = &follow->clocks;
	struct incise_wall_point *point = &result->point;
	int64_t sleep_ns = 0, step_ns = 0;
	double mono_raw = 0, moved_ns = 0;
	int i;

	result->n_events = 0;
	if (follow->started) {
		int64_t doubt_ns = now->half_ns + before->half_ns;

		sleep_ns = (now->boot_ns - now->mono_ns) -
			   (before->boot_ns - before->mono_ns);
		if (llabs(sleep_ns) <= SUSPEND_LEAST_NS + doubt_ns)
			sleep_ns = 0;
		step_ns = (now->real_ns - now->mono_ns) -
			  (before->real_ns - before->mono_ns) - sleep_ns +
			  (now->utc_offset_s - before->utc_offset_s) * INCISE_NS_PER_S;
		if (llabs(step_ns) <=
		    STEP_LEAST_NS + doubt_ns + (sleep_ns ? SUSPEND_LEAST_NS : 0))
			step_ns = 0;
		mono_raw = mono_per_raw(follow, now);
	}
	if (sleep_ns)
		say(result,
		    "suspended for %.3f s, in which CLOCK_MONOTONIC stood still: "
		    "the mapping to TAI restarts",
		    (double)sleep_ns * 1e-9);
	if (step_ns)
		say(result, "CLOCK_REALTIME was stepped by %+.6f s",
		    (double)step_ns * 1e-9);
	if (sleep_ns || step_ns)
		distrust(follow, readings, n);
	trust(follow, readings, n);
	i = choose_wall_follow(follow, readings, n);
	if (i < 0 && (!follow->started || !isfinite(follow->last.uncertainty_ns)))
		i = plain_wall_follow(readings, n);
	if (i >= 0)
		take_wall_follow(now, &readings[i], point);
	else
		hold_wall_follow(follow, now, sleep_ns, point);
	if (follow->started) {
		int64_t passed_ns = now->mono_ns - before->mono_ns;

		moved_ns = movement(follow, now, point, sleep_ns);
		if (sleep_ns)
			snprintf(point->restart, sizeof(point->restart), "suspend");
		else if (strcmp(point->reference, follow->last.reference) != 0)
			snprintf(point->restart, sizeof(point->restart), "source");
		else if (fabs(moved_ns) >
			 RESTART_LEAST_NS + RESTART_SHARE * (double)passed_ns)
			snprintf(point->restart, sizeof(point->restart), "step");
	}
	if (i >= 0)
		measure_rate(follow, now->raw_ns, point->tai_ns, *point->restart != 0);
	point->rate_ppb = follow->started
				  ? ((1 + follow->tai_per_raw) / (1 + mono_raw) - 1) * 1e9
				  : 0;
	/* Before there is a rate of TAI, that of the clock is the best. */
	if (!follow->anchored || now->raw_ns - follow->anchor_raw_ns < ANCHOR_LEAST_NS) {
		if (!point->held)
			set_rate(follow, mono_raw);
		point->rate_ppb = 0;
	}
	if (follow->started && now->raw_ns - before->raw_ns < RATE_LEAST_NS)
		point->rate_ppb = follow->last.rate_ppb;
	if (!isfinite(point->uncertainty_ns))
		point->rate_uncertainty_ppb = FREE_PPB;
	say_source(follow, point, result);
	if (!strcmp(point->restart, "step"))
		say(result, "the mapping to TAI restarts, moved by %+.6f s",
		    moved_ns * 1e-9);
	follow->started = true;
	follow->last = *point;
	follow->clocks = *now;
}
