/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A reference implementation: another project's evaluator, which incise bench measures next to
 * incise's own, on the same model in the same process. It is a shared object of its own, built
 * where its library's headers are, and exports one `struct reference incise_reference`.
 */
#ifndef INCISE_REFERENCE_H
#define INCISE_REFERENCE_H

#include <stddef.h>
#include <incise/model.h>

INCISE_BEGIN_DECLS

struct reference {
	const char *version; /* of the library */

	/* The model in the library's own form, in full precision; NULL with a line in why. */
	void *(*open)(const struct incise_model *model, char *why, size_t size);

	/* Evaluate n points, an evaluation's inputs side by side. */
	void (*run)(void *handle, const double *x, double *y, size_t n);
};

extern INCISE_API const struct reference incise_reference;

INCISE_END_DECLS
#endif
