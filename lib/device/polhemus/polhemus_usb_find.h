/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Which trackers are on USB, and which one is meant.
 */
#ifndef INCISE_POLHEMUS_USB_FIND_H
#define INCISE_POLHEMUS_USB_FIND_H

#include <libusb.h>
#include <incise/error.h>
#include <incise/scan.h>
#include "polhemus_model.h"
#include "polhemus_usb_name.h"

/*
 * What @arguments of rig.conf name, and the model that it is. -EINVAL: it names none;
 * -ENODEV: one that waits for its firmware.
 */
int polhemus_usb_wanted(const char *arguments, struct polhemus_usb_name *wanted,
			const struct polhemus_model **model, const char *where,
			struct incise_error *err);

/*
 * The one that is meant, which the caller unrefs; @name is what messages call it. Where several
 * fit it is the one at @was, if that is not "". -ENODEV (none, or none with firmware),
 * -EINVAL (several), -EACCES (its serial number may not be asked), -ENOMEM.
 */
int polhemus_usb_find(libusb_context *context, const struct polhemus_usb_name *wanted,
		      const char *was, const char *name, libusb_device **device,
		      const char *where, struct incise_error *err);

/* "…: no right to open NAME: …" of -EACCES, -EBUSY, -ENODEV, -ENOMEM, else of -EIO. */
int polhemus_usb_refuse(int rc, const char *name, const char *where,
			struct incise_error *err);

/* Where it is plugged in. */
void polhemus_usb_place(libusb_device *device, char path[POLHEMUS_USB_PATH_MAX]);

/* All that are attached, those without firmware too; as incise_scan(). */
int polhemus_usb_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err);

#endif
