// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker on USB, with libusb: "usb:0f44:0002", "usb:0f44:0002@1-1.2" (bus and ports),
 * "usb:0f44:0002#SERIAL".
 *
 *   bulk OUT           commands
 *   bulk IN            replies
 *   interrupt IN       records of a stream (FASTRAK; the others send all on bulk IN)
 *
 * The descriptors say which endpoints these are. Each IN endpoint always has several
 * transfers of one packet in flight, so that no packet is missed while another is read; a
 * packet is timestamped when its transfer completes. When unread packets fill the queue, no
 * transfer is submitted: the device waits, and no packet is dropped.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <libusb.h>
#include "../../base/hex.h"
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "polhemus_model.h"
#include "polhemus_tracker.h"

#define USB_PATH_MAX 32 /* "255-" and 7 ports of 3 digits */
#define USB_SERIAL_MAX 64

/* --- names in rig.conf --- */

struct usb_name {
	uint16_t vendor, product;
	char path[USB_PATH_MAX];     /* "": any */
	char serial[USB_SERIAL_MAX]; /* "": any */
};

/* Four hexadecimal digits. */
static int read_id(const char *text, uint16_t *id)
{
	unsigned int value = 0;

	for (int i = 0; i < 4; i++) {
		int digit = incise_hex_digit(text[i]);

		if (digit < 0)
			return -EINVAL;
		value = value * 16 + (unsigned int)digit;
	}
	*id = (uint16_t)value;
	return 0;
}

/* Skip a number as write_path() writes it, at most 255; NULL: no number. */
static const char *skip_number(const char *text)
{
	int value = 0, n = 0;

	for (; n < 3 && text[n] >= '0' && text[n] <= '9'; n++)
		value = value * 10 + (text[n] - '0');
	return n && text[0] != '0' && value <= 255 ? text + n : NULL;
}

/* "1-1.2" */
static bool is_path(const char *text)
{
	text = skip_number(text);
	if (!text || *text++ != '-')
		return false;
	for (text = skip_number(text); text && *text == '.';)
		text = skip_number(text + 1);
	return text && !*text;
}

/* 0, or -EINVAL with @name as far as it was read. */
static int read_name(const char *text, struct usb_name *name)
{
	size_t n;

	memset(name, 0, sizeof(*name));
	if (read_id(text, &name->vendor) || text[4] != ':' ||
	    read_id(text + 5, &name->product))
		return -EINVAL;
	text += 9;
	if (!*text)
		return 0;
	n = strlen(text + 1);
	if (*text == '#' && n && n < sizeof(name->serial))
		memcpy(name->serial, text + 1, n + 1);
	else if (*text == '@' && n < sizeof(name->path) && is_path(text + 1))
		memcpy(name->path, text + 1, n + 1);
	else
		return -EINVAL;
	return 0;
}

/* "1-1.2" for bus 1, ports 1 and 2; "1-0" for a root hub. */
static void write_path(char path[USB_PATH_MAX], unsigned int bus, const uint8_t *ports,
		       int n)
{
	int at = snprintf(path, USB_PATH_MAX, "%u-%u", bus & 0xff, n > 0 ? ports[0] : 0);

	for (int i = 1; i < n && at <= USB_PATH_MAX - 5; i++)
		at += snprintf(path + at, USB_PATH_MAX - (size_t)at, ".%u", ports[i]);
}

/* --- search --- */

#define FIRMWARE \
	"has no firmware yet: load the manufacturer's .hex file with fxload, then it appears again"

/* The name in @arguments and its model. -EINVAL; -ENODEV: it waits for its firmware. */
static int read_wanted(const char *arguments, struct usb_name *wanted,
		       const struct polhemus_model **model, const char *where,
		       struct incise_error *err)
{
	if (read_name(arguments, wanted))
		return incise_error_set(
			err, EINVAL,
			"%s: usb:%.60s: expected usb:0f44:0002, with @1-1.2 or #SERIAL "
			"if there are several; correct it",
			where, arguments);
	*model = polhemus_model_find(wanted->vendor, wanted->product);
	if (!*model)
		return incise_error_set(
			err, EINVAL,
			"%s: %04x:%04x is not a known Polhemus tracker, for example "
			"0f44:0002; correct it",
			where, wanted->vendor, wanted->product);
	if (!(*model)->ready)
		return incise_error_set(err, ENODEV, "%s: a %s %04x:%04x " FIRMWARE,
					where, (*model)->name, wanted->vendor,
					wanted->product);
	return 0;
}

