// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth by the camera against depth by the tracker; see incise/redundancy.h.
 *
 *     camera - tracker                   camera - tracker
 *      mm |  . . .                        mm |      . .
 *         | . . . . .  shifted camera        | . .        .  metal nearby
 *         +----------- place                 +----------- place
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/redundancy.h>
#include "../base/ascending.h"
#include "robust_line.h"

#define RATE_MM_S 20 /* 1 ms of error of time is 0.02 mm then, a tracker's noise */
#define PAIRS_MIN 30
#define SECONDS_MIN 4
#define QUARTERS 4

struct redundancy_work {
	double *depth, *off,
		*along; /* tracker's depth; camera - tracker; place on the way */
	int64_t *t_ns;
	double *scratch; /* three times n */
	bool *wild;
	int n;
};

static double median_copy(const double *values, int n, double *scratch)
{
	memcpy(scratch, values, (size_t)n * sizeof(*values));
	return median(scratch, n);
}

/* The longest way along the surface: the first principal axis of the places. */
static void find_way(const struct incise_depth_pair *pairs, int n, double way[2])
{
	double mx = 0, my = 0, xx = 0, xy = 0, yy = 0, angle;

	for (int i = 0; i < n; i++) {
		mx += pairs[i].place_mm[0] / n;
		my += pairs[i].place_mm[1] / n;
	}
	for (int i = 0; i < n; i++) {
		double x = pairs[i].place_mm[0] - mx, y = pairs[i].place_mm[1] - my;

		xx += x * x;
		xy += x * y;
		yy += y * y;
	}
	angle = 0.5 * atan2(2 * xy, xx - yy);
	way[0] = cos(angle);
	way[1] = sin(angle);
}

/* Uncertainty of a mean of @off from means over whole seconds: neighbours err alike. */
static double mean_u(const struct redundancy_work *w, const double *off, const bool *take)
{
	double sum = 0, squares = 0, mean = 0;
	int64_t second = INT64_MIN;
	int in_second = 0, seconds = 0;

	for (int i = 0; i <= w->n; i++) {
		int64_t now = i < w->n ? w->t_ns[i] / INT64_C(1000000000) : INT64_MAX;

		if (i < w->n && take && !take[i])
			continue;
		if (now != second && in_second) {
			double value = sum / in_second, step = value - mean;

			seconds++;
			mean += step / seconds;
			squares += step * (value - mean);
			sum = in_second = 0;
		}
		second = now;
		if (i < w->n) {
			sum += off[i];
			in_second++;
		}
	}
	return seconds > 1 ? sqrt(squares / (seconds - 1) / seconds) : INFINITY;
}

static void find_places(struct redundancy_work *w, const struct robust_line *line,
			struct incise_redundancy *r)
{
	double low = INFINITY, high = -INFINITY, least = INFINITY, most = -INFINITY;
	double least_u = 0, most_u = 0;
	double *rest = w->scratch + w->n, *some = rest + w->n;

	for (int i = 0; i < w->n; i++) {
		low = fmin(low, w->along[i]);
		high = fmax(high, w->along[i]);
		rest[i] = w->off[i] - line->zero - line->slope * w->depth[i];
	}
	r->travel_mm = high - low;
	for (int q = 0; q < QUARTERS; q++) {
		int m = 0;
		double value, u;

		for (int i = 0; i < w->n; i++) {
			int at = (int)(QUARTERS * (w->along[i] - low) /
				       fmax(high - low, 1e-9));

			w->wild[i] = (at == QUARTERS ? QUARTERS - 1 : at) == q;
			if (w->wild[i])
				some[m++] = rest[i];
		}
		if (m < PAIRS_MIN / QUARTERS)
			continue;
		value = median(some, m);
		u = mean_u(w, rest, w->wild);
		if (isinf(u))
			continue;
		if (value < least) {
			least = value;
			least_u = u;
		}
		if (value > most) {
			most = value;
			most_u = u;
		}
	}
	r->place_mm = most > least ? most - least : 0;
	r->place_u_mm = hypot(least_u, most_u);
}

