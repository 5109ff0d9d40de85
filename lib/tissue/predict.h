/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From a tracker's 60–240 poses a second, milliseconds old, to where the tip is now: a
 * steady-state constant-velocity Kalman filter (alpha-beta) per axis, extrapolated.
 */
#ifndef INCISE_PREDICT_H
#define INCISE_PREDICT_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/tracker.h>

struct incise_predict {
	double alpha, beta;
	int64_t latency_ns;
	int64_t gap_ns; /* after a longer gap the filter starts anew */
	bool started;
	int64_t t_ns; /* of acquisition of the last pose */
	double x[3];  /* mm, at t_ns */
	double v[3];  /* mm/s */
};

void incise_predict_init(struct incise_predict *predict,
			 const struct incise_tracker_info *tracker);

/* Take a pose in; one that is not finite, or older than the last, is passed over. */
void incise_predict_add(struct incise_predict *predict,
			const struct incise_tracker_sample *sample);

/* Position at t_ns, mm. */
void incise_predict_at(const struct incise_predict *predict, int64_t t_ns,
		       double position[3]);

/* Speed, mm/s, ≥ 0. */
double incise_predict_speed(const struct incise_predict *predict);

/* Age of the last pose at t_ns; INT64_MAX before the first. */
int64_t incise_predict_age(const struct incise_predict *predict, int64_t t_ns);

#endif
