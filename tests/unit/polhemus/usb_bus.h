/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A USB that is not there, in the place of libusb: the devices of a table, and transfers that
 * complete when the test says so.
 */
#ifndef INCISE_TEST_POLHEMUS_USB_BUS_H
#define INCISE_TEST_POLHEMUS_USB_BUS_H

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <libusb.h>

#define BUS_DEVICES 8
#define BUS_FLIGHTS 32

struct libusb_device {
	uint16_t vendor, product;
	uint8_t bus, ports[7];
	int n_ports;
	const char *serial;
	int open_error;
	int references;
};

struct bus {
	struct libusb_device device[BUS_DEVICES];
	int n;
	int opened; /* handles */
	int claim_error;
	struct libusb_config_descriptor config;
	/* On their way, the oldest first. */
	struct libusb_transfer *flight[BUS_FLIGHTS];
	int flights;
	int submit_error;
	/* What events bring: called once a round. */
	void (*events)(void);
	unsigned char written[256];
	int n_written, write_error;
};

static struct bus bus;

int libusb_init(libusb_context **context)
{
	static int somewhere;

	*context = (libusb_context *)&somewhere;
	return 0;
}

void libusb_exit(libusb_context *context)
{
}

ssize_t libusb_get_device_list(libusb_context *context, libusb_device ***list)
{
	*list = calloc((size_t)bus.n + 1, sizeof(**list));
	if (!*list)
		return LIBUSB_ERROR_NO_MEM;
	for (int i = 0; i < bus.n; i++)
		(*list)[i] = libusb_ref_device(&bus.device[i]);
	return bus.n;
}

void libusb_free_device_list(libusb_device **list, int unref)
{
	for (int i = 0; unref && list[i]; i++)
		libusb_unref_device(list[i]);
	free(list);
}

libusb_device *libusb_ref_device(libusb_device *device)
{
	device->references++;
	return device;
}

void libusb_unref_device(libusb_device *device)
{
	device->references--;
}

int libusb_get_device_descriptor(libusb_device *device,
				 struct libusb_device_descriptor *d)
{
	*d = (struct libusb_device_descriptor){
		.idVendor = device->vendor,
		.idProduct = device->product,
		.iSerialNumber = device->serial ? 3 : 0,
	};
	return 0;
}

uint8_t libusb_get_bus_number(libusb_device *device)
{
	return device->bus;
}

int libusb_get_port_numbers(libusb_device *device, uint8_t *ports, int n)
{
	if (n < device->n_ports)
		return LIBUSB_ERROR_OVERFLOW;
	memcpy(ports, device->ports, (size_t)device->n_ports);
	return device->n_ports;
}

int libusb_open(libusb_device *device, libusb_device_handle **handle)
{
	if (device->open_error)
		return device->open_error;
	*handle = (libusb_device_handle *)device;
	bus.opened++;
	return 0;
}

void libusb_close(libusb_device_handle *handle)
{
	bus.opened--;
}

int libusb_get_string_descriptor_ascii(libusb_device_handle *handle, uint8_t index,
				       unsigned char *text, int size)
{
	const char *serial = ((struct libusb_device *)handle)->serial;
	int n = (int)strlen(serial);

	n = n < size ? n : size;
	memcpy(text, serial, (size_t)n);
	return index == 3 ? n : LIBUSB_ERROR_PIPE;
}

/* Functions for an open device. */

int libusb_set_auto_detach_kernel_driver(libusb_device_handle *handle, int enable)
{
	return 0;
}

int libusb_claim_interface(libusb_device_handle *handle, int interface)
{
	return bus.claim_error;
}

int libusb_release_interface(libusb_device_handle *handle, int interface)
{
	return 0;
}

int libusb_get_active_config_descriptor(libusb_device *device,
					struct libusb_config_descriptor **config)
{
	*config = &bus.config;
	return 0;
}

void libusb_free_config_descriptor(struct libusb_config_descriptor *config)
{
}

struct libusb_transfer *libusb_alloc_transfer(int packets)
{
	return calloc(1, sizeof(struct libusb_transfer));
}

void libusb_free_transfer(struct libusb_transfer *transfer)
{
	free(transfer);
}

int libusb_submit_transfer(struct libusb_transfer *transfer)
{
	if (bus.submit_error || bus.flights == BUS_FLIGHTS)
		return LIBUSB_ERROR_NO_DEVICE;
	bus.flight[bus.flights++] = transfer;
	return 0;
}

static void bus_give_back(int i, enum libusb_transfer_status status, const void *bytes,
			  int n)
{
	struct libusb_transfer *t = bus.flight[i];

	bus.flights--;
	memmove(&bus.flight[i], &bus.flight[i + 1],
		(size_t)(bus.flights - i) * sizeof(*bus.flight));
	t->status = status;
	t->actual_length = n < t->length ? n : t->length;
	memcpy(t->buffer, bytes, (size_t)t->actual_length);
	t->callback(t);
}

/* The oldest on its way to @endpoint, or 0 for any, comes back; false: there is none. */
static inline bool bus_complete(unsigned char endpoint,
				enum libusb_transfer_status status, const void *bytes,
				int n)
{
	for (int i = 0; i < bus.flights; i++)
		if (!endpoint || bus.flight[i]->endpoint == endpoint) {
			bus_give_back(i, status, bytes, n);
			return true;
		}
	return false;
}

int libusb_cancel_transfer(struct libusb_transfer *transfer)
{
	for (int i = 0; i < bus.flights; i++)
		if (bus.flight[i] == transfer) {
			bus_give_back(i, LIBUSB_TRANSFER_CANCELLED, "", 0);
			return 0;
		}
	return LIBUSB_ERROR_NOT_FOUND;
}

int libusb_handle_events_timeout_completed(libusb_context *context, struct timeval *left,
					   int *completed)
{
	if (bus.events)
		bus.events();
	return 0;
}

int libusb_bulk_transfer(libusb_device_handle *handle, unsigned char endpoint,
			 unsigned char *bytes, int n, int *done, unsigned int timeout_ms)
{
	if (bus.write_error)
		return bus.write_error;
	if (bus.events)
		bus.events();
	for (*done = 0; *done < n && bus.n_written < (int)sizeof(bus.written); ++*done)
		bus.written[bus.n_written++] = bytes[*done];
	return 0;
}

int libusb_interrupt_transfer(libusb_device_handle *handle, unsigned char endpoint,
			      unsigned char *bytes, int n, int *done,
			      unsigned int timeout_ms)
{
	return libusb_bulk_transfer(handle, endpoint, bytes, n, done, timeout_ms);
}

#endif
