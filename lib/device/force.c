// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force channel, whatever stands behind it; see incise/force.h.
 */
#include <stdio.h>
#include <incise/backend.h>

int incise_force_read(struct incise_force *force, struct incise_force_sample *samples,
		      int n)
{
	return force->ops->read(force, samples, n);
}

void incise_force_info(const struct incise_force *force, struct incise_force_info *info)
{
	force->ops->info(force, info);
}

uint64_t incise_force_lost(const struct incise_force *force)
{
	return force->ops->lost(force);
}

int incise_force_cause(struct incise_force *force, char *text, size_t size)
{
	return force->ops->cause ? force->ops->cause(force, text, size)
				 : snprintf(text, size, "%s", "");
}
