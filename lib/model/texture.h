/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of a texture (incise/texture.h): the tables that ticks read.
 */
#ifndef INCISE_MODEL_TEXTURE_H
#define INCISE_MODEL_TEXTURE_H

#include <stdint.h>
#include <incise/texture.h>
#include "../fixed/texture.h"

/*
 * Make the tables of a texture: the same bits for the same seed on every machine. @variation: share of the
 * learned variation from cut to cut, 0 … 1. @texture NULL: τ is 0 everywhere, all factors are 1.
 */
void incise_texture_fill(const struct incise_texture *texture, double variation,
			 uint64_t seed, struct incise_fixed_texture *to);

#endif
