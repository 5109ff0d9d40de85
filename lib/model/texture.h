/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a texture (incise/texture.h): what a .tex file has, and the tables that ticks read.
 */
#ifndef INCISE_MODEL_TEXTURE_H
#define INCISE_MODEL_TEXTURE_H

#include <stdint.h>
#include <incise/texture.h>
#include "../fixed/texture.h"

#define INCISE_TEXTURE_CURVES 4096  /* at most */
#define INCISE_TEXTURE_POINTS 16384 /* of all curves, at most */
#define INCISE_TEXTURE_PIECE 2048   /* of one curve, at most */

/* Steps of a tape; see lib/fixed/texture.h. */
#define INCISE_TEXTURE_SHIFT_LEAST 8
#define INCISE_TEXTURE_SHIFT_MOST 20

struct incise_texture {
	uint64_t checksum; /* of its model, incise_model_checksum() */
	struct incise_texture_info info;
	/*
	 * Pieces of τ over the way, a point each step, that are drawn and joined to a tape: from where τ
	 * rises through 0 to where it does so again.
	 */
	double step; /* 2^INCISE_TEXTURE_SHIFT_LEAST / 65536 to … _MOST */
	int n_curves;
	int n[INCISE_TEXTURE_CURVES]; /* points of each, 2 or more */
	/* Of all, after each other; whole, of 1/INCISE_TEXTURE_ONE. */
	double point[INCISE_TEXTURE_POINTS];
};

/*
 * Make the tables of a texture: the same bits for the same seed on every machine. @variation: share of the
 * learned variation from cut to cut, 0 … 1. @texture NULL: τ is 0 everywhere, all factors are 1.
 */
void incise_texture_fill(const struct incise_texture *texture, double variation,
			 uint64_t seed, struct incise_fixed_texture *to);

#endif
