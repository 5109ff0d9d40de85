/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Velocity of the tip from the tracker's records before and after: the loop's filter
 * (lib/control/predict.h, a steady-state Kalman filter of constant acceleration) run forward,
 * and its smoother backward.
 *
 *     forward   ─────────────────────────────►   x, v, a and the residual y - x of each record
 *     backward        ◄─────────────── λ = 0     v less P λ, where λ sums later residuals
 *               taken │ finished │ lag │ last record
 *
 * The backward run is that of Bryson and Frazier in Bierman's form (Fixed interval
 * smoothing with discrete measurements, Int. J. Control 18(1), 1973) with the gains of the
 * loop. So its phase is 0: at ω, for records T apart with tracking index Λ,
 *
 *     v / x = j 2/T tan(ωT/2) / (1 + (2 sin(ωT/2))⁶ / (Λ cos(ωT/2))²)
 *
 * which is half of jω at 16.8 Hz for records at 120 Hz and at 18.5 Hz for 240 Hz. It restarts
 * where the loop does: after a gap of five periods, and at a discontinuity of 20 mm. There the
 * first velocity is the slope of the next records, not 0 as in the loop, which has none yet.
 *
 * The effect of a record on those before it fades from record to record. The lag is the
 * distance at which it has faded to 1e-7, 39 records at 120 Hz and 72 at 240 Hz; later records
 * do not matter. Memory is that of two lags.
 *
 * The noise of positions and depths is from second differences of evenly spaced records, which
 * have √6 of it; over 16 to each side. mm, s; not for several threads.
 */
#ifndef INCISE_SMOOTH_H
#define INCISE_SMOOTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include "../../control/predict.h"

struct incise_smooth_record {
	int64_t seq, t_ns;
	double position_mm[3], depth_mm, t_sd_s; /* given */
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
	size_t lag, capacity;
	struct incise_smooth_record *records;
	size_t n, forward, finished,
		taken; /* records added, filtered, smoothed, returned */
	bool ended;
};

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

#endif
