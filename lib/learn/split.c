// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Keeping rows back for checking, by whole groups; see incise/train.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <incise/train.h>
#include "shuffle.h"

int incise_split(size_t n, const int *groups, double share, uint64_t seed, bool *check,
		 struct incise_error *err)
{
	size_t n_units = n, taken = 0;
	size_t *order, *count;

	if (!(share > 0 && share < 1))
		return incise_error_set(
			err, EINVAL,
			"the share of check data is %g: it must lie between 0 "
			"and 1",
			share);
	if (groups) {
		n_units = 0;
		for (size_t i = 0; i < n; i++)
			if ((size_t)groups[i] + 1 > n_units)
				n_units = (size_t)groups[i] + 1;
	}
	if (n_units < 2)
		return incise_error_set(
			err, EINVAL,
			"there are %zu %s: at least two are needed to keep some "
			"back for checking",
			n_units, groups ? "groups" : "rows");
	order = malloc(n_units * sizeof(*order));
	count = calloc(n_units, sizeof(*count));
	if (!order || !count) {
		free(order);
		free(count);
		return incise_error_set(err, ENOMEM, "no memory to split %zu rows", n);
	}
	for (size_t i = 0; i < n; i++) {
		count[groups ? (size_t)groups[i] : i]++;
		check[i] = false;
	}
	incise_shuffle(order, n_units, seed);
	/* Take units until the next one would lead further away from the share. */
	for (size_t u = 0; u + 1 < n_units; u++) {
		double with = fabs((double)(taken + count[order[u]]) - share * n);

		if (u && with >= fabs((double)taken - share * n))
			continue;
		taken += count[order[u]];
		count[order[u]] = 0; /* taken */
	}
	for (size_t i = 0; i < n; i++)
		check[i] = !count[groups ? (size_t)groups[i] : i];
	free(order);
	free(count);
	return 0;
}
