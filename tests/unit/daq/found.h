/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Devices found by a scan, kept for a test. */
#ifndef INCISE_TEST_DAQ_FOUND_H
#define INCISE_TEST_DAQ_FOUND_H

#include <string.h>
#include <incise/scan.h>

struct found {
	int n;
	int answer; /* to the scan */
	struct incise_scan_device device[4];
};

static inline int keep(void *context, const struct incise_scan_device *device)
{
	struct found *found = context;

	if (found->n < 4)
		found->device[found->n] = *device;
	found->n++;
	return found->answer;
}

/* "" where there is none. */
static inline const char *property_of(const struct incise_scan_device *device,
				      const char *key)
{
	for (int i = 0; i < device->n; i++)
		if (!strcmp(device->property[i].key, key))
			return device->property[i].text;
	return "";
}

#endif
