// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The way to a tracker over USB; see polhemus_usb.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <libusb.h>
#include "polhemus_model.h"
#include "polhemus_usb.h"
#include "polhemus_usb_name.h"

#define WRITE_MS 1000
#define CANCEL_MS 1000
#define FLIGHTS 4 /* transfers on their way, per endpoint: 30 ms at 120 Hz */
#define ENDPOINTS_IN 3
#define PACKETS \
	64 /* that wait; one round of the events completes FLIGHTS × ENDPOINTS_IN */

struct packet {
	int64_t t_ns;
	size_t n;
	unsigned char bytes[POLHEMUS_LINE_CHUNK];
};

struct polhemus_usb {
	struct polhemus_line line;
	struct polhemus_usb_name wanted;
	char path[POLHEMUS_USB_PATH_MAX]; /* where it was */
	libusb_context *context;
	libusb_device_handle *handle;
	int interface;
	unsigned char out;
	bool out_is_interrupt;
	struct libusb_transfer *transfers[ENDPOINTS_IN * FLIGHTS];
	unsigned char buffers[ENDPOINTS_IN * FLIGHTS][POLHEMUS_LINE_CHUNK];
	int in_flight;
	int gone; /* -ENODEV */
	bool stopping;
	struct packet packets[PACKETS];
	unsigned int head, tail;
};

static struct polhemus_usb *of_line(struct polhemus_line *line)
{
	return (struct polhemus_usb *)line;
}

static int64_t now_ns(void)
{
	struct timespec ts;

	clock_gettime(CLOCK_MONOTONIC, &ts);
	return ts.tv_sec * INT64_C(1000000000) + ts.tv_nsec;
}

static void LIBUSB_CALL completed(struct libusb_transfer *transfer)
{
	struct polhemus_usb *usb = transfer->user_data;
	struct packet *packet = &usb->packets[usb->head % PACKETS];

	usb->in_flight--;
	if (transfer->status == LIBUSB_TRANSFER_COMPLETED &&
	    transfer->actual_length > 0 && usb->head - usb->tail < PACKETS) {
		packet->t_ns = now_ns();
		packet->n = (size_t)transfer->actual_length;
		memcpy(packet->bytes, transfer->buffer, packet->n);
		usb->head++;
	}
	if (usb->stopping)
		return;
	if (transfer->status == LIBUSB_TRANSFER_COMPLETED &&
	    !libusb_submit_transfer(transfer))
		usb->in_flight++;
	else
		usb->gone = -ENODEV;
}

/* Until all that is on its way has come back: only then may it be freed. */
static void land(struct polhemus_usb *usb)
{
	struct timeval step = {0, 10000};

	usb->stopping = true;
	for (int i = 0; i < ENDPOINTS_IN * FLIGHTS; i++)
		if (usb->transfers[i])
			libusb_cancel_transfer(usb->transfers[i]);
	for (int i = 0; usb->in_flight && i < CANCEL_MS / 10; i++)
		libusb_handle_events_timeout_completed(usb->context, &step, NULL);
	for (int i = 0; i < ENDPOINTS_IN * FLIGHTS; i++) {
		/* What does not come back is leaked rather than written to when freed. */
		if (usb->transfers[i] && !usb->in_flight)
			libusb_free_transfer(usb->transfers[i]);
		usb->transfers[i] = NULL;
	}
	usb->stopping = false;
}

static void let_go(struct polhemus_usb *usb)
{
	if (usb->handle) {
		land(usb);
		libusb_release_interface(usb->handle, usb->interface);
		libusb_close(usb->handle);
	}
	if (usb->context)
		libusb_exit(usb->context);
	usb->handle = NULL;
	usb->context = NULL;
	usb->gone = -ENODEV;
}

static int fly(struct polhemus_usb *usb, const struct libusb_endpoint_descriptor *in,
	       int which)
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

/* The first interface with a way out and a way in. 0 or -EIO. */
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

/* Claim it and have transfers on their way. 0 or a negative errno. */
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
			rc = fly(usb, e, which++);
	}
	if (config)
		libusb_free_config_descriptor(config);
	return rc;
}

static void path_of(libusb_device *device, char path[POLHEMUS_USB_PATH_MAX])
{
	uint8_t ports[7];
	int n = libusb_get_port_numbers(device, ports, sizeof(ports));

	polhemus_usb_path(path, libusb_get_bus_number(device), ports, n > 0 ? n : 0);
}

