/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The averaged normal of Bhasin et al. (2005), section 2.2:
 * ΣSn_i / |ΣSn_i| over the last n ticks, so
 * that a force does not jerk where the normal does.
 */
#ifndef INCISE_AVERAGE_H
#define INCISE_AVERAGE_H

#include <incise/export.h>
#define INCISE_AVERAGE_MAX 64

struct incise_average {
	int n;	   /* ticks averaged over */
	int count; /* normals in the ring, up to n */
	int at;	   /* where the next one goes */
	double ring[INCISE_AVERAGE_MAX][3];
	double sum[3];
	double turn[3]; /* sum of those that came since at was 0 */
	double last[3]; /* what was last given */
};

/* @n 1 … 64; what is outside is taken as the nearest inside. */
void incise_average_init(struct incise_average *a, int n);

/* Forget all: when a contact starts. */
void incise_average_reset(struct incise_average *a) INCISE_REALTIME;

/*
 * Take a unit normal in and give the average of the last n, or of those that there are
 * since the reset. The same time for any n. With n = 1 it is the normal, bit for bit.
 *
 * A @normal that is none, because it is not finite or far from unit length (no direction
 * is known where |Q - P| is 0), is not counted. Where normals are opposed and their sum
 * vanishes, the last average that there was is given again; before the first, 0 0 0.
 */
void incise_average_add(struct incise_average *a, const double normal[3],
			double averaged[3]) INCISE_REALTIME;

#endif
