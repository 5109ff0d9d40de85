// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The same in each backend; see backends.h and haptic_backend.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "backends.h"
#include "haptic_backend.h"

#define CACHE_LINE 64

void *incise_device_new(size_t size, const char *where, struct incise_error *err)
{
	void *device = aligned_alloc(CACHE_LINE, size + CACHE_LINE - size % CACHE_LINE);

	if (!device)
		return INCISE_ERROR_NULL(err, ENOMEM,
					 "%s: out of memory; end other programs", where);
	return memset(device, 0, size);
}

void *incise_haptic_opened(struct incise_haptic *haptic, int rc)
{
	if (!rc)
		return haptic;
	haptic->ops->close(haptic);
	errno = -rc;
	return NULL;
}

int incise_haptic_end(struct incise_haptic *haptic, int error, const char *format, ...)
{
	va_list args;

	if (haptic->error)
		return haptic->error;
	haptic->error = error;
	va_start(args, format);
	vsnprintf(haptic->cause, sizeof(haptic->cause), format, args);
	va_end(args);
	return error;
}

void incise_haptic_limit(double to[3], const double from[3], double share, double most)
{
	double length = v3_length(from), factor = most > 0 ? share : 0;

	if (length * factor > most)
		factor = most / length;
	for (int i = 0; i < 3; i++)
		to[i] = factor > 0 ? factor * from[i] : 0;
}
