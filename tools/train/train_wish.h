/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What is asked of incise train: its options, checked, with what they are where they are not
 * given.
 */
#ifndef INCISE_TRAIN_WISH_H
#define INCISE_TRAIN_WISH_H

#include <stdbool.h>
#include <incise/train.h>

struct train_wish {
	const char *data, *model, *initial, *history;
	char *inputs[INCISE_MODEL_INPUTS_MAX];
	int n_inputs;
	const char *output, *group;
	double check;
	int mfs[INCISE_MODEL_INPUTS_MAX];
	int n_mfs;
	bool auto_mfs;
	enum incise_mf_type type;
	bool json;
	struct incise_train_options train;
};

/* Bad usage ends the program. */
void train_wish_take(struct train_wish *wish, int argc, char **argv);

#endif
