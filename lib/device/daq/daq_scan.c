// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What is told of a converter that was found; see daq_scan.h.
 */
#include <stdarg.h>
#include <stdio.h>
#include "daq_scan.h"

void daq_scan_add(struct incise_scan_device *device, const char *key, const char *format,
		  ...)
{
	struct incise_scan_property *property;
	va_list args;

	if (device->n >= INCISE_SCAN_PROPERTIES)
		return;
	property = &device->property[device->n++];
	property->key = key;
	va_start(args, format);
	vsnprintf(property->text, sizeof(property->text), format, args);
	va_end(args);
}
