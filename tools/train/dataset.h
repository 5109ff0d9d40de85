/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A description of training data for incise info: counts, ranges, and the groups that differ from
 * the others. Every failure ends the program.
 */
#ifndef TRAIN_DATASET_H
#define TRAIN_DATASET_H

#include "sources.h"

void dataset_show(char **paths, int n, struct source_options *options, bool json);

#endif
