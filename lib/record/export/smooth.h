/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Velocity of the tip from the tracker's records, from what came before and after: the
 * loop's filter (lib/control/predict.h, a steady-state Kalman filter of constant
 * acceleration) run forward, and its smoother backward.
 *
 *     forward   ─────────────────────────────►   x, v, a and the miss y - x of each record
 *     backward        ◄─────────────── λ = 0     v less P λ, where λ gathers later misses
 *               taken │ finished │ lag │ end of what is there
 *
 * The backward run is that of Bryson and Frazier in Bierman's form (Fixed interval
 * smoothing with discrete measurements, Int. J. Control 18(1), 1973) with the gains that the
 * loop has too. So its phase is 0: at ω, for records T apart with tracking index Λ,
 *
 *     v / x = j 2/T tan(ωT/2) / (1 + (2 sin(ωT/2))⁶ / (Λ cos(ωT/2))²)
 *
 * which is half of jω at 16.8 Hz for records at 120 Hz and at 18.5 Hz for 240 Hz. It begins anew where
 * the loop does: after a gap of five periods, and at a leap of 20 mm. There the first
 * velocity is the slope of the next records, not 0 as in the loop, which does not know them.
 *
 * What a record adds to those before it fades from record to record. The lag is as long as
 * it takes to fade to 1e-7, 39 records at 120 Hz and 72 at 240 Hz; so what a record gets
 * from those within it is what all that follow would give. Memory is that of two lags.
 *
 * The noise of positions and depths is that of second differences of records evenly apart,
 * which have √6 of it; of 16 to each side. mm, s; not for several threads.
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
	double velocity_mm_s[3];		 /* NAN: of a position that is none */
	double noise_mm, depth_noise_mm; /* standard deviations of one; NAN: not known */
	/* forward */
	double miss_mm[3], periods; /* since the record before */
	bool begins, skipped, even;
	double bend2_mm2, depth_bend2_mm2; /* second differences, squared */
};

struct incise_smooth {
	struct incise_predict fresh, predict;
	double period_s, pull[3]; /* of λ on velocity, for a noise of 1 */
	size_t lag, room;
	struct incise_smooth_record *records;
	size_t n, forward, finished, taken; /* records; gone through; told; handed out */
	bool ended;
};

/* For records at so many Hz. Returns 0 or -ENOMEM. */
int incise_smooth_init(struct incise_smooth *smooth, double rate_hz);
void incise_smooth_free(struct incise_smooth *smooth);

/* Add what is given of a record, later than the one before; then take what is finished. */
void incise_smooth_push(struct incise_smooth *smooth,
			const struct incise_smooth_record *record);

/* There will be no more. */
void incise_smooth_end(struct incise_smooth *smooth);

/* The next record that is finished, good until the next push; NULL: none for now. */
const struct incise_smooth_record *incise_smooth_take(struct incise_smooth *smooth);

#endif
