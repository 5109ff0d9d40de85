// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_usb.c and polhemus_usb_find.c over a bus that is not there: packets
 * and what may go wrong with them. Over the kernel's own USB it is in tests/vm.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include "../../../lib/device/polhemus/polhemus_usb_find.c"
#include "../../../lib/device/polhemus/polhemus_usb.c"
#include "usb_bus.h"

enum { OUT = 0x02, IN = 0x82, INTERRUPT = 0x84 };

static struct libusb_endpoint_descriptor endpoints[3];
static struct libusb_interface_descriptor interfaces[1];
static struct libusb_interface interface;
/* What the device has to send, and what came. */
static unsigned int to_send, sent;
static struct polhemus_line *line;

static void describe(int out_type, int packet)
{
	memset(&bus, 0, sizeof(bus));
	to_send = sent = 0;
	bus.device[0] = (struct libusb_device){.vendor = 0x0f44,
					       .product = 0x0002,
					       .bus = 1,
					       .ports = {1},
					       .n_ports = 1};
	bus.n = 1;
	endpoints[0] = (struct libusb_endpoint_descriptor){
		.bEndpointAddress = OUT, .bmAttributes = (uint8_t)out_type};
	endpoints[1] = (struct libusb_endpoint_descriptor){
		.bEndpointAddress = IN,
		.bmAttributes = LIBUSB_TRANSFER_TYPE_BULK,
		.wMaxPacketSize = (uint16_t)packet};
	endpoints[2] = (struct libusb_endpoint_descriptor){
		.bEndpointAddress = INTERRUPT,
		.bmAttributes = LIBUSB_TRANSFER_TYPE_INTERRUPT,
		.wMaxPacketSize = (uint16_t)packet};
	interfaces[0] = (struct libusb_interface_descriptor){.bNumEndpoints = 3,
							     .endpoint = endpoints};
	interface =
		(struct libusb_interface){.altsetting = interfaces, .num_altsetting = 1};
	bus.config = (struct libusb_config_descriptor){.bNumInterfaces = 1,
						       .interface = &interface};
}

static int begin(void **state)
{
	struct incise_error err = {0};

	describe(LIBUSB_TRANSFER_TYPE_BULK, 64);
	line = polhemus_usb_open("0f44:0002", "rig.conf:1", &err);
	return line ? 0 : -1;
}

static int end(void **state)
{
	line->ops->close(line);
	return bus.opened || bus.flights || bus.device[0].references ? -1 : 0;
}

/* The device sends as fast as it is asked. */
static void flood(void)
{
	while (sent < to_send &&
	       bus_complete(INTERRUPT, LIBUSB_TRANSFER_COMPLETED, &sent, sizeof(sent)))
		sent++;
}

static ssize_t read_some(void *bytes, size_t size, int timeout_ms)
{
	int64_t t_ns = 0;

	return line->ops->read(line, bytes, size, &t_ns, timeout_ms);
}

/* However many come while nobody reads: each is there, in order; the device waited. */
static void none_is_thrown_away(void **state)
{
	bus.events = flood;
	to_send = 1000;
	assert_int_equal(line->ops->write(line, "c", 1), 0);
	/* As many as there is room for. */
	assert_in_range(sent, 60, 64);
	for (unsigned int k = 0; k < 1000; k++) {
		unsigned int is = 0;

		assert_int_equal(read_some(&is, sizeof(is), 1000), sizeof(is));
		assert_int_equal(is, k);
	}
	assert_int_equal(read_some(&to_send, 1, 5), 0);
	/* All of them are on their way again. */
	assert_int_equal(bus.flights, 8);
}

/* A reader with less room than a packet. */
static void a_small_reader(void **state)
{
	char bytes[8] = "";

	assert_true(bus_complete(IN, LIBUSB_TRANSFER_COMPLETED, "abcde", 5));
	assert_true(bus_complete(IN, LIBUSB_TRANSFER_COMPLETED, "fg", 2));
	assert_int_equal(read_some(bytes, 2, 5), 2);
	assert_int_equal(read_some(bytes + 2, 2, 5), 2);
	assert_int_equal(read_some(bytes + 4, 2, 5), 1);
	assert_int_equal(read_some(bytes + 5, 2, 5), 2);
	assert_string_equal(bytes, "abcdefg");
}

/* Packets with nothing in them wake it, and are not the end of its time. */
static void come_empty(void)
{
	sent++;
	bus_complete(IN, LIBUSB_TRANSFER_COMPLETED, "", 0);
	if (sent == 500)
		bus_complete(IN, LIBUSB_TRANSFER_COMPLETED, "x", 1);
}

