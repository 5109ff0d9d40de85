/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The look of cuts: metrics of the texture of a force over the way of the front, by which rendered cuts
 * are compared with recorded ones.
 *
 *   part    of a cut, from the first to the last row where the blade is fast and the force large; rows
 *           are as far apart in time
 *   force   means over cells of one step of the way
 *   event   a fall of at least 6 sd of the sensor's noise and 2 % of the cut's largest force
 *   octave  mean power of the force's differences, in windows of 32 cells; 0 is the highest, the one
 *           up to half a cycle per step
 *   rms     of the force in these windows about its line there, relative to its mean
 */
#ifndef INCISE_LEARN_REALISM_H
#define INCISE_LEARN_REALISM_H

#include <incise/realism.h>
#include "texture.h"

#define INCISE_DECIBEL(ratio) (10 * log10(fmax(ratio, 1e-30)))

struct incise_look {
	double step;   /* of the way; 0: the median of the rows in their parts */
	double noise;  /* sd of the sensor's; 0: that of the rows' second differences */
	double length; /* of the way */
	double skewness;
	struct incise_texture_look shape;
	/* Falls of the events, relative to the force before each, ascending: free(3). */
	double *drop;
	size_t n_events, capacity;
};

/*
 * The part of a cut that is looked at: the first to the last row in which the blade has a fifth of its
 * speed and the force half of its size, relative to their quantiles 0.99. @numbers: room for the rows.
 */
struct incise_texture_cut incise_look_part(const struct incise_texture_cut *cut,
					   double *numbers);

/*
 * Look at cuts as they were recorded, or with the forces of @rendered, those of each cut after each other, in
 * place of the recorded ones; a fall is compared with the largest recorded force in any case. @look: {0}, or
 * with step and noise of another one. 0 or -ENOMEM; the look is freed with free(look->drop) in any case.
 */
int incise_look_at(struct incise_look *look, const struct incise_texture_cut *cuts, int n,
		   const double *rendered);

/*
 * The forces of the cuts, after each other, by the tables of a texture as a sensor with @noise would have
 * measured them; returns their sum over the sum of the model's.
 */
double incise_look_render(const struct incise_fixed_texture *knots,
			  const struct incise_texture_cut *cuts, int n, double noise,
			  uint64_t key, double *force);

/* Compare cuts, rendered in each way, with what was recorded. All is 0 without cuts. 0 or -ENOMEM. */
int incise_realism_of(const struct incise_texture *texture,
		      const struct incise_texture_cut *cuts, int n, uint64_t seed,
		      struct incise_realism *realism);

/* Rows of all cuts. */
size_t incise_look_rows(const struct incise_texture_cut *cuts, int n);

/* Mean distance of the octaves of two looks, dB. */
double incise_look_distance(const struct incise_look *a, const struct incise_look *b);

/* Largest distance of the distributions of their drops (Kolmogorov and Smirnov); 1 without events. */
double incise_look_drops(const struct incise_look *a, const struct incise_look *b);

#endif
