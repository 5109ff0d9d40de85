/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a texture (incise/texture.h): what a .tex file has, and the tables that ticks read.
 */
#ifndef INCISE_MODEL_TEXTURE_H
#define INCISE_MODEL_TEXTURE_H

#include <stdint.h>
#include <incise/texture.h>
#include "../fixed/texture.h"

#define INCISE_TEXTURE_UNIT 16	     /* bytes of a unit's name */
#define INCISE_TEXTURE_CURVES 16384  /* at most */
#define INCISE_TEXTURE_POINTS 262144 /* of all curves */

struct incise_texture {
	uint64_t checksum; /* of its model, incise_model_checksum() */
	char unit[INCISE_TEXTURE_UNIT];
	struct incise_texture_info info; /* unit is the one above */
	/* τ over the way, a point each step, of pieces that are drawn and joined to a tape. */
	double step;
	int n_curves;
	int *n;	       /* points of each, 2 or more */
	double *point; /* of all, after each other */
};

/*
 * Make the tables of a texture: the same bits for the same seed on every machine. @variation: share of the
 * learned variation from cut to cut, 0 … 1. @texture NULL: τ is 0 everywhere, all factors are 1.
 */
void incise_texture_fill(const struct incise_texture *texture, double variation,
			 uint64_t seed, struct incise_fixed_texture *to);

#endif
