/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Premises by Levenberg–Marquardt on the variable-projected problem: the consequents are
 * always the best ones (ridge least squares) for the premises at hand, so only the
 * premises are searched. Inputs are scaled to [0, 1].
 */
#ifndef INCISE_VARPRO_H
#define INCISE_VARPRO_H

#include "basis.h"
#include "watch.h"

struct incise_varpro {
	const struct incise_pairs *pairs;
	const struct incise_ridge *ridge; /* of the consequents */
	int epochs; /* solutions at most; the first is that of the premises given */
	/*
	 * Called after each epoch, from 1, with its premises and consequents; false ends
	 * the search. May be NULL.
	 */
	bool (*each)(void *user, int epoch, const struct incise_basis *basis,
		     const double *consequents);
	void *user;
	struct incise_watch *watch; /* ends the search; or NULL */
	int run;		    /* result: the last epoch */
};

/*
 * Search from the premises in basis and leave the last ones there, with consequents
 * (n_rules·(n_inputs+1)). It ends before its epochs where no step leads down. Returns 0,
 * -EDOM, -ENOMEM.
 */
int incise_varpro_run(struct incise_basis *basis, double *consequents,
		      struct incise_varpro *varpro);

#endif
