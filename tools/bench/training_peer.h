/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Regressors of scikit-learn on the same pairs and the same unseen cuts, where Python finds
 * it: tools/bench/peers/scikit_learn.py in a process of its own. It is for measuring, and is not
 * installed.
 */
#ifndef INCISE_TRAINING_PEER_H
#define INCISE_TRAINING_PEER_H

#include "training_data.h"

#define TRAINING_PEERS 3
#define TRAINING_PEER_SEEDS 16

struct training_peer {
	const char *name;
	/* By data set; NaN where it failed. */
	double ns[TRAINING_PEER_SEEDS], rmse[TRAINING_PEER_SEEDS],
		max[TRAINING_PEER_SEEDS], mean[TRAINING_PEER_SEEDS];
	char failed[200]; /* why; empty */
};

void training_peers(struct training_peer peers[TRAINING_PEERS],
		    const struct training_data *data, int seeds,
		    double unseen[TRAINING_UNSEEN][3]);

#endif