/* "" where it has none, or it may not be asked. */
static void serial_of(libusb_device *device, const struct libusb_device_descriptor *d,
		      char serial[POLHEMUS_USB_SERIAL_MAX])
{
	libusb_device_handle *handle;
	int n = 0;

	serial[0] = '\0';
	if (!d->iSerialNumber || libusb_open(device, &handle))
		return;
	n = libusb_get_string_descriptor_ascii(handle, d->iSerialNumber,
					       (unsigned char *)serial,
					       POLHEMUS_USB_SERIAL_MAX - 1);
	serial[n > 0 ? n : 0] = '\0';
	libusb_close(handle);
}

static bool fits(libusb_device *device, const struct polhemus_usb_name *wanted)
{
	char path[POLHEMUS_USB_PATH_MAX], serial[POLHEMUS_USB_SERIAL_MAX];
	struct libusb_device_descriptor d;

	if (libusb_get_device_descriptor(device, &d) || d.idVendor != wanted->vendor ||
	    d.idProduct != wanted->product)
		return false;
	path_of(device, path);
	if (wanted->path[0] && strcmp(path, wanted->path))
		return false;
	if (!wanted->serial[0])
		return true;
	serial_of(device, &d, serial);
	return !strcmp(serial, wanted->serial);
}

/* What @list has of those that fit: how many, the first, and where they are. */
static int find(libusb_device **list, const struct polhemus_usb_name *wanted,
		libusb_device **first, char *where, size_t size)
{
	int n = 0;

	where[0] = '\0';
	for (; *list; list++) {
		char path[POLHEMUS_USB_PATH_MAX];
		size_t at = strlen(where);

		if (!fits(*list, wanted))
			continue;
		if (!n++)
			*first = *list;
		path_of(*list, path);
		snprintf(where + at, size - at, "%s@%s", at ? ", " : "", path);
	}
	return n;
}

/* One of the same family that waits for its firmware, and where; NULL: there is none. */
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
		path_of(*list, path);
		return model;
	}
	return NULL;
}

#define FIRMWARE                                                                            \
	"has no firmware yet: load the maker's .hex file with fxload, as the rule of udev " \
	"that comes with it does, then it appears anew"

static int none(const struct polhemus_usb *usb, libusb_device **list, const char *where,
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
		where, usb->line.name);
}

static int refuse(const struct polhemus_usb *usb, int rc, const char *where,
		  struct incise_error *err)
{
	switch (rc) {
	case -EACCES:
		return incise_error_set(err, EACCES,
					"%s: no right to open %s: join the group incise, "
					"and see that its udev rules are installed",
					where, usb->line.name);
	case -EBUSY:
		return incise_error_set(err, EBUSY,
					"%s: another program has %s open: end it first",
					where, usb->line.name);
	case -ENODEV:
		return incise_error_set(err, ENODEV, "%s: %s went away: check its cable",
					where, usb->line.name);
	case -ENOMEM:
		return incise_error_set(err, ENOMEM, "%s: out of memory", where);
	default:
		return incise_error_set(
			err, EIO,
			"%s: %s cannot be talked to: plug it out and in, and "
			"switch it on",
			where, usb->line.name);
	}
}

