// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Losses of a source that does not count its samples; see pace.h.
 */
#include <math.h>
#include "pace.h"

#define WINDOW_NS 250e6 /* more than blocks and chunks last */
#define FRESH_MIN 8
#define FRESH_PER_PERIOD 32 /* more, per period that the lateness scatters */
#define FRESH_MAX 100
#define STEPS 6	      /* samples that show a step */
#define NOISE 8.0     /* of the least of as many, in scatter */
#define SCATTER_MAX 3 /* periods, by which a loss of one is seen */
#define WRAPS 4
#define WRAPS_WINDOWS 8 /* so many times as many, if they show the beat of blocks */
#define FITS_MAX 1000	/* windows that the line remembers */
#define BEAT 2.5	/* periods, that the beat of blocks may make */
#define FITS_SURE 5	/* which show that beat */
#define FITS_MOVED 4	/* if the period has changed */
#define OFF 0.06	/* period, seen in the first windows */
#define SET_NS 20e6	/* a clock is not set by less */
#define SET_DRIFT 1e-4	/* of it against arrivals */
#define MISSING_MAX 1e9 /* more than any source sends in a day */
#define TIME_MAX (INT64_C(1) << 60)

static void start_window(struct incise_pace *pace)
{
	pace->window = (struct incise_pace_window){
		.low_ns = {INFINITY, INFINITY},
		.fresh_ns = pace->window.fresh_ns,
		.ahead_ns = INFINITY,
	};
}

static void start_line(struct incise_pace *pace, int64_t t_ns)
{
	pace->base_ns = t_ns;
	pace->n = 0;
	pace->started = true;
	pace->broken = false;
	pace->rise_ns = pace->late_ns = pace->window.fresh_ns = 0;
	pace->run = pace->fresh = pace->steps = 0;
	start_window(pace);
}

void incise_pace_init(struct incise_pace *pace, double rate_hz, double off,
		      unsigned int unit)
{
	*pace = (struct incise_pace){
		.nominal_ns = 1e9 / rate_hz,
		.period_ns = 1e9 / rate_hz,
		.off = off,
		.unit = unit,
		.blocks = 1,
		.ahead_ns = INFINITY,
		.before_ns = INFINITY,
		.scatter_ns = {INFINITY, INFINITY},
	};
}

double incise_pace_late(const struct incise_pace *pace, int64_t t_ns, uint64_t steps)
{
	return (double)t_ns - (double)pace->base_ns -
	       pace->period_ns * (double)(pace->n + steps);
}

static double usual_scatter(const struct incise_pace *pace)
{
	return fmin(pace->scatter_ns[0], pace->scatter_ns[1]);
}

static double window_scatter(const struct incise_pace *pace)
{
	const struct incise_pace_window *window = &pace->window;

	/* But for the largest one, which may be a loss. */
	return window->shown ? 1.5 * (window->sum_ns - window->most_ns) / window->shown
			     : INFINITY;
}

double incise_pace_early_ns(const struct incise_pace *pace)
{
	return pace->fits > 2 ? pace->period_ns / 2 + 2 * usual_scatter(pace) : INFINITY;
}

int64_t incise_pace_spread_ns(const struct incise_pace *pace)
{
	unsigned int usual =
		pace->runs[0] < pace->runs[1] ? pace->runs[0] : pace->runs[1];

	return (pace->blocks == 3 || !pace->fits) && pace->run < usual
		       ? llround((usual - pace->run) * pace->period_ns)
		       : 0;
}

/* Move the line by @by_ns; time goes on from the last sample. */
static void move_line(struct incise_pace *pace, double by_ns)
{
	pace->base_ns += llround(pace->period_ns * (double)pace->n + by_ns);
	pace->n = 0;
}

/* A line of least squares through the least lateness of all windows, or of the last FITS_MAX. */
static void follow(struct incise_pace *pace, double rise_ns)
{
	double j = pace->fits, n = (double)pace->n, of_all = (j + 1) * (j + 2);
	double period_ns = pace->period_ns, behind = n - pace->window.low_n[1];

	if (pace->fresh)
		period_ns +=
			6 / of_all * rise_ns / fmax(n - behind + pace->behind, n / 2);
	period_ns = fmax(fmin(period_ns, pace->nominal_ns * (1 + pace->off)),
			 pace->nominal_ns * (1 - pace->off));
	/* The first window of a line says where it is. */
	move_line(pace, (pace->fresh ? 2 * (2 * j + 1) / of_all : 1) * rise_ns +
				behind * (period_ns - pace->period_ns));
	pace->period_ns = period_ns;
	pace->behind = behind;
	/* Twice to the same side. */
	if (rise_ns * pace->fitted_ns > pow(pace->period_ns / 4, 2) &&
	    pace->fits > FITS_MOVED) {
		pace->fits = FITS_MOVED;
		pace->unsure |= pace->blocks == 3;
	} else if (pace->fits < FITS_MAX) {
		pace->fits++;
	}
	/* The clock may have been set in this window. */
	pace->ahead_ns = isinf(pace->ahead_ns) ? pace->window.ahead_ns
					       : fmin(pace->ahead_ns, pace->before_ns);
	pace->before_ns = pace->window.ahead_ns;
	pace->fresh = pace->window.shown;
	pace->unsure |=
		pace->fits > 2 && usual_scatter(pace) > SCATTER_MAX * pace->period_ns;
	pace->fitted_ns = rise_ns;
	pace->rise_ns = 0;
}

