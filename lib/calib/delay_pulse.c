// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Delay of a stream behind the edges of a sync pulse; see incise/calibrate_delay.h.
 *
 *     edge      |
 *     stream  ..|.....          levels: medians of the first and the last quarter
 *               |    :.....     of a window about the edge; the step is where
 *     [  before |  |    after ] the line between two values crosses their middle
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <incise/calibrate_delay.h>
#include "../base/ascending.h"

#define TIME_MAX_NS (INT64_MAX / 4)
#define EDGES_MIN 10
#define WINDOW_MAX_NS 200e6
#define WINDOW_SHARE 0.45 /* of the least time between edges */
#define LEVEL_MAX 200	  /* values that a level is the median of */
#define STEP_MIN 5	  /* times what the levels scatter */
#define FAR 5

/* Median of some values, and how they scatter. */
static double median(double *values, int n, double *scatter)
{
	double middle;

	qsort(values, (size_t)n, sizeof(*values), ascending);
	middle = values[n / 2];
	for (int i = 0; i < n; i++)
		values[i] = fabs(values[i] - middle);
	qsort(values, (size_t)n, sizeof(*values), ascending);
	*scatter = 1.4826 * values[n / 2];
	return middle;
}

/* Level of the stream between two times; NAN where there is none. */
static double level(const struct incise_delay_point *stream, int n, double from_ns,
		    double to_ns, int64_t edge_ns, double *scatter)
{
	double values[LEVEL_MAX];
	int m = 0;

	for (int i = 0; i < n && m < LEVEL_MAX; i++) {
		double t = (double)(stream[i].t_ns - edge_ns);

		if (t >= from_ns && t <= to_ns && isfinite(stream[i].value))
			values[m++] = stream[i].value;
	}
	return m ? median(values, m, scatter) : NAN;
}

/* Time from an edge to its step, ns; NAN where there is none. */
static double step_of(const struct incise_delay_point *stream, int n, int64_t edge_ns,
		      double window_ns)
{
	double scatter[2] = {0}, before, after, middle;
	int first = 0, last = n;

	/* those in the window, by bisection: a stream may be long */
	for (int low = 0, high = n; low < high;) {
		int at = (low + high) / 2;

		if ((double)(stream[at].t_ns - edge_ns) < -window_ns)
			low = at + 1;
		else
			high = at;
		first = low;
	}
	while (last > first && (double)(stream[last - 1].t_ns - edge_ns) > window_ns)
		last--;
	stream += first;
	n = last - first;
	before = level(stream, n, -window_ns, -window_ns / 2, edge_ns, &scatter[0]);
	after = level(stream, n, window_ns / 2, window_ns, edge_ns, &scatter[1]);
	if (!(fabs(after - before) > STEP_MIN * fmax(scatter[0], scatter[1])))
		return NAN;
	middle = (before + after) / 2;
	for (int i = 1; i < n; i++) {
		double a = stream[i - 1].value - middle, b = stream[i].value - middle;

		if ((a < 0) == (b < 0) || (b < 0) == (after > before))
			continue;
		return (double)(stream[i - 1].t_ns - edge_ns) +
		       a / (a - b) * (double)(stream[i].t_ns - stream[i - 1].t_ns);
	}
	return NAN;
}

static bool ascends(const int64_t *edges_ns, int n_edges,
		    const struct incise_delay_point *stream, int n)
{
	/* so that differences of times fit their type */
	if (n_edges < 1 || n < 1 || edges_ns[0] < -TIME_MAX_NS ||
	    stream[0].t_ns < -TIME_MAX_NS || edges_ns[n_edges - 1] > TIME_MAX_NS ||
	    stream[n - 1].t_ns > TIME_MAX_NS)
		return false;
	for (int i = 1; i < n_edges; i++)
		if (edges_ns[i] <= edges_ns[i - 1])
			return false;
	for (int i = 1; i < n; i++)
		if (stream[i].t_ns <= stream[i - 1].t_ns)
			return false;
	return true;
}

/* Mean of delays in ms at times u, without those far from the middle; and their trend. */
static void state(const double *delay, const double *u, double *scratch, int n,
		  struct incise_delay_fit *fit)
{
	double middle, scatter, sum = 0, mean_u = 0, uu = 0, ud = 0, square = 0;
	int m = 0;

	for (int i = 0; i < n; i++)
		scratch[i] = delay[i];
	middle = median(scratch, n, &scatter);
	for (int i = 0; i < n; i++)
		if (fabs(delay[i] - middle) <= FAR * scatter + 1e-9) {
			sum += delay[i];
			mean_u += u[i];
			m++;
		}
	mean_u /= m;
	fit->delay_ms = sum / m;
	fit->outliers = n - m;
	fit->blocks = m;
	for (int i = 0; i < n; i++)
		if (fabs(delay[i] - middle) <= FAR * scatter + 1e-9) {
			double d = delay[i] - fit->delay_ms;

			square += d * d;
			uu += (u[i] - mean_u) * (u[i] - mean_u);
			ud += (u[i] - mean_u) * d;
		}
	square /= m - 1;
	/* few have Student's tails; k = 2 holds them */
	fit->sd_ms = sqrt(square / m) * (1 + 1.21 / (m - 1));
	fit->low_ms = fit->delay_ms - 1.96 * fit->sd_ms;
	fit->high_ms = fit->delay_ms + 1.96 * fit->sd_ms;
	fit->drift_ms = uu > 0 ? ud / uu : NAN;
	fit->drift_sd_ms = uu > 0 ? sqrt(square / uu) : NAN;
}

int incise_calibrate_delay_pulse(const int64_t *edges_ns, int n_edges,
				 const struct incise_delay_point *stream, int n,
				 struct incise_delay_fit *fit, struct incise_error *err)
{
	double window_ns = WINDOW_MAX_NS, *delay, *u;
	int found = 0;

	*fit = (struct incise_delay_fit){
		.delay_ms = NAN, .sd_ms = NAN, .contact_mm = NAN};
	if (!ascends(edges_ns, n_edges, stream, n))
		return incise_error_set(err, EINVAL,
					"times are missing or do not ascend; sort them");
	delay = malloc(3 * (size_t)(n_edges > 0 ? n_edges : 1) * sizeof(*delay));
	if (!delay)
		return incise_error_set(err, ENOMEM, "out of memory");
	u = delay + n_edges;
	for (int i = 1; i < n_edges; i++)
		window_ns = fmin(window_ns,
				 WINDOW_SHARE * (double)(edges_ns[i] - edges_ns[i - 1]));
	for (int i = 0; i < n_edges; i++) {
		double ns = step_of(stream, n, edges_ns[i], window_ns);

		if (isnan(ns))
			continue;
		delay[found] = ns * 1e-6;
		u[found++] = (double)(edges_ns[i] - edges_ns[0]) /
			     (double)(edges_ns[n_edges - 1] - edges_ns[0]);
	}
	if (found >= EDGES_MIN) {
		fit->span_s = (double)(edges_ns[n_edges - 1] - edges_ns[0]) * 1e-9;
		fit->correlation = 1;
		state(delay, u, u + n_edges, found, fit);
	}
	free(delay);
	if (found < EDGES_MIN)
		return incise_error_set(err, EDOM,
					"the stream shows a step at %d of %d edges, %d "
					"are needed; is it lit by the pulse?",
					found, n_edges, EDGES_MIN);
	return 0;
}