static void path_of(libusb_device *device, char path[USB_PATH_MAX])
{
	uint8_t ports[7];
	int n = libusb_get_port_numbers(device, ports, sizeof(ports));

	write_path(path, libusb_get_bus_number(device), ports, n > 0 ? n : 0);
}

/* 0, with "" without a serial number; -EACCES; -EIO: it does not answer. */
static int serial_of(libusb_device *device, const struct libusb_device_descriptor *d,
		     char serial[USB_SERIAL_MAX])
{
	libusb_device_handle *handle;
	int n;

	serial[0] = '\0';
	if (!d->iSerialNumber)
		return 0;
	n = libusb_open(device, &handle);
	if (n)
		return n == LIBUSB_ERROR_ACCESS ? -EACCES : -EIO;
	n = libusb_get_string_descriptor_ascii(
		handle, d->iSerialNumber, (unsigned char *)serial, USB_SERIAL_MAX - 1);
	serial[n > 0 ? n : 0] = '\0';
	libusb_close(handle);
	return 0;
}

static bool is_kind(libusb_device *device, const struct usb_name *wanted,
		    struct libusb_device_descriptor *d)
{
	return !libusb_get_device_descriptor(device, d) &&
	       d->idVendor == wanted->vendor && d->idProduct == wanted->product;
}

/* *denied is set where only a serial number that may not be read could decide. */
static bool fits_polhemus_usb(libusb_device *device, const struct usb_name *wanted,
			      bool *denied)
{
	char path[USB_PATH_MAX], serial[USB_SERIAL_MAX];
	struct libusb_device_descriptor d;

	if (!is_kind(device, wanted, &d))
		return false;
	path_of(device, path);
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
	char where[100]; /* "@1-1, @1-2" */
};

static struct fitting find_fitting(libusb_device **list, const struct usb_name *wanted)
{
	struct fitting f = {0};

	for (; *list; list++) {
		char path[USB_PATH_MAX];
		size_t at = strlen(f.where);

		if (!fits_polhemus_usb(*list, wanted, &f.denied))
			continue;
		if (!f.n++)
			f.first = *list;
		path_of(*list, path);
		snprintf(f.where + at, sizeof(f.where) - at, "%s@%s", at ? ", " : "",
			 path);
	}
	return f;
}

/* A tracker that waits for its firmware, and its path; NULL: no such tracker. */
static const struct polhemus_model *find_unready(libusb_device **list,
						 char path[USB_PATH_MAX])
{
	for (; *list; list++) {
		struct libusb_device_descriptor d;
		const struct polhemus_model *model;

		if (libusb_get_device_descriptor(*list, &d))
			continue;
		model = polhemus_model_find(d.idVendor, d.idProduct);
		if (!model || model->ready)
			continue;
		path_of(*list, path);
		return model;
	}
	return NULL;
}

static int none(libusb_device **list, const char *name, const char *where,
		struct incise_error *err)
{
	char path[USB_PATH_MAX];
	const struct polhemus_model *unready = find_unready(list, path);

	if (unready)
		return incise_error_set(err, ENODEV,
					"%s: the %s %04x:%04x at %s " FIRMWARE, where,
					unready->name, POLHEMUS_VENDOR, unready->product,
					path);
	return incise_error_set(
		err, ENODEV,
		"%s: no %s is attached; plug it in and switch it on; `incise info "
		"devices` lists the trackers",
		where, name);
}

/* "…: no right to open NAME: …" for -EACCES, -EBUSY, -ENODEV, -ENOMEM; else for -EIO. */
static int refuse_polhemus_usb(int rc, const char *name, const char *where,
			       struct incise_error *err)
{
	switch (rc) {
	case -EACCES:
		return incise_error_set(err, EACCES,
					"%s: no permission to open %s; join the group "
					"incise, and check that its udev rules are "
					"installed",
					where, name);
	case -EBUSY:
		return incise_error_set(err, EBUSY,
					"%s: another program has %s open; end it first",
					where, name);
	case -ENODEV:
		return incise_error_set(err, ENODEV,
					"%s: %s disconnected; check its "
					"cable",
					where, name);
	case -ENOMEM:
		return incise_error_set(err, ENOMEM,
					"%s: out of memory; end other programs", where);
	default:
		return incise_error_set(
			err, EIO,
			"%s: %s does not respond; unplug it, plug it in, and switch it "
			"on",
			where, name);
	}
}

