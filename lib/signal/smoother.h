/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Velocity of the tip and progress of the cut, from the records of a tracker before and after. No
 * clock, no file. mm, s; times in ns. For one thread at a time.
 */
#ifndef INCISE_SMOOTHER_H
#define INCISE_SMOOTHER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "../control/predict.h"

/* --- velocity of the tip ------------------------------------------------------------- */

struct incise_smooth_record {
	int64_t seq, t_ns;
	double position_mm[3], depth_mm, t_sd_s; /* given */
	double line_mm_s;			 /* given: speed by table depth */
	double velocity_mm_s[3];		 /* NAN: of an invalid position */
	double noise_mm, depth_noise_mm; /* standard deviations of one; NAN: not known */
	/* forward */
	double residual_mm[3], periods; /* since the record before */
	bool starts, skipped, even;
	double bend2_mm2, depth_bend2_mm2; /* second differences, squared */
};

struct incise_smooth {
	struct incise_predict fresh, predict;
	double period_s, pull[3]; /* of λ on velocity, for a noise of 1 */
	double noise_1_s;	  /* of the velocity, for a noise of 1 mm of positions */
	size_t lag, capacity;
	struct incise_smooth_record *records;
	size_t n, forward, finished,
		taken; /* records added, filtered, smoothed, returned */
	bool ended;
};

/*
 * Noise of the slope of a line through so many records to each side, less the smoother's
 * velocity, for a noise of 1 mm of positions; 1/s.
 */
double incise_smooth_line_noise(const struct incise_smooth *smooth, int half);

/* For records at this rate. Returns 0 or -ENOMEM. */
int incise_smooth_init(struct incise_smooth *smooth, double rate_hz);
void incise_smooth_free(struct incise_smooth *smooth);

/* Add a record, later than the one before; then take the finished ones. */
void incise_smooth_push(struct incise_smooth *smooth,
			const struct incise_smooth_record *record);

/* No more records follow. */
void incise_smooth_end(struct incise_smooth *smooth);

/* The next finished record, valid until the next push; NULL: none now. */
const struct incise_smooth_record *incise_smooth_take(struct incise_smooth *smooth);

/* --- progress of a cut --------------------------------------------------------------- */

/*
 * Whether the blade advances: it goes deeper than ever before in its cut, or along the skin into
 * new tissue; see ../tissue/front.proto.c. Its progress is the depth and the length of the cut in
 * the skin,
 *
 *     progress      ,-----.      ,----
 *              ,---'       `.  ,'         highest so far, less the noise of a difference
 *     ________/              `'           of two depths
 *     advances ▔▔▔▔▔▔▔▔         ▔▔▔▔▔
 *
 * and it advances where that rises, and is at its highest. Both at 95 %: noise alone passes for
 * a rise in one record of 40. The line of the cut leads to its farthest point; 1 mm beside it
 * tissue is new.
 *
 * A blade that comes out on a slant meets new tissue too, but the work that was put in is given
 * back and ends before the surface. Of a force that grows by no more than the square of the
 * depth, all but INCISE_FRONT_KEPT is back at the cube root of that share of the deepest
 * depth: 0.4 of it. Nothing that is less deep counts as advancing.
 *
 * Starts with {0} and the surface's normal.
 */
struct incise_cut_progress {
	double normal[3]; /* unit, out of the tissue */
	bool inside, has_line;
	double at_mm[3], along[3]; /* on the surface: start, and then the direction */
	double from_mm,
		to_mm; /* of the line; of one without direction, 0 and its radius */
	double way_mm; /* of new tissue */
	double highest_mm, deepest_mm; /* progress and depth so far */
};

/*
 * Add a finished record of the smoother; @noise_1_s is the smoother's. Returns whether the blade
 * advances there. Without a known noise there is none.
 */
bool incise_cut_progress_add(struct incise_cut_progress *progress,
			     const struct incise_smooth_record *record, double noise_1_s);

#endif
