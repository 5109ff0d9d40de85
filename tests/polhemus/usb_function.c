// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The emulator as a function of USB; see usb_function.h. A thread for each endpoint, as reads
 * and writes of FunctionFS block:
 *
 *   ep0 (events)   ep1 bulk OUT -> commands   ep2 bulk IN <- replies   ep3 interrupt IN <- records
 */
#include <endian.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <linux/usb/functionfs.h>
#include "../clock.h"
#include "usb_function.h"

#define PACKET 64 /* a FASTRAK is full speed */

struct descriptors {
	struct usb_interface_descriptor interface;
	struct usb_endpoint_descriptor_no_audio out, in, interrupt;
} __attribute__((packed));

static struct emulator *emulator;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static const char *folder;

static struct usb_endpoint_descriptor_no_audio endpoint(int address, int type, int size)
{
	return (struct usb_endpoint_descriptor_no_audio){
		.bLength = sizeof(struct usb_endpoint_descriptor_no_audio),
		.bDescriptorType = USB_DT_ENDPOINT,
		.bEndpointAddress = (uint8_t)address,
		.bmAttributes = (uint8_t)type,
		.wMaxPacketSize = htole16((uint16_t)size),
		.bInterval = type == USB_ENDPOINT_XFER_INT ? 1 : 0,
	};
}

static struct descriptors describe(int bulk)
{
	return (struct descriptors){
		.interface = {.bLength = sizeof(struct usb_interface_descriptor),
			      .bDescriptorType = USB_DT_INTERFACE,
			      .bNumEndpoints = 3,
			      .bInterfaceClass = USB_CLASS_VENDOR_SPEC,
			      .iInterface = 1},
		.out = endpoint(USB_DIR_OUT | 2, USB_ENDPOINT_XFER_BULK, bulk),
		.in = endpoint(USB_DIR_IN | 2, USB_ENDPOINT_XFER_BULK, bulk),
		.interrupt = endpoint(USB_DIR_IN | 4, USB_ENDPOINT_XFER_INT, PACKET),
	};
}

static int open_in(const char *name, int flags)
{
	char path[200];

	snprintf(path, sizeof(path), "%s/%s", folder, name);
	return open(path, flags | O_CLOEXEC);
}

static int describe_all(int ep0)
{
	struct {
		struct usb_functionfs_descs_head_v2 header;
		uint32_t full_count, high_count;
		struct descriptors full, high;
	} __attribute__((packed)) all = {
		.header = {.magic = htole32(FUNCTIONFS_DESCRIPTORS_MAGIC_V2),
			   .length = htole32(sizeof(all)),
			   .flags = htole32(FUNCTIONFS_HAS_FS_DESC |
					    FUNCTIONFS_HAS_HS_DESC)},
		.full_count = htole32(4),
		.high_count = htole32(4),
		.full = describe(64),
		.high = describe(512),
	};
	struct {
		struct usb_functionfs_strings_head header;
		uint16_t language;
		char name[8];
	} __attribute__((packed)) strings = {
		.header = {.magic = htole32(FUNCTIONFS_STRINGS_MAGIC),
			   .length = htole32(sizeof(strings)),
			   .str_count = htole32(1),
			   .lang_count = htole32(1)},
		.language = htole16(0x0409),
		.name = "FASTRAK",
	};

	return write(ep0, &all, sizeof(all)) == sizeof(all) &&
			       write(ep0, &strings, sizeof(strings)) == sizeof(strings)
		       ? 0
		       : -1;
}

/* A failure is an unplugged host: try again. */
static void rest(void)
{
	nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

static void *take_commands(void *unused)
{
	int fd = open_in("ep1", O_RDWR);

	for (;;) {
		char bytes[512];
		ssize_t n = read(fd, bytes, sizeof(bytes));

		if (n <= 0) {
			rest();
			continue;
		}
		pthread_mutex_lock(&lock);
		emulator_write(emulator, bytes, (size_t)n);
		pthread_mutex_unlock(&lock);
	}
	return unused;
}

static void *give_replies(void *unused)
{
	int fd = open_in("ep2", O_RDWR);

	for (;;) {
		char bytes[PACKET];
		size_t n;

		pthread_mutex_lock(&lock);
		n = emulator_take_replies(emulator, bytes, sizeof(bytes));
		pthread_mutex_unlock(&lock);
		if (!n || write(fd, bytes, n) < 0)
			rest();
	}
	return unused;
}

static void *give_records(void *unused)
{
	int fd = open_in("ep3", O_RDWR);

	for (;;) {
		char bytes[PACKET];
		int64_t next_ns;
		size_t n;

		pthread_mutex_lock(&lock);
		emulator_advance(emulator, now_ns());
		n = emulator_take_records(emulator, bytes, sizeof(bytes));
		next_ns = emulator_next_ns(emulator);
		pthread_mutex_unlock(&lock);
		if (n) {
			if (write(fd, bytes, n) < 0)
				rest();
		} else if (next_ns == INT64_MAX) {
			rest();
		} else {
			struct timespec until = {next_ns / 1000000000,
						 next_ns % 1000000000};

			clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
		}
	}
	return unused;
}

int usb_function(struct emulator *e, const char *where, bool (*command)(void))
{
	void *(*const threads[])(void *) = {take_commands, give_replies, give_records};
	bool listen = true;
	int ep0;

	emulator = e;
	folder = where;
	ep0 = open_in("ep0", O_RDWR);
	if (ep0 < 0 || describe_all(ep0)) {
		perror("fastrak: FunctionFS");
		return 1;
	}
	for (int i = 0; i < 3; i++) {
		pthread_t thread;

		if (pthread_create(&thread, NULL, threads[i], NULL))
			return 1;
	}
	puts("ready usb");
	fflush(stdout);
	for (;;) {
		struct pollfd waits[2] = {{.fd = ep0, .events = POLLIN},
					  {.fd = listen ? 0 : -1, .events = POLLIN}};
		struct usb_functionfs_event event;

		poll(waits, 2, 1000);
		if (waits[0].revents & POLLIN && read(ep0, &event, sizeof(event)) > 0 &&
		    event.type == FUNCTIONFS_SETUP &&
		    read(ep0, NULL, 0) < 0) /* no request is known: that stalls it */
			continue;
		if (waits[1].revents) {
			pthread_mutex_lock(&lock);
			listen = command();
			pthread_mutex_unlock(&lock);
		}
	}
}
