/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Data of paper 1's size made of a known truth: 12 cuts with 10 averaged pairs each, every
 * cut harder or softer as a whole, with noise; and cuts that no training sees, as the truth
 * has them.
 *
 *   F(d, v) = (0.045 d + 0.0028 d²) (1 + 0.35 v/(v + 15)) N, d in mm, v in mm/s
 */
#ifndef INCISE_TRAINING_DATA_H
#define INCISE_TRAINING_DATA_H

#include <stdint.h>
#include <incise/train.h>

#define TRAINING_PAIRS 120
#define TRAINING_UNSEEN 1200

struct training_data {
	double row[TRAINING_PAIRS][3]; /* depth_mm, velocity_mm_s, force_N */
	int group[TRAINING_PAIRS];     /* its cut */
};

/* Pairs of the training, by seed. */
void training_data_make(struct training_data *data, uint64_t seed);

/* 20 cuts of 60 points, always the same ones. */
void training_data_unseen(double row[TRAINING_UNSEEN][3]);

#endif