static int choose_polhemus_usb(libusb_device **list, const struct usb_name *wanted,
			       const char *was, const char *name, libusb_device **device,
			       const char *where, struct incise_error *err)
{
	struct fitting f = find_fitting(list, wanted);

	/* If there are several, take the one that was open before. */
	if (f.n > 1 && was[0]) {
		struct usb_name again = *wanted;

		snprintf(again.path, sizeof(again.path), "%s", was);
		f = find_fitting(list, &again);
	}
	if (!f.n && f.denied)
		return refuse_polhemus_usb(-EACCES, name, where, err);
	if (!f.n)
		return none(list, name, where, err);
	if (f.n > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: %d devices match %s; name one by its port (%s) or by "
			"#SERIAL",
			where, f.n, name, f.where);
	*device = libusb_ref_device(f.first);
	return 0;
}

/*
 * The device named @wanted, which the caller unrefs; messages call it @name. Of several the
 * one at @was is taken, unless that is "". -ENODEV, -EINVAL (several), -EACCES, -ENOMEM.
 */
static int find_device(libusb_context *context, const struct usb_name *wanted,
		       const char *was, const char *name, libusb_device **device,
		       const char *where, struct incise_error *err)
{
	libusb_device **list;
	int rc;

	if (libusb_get_device_list(context, &list) < 0)
		return refuse_polhemus_usb(-ENOMEM, name, where, err);
	rc = choose_polhemus_usb(list, wanted, was, name, device, where, err);
	libusb_free_device_list(list, 1);
	return rc;
}

/* Whether rig.conf can have it between quotes. */
static bool is_plain(const char *serial)
{
	for (; *serial; serial++)
		if (*serial <= ' ' || *serial > '~' || *serial == '"' || *serial == '\\')
			return false;
	return true;
}

static int show_polhemus_usb(libusb_device *device,
			     const struct libusb_device_descriptor *d,
			     const struct polhemus_model *model, incise_scan_found *found,
			     void *context)
{
	char path[USB_PATH_MAX], serial[USB_SERIAL_MAX], id[12];
	struct incise_scan_device seen = {.usable = model->ready};
	bool by_serial;

	path_of(device, path);
	serial_of(device, d, serial);
	snprintf(id, sizeof(id), "%04x:%04x", d->idVendor, d->idProduct);
	/* A serial number stays with the device, a path does not. */
	by_serial = serial[0] && is_plain(serial);
	snprintf(seen.device, sizeof(seen.device), "usb:%s%s%s", id,
		 by_serial ? "#" : "@", by_serial ? serial : path);
	if (model->ready)
		snprintf(seen.what, sizeof(seen.what), "%s", model->name);
	else
		snprintf(seen.what, sizeof(seen.what),
			 "%s without firmware: load the manufacturer's .hex file with "
			 "fxload",
			 model->name);
	incise_scan_tell(&seen, "family", "%s", polhemus_family_name(model->family));
	incise_scan_tell(&seen, "usb_id", "%s", id);
	incise_scan_tell(&seen, "usb_path", "%s", path);
	if (serial[0])
		incise_scan_tell(&seen, "serial", "%s", serial);
	return found(context, &seen);
}

static int usb_scan(const char *arguments, incise_scan_found *found, void *context,
		    struct incise_error *err)
{
	struct usb_name wanted = {0};
	libusb_context *usb = NULL;
	libusb_device **list = NULL;
	bool denied;
	int rc = 0;

	if (*arguments && read_name(arguments, &wanted))
		return incise_error_set(
			err, EINVAL,
			"usb:%.60s: expected usb: for all, or usb:0f44:0002; "
			"correct it",
			arguments);
	/* A computer without USB has no trackers. */
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
		if (model && (!*arguments || fits_polhemus_usb(*at, &wanted, &denied)))
			rc = show_polhemus_usb(*at, &d, model, found, context);
	}
	if (list)
		libusb_free_device_list(list, 1);
	libusb_exit(usb);
	return rc;
}

/* --- line --- */

#define WRITE_MS 1000
#define CANCEL_MS 1000
#define FLIGHTS 4 /* transfers in flight per endpoint: 30 ms at 120 Hz */
#define ENDPOINTS_IN 3
#define PACKETS 64 /* unread */

