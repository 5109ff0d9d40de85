/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The group `tissue` of a scene with every force that the library has, for
 * tests that exercise all of them.
 */
#ifndef INCISE_TEST_ALL_FORCES_H
#define INCISE_TEST_ALL_FORCES_H

#include <stdio.h>
#include <string.h>
#include "../../lib/scene/forces.h"

/* Write "tissue = { KEY = VALUE; … @more };" with @times the constants of skin. The force
 * called @without is left out, or none where that is NULL. Returns the length, or -1 where
 * @size is too small. */
static inline int all_forces(char *text, size_t size, double times, const char *without,
			     const char *more)
{
	size_t n = (size_t)snprintf(text, size, "tissue = {");

	for (int i = 0; i < incise_n_tissue_forces && n < size; i++) {
		const struct incise_tissue_force *force = &incise_tissue_forces[i];

		if (without && !strcmp(without, force->name))
			continue;
		for (int k = 0; k < INCISE_FORCE_NUMBERS && n < size; k++)
			if (force->number[k].key)
				n += (size_t)snprintf(text + n, size - n, " %s = %#.9g;",
						      force->number[k].key,
						      (k ? 1 : times) *
							      force->number[k].skin);
	}
	if (n < size)
		n += (size_t)snprintf(text + n, size - n, " %s };\n", more);
	return n < size ? (int)n : -1;
}

#endif
