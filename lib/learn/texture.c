// SPDX-License-Identifier: LGPL-2.1-or-later
/* Stand-in until tex-learn's is merged. */
#include <errno.h>
#include <stdlib.h>
#include <math.h>
#include "texture.h"

struct incise_texture *incise_texture_learn(const struct incise_texture_cut *cuts, int n,
					    uint64_t seed, struct incise_watch *watch,
					    struct incise_error *err)
{
	struct incise_texture *t = calloc(1, sizeof(*t));

	(void)watch;
	if (n < 4)
		return free(t), INCISE_ERROR_NULL(err, ENODATA,
						  "%d events: a texture needs 20", n);
	t->info.seed = seed;
	t->info.n_cuts = n;
	t->info.n_events = 40;
	t->info.most = 0.5;
	t->info.up_to_cycles = 10;
	t->step = 0.05;
	t->n_curves = 1;
	t->n = malloc(sizeof(int));
	t->n[0] = (int)cuts[0].n;
	t->point = calloc((size_t)t->n[0], sizeof(double));
	for (int i = 0; i < t->n[0]; i++)
		t->point[i] =
			fmax(-0.5, fmin(0.5, cuts[0].force[i] / cuts[0].model[i] - 1));
	return t;
}
