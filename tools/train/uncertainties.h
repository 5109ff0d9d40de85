/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Columns of uncertainties of incise train: the parts of incise export --uncertainty parts, of the
 * columns that a model is learnt from.
 */
#ifndef TRAIN_UNCERTAINTIES_H
#define TRAIN_UNCERTAINTIES_H

#include <incise/budget.h>
#include <incise/propagation.h>

/* Behind the columns of a model. */
struct uncertainties {
	const char *columns[INCISE_BUDGET_PARTS];
	struct incise_propagation_part parts[INCISE_BUDGET_PARTS];
	int n;
};

enum uncertainties_wanted {
	UNCERTAINTIES_FOUND, /* of files that have them */
	UNCERTAINTIES_NONE,
	UNCERTAINTIES_PARTS
};

/*
 * Find those of n_inputs inputs and the output that all sources have, n 0 for none. Fails the
 * program where some sources have others than the rest, or with UNCERTAINTIES_PARTS one has none.
 */
void uncertainties_find(struct uncertainties *found, enum uncertainties_wanted wanted,
			const char *const *columns, int n_inputs, char **paths, int n);

#endif