struct packet {
	int64_t t_ns;
	size_t n;
	unsigned char bytes[POLHEMUS_LINE_CHUNK];
};

struct polhemus_usb {
	struct polhemus_line line;
	struct usb_name wanted;
	char path[USB_PATH_MAX]; /* where it was */
	libusb_context *context;
	libusb_device_handle *handle;
	int interface;
	unsigned char out;
	bool out_is_interrupt;
	struct libusb_transfer *transfers[ENDPOINTS_IN * FLIGHTS];
	unsigned char buffers[ENDPOINTS_IN * FLIGHTS][POLHEMUS_LINE_CHUNK];
	/* Each transfer in flight has a free packet reserved; the others rest. */
	struct libusb_transfer *resting[ENDPOINTS_IN * FLIGHTS];
	int in_flight, n_resting;
	int gone; /* -ENODEV */
	bool stopping;
	struct packet packets[PACKETS];
	unsigned int head, tail;
};

static struct polhemus_usb *of_line(struct polhemus_line *line)
{
	return (struct polhemus_usb *)line;
}

/* Submit it again if a packet is free. */
static void submit(struct polhemus_usb *usb, struct libusb_transfer *transfer)
{
	if (usb->head - usb->tail + (unsigned int)usb->in_flight >= PACKETS)
		usb->resting[usb->n_resting++] = transfer;
	else if (libusb_submit_transfer(transfer))
		usb->gone = -ENODEV;
	else
		usb->in_flight++;
}

static void LIBUSB_CALL completed(struct libusb_transfer *transfer)
{
	struct polhemus_usb *usb = transfer->user_data;
	struct packet *packet = &usb->packets[usb->head % PACKETS];

	usb->in_flight--;
	/* A packet is free: else it would not have been submitted. */
	if (transfer->status == LIBUSB_TRANSFER_COMPLETED &&
	    transfer->actual_length > 0) {
		packet->t_ns = incise_monotonic_ns();
		packet->n = (size_t)transfer->actual_length;
		memcpy(packet->bytes, transfer->buffer, packet->n);
		usb->head++;
	}
	if (usb->stopping)
		return;
	if (transfer->status == LIBUSB_TRANSFER_COMPLETED)
		submit(usb, transfer);
	else
		usb->gone = -ENODEV;
}

/* Cancel all transfers and wait for them: before that they must not be freed. */
static void cancel_all(struct polhemus_usb *usb)
{
	struct timeval step = {0, 10000};

	usb->stopping = true;
	for (int i = 0; i < ENDPOINTS_IN * FLIGHTS; i++)
		if (usb->transfers[i])
			libusb_cancel_transfer(usb->transfers[i]);
	for (int i = 0; usb->in_flight && i < CANCEL_MS / 10; i++)
		libusb_handle_events_timeout_completed(usb->context, &step, NULL);
	for (int i = 0; i < ENDPOINTS_IN * FLIGHTS; i++) {
		/* A transfer that never completes is leaked: libusb might still write to it. */
		if (usb->transfers[i] && !usb->in_flight)
			libusb_free_transfer(usb->transfers[i]);
		usb->transfers[i] = NULL;
	}
	usb->stopping = false;
}

static void usb_detach(struct polhemus_usb *usb)
{
	if (usb->handle) {
		cancel_all(usb);
		libusb_release_interface(usb->handle, usb->interface);
		libusb_close(usb->handle);
	}
	if (usb->context)
		libusb_exit(usb->context);
	usb->handle = NULL;
	usb->context = NULL;
	usb->gone = -ENODEV;
}

static int start_transfers(struct polhemus_usb *usb,
			   const struct libusb_endpoint_descriptor *in, int which)
{
	bool interrupt = (in->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) ==
			 LIBUSB_TRANSFER_TYPE_INTERRUPT;
	int size = in->wMaxPacketSize & 0x7ff;

	if (size < 1 || size > POLHEMUS_LINE_CHUNK)
		size = POLHEMUS_LINE_CHUNK;
	for (int i = which * FLIGHTS; i < (which + 1) * FLIGHTS; i++) {
		struct libusb_transfer *t = usb->transfers[i] = libusb_alloc_transfer(0);

		if (!t)
			return -ENOMEM;
		if (interrupt)
			libusb_fill_interrupt_transfer(t, usb->handle,
						       in->bEndpointAddress,
						       usb->buffers[i], size, completed,
						       usb, 0);
		else
			libusb_fill_bulk_transfer(t, usb->handle, in->bEndpointAddress,
						  usb->buffers[i], size, completed, usb,
						  0);
		if (libusb_submit_transfer(t))
			return -EIO;
		usb->in_flight++;
	}
	return 0;
}

