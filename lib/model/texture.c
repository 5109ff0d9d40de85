// SPDX-License-Identifier: LGPL-2.1-or-later
/* Stand-in until tex-learn's is merged. */
#include <string.h>
#include "texture.h"

void incise_texture_fill(const struct incise_texture *texture, double variation,
			 uint64_t seed, struct incise_fixed_texture *to)
{
	(void)variation;
	(void)seed;
	memset(to, 0, sizeof(*to));
	to->step_shift = 12;
	for (int i = 0; i < INCISE_TEXTURE_KNOTS && texture; i++)
		to->knot[i] =
			(int16_t)(texture->point[i % texture->n[0]] * INCISE_TEXTURE_ONE);
}
