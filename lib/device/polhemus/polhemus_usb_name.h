/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What rig.conf calls a tracker on USB: "0f44:0002", and "@BUS-PORT.PORT" or "#SERIAL"; pure.
 */
#ifndef INCISE_POLHEMUS_USB_NAME_H
#define INCISE_POLHEMUS_USB_NAME_H

#include <stddef.h>
#include <stdint.h>

#define POLHEMUS_USB_PATH_MAX 32 /* "255-" and 7 ports of 3 digits */
#define POLHEMUS_USB_SERIAL_MAX 64

struct polhemus_usb_name {
	uint16_t vendor, product;
	char path[POLHEMUS_USB_PATH_MAX];     /* "": any */
	char serial[POLHEMUS_USB_SERIAL_MAX]; /* "": any */
};

/* 0; -EINVAL, and what was read of it in @name. */
int polhemus_usb_name_read(const char *text, struct polhemus_usb_name *name);

/* "1-1.2" of bus 1, ports 1 and 2; a root hub is "1-0". */
void polhemus_usb_path(char path[POLHEMUS_USB_PATH_MAX], unsigned int bus,
		       const uint8_t *ports, int n);

#endif