/* The first interface with an OUT and an IN endpoint. 0 or -EIO. */
static int choose_endpoints(struct polhemus_usb *usb, libusb_device *device,
			    struct libusb_config_descriptor **config,
			    const struct libusb_interface_descriptor **chosen)
{
	if (libusb_get_active_config_descriptor(device, config))
		return -EIO;
	for (int i = 0; i < (*config)->bNumInterfaces; i++) {
		const struct libusb_interface_descriptor *d;
		bool out = false, in = false;

		if ((*config)->interface[i].num_altsetting < 1)
			continue;
		d = &(*config)->interface[i].altsetting[0];
		for (int k = 0; k < d->bNumEndpoints; k++) {
			const struct libusb_endpoint_descriptor *e = &d->endpoint[k];
			int type = e->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK;

			if (type != LIBUSB_TRANSFER_TYPE_BULK &&
			    type != LIBUSB_TRANSFER_TYPE_INTERRUPT)
				continue;
			if (e->bEndpointAddress & LIBUSB_ENDPOINT_IN) {
				in = true;
			} else if (!out) {
				out = true;
				usb->out = e->bEndpointAddress;
				usb->out_is_interrupt =
					type == LIBUSB_TRANSFER_TYPE_INTERRUPT;
			}
		}
		if (in && out) {
			usb->interface = d->bInterfaceNumber;
			*chosen = d;
			return 0;
		}
	}
	libusb_free_config_descriptor(*config);
	*config = NULL;
	return -EIO;
}

static int from_libusb(int rc)
{
	switch (rc) {
	case LIBUSB_SUCCESS:
		return 0;
	case LIBUSB_ERROR_ACCESS:
		return -EACCES;
	case LIBUSB_ERROR_BUSY:
		return -EBUSY;
	case LIBUSB_ERROR_NO_DEVICE:
	case LIBUSB_ERROR_NOT_FOUND:
		return -ENODEV;
	case LIBUSB_ERROR_NO_MEM:
		return -ENOMEM;
	default:
		return -EIO;
	}
}

/* Claim it and start transfers. 0 or a negative errno. */
static int take_device(struct polhemus_usb *usb, libusb_device *device)
{
	const struct libusb_interface_descriptor *interface = NULL;
	struct libusb_config_descriptor *config = NULL;
	int rc, which = 0;

	rc = choose_endpoints(usb, device, &config, &interface);
	if (!rc)
		rc = from_libusb(libusb_open(device, &usb->handle));
	if (!rc) {
		libusb_set_auto_detach_kernel_driver(usb->handle, 1);
		rc = from_libusb(libusb_claim_interface(usb->handle, usb->interface));
	}
	for (int k = 0; !rc && k < interface->bNumEndpoints && which < ENDPOINTS_IN;
	     k++) {
		const struct libusb_endpoint_descriptor *e = &interface->endpoint[k];
		int type = e->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK;

		if (e->bEndpointAddress & LIBUSB_ENDPOINT_IN &&
		    (type == LIBUSB_TRANSFER_TYPE_BULK ||
		     type == LIBUSB_TRANSFER_TYPE_INTERRUPT))
			rc = start_transfers(usb, e, which++);
	}
	if (config)
		libusb_free_config_descriptor(config);
	return rc;
}

/* A new context each time: an old one may not see devices plugged in since. */
static int usb_attach(struct polhemus_usb *usb, const char *where,
		      struct incise_error *err)
{
	libusb_device *device = NULL;
	int rc;

	usb->gone = 0;
	usb->head = usb->tail = 0;
	usb->in_flight = 0;
	usb->n_resting = 0;
	if (libusb_init(&usb->context)) {
		usb->context = NULL;
		return incise_error_set(
			err, EIO,
			"%s: libusb finds no USB on this computer; load the driver of "
			"its controller, or use a serial port",
			where);
	}
	rc = find_device(usb->context, &usb->wanted, usb->path, usb->line.name, &device,
			 where, err);
	if (rc)
		return rc;
	rc = take_device(usb, device);
	if (rc)
		refuse_polhemus_usb(rc, usb->line.name, where, err);
	else
		path_of(device, usb->path);
	libusb_unref_device(device);
	return rc;
}