/* Earlier and earlier: the period was wrong. */
static void relearn(struct incise_pace *pace, double rise_ns)
{
	pace->fits = pace->fresh = 0;
	pace->period_ns = pace->nominal_ns;
	follow(pace, rise_ns);
}

/* A change by one period: it may be a sample that came at another look of the host. */
static bool is_wrap(const struct incise_pace *pace, double rise_ns)
{
	return pace->unit == 1 && fabs(round(rise_ns / pace->period_ns)) == 1 &&
	       pace->blocks == 3 && pace->window.wraps < WRAPS && !pace->longer &&
	       usual_scatter(pace) < pace->period_ns;
}

static uint64_t count_units(struct incise_pace *pace, double units)
{
	uint64_t missing = (uint64_t)fmin(fmax(0, units) * pace->unit, MISSING_MAX);

	pace->n += missing;
	return missing;
}

/* The clock of the times was set: arrivals show no such rise. */
static bool is_set(const struct incise_pace *pace, double rise_ns)
{
	return pace->window.ahead_ns < pace->ahead_ns - fmax(SET_NS, rise_ns / 2);
}

/* Two windows in a row have risen by @rise_ns. */
static uint64_t count_missing(struct incise_pace *pace, double rise_ns)
{
	double units = round(rise_ns / (pace->unit * pace->period_ns));
	bool set = is_set(pace, rise_ns);

	pace->rise_ns = 0;
	if (units > 0 && !set && !is_wrap(pace, rise_ns))
		return count_units(pace, units);
	move_line(pace, rise_ns);
	if (set || rise_ns < 0)
		pace->ahead_ns -= rise_ns;
	pace->before_ns = pace->window.ahead_ns;
	return 0;
}

/* A window off the line, by @rise_ns, and maybe the one before. */
static uint64_t judge_rise(struct incise_pace *pace, double rise_ns, double noise_ns)
{
	double before_ns = pace->rise_ns, unit_ns = pace->unit * pace->period_ns;
	uint64_t missing;

	pace->unsure |= is_wrap(pace, rise_ns);
	if (before_ns && fabs(rise_ns - before_ns) < noise_ns)
		return count_missing(pace, rise_ns);
	pace->rise_ns = rise_ns;
	if (before_ns < 0 && rise_ns < before_ns)
		relearn(pace, rise_ns);
	if (!(before_ns > 0 && rise_ns > before_ns) || is_set(pace, rise_ns))
		return 0;
	/* More and more are missing; of the lateness before, a part may be jitter. */
	missing = count_units(pace, round(before_ns / unit_ns) - 1);
	pace->rise_ns -= (double)missing * pace->period_ns;
	return missing;
}

static uint64_t end_window(struct incise_pace *pace)
{
	const struct incise_pace_window *window = &pace->window;
	double T = pace->period_ns, rise_ns = window->low_ns[1], noise_ns, limit_ns;
	uint64_t missing = 0;

	pace->scatter_ns[1] = pace->scatter_ns[0];
	pace->scatter_ns[0] = window_scatter(pace);
	pace->blocks = (pace->blocks << 1 & 3) | (4 * window->blocks > window->fresh);
	noise_ns = NOISE * usual_scatter(pace) / (pace->fresh + 1.0);
	limit_ns = pace->unit * T / 2 + noise_ns;
	if (pace->fits < 3)
		limit_ns += fmin(OFF, pace->off) * T * (double)pace->n;
	if (pace->blocks == 3 && pace->fits < FITS_SURE)
		limit_ns = fmax(limit_ns, BEAT * T);
	if (!pace->fresh || fabs(rise_ns) <= limit_ns)
		follow(pace, rise_ns);
	else
		missing = judge_rise(pace, rise_ns, T / 4 + noise_ns);
	/* The rise of a loss is in the window before those that show it. */
	pace->longer = pace->longer << 1 & 7;
	start_window(pace);
	return missing;
}

/* Whether the window shows what it can. */
static bool is_full(const struct incise_pace *pace)
{
	double scatter, enough;

	/* Most samples end here. */
	if (pace->window.samples * pace->period_ns < WINDOW_NS)
		return false;
	scatter = fmin(usual_scatter(pace), window_scatter(pace)) / pace->period_ns;
	enough = fmin(FRESH_MIN + FRESH_PER_PERIOD * scatter, FRESH_MAX);
	/* Two of each show all of a beat. */
	if (pace->blocks == 3 && pace->window.wraps && pace->window.wraps < WRAPS &&
	    !(pace->longer & 1) && scatter < 1)
		enough *= WRAPS_WINDOWS;
	return pace->window.shown + pace->window.fresh / 32 >= enough;
}

