/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Search for devices of a backend, to write a rig.conf: "can:can0" lists the drives on that
 * bus. A search changes, moves and sets up nothing.
 */
#ifndef INCISE_SCAN_H
#define INCISE_SCAN_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Largest number of properties of a device. */
#define INCISE_SCAN_PROPERTIES 24

/** A property of a device. */
struct incise_scan_property {
	const char *key; /**< for JSON, lower snake case, unit as suffix: "vendor_id" */
	char text[100];	 /**< text for people, and a string in JSON */
};

/** A device. */
struct incise_scan_device {
	char device[320]; /**< its name in rig.conf, for example "can:can0:0x10" */
	char what[240];	  /**< one line: kind of device and its state */
	bool usable;	  /**< rig.conf may name it */
	int n;
	struct incise_scan_property property[INCISE_SCAN_PROPERTIES];
	char kind[16]; /**< "stepper" …; set by the library */
};

/**
 * Called for each device. @device is valid until the function returns.
 * @return 0; another value ends the scan, and incise_scan() returns it
 */
typedef int incise_scan_found(void *context, const struct incise_scan_device *device);

/**
 * Search for devices. Blocks for at most some seconds.
 *
 * @param kind "stepper", "tracker", "force", "camera" or "haptic"; NULL: any kind of that backend
 * @param spec "BACKEND:ARGUMENTS", for example "can:can0"; NULL: search all backends that need
 *             no arguments; a failing backend is reported as an unusable device with the
 *             reason in its line
 * @param found NULL, with a @spec: search for nothing, and only check that the backend is there
 * @return 0, also if there is none; the value of @found; -EINVAL (@spec), -ENODEV (no such
 *         backend or bus), -EOPNOTSUPP (the backend cannot search), -EACCES, -EBUSY,
 *         -ENETDOWN, -EIO.
 */
INCISE_API int incise_scan(const char *kind, const char *spec, incise_scan_found *found,
			   void *context, struct incise_error *err);

/**
 * For backends: add a property to @device if there is space; text as in printf(3).
 *
 * @param key must be valid as long as @device
 */
INCISE_API void incise_scan_tell(struct incise_scan_device *device, const char *key,
				 const char *format, ...)
	__attribute__((format(printf, 3, 4)));

INCISE_END_DECLS
#endif
