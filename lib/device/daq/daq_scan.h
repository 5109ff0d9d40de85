/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What is told of a converter that was found.
 */
#ifndef INCISE_DAQ_SCAN_H
#define INCISE_DAQ_SCAN_H

#include <incise/scan.h>

/* Adds a property; one too many is left out. */
void daq_scan_add(struct incise_scan_device *device, const char *key, const char *format,
		  ...) __attribute__((format(printf, 3, 4)));

#endif
