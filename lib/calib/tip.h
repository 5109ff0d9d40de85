/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside the pivot calibration: the least squares themselves, which poses to believe, and
 * what is known of the solution.
 */
#ifndef INCISE_TIP_H
#define INCISE_TIP_H

#include <incise/calibrate_tip.h>

/* The poses as the fit has them. */
struct tip_poses {
	int n;
	double (*p)[3];	       /* mm */
	double (*r)[9];	       /* rotation, row by row */
	double (*residual)[3]; /* mm, of the last tip_residuals() */
	double *square;	       /* its length squared */
	bool *in;
	int *list;	/* room for n indices */
	double *sorted; /* room for n */
};

/* A solution, and what it rests upon. */
struct tip_solution {
	double t[3], c[3];
	double mean_r[9];
	double values[3], vectors[9]; /* of I - R̄ᵀR̄, ascending; vector k is column k */
	int n;
};

/* Of those of the list (NULL: the first n). False where they do not fix the tip. */
bool tip_solve(const struct tip_poses *poses, const int *list, int n,
	       struct tip_solution *solution);

/* to = r·v */
void tip_turn(double to[3], const double r[9], const double v[3]);

/* Of all poses under a solution. */
void tip_residuals(struct tip_poses *poses, const struct tip_solution *solution);

/* Mark the poses that are about one pivot and solve by them. False: none fixes the tip. */
bool tip_robust(struct tip_poses *poses, struct tip_solution *solution);

/* Those marked, as a list in ->list. How many. */
int tip_listed(const struct tip_poses *poses);

/* How far the n poses listed turned, and what of the tip that fixes. */
void tip_motion(const struct tip_poses *poses, int n, const struct tip_solution *s,
		struct incise_tip_fit *fit);

/* Poses in a row that count as one: of noise that lasts, some times as long. */
int tip_block(const struct tip_poses *poses, int n);

/*
 * The solution's covariance, and how far the pivot moved, with its χ², by blocks of
 * fit->block; u: times of those listed, in halves of the run, that add up to 0.
 */
void tip_uncertainty(struct tip_poses *poses, int n, const double *u,
		     const struct tip_solution *s, struct incise_tip_fit *fit,
		     double *chi2);

/* Whether to believe it. 0; -EDOM with what to do. */
int tip_judge(const struct tip_poses *poses, const struct incise_tip_fit *fit,
	      double chi2, struct incise_error *err);

#endif
