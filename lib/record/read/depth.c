// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Depth and speed of the blade; see depth.h.
 */
#include <math.h>
#include <string.h>
#include "depth.h"

void incise_depth_init(struct incise_depth *depth, const double point_mm[3],
		       const double normal[3])
{
	memset(depth, 0, sizeof(*depth));
	memcpy(depth->point_mm, point_mm, sizeof(depth->point_mm));
	memcpy(depth->normal, normal, sizeof(depth->normal));
}

double incise_depth_of(const struct incise_depth *depth, const double position_mm[3])
{
	double height = 0;

	for (int i = 0; i < 3; i++)
		height += (position_mm[i] - depth->point_mm[i]) * depth->normal[i];
	return -height;
}

/* Norm of the slopes of the lines through the records around one of them, mm/s. */
static double speed(const struct incise_depth *depth, int at)
{
	const struct incise_depth_record *window = depth->window;
	int first = at, last = at;
	double mean_t = 0, mean[3] = {0}, tt = 0, tp[3] = {0};
	double sum = 0;

	while (first > 0 && first > at - INCISE_DEPTH_HALF &&
	       window[at].t_ns - window[first - 1].t_ns <= INCISE_DEPTH_GAP_NS)
		first--;
	while (last < depth->n - 1 && last < at + INCISE_DEPTH_HALF &&
	       window[last + 1].t_ns - window[at].t_ns <= INCISE_DEPTH_GAP_NS)
		last++;
	if (first == last)
		return 0;
	/* Relative to the record itself: small differences are exact. */
	for (int i = first; i <= last; i++) {
		mean_t += (window[i].t_ns - window[at].t_ns) * 1e-9 / (last - first + 1);
		for (int k = 0; k < 3; k++)
			mean[k] +=
				(window[i].position_mm[k] - window[at].position_mm[k]) /
				(last - first + 1);
	}
	for (int i = first; i <= last; i++) {
		double t = (window[i].t_ns - window[at].t_ns) * 1e-9 - mean_t;

		tt += t * t;
		for (int k = 0; k < 3; k++)
			tp[k] += t * (window[i].position_mm[k] -
				      window[at].position_mm[k] - mean[k]);
	}
	for (int k = 0; k < 3; k++)
		sum += tp[k] / tt * (tp[k] / tt);
	return sqrt(sum);
}

/* Depth is the record's own: in a quick plunge the error of a mean over the window would
 * exceed the tracker's noise. */
static void fill_row(struct incise_depth *depth, struct incise_depth_row *row)
{
	const struct incise_depth_record *record = &depth->window[depth->done];

	*row = (struct incise_depth_row){
		.seq = record->seq,
		.t_ns = record->t_ns,
		.depth_mm = incise_depth_of(depth, record->position_mm),
		.velocity_mm_s = speed(depth, depth->done),
	};
	depth->done++;
}

bool incise_depth_push(struct incise_depth *depth, int64_t seq, int64_t t_ns,
		       const double position_mm[3], struct incise_depth_row *row)
{
	struct incise_depth_record *record;

	if (depth->n == INCISE_DEPTH_WINDOW) {
		memmove(depth->window, depth->window + 1,
			(INCISE_DEPTH_WINDOW - 1) * sizeof(*depth->window));
		depth->n--;
		depth->done--;
	}
	record = &depth->window[depth->n++];
	record->seq = seq;
	record->t_ns = t_ns;
	memcpy(record->position_mm, position_mm, sizeof(record->position_mm));
	if (depth->n - depth->done <= INCISE_DEPTH_HALF)
		return false;
	fill_row(depth, row);
	return true;
}

bool incise_depth_flush(struct incise_depth *depth, struct incise_depth_row *row)
{
	if (depth->done == depth->n)
		return false;
	fill_row(depth, row);
	return true;
}
