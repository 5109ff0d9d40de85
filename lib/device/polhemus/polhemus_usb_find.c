// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Which trackers are on USB, and which one is meant; see polhemus_usb_find.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include "polhemus_usb_find.h"

#define FIRMWARE \
	"has no firmware yet: load the maker's .hex file with fxload, then it appears anew"

int polhemus_usb_wanted(const char *arguments, struct polhemus_usb_name *wanted,
			const struct polhemus_model **model, const char *where,
			struct incise_error *err)
{
	if (polhemus_usb_name_read(arguments, wanted))
		return incise_error_set(
			err, EINVAL,
			"%s: usb:%.60s: expected usb:0f44:0002, and @1-1.2 or "
			"#SERIAL behind it where there are several; correct it",
			where, arguments);
	*model = polhemus_model_find(wanted->vendor, wanted->product);
	if (!*model)
		return incise_error_set(
			err, EINVAL,
			"%s: %04x:%04x is no tracker of Polhemus that is known, "
			"such as 0f44:0002; correct it",
			where, wanted->vendor, wanted->product);
	if (!(*model)->ready)
		return incise_error_set(err, ENODEV, "%s: a %s %04x:%04x " FIRMWARE,
					where, (*model)->name, wanted->vendor,
					wanted->product);
	return 0;
}

void polhemus_usb_place(libusb_device *device, char path[POLHEMUS_USB_PATH_MAX])
{
	uint8_t ports[7];
	int n = libusb_get_port_numbers(device, ports, sizeof(ports));

	polhemus_usb_path(path, libusb_get_bus_number(device), ports, n > 0 ? n : 0);
}

/* 0, "" where it has none; -EACCES: it may not be asked; -EIO: it does not answer. */
static int serial_of(libusb_device *device, const struct libusb_device_descriptor *d,
		     char serial[POLHEMUS_USB_SERIAL_MAX])
{
	libusb_device_handle *handle;
	int n;

	serial[0] = '\0';
	if (!d->iSerialNumber)
		return 0;
	n = libusb_open(device, &handle);
	if (n)
		return n == LIBUSB_ERROR_ACCESS ? -EACCES : -EIO;
	n = libusb_get_string_descriptor_ascii(handle, d->iSerialNumber,
					       (unsigned char *)serial,
					       POLHEMUS_USB_SERIAL_MAX - 1);
	serial[n > 0 ? n : 0] = '\0';
	libusb_close(handle);
	return 0;
}

static bool is_kind(libusb_device *device, const struct polhemus_usb_name *wanted,
		    struct libusb_device_descriptor *d)
{
	return !libusb_get_device_descriptor(device, d) &&
	       d->idVendor == wanted->vendor && d->idProduct == wanted->product;
}

/* @denied: it may be the one, but may not be asked. */
static bool fits(libusb_device *device, const struct polhemus_usb_name *wanted,
		 bool *denied)
{
	char path[POLHEMUS_USB_PATH_MAX], serial[POLHEMUS_USB_SERIAL_MAX];
	struct libusb_device_descriptor d;

	if (!is_kind(device, wanted, &d))
		return false;
	polhemus_usb_place(device, path);
	if (wanted->path[0] && strcmp(path, wanted->path))
		return false;
	if (!wanted->serial[0])
		return true;
	if (serial_of(device, &d, serial) == -EACCES)
		*denied = true;
	return !strcmp(serial, wanted->serial);
}

struct fitting {
	libusb_device *first;
	int n;
	bool denied;
	char where[100]; /* they are: "@1-1, @1-2" */
};

static struct fitting find_fitting(libusb_device **list,
				   const struct polhemus_usb_name *wanted)
{
	struct fitting f = {0};

	for (; *list; list++) {
		char path[POLHEMUS_USB_PATH_MAX];
		size_t at = strlen(f.where);

		if (!fits(*list, wanted, &f.denied))
			continue;
		if (!f.n++)
			f.first = *list;
		polhemus_usb_place(*list, path);
		snprintf(f.where + at, sizeof(f.where) - at, "%s@%s", at ? ", " : "",
			 path);
	}
	return f;
}

/* One of them that waits for its firmware, and where; NULL: there is none. */
static const struct polhemus_model *find_unready(libusb_device **list,
						 char path[POLHEMUS_USB_PATH_MAX])
{
	for (; *list; list++) {
		struct libusb_device_descriptor d;
		const struct polhemus_model *model;

		if (libusb_get_device_descriptor(*list, &d))
			continue;
		model = polhemus_model_find(d.idVendor, d.idProduct);
		if (!model || model->ready)
			continue;
		polhemus_usb_place(*list, path);
		return model;
	}
	return NULL;
}

static int none(libusb_device **list, const char *name, const char *where,
		struct incise_error *err)
{
	char path[POLHEMUS_USB_PATH_MAX];
	const struct polhemus_model *unready = find_unready(list, path);

	if (unready)
		return incise_error_set(err, ENODEV,
					"%s: the %s %04x:%04x at %s " FIRMWARE, where,
					unready->name, POLHEMUS_VENDOR, unready->product,
					path);
	return incise_error_set(
		err, ENODEV,
		"%s: no %s is attached: plug it in and switch it on; incise "
		"info devices lists those that are",
		where, name);
}

