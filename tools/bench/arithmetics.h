/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The arithmetics that incise bench measures: every way to evaluate one model, among them
 * the plainest and a peer's, over the same points, and the reference that tells their
 * errors.
 */
#ifndef INCISE_ARITHMETICS_H
#define INCISE_ARITHMETICS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/fixed.h>
#include <incise/model.h>

#define ARITHMETICS_MAX 32

/* Points at random over the model's support, an evaluation's inputs side by side, in the
 * form that each arithmetic takes; and room for what they answer. */
struct points {
	size_t n;
	int n_inputs;
	double *x, *y;
	float *x_float, *y_float;
	int32_t *x_fixed, *y_fixed;
	double *truth; /* eq. (3) in long double */
};

enum arithmetic_kind {
	ARITHMETIC_FLOATING,
	ARITHMETIC_DIRECT,
	ARITHMETIC_TABLE,
	ARITHMETIC_FORCE,
	ARITHMETIC_BATCH,
	ARITHMETIC_PEER,
	ARITHMETIC_KINDS,
};

struct arithmetic {
	char name[32];
	enum arithmetic_kind kind;
	char failed[600]; /* why it cannot be measured, or is wrong; else empty */

	/* Evaluate all points, leaving the answers in the form of its own. */
	void (*run)(const struct arithmetic *a, const struct points *p);
	const void *context;
	const struct incise_fixed *fixed; /* whose bound is certified, or NULL */
};

struct arithmetics {
	int n;
	struct arithmetic row[ARITHMETICS_MAX];
	char peer_version[64]; /* of fuzzylite; empty without it */
};

/* Fails the program when the model has no fixed-point form or memory is short. */
void arithmetics_init(struct arithmetics *all, const struct incise_model *model);

void points_init(struct points *p, const struct incise_model *model, size_t n);

/* Run over all points, and tell the largest and the rms error. */
void arithmetic_errors(const struct arithmetic *a, const struct points *p, double *max,
		       double *rms);

#endif
