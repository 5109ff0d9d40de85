/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What the parts of the actuator's calibration hand to each other; see stepper.c.
 */
#ifndef INCISE_STEPPER_WORK_H
#define INCISE_STEPPER_WORK_H

#include <incise/calibrate_stepper.h>

/* A run of points that go one way: first … last. */
struct stroke {
	int first, last, way; /* way: 1 up, -1 down */
	double from_mm;	      /* where it turned round */
	double zero_N;	      /* its line at 0 mm */
	double mean_mm;	      /* of the points used */
	int used;
};

struct stepper_work {
	const struct incise_calibrate_stepper_point *points;
	const struct incise_calibrate_stepper_setup *setup;
	int n, n_strokes;
	struct stroke *strokes;
	enum incise_calibrate_stepper_state *states;
	double range_mm; /* of all positions */
	double slope;	 /* N/mm, of all lines */
	double sd;	 /* N */
	double sxx;	 /* Σ (x - its stroke's mean)² of the points used */
};

/* Distance of a point from its stroke's line, N. */
double incise_stepper_off(const struct stepper_work *w, const struct stroke *stroke,
			  int i);

/*
 * Lines of one slope through what lies further than @skip_mm behind each turn, without
 * outliers. Returns 0, -EDOM (nothing to fit), -ENOMEM.
 */
int incise_stepper_lines(struct stepper_work *w, double skip_mm);

/* Whether the force changes at all; -EDOM, -ENOMEM. */
int incise_stepper_check_moves(const struct stepper_work *w, struct incise_error *err);

/* Whether the lines can be those of an actuator; counts outliers. -EDOM, -ENOMEM. */
int incise_stepper_check_lines(const struct stepper_work *w,
			       struct incise_calibrate_stepper *result,
			       struct incise_error *err);

/* What happens behind the turns, from the lines. Returns 0, -ENOMEM. */
int incise_stepper_turn(const struct stepper_work *w,
			struct incise_calibrate_stepper *result);

#endif
