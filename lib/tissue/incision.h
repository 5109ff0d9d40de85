/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside of an incision: the members that lib/scene sets. See incise/incision.h.
 */
#ifndef INCISE_TISSUE_INCISION_H
#define INCISE_TISSUE_INCISION_H

#include "tick.h"

/* @param side of blade and handle, in their frame. @return incision; NULL with errno ENOMEM. */
struct incise_incision *incise_incision_make(
	const struct incise_double_incision_setup *setup, const double side[3],
	struct incise_error *err);

/* Memory that it holds, bytes. */
size_t incise_incision_memory(const struct incise_incision *incision);

/* Its cuts, for ticks. Valid until it is freed. */
struct incise_double_incision *incise_incision_of(struct incise_incision *incision);

#endif
