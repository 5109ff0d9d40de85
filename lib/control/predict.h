/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The predictor of poses as it is inside; see incise/predict.h. Who is in the library has
 * it in his own memory.
 */
#ifndef INCISE_PREDICT_PRIVATE_H
#define INCISE_PREDICT_PRIVATE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/predict.h>

struct incise_predict {
	double alpha, beta, gamma; /* of a miss: to x, v · period, a · period² */
	double period_s;
	int64_t latency_ns;
	int64_t gap_ns; /* after a longer gap the filter starts anew */
	bool started;
	/* How often a pose was taken where no hand can have got to since the last. */
	unsigned int leaps;
	int64_t t_ns; /* of acquisition of the last pose */
	double x[3];  /* mm, at t_ns */
	double v[3];  /* mm/s */
	double a[3];  /* mm/s² */
	double q[4];  /* attitude of the last pose that had one */
	/* What was shown when the last pose arrived, to be blended out. */
	int64_t arrival_ns;
	double x_shown[3], v_shown[3]; /* less what the filter says then */
	double q_shown[4];
};

/* As incise_predict_new() of noise 0. */
void incise_predict_init(struct incise_predict *p,
			 const struct incise_tracker_info *tracker);

/* The same for positions with a noise of @noise_mm, sd per axis. */
void incise_predict_init_noise(struct incise_predict *p,
			       const struct incise_tracker_info *tracker,
			       double noise_mm);

#endif
