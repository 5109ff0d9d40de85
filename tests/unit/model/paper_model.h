/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Models of the paper's shape (5 × 4 Gaussians, 0–20 mm, 0–50 mm/s) with consequents by
 * seed, for tests.
 */
#ifndef INCISE_TEST_PAPER_MODEL_H
#define INCISE_TEST_PAPER_MODEL_H

#include <incise/model.h>
#include "../../../lib/base/random.h"

/* Uniform in -1 … 1. */
static inline double paper_random(uint64_t *seed)
{
	incise_random_step(seed);
	return (*seed >> 11) * 0x1p-52 - 1;
}

static inline struct incise_model *paper_model(enum incise_mf_type type, uint64_t seed,
					       double size)
{
	static const struct incise_variable in[] = {{"depth_mm", 0, 20},
						    {"velocity_mm_s", 0, 50}};
	static const struct incise_variable out = {"force_N", 0, 4};
	static const int mfs[] = {5, 4};
	struct incise_model *model = incise_model_new_grid(2, in, mfs, type, &out, NULL);

	for (int r = 0; r < 20; r++) {
		double p[] = {size * paper_random(&seed), size * paper_random(&seed) / 20,
			      size * paper_random(&seed) / 50};

		incise_model_set_consequent(model, r, p);
	}
	return model;
}

/* Move and widen the membership functions by up to a share of their spacing. */
static inline void paper_disturb(struct incise_model *model, uint64_t seed, double share)
{
	for (int i = 0; i < 2; i++)
		for (int k = 0; k < incise_model_info(model)->n_mfs[i]; k++) {
			const struct incise_mf *mf = incise_model_mf(model, i, k);
			int c = mf->type == INCISE_MF_GBELL ? 2 : 1;
			double p[4] = {mf->p[0], mf->p[1], mf->p[2], mf->p[3]};

			p[0] *= 1 + share * paper_random(&seed);
			p[c] += share * p[0] * paper_random(&seed);
			incise_model_set_mf(model, i, k, p);
		}
}

#endif
