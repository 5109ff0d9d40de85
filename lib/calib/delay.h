/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside the calibration of delays: both streams on one grid, and what of them is compared.
 */
#ifndef INCISE_DELAY_H
#define INCISE_DELAY_H

#include <stdbool.h>
#include <incise/calibrate_delay.h>

#define DELAY_STEP_S 0.004
#define DELAY_COLUMNS 9 /* of a force */

/* Both streams, a value per step; what is not known is NAN. */
struct delay_grid {
	int n;
	int64_t start_ns;
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

/* 0, -EDOM (nothing in common), -EINVAL (times), -ENOMEM. */
int delay_grid_make(struct delay_grid *grid, const struct incise_delay_point *motion,
		    int n_motion, const struct incise_delay_point *other, int n_other,
		    struct incise_error *err);
void delay_grid_free(struct delay_grid *grid);

/* to = derivative of from, filtered, per step. */
void delay_grid_filter(const struct delay_grid *grid, const double *from, double *to);

/* Values of a filtered column `shift` steps later than row i; i is within the reach. */
double delay_grid_at(const double *column, int i, double shift);

/* A fit under way. Delays are in steps of the grid. */
struct delay {
	struct delay_grid grid;
	enum incise_delay_relation relation;
	double low_mm, high_mm; /* of the motion: 2 and 98 % */
	double floor_mm;	/* it never is below */
	int range;		/* steps */
	/* The fit: */
	double shift, contact_mm, c[DELAY_COLUMNS];
	bool touches; /* contact begins within the motion, and is fitted along */
};

#define DELAY_UNKNOWNS (DELAY_COLUMNS + 3) /* and delay, contact, drift */

/* Normal equations of some rows; the lower triangle. */
struct delay_normal {
	int m;
	double a[DELAY_UNKNOWNS * DELAY_UNKNOWNS], b[DELAY_UNKNOWNS], yy;
};

void delay_add_row(struct delay_normal *normal, const double *row, double y);
void delay_add_normal(struct delay_normal *to, const struct delay_normal *from,
		      double times);

/* x of the least squares; columns that are none get 0. False: nothing can be said. */
bool delay_solve(const struct delay_normal *normal, double *x);

/* What the other stream is made of, for a contact that begins at a depth. */
void delay_columns(struct delay *d, double contact_mm);

/* Whether a row can be compared at a delay. */
bool delay_usable(const struct delay *d, int i, int shift);

/* The delay roughly, by the peak of the correlation. 0, -EDOM, -ENOMEM. */
int delay_search(struct delay *d, struct incise_delay_fit *fit, struct incise_error *err);

/*
 * Where contact begins, of some depths, and the delay anew, as viscosity has moved the peak
 * of the correlation; the fit goes on from there.
 */
void delay_search_contact(struct delay *d);

/* Rows of the derivatives by all unknowns at the present fit, and the rest. */
struct delay_tangent {
	int n, m;
	double *row;  /* n × m: columns, delay, contact, drift */
	double *rest; /* n; NAN: not to be used */
};

/* Of all rows, or of those of one block; the last `without` unknowns are left out. */
void delay_tangent_normal(const struct delay_tangent *t, int from, int to, int without,
			  struct delay_normal *normal);

/* Uncertainty, interval and drift of a fit. 0, -EDOM (too few blocks), -ENOMEM. */
int delay_bootstrap(struct delay *d, const struct delay_tangent *t,
		    struct incise_delay_fit *fit, struct incise_error *err);

#endif