static int usb_write(struct polhemus_line *line, const void *bytes, size_t n)
{
	struct polhemus_usb *usb = of_line(line);
	unsigned char copy[256]; /* libusb does not say const */
	const char *at = bytes;

	while (n) {
		int some = n < sizeof(copy) ? (int)n : (int)sizeof(copy), done = 0, rc;

		if (usb->gone || !usb->handle)
			return -ENODEV;
		memcpy(copy, at, (size_t)some);
		rc = (usb->out_is_interrupt ? libusb_interrupt_transfer
					    : libusb_bulk_transfer)(
			usb->handle, usb->out, copy, some, &done, WRITE_MS);
		if (rc || done <= 0)
			return rc == LIBUSB_ERROR_NO_DEVICE ? -ENODEV : -EIO;
		at += done;
		n -= (size_t)done;
	}
	return 0;
}

/*
 * Wait until a packet is there, the device is gone or the time is over; other events
 * return early.
 */
static void await_packet(struct polhemus_usb *usb, int timeout_ms)
{
	int64_t end_ns = incise_monotonic_ns() + timeout_ms * INT64_C(1000000), left_ns;
	struct timeval left;

	while (usb->n_resting && usb->head == usb->tail && !usb->gone)
		submit(usb, usb->resting[--usb->n_resting]);
	while (usb->head == usb->tail && !usb->gone &&
	       (left_ns = end_ns - incise_monotonic_ns()) > 0) {
		left = (struct timeval){left_ns / 1000000000,
					left_ns % 1000000000 / 1000};
		if (libusb_handle_events_timeout_completed(usb->context, &left, NULL))
			usb->gone = -ENODEV;
	}
}

static ssize_t usb_read(struct polhemus_line *line, void *bytes, size_t size,
			int64_t *t_ns, int timeout_ms)
{
	struct polhemus_usb *usb = of_line(line);
	struct packet *packet;
	size_t n;

	await_packet(usb, timeout_ms);
	if (usb->head == usb->tail)
		return usb->gone;
	packet = &usb->packets[usb->tail % PACKETS];
	n = packet->n < size ? packet->n : size;
	memcpy(bytes, packet->bytes, n);
	*t_ns = packet->t_ns;
	/* The next read gets the rest of the packet. */
	packet->n -= n;
	memmove(packet->bytes, packet->bytes + n, packet->n);
	if (!packet->n)
		usb->tail++;
	return (ssize_t)n;
}

static int usb_reopen(struct polhemus_line *line)
{
	struct polhemus_usb *usb = of_line(line);
	int rc;

	usb_detach(usb);
	rc = usb_attach(usb, "", NULL);
	if (rc)
		usb_detach(usb);
	return rc;
}

static void usb_close(struct polhemus_line *line)
{
	struct polhemus_usb *usb = of_line(line);
	bool leaked;

	usb_detach(usb);
	leaked = usb->in_flight;
	if (!leaked)
		free(usb);
}

static const struct polhemus_line_ops ops = {
	.write = usb_write,
	.read = usb_read,
	.reopen = usb_reopen,
	.close = usb_close,
};

static struct polhemus_line *usb_open(const char *arguments, const char *where,
				      struct incise_error *err)
{
	struct polhemus_usb *usb = calloc(1, sizeof(*usb));
	const struct polhemus_model *model = NULL;
	int rc;

	if (!usb) {
		refuse_polhemus_usb(-ENOMEM, arguments, where, err);
		return NULL;
	}
	usb->line.ops = &ops;
	usb->line.grain_ns = 1000000; /* frames of full speed */
	snprintf(usb->line.name, sizeof(usb->line.name), "%s", arguments);
	rc = read_wanted(arguments, &usb->wanted, &model, where, err);
	if (!rc) {
		usb->line.family = (int)model->family;
		rc = usb_attach(usb, where, err);
	}
	if (!rc)
		return &usb->line;
	usb_close(&usb->line);
	errno = -rc;
	return NULL;
}

static void *open_tracker(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	struct polhemus_line *line = usb_open(request->arguments, request->where, err);

	return line ? polhemus_tracker_open(line, request->tracker, &POLHEMUS_TIMES,
					    request->where, err)
		    : NULL;
}

INCISE_BACKEND(incise_tracker_usb, "tracker", "usb", .open = open_tracker,
	       .scan = usb_scan);
