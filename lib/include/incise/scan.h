/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Which devices there are behind a backend, for who writes a rig.conf: "can:can0" lists the
 * drives on that bus. Nothing that is found is changed, moved or set up.
 */
#ifndef INCISE_SCAN_H
#define INCISE_SCAN_H

#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Properties that a device has at most. */
#define INCISE_SCAN_PROPERTIES 24

/** Something known of a device. */
struct incise_scan_property {
	const char *key; /**< "vendor_id": for JSON, lower snake case, unit as suffix */
	char text[100];	 /**< for people, and for JSON a string */
};

/** A device. */
struct incise_scan_device {
	char device[320]; /**< what rig.conf names it by, such as "can:can0:0x10" */
	char what[240];	  /**< a line: what it is, and how it is */
	bool usable; /**< rig.conf may name it; false: it is there, but of no use here */
	int n;
	struct incise_scan_property property[INCISE_SCAN_PROPERTIES];
	char kind[16]; /**< "stepper" …; the library's to fill in */
};

/**
 * Called for each device that is found. @device lives until it returns.
 * @return 0; another value ends the scan, which returns it
 */
typedef int incise_scan_found(void *context, const struct incise_scan_device *device);

/**
 * Look for devices. Blocks, for some seconds at most.
 *
 * @param kind "stepper", "tracker", "force" or "camera"; NULL: whichever has that backend
 * @param spec "BACKEND:ARGUMENTS", such as "can:can0"
 * @return 0, also where none was found; what @found returned; -EINVAL (@spec),
 *         -ENODEV (no such backend, or bus), -EOPNOTSUPP (the backend cannot look),
 *         -EACCES, -EBUSY, -ENETDOWN, -EIO.
 */
INCISE_API int incise_scan(const char *kind, const char *spec, incise_scan_found *found,
			   void *context, struct incise_error *err);

/**
 * Look for all that is attached: each backend of each kind that can look without being told
 * where. One that fails is told as a device that is not usable, whose line says why.
 *
 * @return 0; what @found returned; -ENOMEM
 */
INCISE_API int incise_scan_all(incise_scan_found *found, void *context);

/**
 * For backends: add a property to @device, its text as printf(3). One too many is left out.
 *
 * @param key is kept as it is
 */
INCISE_API void incise_scan_tell(struct incise_scan_device *device, const char *key,
				 const char *format, ...)
	__attribute__((format(printf, 3, 4)));

INCISE_END_DECLS
#endif
