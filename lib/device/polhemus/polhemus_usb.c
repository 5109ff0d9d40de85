// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The way to a tracker over USB; see polhemus_usb.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <libusb.h>
#include "../../base/monotonic.h"
#include "polhemus_usb.h"
#include "polhemus_usb_find.h"

#define WRITE_MS 1000
#define CANCEL_MS 1000
#define FLIGHTS 4 /* transfers on their way, per endpoint: 30 ms at 120 Hz */
#define ENDPOINTS_IN 3
#define PACKETS 64 /* that wait */

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
	/* Each that is on its way has a place that waits for it; else it rests. */
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

/* On its way again, if there is a place for what it brings. */
static void send_off(struct polhemus_usb *usb, struct libusb_transfer *transfer)
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
	/* There is room: it was only sent off because there was. */
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
		send_off(usb, transfer);
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

/* A context of its own each time: one that is old may not see what was plugged in since. */
static int attach(struct polhemus_usb *usb, const char *where, struct incise_error *err)
{
	libusb_device *device;
	int rc;

	usb->gone = 0;
	usb->head = usb->tail = 0;
	usb->in_flight = 0;
	usb->n_resting = 0;
	if (libusb_init(&usb->context)) {
		usb->context = NULL;
		return incise_error_set(
			err, EIO,
			"%s: this computer has no USB that libusb can use: load the "
			"driver of its controller, or use a serial line",
			where);
	}
	rc = polhemus_usb_find(usb->context, &usb->wanted, usb->path, usb->line.name,
			       &device, where, err);
	if (rc)
		return rc;
	rc = take_device(usb, device);
	if (rc)
		polhemus_usb_refuse(rc, usb->line.name, where, err);
	else
		polhemus_usb_place(device, usb->path);
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

/* Until a packet waits, or it is gone, or time is over: other events wake it as well. */
static void await_packet(struct polhemus_usb *usb, int timeout_ms)
{
	int64_t end_ns = incise_monotonic_ns() + timeout_ms * INT64_C(1000000), left_ns;
	struct timeval left;

	while (usb->n_resting && usb->head == usb->tail && !usb->gone)
		send_off(usb, usb->resting[--usb->n_resting]);
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
	int rc;

	if (!usb) {
		polhemus_usb_refuse(-ENOMEM, arguments, where, err);
		return NULL;
	}
	usb->line.ops = &ops;
	usb->line.grain_ns = 1000000; /* frames of full speed */
	snprintf(usb->line.name, sizeof(usb->line.name), "%s", arguments);
	rc = polhemus_usb_wanted(arguments, &usb->wanted, &model, where, err);
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
