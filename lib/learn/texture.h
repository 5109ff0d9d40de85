/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Learning of a texture (incise/texture.h) from cuts at full rate. */
#ifndef INCISE_LEARN_TEXTURE_H
#define INCISE_LEARN_TEXTURE_H

#include "../model/texture.h"
#include "watch.h"

/* Rows of a cut in which the blade advances, in their order; the way rises from row to row. */
struct incise_texture_cut {
	const struct incise_texture_row {
		double way, force, model; /* the latter: force by the model */
	} * row;
	size_t n;
};

/*
 * Learn a texture; unit, checksum, variation and length are the caller's. NULL with errno ENODATA (too few
 * events), ENOMEM, ECANCELED.
 */
struct incise_texture *incise_texture_learn(const struct incise_texture_cut *cuts, int n,
					    uint64_t seed, struct incise_watch *watch,
					    struct incise_error *err);

#endif
