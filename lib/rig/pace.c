// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Losses of a source that does not count; see pace.h.
 */
#include <math.h>
#include "pace.h"

#define HOLE_NS 250e6
#define HOLE_PERIODS 4
#define WINDOW_NS 500000000
#define WINDOW_SAMPLES 8
#define DRIFT 2e-4	/* of two clocks that nothing keeps together, within a window */
#define MISSING_MAX 1e9 /* more than any source sends in a day */

static void start_window(struct incise_pace *pace, int64_t t_ns)
{
	pace->window_ns = t_ns;
	pace->in_window = 0;
	pace->least_ns = INFINITY;
	pace->most_ns = -INFINITY;
}

static void start_line(struct incise_pace *pace, int64_t t_ns)
{
	pace->line_ns = pace->base_ns = pace->last_ns = t_ns;
	pace->n = pace->on_line = 0;
	pace->started = true;
	pace->broken = false;
	pace->scatter_ns[0] = pace->scatter_ns[1] = -1;
	start_window(pace, t_ns);
}

void incise_pace_init(struct incise_pace *pace, double rate_hz)
{
	*pace = (struct incise_pace){.nominal_ns = 1e9 / rate_hz,
				     .period_ns = 1e9 / rate_hz};
}

/* The mean since the line began, unless the window has a jump, which may be a loss. */
static void measure_period(struct incise_pace *pace, int64_t t_ns)
{
	double mean_ns = (double)(t_ns - pace->line_ns) / (double)pace->on_line;

	pace->period_ns =
		fmax(fmin(mean_ns, pace->nominal_ns * 1.25), pace->nominal_ns * 0.8);
}

/* The window is full: divide its lateness into losses and a move of the line. */
static uint64_t end_window(struct incise_pace *pace, int64_t t_ns)
{
	double T = pace->period_ns, span_ns = (double)(t_ns - pace->window_ns);
	double usual_ns = fmin(pace->scatter_ns[0], pace->scatter_ns[1]);
	double scatter_ns = pace->most_ns - pace->least_ns, rest_ns = pace->least_ns;
	double limit_ns = T / 2 + usual_ns + DRIFT * span_ns, missing = 0;

	if (usual_ns >= 0 && rest_ns > limit_ns)
		missing = fmin(round(rest_ns / T), MISSING_MAX);
	pace->on_line += pace->n + (uint64_t)missing;
	pace->base_ns += (int64_t)(T * (double)pace->n + rest_ns);
	pace->n = 0;
	if (usual_ns < 0 || scatter_ns <= limit_ns)
		measure_period(pace, t_ns);
	pace->scatter_ns[1] = pace->scatter_ns[0];
	pace->scatter_ns[0] = scatter_ns;
	start_window(pace, t_ns);
	return (uint64_t)missing;
}

uint64_t incise_pace_add(struct incise_pace *pace, int64_t t_ns)
{
	double gap_ns = (double)t_ns - (double)pace->last_ns, late_ns;

	if (!pace->started || gap_ns < -HOLE_NS) {
		start_line(pace, t_ns);
		return 0;
	}
	if (pace->broken || gap_ns > HOLE_NS + HOLE_PERIODS * pace->period_ns) {
		start_line(pace, t_ns);
		return (uint64_t)fmin(fmax(0, round(gap_ns / pace->period_ns) - 1),
				      MISSING_MAX);
	}
	pace->last_ns = t_ns;
	pace->n++;
	late_ns = (double)(t_ns - pace->base_ns) - pace->period_ns * (double)pace->n;
	pace->least_ns = fmin(pace->least_ns, late_ns);
	pace->most_ns = fmax(pace->most_ns, late_ns);
	if (++pace->in_window < WINDOW_SAMPLES || t_ns - pace->window_ns < WINDOW_NS)
		return 0;
	return end_window(pace, t_ns);
}

void incise_pace_skip(struct incise_pace *pace)
{
	pace->n += pace->started;
}

void incise_pace_broken(struct incise_pace *pace)
{
	pace->broken = pace->started;
}
