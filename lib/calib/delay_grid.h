/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Two streams on one grid of time, with their derivatives through a Gaussian, for the
 * calibration of delays.
 */
#ifndef INCISE_DELAY_GRID_H
#define INCISE_DELAY_GRID_H

#include <stdbool.h>
#include <incise/calibrate_delay.h>

#define DELAY_STEP_S 0.004
#define DELAY_COLUMNS 9 /* of a force */

/* Both streams, a value per step; a missing one is NAN. */
struct delay_grid {
	int n;
	int64_t start_ns;
	double *values; /* the block that holds all of them */
	double *motion, *speed, *other;
	double *target; /* the other's derivative, filtered */
	bool *good;	/* rows of the target that rest on known values alone */
	double *column[DELAY_COLUMNS]; /* of the motion, filtered alike */
	int columns;
	double *scratch;
	double sigma;	/* of the filter, steps */
	int reach;	/* steps that it takes in to either side */
	double *weight; /* 2 reach + 1: derivative of a Gaussian */
};

/* 0, -EDOM (nothing in common), -EINVAL (times), -ENOMEM; delay_grid_free() in any case. */
int delay_grid_make(struct delay_grid *grid, const struct incise_delay_point *motion,
		    int n_motion, const struct incise_delay_point *other, int n_other,
		    struct incise_error *err);
void delay_grid_free(struct delay_grid *grid);

/* to = derivative of from, filtered, per step. */
void delay_grid_filter(const struct delay_grid *grid, const double *from, double *to);

/* Values of a filtered column `shift` steps later than row i; i is within the reach. */
double delay_grid_at(const double *column, int i, double shift);

#endif
