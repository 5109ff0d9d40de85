/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Search for devices behind a backend, to write a rig.conf: "can:can0" lists the drives
 * on that bus. Nothing is changed, moved or set up.
 */
#ifndef INCISE_SCAN_H
#define INCISE_SCAN_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Most properties of a device. */
#define INCISE_SCAN_PROPERTIES 24

/** A property of a device. */
struct incise_scan_property {
	const char *key; /**< "vendor_id": for JSON, lower snake case, unit as suffix */
	char text[100];	 /**< for people, and for JSON a string */
};

/** A device. */
struct incise_scan_device {
	char device[320]; /**< its name in rig.conf, for example "can:can0:0x10" */
	char what[240];	  /**< a line: kind of device and its state */
	bool usable;	  /**< rig.conf may name it */
	int n;
	struct incise_scan_property property[INCISE_SCAN_PROPERTIES];
	char kind[16]; /**< "stepper" …; set by the library */
};

/**
 * Called for each device that is found. @device is valid until it returns.
 * @return 0; another value ends the scan, which returns it
 */
typedef int incise_scan_found(void *context, const struct incise_scan_device *device);

/**
 * Look for devices. Blocks, for some seconds at most.
 *
 * @param kind "stepper", "tracker", "force" or "camera"; NULL: any that has that backend
 * @param spec "BACKEND:ARGUMENTS", for example "can:can0"; NULL: search all backends that need
 *        no arguments; one that fails is reported as a device that is not usable, with the
 *        reason in its line
 * @return 0, also where none was found; what @found returned; -EINVAL (@spec),
 *         -ENODEV (no such backend, or bus), -EOPNOTSUPP (the backend cannot search),
 *         -EACCES, -EBUSY, -ENETDOWN, -EIO.
 */
INCISE_API int incise_scan(const char *kind, const char *spec, incise_scan_found *found,
			   void *context, struct incise_error *err);

/**
 * For backends: add a property to @device, its text as printf(3), if there is space.
 *
 * @param key must live as long as @device
 */
INCISE_API void incise_scan_tell(struct incise_scan_device *device, const char *key,
				 const char *format, ...)
	__attribute__((format(printf, 3, 4)));

INCISE_END_DECLS
#endif
