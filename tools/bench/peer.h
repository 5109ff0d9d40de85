/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A peer: another project's evaluator, for incise bench to measure beside incise's own,
 * on the same model in the same process. A peer is a shared object of its own, built
 * where its library's headers are, and exports one `struct peer incise_peer`.
 */
#ifndef INCISE_PEER_H
#define INCISE_PEER_H

#include <stddef.h>
#include <incise/model.h>

INCISE_BEGIN_DECLS

struct peer {
	const char *name;    /* of its row */
	const char *version; /* of the library */

	/* The model in the peer's own form, in full precision; NULL with a line in why. */
	void *(*open)(const struct incise_model *model, char *why, size_t size);

	/* Evaluate n points, an evaluation's inputs side by side. */
	void (*run)(void *peer, const double *x, double *y, size_t n);
	void (*close)(void *peer);
};

extern INCISE_API const struct peer incise_peer;

INCISE_END_DECLS
#endif
