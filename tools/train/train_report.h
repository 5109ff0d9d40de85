/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What came of training, for people and as JSON: errors beside those of simpler predictors,
 * and what should be known before the model is used.
 */
#ifndef INCISE_TRAIN_REPORT_H
#define INCISE_TRAIN_REPORT_H

#include <jansson.h>
#include "train_wish.h"

/* What the standard deviation says, and how often it is right on the pairs kept back. */
struct train_interval {
	struct incise_uncertainty *uncertainty;
	double noise;
	double coverage; /* NAN without check pairs */
};

struct train_result {
	const struct train_wish *wish;
	const struct incise_model *model;
	const struct incise_train_side *fit,
		*check; /* check NULL: no pairs were kept back */
	struct incise_train_report report;
	struct incise_baselines baselines;
	struct train_interval interval;
};

/* Warn on stderr; the same as a list for JSON. */
json_t *train_warnings(const struct train_result *result);

void train_report_text(const struct train_result *result);

/* @warned becomes part of it. */
void train_report_json(const struct train_result *result, json_t *warned);

#endif