static void compare_redundancy(struct redundancy_work *w, struct incise_redundancy *r)
{
	struct robust_line line = {0};
	double mean = 0, squares = 0, distance;

	r->n = w->n;
	r->bias_mm = median_copy(w->off, w->n, w->scratch);
	r->depth_low_mm = INFINITY;
	r->depth_high_mm = -INFINITY;
	for (int i = 0; i < w->n; i++) {
		mean += w->depth[i] / w->n;
		r->depth_low_mm = fmin(r->depth_low_mm, w->depth[i]);
		r->depth_high_mm = fmax(r->depth_high_mm, w->depth[i]);
	}
	for (int i = 0; i < w->n; i++)
		squares += (w->depth[i] - mean) * (w->depth[i] - mean);
	r->trend = r->trend_u = NAN;
	line.zero = r->bias_mm;
	/* A trend needs a range of depths. */
	if (r->depth_high_mm - r->depth_low_mm > 1 &&
	    !incise_robust_line(w->depth, w->off, w->n, 0, &line, w->wild)) {
		r->trend = line.slope;
	} else {
		line.slope = 0;
	}
	find_places(w, &line, r);
	/* find_places() has left the distances from the trend there */
	r->bias_u_mm = mean_u(w, w->scratch + w->n, NULL);
	/* as if the slope were a difference of means at one sd to each side */
	if (isfinite(r->trend))
		r->trend_u = r->bias_u_mm / sqrt(squares / w->n);
	for (int i = 0; i < w->n; i++)
		w->off[i] = fabs(w->off[i] - line.zero - line.slope * w->depth[i]);
	distance = median(w->off, w->n);
	r->scatter_sd_mm = 1.4826 * distance;
	r->bias_bad = fabs(r->bias_mm) > INCISE_REDUNDANCY_BIAS_MM + 2 * r->bias_u_mm;
	r->place_bad = r->place_mm > INCISE_REDUNDANCY_PLACE_MM + 2 * r->place_u_mm;
	r->trend_bad = fabs(r->trend) > INCISE_REDUNDANCY_TREND + 2 * r->trend_u;
}

/* Seconds that hold a pair. */
static int seconds_of(const struct redundancy_work *w)
{
	int seconds = 0;

	for (int i = 0; i < w->n; i++)
		seconds += !i || w->t_ns[i] / INT64_C(1000000000) !=
					 w->t_ns[i - 1] / INT64_C(1000000000);
	return seconds;
}

int incise_redundancy(const struct incise_depth_pair *pairs, int n,
		      struct incise_redundancy *result, struct incise_error *err)
{
	struct redundancy_work w = {0};
	double way[2];
	int rc = 0, seconds = 0;

	*result = (struct incise_redundancy){0};
	for (int i = 0; i < n; i++)
		if (!isfinite(pairs[i].camera_mm) || !isfinite(pairs[i].tracker_mm) ||
		    !isfinite(pairs[i].place_mm[0]) || !isfinite(pairs[i].place_mm[1]) ||
		    pairs[i].t_ns < (i ? pairs[i - 1].t_ns : 0))
			return incise_error_set(
				err, EINVAL,
				"pair %d of depths is not finite, or its time decreases",
				i + 1);
	w.depth = malloc((6 * sizeof(double) + sizeof(int64_t)) * (n > 0 ? n : 1));
	w.wild = malloc(n > 0 ? n : 1);
	if (w.depth && w.wild) {
		w.off = w.depth + n;
		w.along = w.off + n;
		w.scratch = w.along + n;
		w.t_ns = (int64_t *)(w.scratch + 3 * n);
		find_way(pairs, n, way);
		for (int i = 0; i < n; i++) {
			if (!(fabs(pairs[i].rate_mm_s) <= RATE_MM_S))
				continue;
			w.depth[w.n] = pairs[i].tracker_mm;
			w.off[w.n] = pairs[i].camera_mm - pairs[i].tracker_mm;
			w.along[w.n] = way[0] * pairs[i].place_mm[0] +
				       way[1] * pairs[i].place_mm[1];
			w.t_ns[w.n++] = pairs[i].t_ns;
		}
		seconds = seconds_of(&w);
		if (w.n >= PAIRS_MIN && seconds >= SECONDS_MIN)
			compare_redundancy(&w, result);
		else
			rc = incise_error_set(
				err, ENODATA,
				"%d frames within %d seconds have depths of 1 mm or "
				"more from camera and tracker: %d within %d are "
				"required; record a few slow cuts with the camera",
				w.n, seconds, PAIRS_MIN, SECONDS_MIN);
	} else {
		rc = incise_error_set(err, ENOMEM, "no memory for %d pairs", n);
	}
	free(w.depth);
	free(w.wild);
	return rc;
}