/* A context of its own each time: one that is old may not see what was plugged in since. */
static int attach(struct polhemus_usb *usb, const char *where, struct incise_error *err)
{
	libusb_device **list = NULL, *device = NULL;
	char found[100];
	int rc, n;

	usb->gone = 0;
	usb->head = usb->tail = 0;
	usb->in_flight = 0;
	if (libusb_init(&usb->context)) {
		usb->context = NULL;
		return incise_error_set(
			err, EIO, "%s: this computer has no USB that libusb can use",
			where);
	}
	if (libusb_get_device_list(usb->context, &list) < 0)
		return refuse(usb, -ENOMEM, where, err);
	n = find(list, &usb->wanted, &device, found, sizeof(found));
	/* Where there are several now, it is the one that was there before. */
	if (n > 1 && usb->path[0]) {
		struct polhemus_usb_name again = usb->wanted;

		strcpy(again.path, usb->path);
		n = find(list, &again, &device, found, sizeof(found));
	}
	if (!n) {
		rc = none(usb, list, where, err);
	} else if (n > 1) {
		rc = incise_error_set(
			err, EINVAL,
			"%s: %d devices are %s: name one by its place, which "
			"are %s, or by #SERIAL",
			where, n, usb->line.name, found);
	} else {
		rc = take_device(usb, device);
		if (rc)
			refuse(usb, rc, where, err);
		else
			path_of(device, usb->path);
	}
	libusb_free_device_list(list, 1);
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

static ssize_t usb_read(struct polhemus_line *line, void *bytes, size_t size,
			int64_t *t_ns, int timeout_ms)
{
	struct polhemus_usb *usb = of_line(line);
	struct timeval left = {timeout_ms / 1000, timeout_ms % 1000 * 1000};
	struct packet *packet;
	size_t n;

	if (usb->head == usb->tail && !usb->gone &&
	    libusb_handle_events_timeout_completed(usb->context, &left, NULL))
		usb->gone = -ENODEV;
	if (usb->head == usb->tail)
		return usb->gone;
	packet = &usb->packets[usb->tail % PACKETS];
	n = packet->n < size ? packet->n : size;
	memcpy(bytes, packet->bytes, n);
	*t_ns = packet->t_ns;
	/* A reader with less room than a packet gets the rest next time. */
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

	let_go(usb);
	rc = attach(usb, "", NULL);
	if (rc)
		let_go(usb);
	return rc;
}

static void usb_close(struct polhemus_line *line)
{
	struct polhemus_usb *usb = of_line(line);
	bool leaked;

	let_go(usb);
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

struct polhemus_line *polhemus_usb_open(const char *arguments, const char *where,
					struct incise_error *err)
{
	struct polhemus_usb *usb = calloc(1, sizeof(*usb));
	const struct polhemus_model *model;
	int rc = 0;

	if (!usb) {
		incise_error_set(err, ENOMEM, "%s: out of memory", where);
		return NULL;
	}
	usb->line.ops = &ops;
	snprintf(usb->line.name, sizeof(usb->line.name), "%s", arguments);
	if (polhemus_usb_name_read(arguments, &usb->wanted))
		rc = incise_error_set(
			err, EINVAL,
			"%s: usb:%.60s: expected usb:0f44:0002, and @1-1.2 or "
			"#SERIAL behind it where there are several; correct it",
			where, arguments);
	model = rc ? NULL : polhemus_model_find(usb->wanted.vendor, usb->wanted.product);
	if (!rc && !model)
		rc = incise_error_set(
			err, EINVAL,
			"%s: %04x:%04x is no tracker of Polhemus that is known, "
			"such as 0f44:0002; correct it",
			where, usb->wanted.vendor, usb->wanted.product);
	if (!rc && !model->ready)
		rc = incise_error_set(err, ENODEV, "%s: a %s %04x:%04x " FIRMWARE, where,
				      model->name, usb->wanted.vendor,
				      usb->wanted.product);
	if (!rc) {
		usb->line.family = (int)model->family;
		rc = attach(usb, where, err);
	}
	if (!rc)
		return &usb->line;
	usb_close(&usb->line);
	errno = -rc;
	return NULL;
}

static void put(struct incise_scan_device *device, const char *key, const char *text)
{
	struct incise_scan_property *p = &device->property[device->n++];

	p->key = key;
	snprintf(p->text, sizeof(p->text), "%s", text);
}

static int show(libusb_device *device, const struct libusb_device_descriptor *d,
		const struct polhemus_model *model, incise_scan_found *found,
		void *context)
{
	char path[POLHEMUS_USB_PATH_MAX], serial[POLHEMUS_USB_SERIAL_MAX], id[12];
	struct incise_scan_device seen = {0};

	path_of(device, path);
	serial_of(device, d, serial);
	snprintf(id, sizeof(id), "%04x:%04x", d->idVendor, d->idProduct);
	/* A serial number stays with it, a place does not. */
	snprintf(seen.device, sizeof(seen.device), "usb:%s%s%s", id,
		 serial[0] ? "#" : "@", serial[0] ? serial : path);
	if (model->ready)
		snprintf(seen.what, sizeof(seen.what), "%s", model->name);
	else
		snprintf(seen.what, sizeof(seen.what),
			 "%s without firmware: load the maker's .hex file with fxload",
			 model->name);
	put(&seen, "family", polhemus_family_name(model->family));
	put(&seen, "usb_id", id);
	put(&seen, "usb_path", path);
	if (serial[0])
		put(&seen, "serial", serial);
	return found(context, &seen);
}

int polhemus_usb_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err)
{
	struct polhemus_usb_name wanted = {0};
	libusb_context *usb = NULL;
	libusb_device **list = NULL;
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
		if (model && (!*arguments || fits(*at, &wanted)))
			rc = show(*at, &d, model, found, context);
	}
	if (list)
		libusb_free_device_list(list, 1);
	libusb_exit(usb);
	return rc;
}
