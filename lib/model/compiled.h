/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A compiled model with the bytes that it reads.
 */
#ifndef INCISE_COMPILED_H
#define INCISE_COMPILED_H

#include <incise/fixed.h>

struct incise_compiled {
	struct incise_fixed fx; /* first: what users hold */
	uint64_t blob[];	/* aligned to 8 */
};

#endif