int polhemus_usb_refuse(int rc, const char *name, const char *where,
			struct incise_error *err)
{
	switch (rc) {
	case -EACCES:
		return incise_error_set(err, EACCES,
					"%s: no right to open %s: join the group incise, "
					"and see that its udev rules are installed",
					where, name);
	case -EBUSY:
		return incise_error_set(err, EBUSY,
					"%s: another program has %s open: end it first",
					where, name);
	case -ENODEV:
		return incise_error_set(err, ENODEV, "%s: %s went away: check its cable",
					where, name);
	case -ENOMEM:
		return incise_error_set(err, ENOMEM,
					"%s: out of memory: end other programs", where);
	default:
		return incise_error_set(
			err, EIO,
			"%s: %s cannot be talked to: plug it out and in, and "
			"switch it on",
			where, name);
	}
}

static int choose(libusb_device **list, const struct polhemus_usb_name *wanted,
		  const char *was, const char *name, libusb_device **device,
		  const char *where, struct incise_error *err)
{
	struct fitting f = find_fitting(list, wanted);

	/* Where there are several now, it is the one that was there before. */
	if (f.n > 1 && was[0]) {
		struct polhemus_usb_name again = *wanted;

		snprintf(again.path, sizeof(again.path), "%s", was);
		f = find_fitting(list, &again);
	}
	if (!f.n && f.denied)
		return polhemus_usb_refuse(-EACCES, name, where, err);
	if (!f.n)
		return none(list, name, where, err);
	if (f.n > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: %d devices are %s: name one by its place, which "
			"are %s, or by #SERIAL",
			where, f.n, name, f.where);
	*device = libusb_ref_device(f.first);
	return 0;
}

int polhemus_usb_find(libusb_context *context, const struct polhemus_usb_name *wanted,
		      const char *was, const char *name, libusb_device **device,
		      const char *where, struct incise_error *err)
{
	libusb_device **list;
	int rc;

	if (libusb_get_device_list(context, &list) < 0)
		return polhemus_usb_refuse(-ENOMEM, name, where, err);
	rc = choose(list, wanted, was, name, device, where, err);
	libusb_free_device_list(list, 1);
	return rc;
}

/* What rig.conf can say between quotes, whatever a device has there. */
static bool is_plain(const char *serial)
{
	for (; *serial; serial++)
		if (*serial <= ' ' || *serial > '~' || *serial == '"' || *serial == '\\')
			return false;
	return true;
}

static int show(libusb_device *device, const struct libusb_device_descriptor *d,
		const struct polhemus_model *model, incise_scan_found *found,
		void *context)
{
	char path[POLHEMUS_USB_PATH_MAX], serial[POLHEMUS_USB_SERIAL_MAX], id[12];
	struct incise_scan_device seen = {.usable = model->ready};
	bool by_serial;

	polhemus_usb_place(device, path);
	serial_of(device, d, serial);
	snprintf(id, sizeof(id), "%04x:%04x", d->idVendor, d->idProduct);
	/* A serial number stays with it, a place does not. */
	by_serial = serial[0] && is_plain(serial);
	snprintf(seen.device, sizeof(seen.device), "usb:%s%s%s", id,
		 by_serial ? "#" : "@", by_serial ? serial : path);
	if (model->ready)
		snprintf(seen.what, sizeof(seen.what), "%s", model->name);
	else
		snprintf(seen.what, sizeof(seen.what),
			 "%s without firmware: load the maker's .hex file with fxload",
			 model->name);
	incise_scan_tell(&seen, "family", "%s", polhemus_family_name(model->family));
	incise_scan_tell(&seen, "usb_id", "%s", id);
	incise_scan_tell(&seen, "usb_path", "%s", path);
	if (serial[0])
		incise_scan_tell(&seen, "serial", "%s", serial);
	return found(context, &seen);
}

int polhemus_usb_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct polhemus_usb_name wanted = {0};
	libusb_context *usb = NULL;
	libusb_device **list = NULL;
	bool denied;
	int rc = 0;

	if (*arguments && polhemus_usb_name_read(arguments, &wanted))
		return incise_error_set(
			err, EINVAL,
			"usb:%.60s: expected usb: for all, or usb:0f44:0002; "
			"correct it",
			arguments);
	/* A computer without USB has none. */
	if (libusb_init(&usb))
		return 0;
	if (libusb_get_device_list(usb, &list) < 0)
		list = NULL;
	for (libusb_device **at = list; !rc && at && *at; at++) {
		const struct polhemus_model *model;
		struct libusb_device_descriptor d;

		if (libusb_get_device_descriptor(*at, &d))
			continue;
		model = polhemus_model_find(d.idVendor, d.idProduct);
		if (model && (!*arguments || fits(*at, &wanted, &denied)))
			rc = show(*at, &d, model, found, context);
	}
	if (list)
		libusb_free_device_list(list, 1);
	libusb_exit(usb);
	return rc;
}