static void empty_packets(void **state)
{
	char byte = 0;

	bus.events = come_empty;
	/* A host that is busy has the time for them. */
	assert_int_equal(read_some(&byte, 1, 20000), 1);
	assert_int_equal(byte, 'x');
	assert_int_equal(sent, 500);
}

static void pulled_out(void **state)
{
	static const enum libusb_transfer_status ends[] = {LIBUSB_TRANSFER_NO_DEVICE,
							   LIBUSB_TRANSFER_ERROR,
							   LIBUSB_TRANSFER_STALL,
							   LIBUSB_TRANSFER_OVERFLOW};
	char byte;

	for (size_t i = 0; i < sizeof(ends) / sizeof(*ends); i++) {
		assert_true(bus_complete(IN, LIBUSB_TRANSFER_COMPLETED, "x", 1));
		while (bus_complete(0, ends[i], "", 0))
			;
		/* What came before is still read. */
		assert_int_equal(read_some(&byte, 1, 5), 1);
		assert_int_equal(read_some(&byte, 1, 5), -ENODEV);
		assert_int_equal(line->ops->write(line, "c", 1), -ENODEV);
		bus.n = 0;
		assert_int_equal(line->ops->reopen(line), -ENODEV);
		assert_int_equal(line->ops->reopen(line), -ENODEV);
		assert_int_equal(read_some(&byte, 1, 5), -ENODEV);
		bus.n = 1;
		assert_int_equal(line->ops->reopen(line), 0);
		assert_int_equal(bus.flights, 8);
		assert_int_equal(bus.opened, 1);
	}
	bus.write_error = LIBUSB_ERROR_TIMEOUT;
	assert_int_equal(line->ops->write(line, "c", 1), -EIO);
	bus.write_error = LIBUSB_ERROR_NO_DEVICE;
	assert_int_equal(line->ops->write(line, "c", 1), -ENODEV);
}

static void refuses(void **state)
{
	static const struct {
		int claim_error, open_error, submit_error, endpoints;
		int code;
		const char *says;
	} cases[] = {
		{LIBUSB_ERROR_BUSY, 0, 0, 3, EBUSY, "end it first"},
		{0, LIBUSB_ERROR_ACCESS, 0, 3, EACCES, "join the group"},
		{0, LIBUSB_ERROR_NO_DEVICE, 0, 3, ENODEV, "check its cable"},
		{0, LIBUSB_ERROR_NO_MEM, 0, 3, ENOMEM, "out of memory"},
		{0, LIBUSB_ERROR_OTHER, 0, 3, EIO, "plug it out and in"},
		{0, 0, 1, 3, EIO, "plug it out and in"},
		/* No way in; no way at all. */
		{0, 0, 0, 1, EIO, "cannot be talked to"},
		{0, 0, 0, 0, EIO, "cannot be talked to"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		describe(LIBUSB_TRANSFER_TYPE_BULK, 64);
		bus.claim_error = cases[i].claim_error;
		bus.device[0].open_error = cases[i].open_error;
		bus.submit_error = cases[i].submit_error;
		interfaces[0].bNumEndpoints = (uint8_t)cases[i].endpoints;
		errno = 0;
		assert_null(polhemus_usb_open("0f44:0002", "rig.conf:1", &err));
		if (errno != cases[i].code || err.code != errno ||
		    !strstr(err.text, cases[i].says))
			fail_msg("case %zu: %s", i, err.text);
		assert_int_equal(bus.opened, 0);
		assert_int_equal(bus.flights, 0);
	}
}

/* Sizes that a descriptor may have, true or not; and commands through an interrupt OUT. */
static void descriptors(void **state)
{
	static const struct {
		int packet, length;
	} cases[] = {{1, 1},	   {8, 8},    {64, 64},	     {512, 512},
		     {1024, 1024}, {0, 1024}, {0x7ff, 1024}, {0xffff, 1024}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		describe(LIBUSB_TRANSFER_TYPE_INTERRUPT, cases[i].packet);
		line = polhemus_usb_open("0f44:0002@1-1", "rig.conf:1", NULL);
		assert_non_null(line);
		for (int k = 0; k < bus.flights; k++)
			assert_int_equal(bus.flight[k]->length, cases[i].length);
		assert_int_equal(line->ops->write(line, "abc", 3), 0);
		assert_memory_equal(bus.written, "abc", 3);
		line->ops->close(line);
		assert_int_equal(bus.flights, 0);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(none_is_thrown_away, begin, end),
		cmocka_unit_test_setup_teardown(a_small_reader, begin, end),
		cmocka_unit_test_setup_teardown(empty_packets, begin, end),
		cmocka_unit_test_setup_teardown(pulled_out, begin, end),
		cmocka_unit_test(refuses),
		cmocka_unit_test(descriptors),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
