/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From a tracker's 60–240 poses a second, milliseconds old, to where the tip is now.
 *
 * A steady-state constant-acceleration Kalman filter (alpha-beta-gamma) per axis,
 * extrapolated. The shown values never jump: their difference from a new pose is blended out,
 * linearly, over one tracker period.
 *
 *   shown   ·····.                 the old prediction
 *                 '·.  difference × (1 - (t - arrival) / period)
 *                    '·.__________ the new prediction
 *   time         |    |
 *             arrival  + period
 *
 * The blend starts when a pose arrives at the host (sample->t_ns), not when it is taken
 * in. So it does not matter how many poses are taken in at one tick. A pose must be taken
 * in before the first tick after its arrival is asked for; when it is late by d, the shown values
 * step by d / period of the difference.
 *
 * mm, s; times of the host's clock in ns. All numbers given are finite, whatever the poses
 * are. tests/bench/settings measures how far off it is. Gains after Kalata, The tracking
 * index, IEEE Trans. AES-20(2), 1984, in the closed form of Gray and Murray, IEEE Trans.
 * AES-29(3), 1993.
 */
#ifndef INCISE_PREDICT_H
#define INCISE_PREDICT_H

#include <stdint.h>
#include <incise/export.h>
#include <incise/tracker.h>
#include "../tissue/tick.h"

/* At 60 Hz a hand that misses a pose by this is faster than 1 m/s. */
#define INCISE_PREDICT_JUMP_MM 20.0

/*
 * A quick tracker may be late by more than five periods. A hand's force, and so its acceleration,
 * stays the same for some hundredths of a second.
 */
#define INCISE_PREDICT_AHEAD_NS 40000000

struct incise_predict {
	double alpha, beta, gamma; /* of a miss: to x, v · period, a · period² */
	double period_s;
	int64_t latency_ns;
	int64_t gap_ns; /* after a longer gap the filter restarts */
	struct incise_double_predict now;
};

/* Its gains as a tick takes them. */
void incise_predict_filter(const struct incise_predict *p,
			   struct incise_double_filter *filter);

/*
 * Start without a pose. A rate of @tracker outside 1 … 10000 Hz and a latency outside 0 … 1 s
 * count as the nearest inside. @noise_mm of its positions, sd per axis; 0: 0.02, for a magnetic
 * tracker near its source.
 */
void incise_predict_init(struct incise_predict *p,
			 const struct incise_tracker_info *tracker, double noise_mm);

/*
 * Take a pose in. A pose whose position is not finite or metres away, or that is not newer than
 * the last, is passed over. An invalid quaternion leaves the attitude as it was.
 *
 * After a gap of more than five periods velocity starts from 0. The filter also starts again when
 * a pose is more than INCISE_PREDICT_JUMP_MM from its expected place: no hand did that, and the
 * tool must not be dragged through the tissue, so there is no blend, either; the force's limits do
 * the rest. Real-time safe.
 */
void incise_predict_add(struct incise_predict *p,
			const struct incise_tracker_sample *sample) INCISE_REALTIME;

/*
 * Position, velocity and attitude (unit quaternion, w first) at t_ns. Before the first
 * pose all is 0 and the attitude 1.
 *
 * Position and velocity are blended each by itself: velocity is the filter's, and not the
 * derivative of the position shown, which holds the speed of the correction too. Further
 * than five periods, or 40 ms of a tracker of more than 125 Hz, after the last pose was acquired
 * they stay as they were then, so that a longer latency is made up for in part only. The attitude
 * is not extrapolated. Real-time safe.
 */
void incise_predict_at(const struct incise_predict *p, int64_t t_ns,
		       double position_mm[3], double velocity_mm_s[3],
		       double attitude[4]) INCISE_REALTIME;

/*
 * Acceleration at t_ns, mm/s², within ±10⁵ per component: the filter's, which takes it as constant
 * between poses, blended as the velocity is. Causal: poses before t_ns only. Real-time safe.
 */
void incise_predict_acceleration(const struct incise_predict *p, int64_t t_ns,
				 double acceleration_mm_s2[3]) INCISE_REALTIME;

#endif
