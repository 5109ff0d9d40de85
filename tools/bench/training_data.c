// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Data with a known truth; see training_data.h.
 */
#include <math.h>
#include "training_data.h"

#define DEPTH_mm 20
#define SPEED_mm_s 50
#define PER_CUT 10
#define HARDER 0.05  /* sd of a cut's factor */
#define NOISE_N 0.02 /* sd of a pair */
#define CUTS 20

static double truth_N(double depth_mm, double speed_mm_s)
{
	return depth_mm * (0.045 + 0.0028 * depth_mm) *
	       (1 + 0.35 * speed_mm_s / (speed_mm_s + 15));
}

/* 0 … 1 */
static double any(uint64_t *state)
{
	*state = *state * 6364136223846793005u + 1442695040888963407u;
	return (double)(*state >> 11) * 0x1p-53;
}

/* Near enough to a normal distribution, of sd 1. */
static double spread(uint64_t *state)
{
	double sum = -6;

	for (int i = 0; i < 12; i++)
		sum += any(state);
	return sum;
}

void training_data_make(struct training_data *data, uint64_t seed)
{
	uint64_t state = seed * 0x9e3779b97f4a7c15;
	double harder = 1;

	for (int i = 0; i < TRAINING_PAIRS; i++) {
		double *row = data->row[i];

		if (i % PER_CUT == 0)
			harder = 1 + HARDER * spread(&state);
		row[0] = DEPTH_mm * any(&state);
		row[1] = SPEED_mm_s * any(&state);
		row[2] = harder * truth_N(row[0], row[1]) + NOISE_N * spread(&state);
		data->group[i] = i / PER_CUT;
	}
}

void training_data_unseen(double row[TRAINING_UNSEEN][3])
{
	const int points = TRAINING_UNSEEN / CUTS;

	for (int i = 0; i < TRAINING_UNSEEN; i++) {
		double cut = (i / points + 0.5) / CUTS,
		       along = (i % points + 0.5) / points;

		/* A hand sinks in a little, and is fast in the middle. */
		row[i][0] = DEPTH_mm * (0.03 + 0.9 * cut + 0.05 * along);
		row[i][1] = SPEED_mm_s * (0.5 - 0.48 * cos(2 * M_PI * (along + cut)));
		row[i][2] = truth_N(row[i][0], row[i][1]);
	}
}