static bool is_even(const struct incise_pace *pace)
{
	return pace->fits && pace->blocks < 3 &&
	       usual_scatter(pace) < pace->period_ns / 8;
}

/*
 * The lateness of an even source rose at once by whole periods, and some samples since then have it:
 * as many are missing, whatever its rate is.
 */
static uint64_t judge_step(struct incise_pace *pace, double rise_ns)
{
	double T = pace->period_ns, unit_ns = pace->unit * T, units;

	if (rise_ns > 0.75 * unit_ns && is_even(pace)) {
		if (!pace->steps)
			pace->from_ns = pace->late_ns - rise_ns;
		pace->steps = 1;
		pace->step_ns = pace->late_ns;
	} else if (pace->steps && pace->late_ns > pace->step_ns - T / 4) {
		pace->steps++;
		pace->step_ns = fmin(pace->step_ns, pace->late_ns);
	} else {
		pace->steps = 0;
	}
	if (pace->steps != STEPS)
		return 0;
	pace->steps = 0;
	/* The sample before may have been late, or early, which a known line shows. */
	if (pace->fits > 2 && fabs(pace->from_ns) > T / 2)
		pace->from_ns = 0;
	rise_ns = pace->step_ns - pace->from_ns;
	units = round(rise_ns / unit_ns);
	if (fabs(rise_ns - units * unit_ns) > T / 4 || is_set(pace, rise_ns))
		return 0;
	pace->rise_ns = 0;
	return count_units(pace, units);
}

static void swap(double *a, double *b)
{
	double was = *a;

	*a = *b;
	*b = was;
}

/* The last sample: none waited behind it. */
static uint64_t judge_fresh(struct incise_pace *pace)
{
	struct incise_pace_window *window = &pace->window;
	bool first = !pace->fresh && !window->fresh;
	double rise_ns = first ? 0 : pace->late_ns - window->fresh_ns;
	double change_ns = fabs(rise_ns), half_ns = pace->period_ns / 2;
	double late_ns = pace->late_ns, n = (double)pace->n;
	uint64_t missing;

	window->fresh++;
	window->blocks += pace->run > 1;
	window->sum_ns += change_ns;
	window->most_ns = fmax(window->most_ns, change_ns);
	/* In a chunk that is late as a whole, one sample shows as much as all. */
	window->shown += 4 * change_ns * window->fresh >= window->sum_ns ||
			 8 * change_ns >= usual_scatter(pace);
	window->wraps += change_ns >= half_ns && change_ns < 3 * half_ns;
	pace->longer |= rise_ns >= half_ns && pace->run == pace->runs[0];
	for (int i = 0; i < 2; i++)
		if (late_ns < window->low_ns[i]) {
			swap(&late_ns, &window->low_ns[i]);
			swap(&n, &window->low_n[i]);
		}
	pace->runs[1] = pace->runs[0];
	pace->runs[0] = pace->run;
	pace->run = 0;
	missing = judge_step(pace, rise_ns);
	if (is_full(pace))
		missing += end_window(pace);
	window->fresh_ns = incise_pace_late(pace, pace->last_ns, 0);
	return missing;
}

/* The gap behind a broken link, by the earliest that the sample can have come. */
static uint64_t count_broken(const struct incise_pace *pace, int64_t t_ns)
{
	double unit_ns = pace->unit * pace->period_ns;
	double units = round(incise_pace_late(pace, t_ns, 1) / unit_ns);

	return (uint64_t)fmin(fmax(0, units) * pace->unit, MISSING_MAX);
}

uint64_t incise_pace_add(struct incise_pace *pace, int64_t t_ns, int64_t arrival_ns)
{
	struct incise_pace_window *window = &pace->window;
	uint64_t missing = 0;

	t_ns = t_ns < -TIME_MAX ? -TIME_MAX : t_ns > TIME_MAX ? TIME_MAX : t_ns;
	if (pace->broken || !pace->started) {
		missing = pace->broken ? count_broken(pace, t_ns) : 0;
		start_line(pace, t_ns);
		pace->run = 1;
	} else {
		if ((double)(t_ns - pace->last_ns) >= pace->period_ns / 2)
			missing = judge_fresh(pace);
		pace->run++;
		pace->n++;
		pace->late_ns = incise_pace_late(pace, t_ns, 0);
		pace->ahead_ns += SET_DRIFT * pace->period_ns;
	}
	pace->last_ns = t_ns;
	window->samples++;
	window->ahead_ns = fmin(window->ahead_ns, (double)arrival_ns - (double)t_ns);
	return missing;
}

void incise_pace_skip(struct incise_pace *pace, uint64_t n)
{
	pace->n += pace->started ? n : 0;
}

void incise_pace_broken(struct incise_pace *pace)
{
	pace->broken = pace->started;
}
