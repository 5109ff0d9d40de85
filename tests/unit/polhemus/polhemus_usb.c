// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_usb.c over a simulated bus, in place of libusb: names of trackers, which
 * device is taken, and packets with what may go wrong with them. Over the USB of the kernel it is in tests/vm.
 */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_usb.c"
#include "usb_bus.h"

/* --- name --- */

#define LETTERS_63 "abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyz01234567890"
/* The longest that there is: 7 hubs behind one another, 255 of everything. */
#define LONGEST "255-255.255.255.255.255.255.255"

TEST(good_names)
{
	static const struct {
		const char *text;
		struct usb_name name;
	} cases[] = {
		{"0f44:0002", {0x0f44, 0x0002, "", ""}},
		{"0F44:FF12", {0x0f44, 0xff12, "", ""}},
		{"ffff:0000", {0xffff, 0x0000, "", ""}},
		{"0f44:0002@1-1", {0x0f44, 0x0002, "1-1", ""}},
		{"0f44:0002@1-1.2", {0x0f44, 0x0002, "1-1.2", ""}},
		{"0f44:0002@" LONGEST, {0x0f44, 0x0002, LONGEST, ""}},
		{"0f44:0002#SN-77", {0x0f44, 0x0002, "", "SN-77"}},
		/* A number of a device may be anything, also what looks like a place. */
		{"0f44:0002##", {0x0f44, 0x0002, "", "#"}},
		{"0f44:0002#@1-1", {0x0f44, 0x0002, "", "@1-1"}},
		{"0f44:0002# a b ", {0x0f44, 0x0002, "", " a b "}},
		{"0f44:0002#" LETTERS_63, {0x0f44, 0x0002, "", LETTERS_63}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct usb_name *is = &cases[i].name;
		struct usb_name name;

		memset(&name, 0xaa, sizeof(name));
		if (read_name(cases[i].text, &name))
			fail_msg("\"%s\" is refused", cases[i].text);
		assert_int_equal(name.vendor, is->vendor);
		assert_int_equal(name.product, is->product);
		assert_string_equal(name.path, is->path);
		assert_string_equal(name.serial, is->serial);
	}
}

TEST(bad_names)
{
	static const char *const cases[] = {
		"",
		":",
		"0",
		"0f44",
		"0f44:",
		"0f44:000",
		"0f44:00020",
		"f44:0002",
		"0f44-0002",
		"0f44 0002",
		" 0f44:0002",
		"0f44:0002 ",
		"0f44:0002\n",
		"0x0f44:0002",
		"0g44:0002",
		"0f44:000g",
		"+f44:0002",
		"10f44:0002",
		"0f44:0002:1",
		"0f44:0002@",
		"0f44:0002#",
		"0f44:0002@1",
		"0f44:0002@1-",
		"0f44:0002@-1",
		"0f44:0002@1.1",
		"0f44:0002@1-.2",
		"0f44:0002@1-1.",
		"0f44:0002@1-1..2",
		"0f44:0002@1--1",
		"0f44:0002@1-1-1",
		"0f44:0002@1-1.2 ",
		"0f44:0002@1-1.2#SN-77",
		"0f44:0002@1-1:1.0",
		"0f44:0002@a-b",
		/* As none is ever called. */
		"0f44:0002@0-1",
		"0f44:0002@01-1",
		"0f44:0002@1-0",
		"0f44:0002@256-1",
		"0f44:0002@1-1.256",
		"0f44:0002@1-1.1000",
		"0f44:0002@" LONGEST ".1",
		"0f44:0002#" LETTERS_63 "x",
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		/* Behind its end is nothing that may be read: a sanitizer reports it. */
		char *text = strdup(cases[i]);
		struct usb_name name;

		assert_non_null(text);
		if (read_name(text, &name) != -EINVAL)
			fail_msg("\"%s\" is taken", text);
		free(text);
	}
}

TEST(places)
{
	static const struct {
		unsigned int bus;
		uint8_t ports[8];
		int n;
		const char *path;
	} cases[] = {
		{1, {0}, 0, "1-0"},
		{1, {1}, 1, "1-1"},
		{2, {1, 2}, 2, "2-1.2"},
		{12, {10, 4, 3}, 3, "12-10.4.3"},
		{255, {255, 255, 255, 255, 255, 255, 255}, 7, LONGEST},
		/* More than USB has: what there is room for. */
		{255, {255, 255, 255, 255, 255, 255, 255, 1}, 8, LONGEST},
		{1, {1}, -1, "1-0"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char path[USB_PATH_MAX], text[64] = "0f44:0002@";
		struct usb_name name;

		write_path(path, cases[i].bus, cases[i].ports, cases[i].n);
		assert_string_equal(path, cases[i].path);
		/* rig.conf can name each place; a root hub is no tracker. */
		if (cases[i].n < 1)
			continue;
		assert_int_equal(read_name(strcat(text, path), &name), 0);
		assert_string_equal(name.path, path);
	}
}

/* --- find --- */

#define DEVICE(id, number, at, error, levels, ...)                                  \
	{                                                                           \
		.vendor = (id) >> 16, .product = (id)&0xffff, .serial = (number),   \
		.bus = (at), .open_error = (error), .n_ports = (levels), .ports = { \
			__VA_ARGS__                                                 \
		}                                                                   \
	}

static const struct libusb_device one[] = {
	DEVICE(0x1d6b0002, "0000:00:14.0", 1, 0, 0, 0),
	DEVICE(0x0f440002, "SN-77", 1, 0, 1, 1),
};
static const struct libusb_device two[] = {
	DEVICE(0x0f440002, "SN-77", 1, 0, 1, 1),
	DEVICE(0x0f440002, NULL, 1, 0, 2, 2, 4),
	DEVICE(0x0f44ff20, "\033[31m\"", 2, 0, 1, 1),
};
static const struct libusb_device unready[] = {
	DEVICE(0x0f440001, "", 3, 0, 1, 2),
};
static const struct libusb_device locked[] = {
	DEVICE(0x0f440002, "SN-77", 1, LIBUSB_ERROR_ACCESS, 1, 1),
	DEVICE(0x0f440002, "SN-78", 1, LIBUSB_ERROR_NO_DEVICE, 1, 2),
};

#define BUS(is) is, sizeof(is) / sizeof(*(is))

static void plug(const struct libusb_device *devices, size_t n)
{
	memset(&bus, 0, sizeof(bus));
	memcpy(bus.device, devices, n * sizeof(*devices));
	bus.n = (int)n;
}

TEST(which_one)
{
	static const struct {
		const struct libusb_device *devices;
		size_t n;
		const char *name, *was;
		int rc, index;
		const char *says;
	} cases[] = {
		{BUS(one), "0f44:0002", "", 0, 1, NULL},
		{BUS(one), "0f44:0002@1-1", "", 0, 1, NULL},
		{BUS(one), "0f44:0002#SN-77", "", 0, 1, NULL},
		/* Where it is the only one it may have moved. */
		{BUS(one), "0f44:0002", "2-2", 0, 1, NULL},
		{BUS(one), "0f44:0002@1-1.2", "", -ENODEV, 0, "incise info devices"},
		{BUS(one), "0f44:0002#SN-7", "", -ENODEV, 0, "no 0f44:0002#SN-7 is"},
		{BUS(one), "0f44:0003", "", -ENODEV, 0, "no 0f44:0003 is"},
		{BUS(two), "0f44:0002", "", -EINVAL, 0, "2 devices"},
		{BUS(two), "0f44:0002", "", -EINVAL, 0, "@1-1, @1-2.4"},
		{BUS(two), "0f44:0002", "1-2.4", 0, 1, NULL},
		{BUS(two), "0f44:0002", "1-3", -ENODEV, 0, "no 0f44:0002 is"},
		{BUS(two), "0f44:0002@1-2.4", "", 0, 1, NULL},
		{BUS(two), "0f44:0002#SN-77", "", 0, 0, NULL},
		{BUS(two), "0f44:ff20", "", 0, 2, NULL},
		{BUS(unready), "0f44:0002", "", -ENODEV, 0, "0f44:0001 at 3-2 has no"},
		{BUS(locked), "0f44:0002@1-1", "", 0, 0, NULL},
		{BUS(locked), "0f44:0002#SN-77", "", -EACCES, 0, "join the group"},
		{BUS(locked), "0f44:0002#SN-78", "", -EACCES, 0, "join the group"},
		{NULL, 0, "0f44:0002", "", -ENODEV, 0, "plug it in"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct polhemus_model *model;
		struct incise_error err = {0};
		struct usb_name wanted;
		libusb_device *device = NULL;
		int rc;

		if (cases[i].n)
			plug(cases[i].devices, cases[i].n);
		else
			memset(&bus, 0, sizeof(bus));
		assert_int_equal(read_wanted(cases[i].name, &wanted, &model, "rig.conf:1",
					     &err),
				 0);
		rc = find_device(NULL, &wanted, cases[i].was, cases[i].name, &device,
				 "rig.conf:1", &err);
		if (rc != cases[i].rc ||
		    (rc && (err.code != -rc || !strstr(err.text, cases[i].says))))
			fail_msg("case %zu: %d: %s", i, rc, err.text);
		if (!rc) {
			assert_ptr_equal(device, &bus.device[cases[i].index]);
			libusb_unref_device(device);
		}
		for (int k = 0; k < bus.n; k++)
			assert_int_equal(bus.device[k].references, 0);
		assert_int_equal(bus.opened, 0);
	}
}

TEST(what_is_wanted)
{
	static const struct {
		const char *name;
		int rc;
		const char *says;
	} cases[] = {
		{"", -EINVAL, "expected usb:0f44:0002"},
		{"0f44:0002@", -EINVAL, "expected usb:0f44:0002"},
		{"1d6b:0002", -EINVAL, "1d6b:0002 is not a known Polhemus tracker"},
		{"0f44:0004", -EINVAL, "not a known Polhemus tracker"},
		{"0f44:0001", -ENODEV, "fxload"},
		{"0f44:ff11", -ENODEV, "a LIBERTY 0f44:ff11 has no firmware"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct polhemus_model *model;
		struct usb_name wanted;
		struct incise_error err = {0};

		assert_int_equal(read_wanted(cases[i].name, &wanted, &model, "rig.conf:1",
					     &err),
				 cases[i].rc);
		assert_non_null(strstr(err.text, cases[i].says));
	}
}

static int note(void *context, const struct incise_scan_device *device)
{
	char *text = context;
	size_t at = strlen(text);

	snprintf(text + at, 400 - at, "%s%s %s\n", device->usable ? "" : "! ",
		 device->device, device->what);
	return 0;
}

static int enough(void *context, const struct incise_scan_device *device)
{
	++*(int *)context;
	return 7;
}

TEST(a_scan)
{
	static const struct {
		const struct libusb_device *devices;
		size_t n;
		const char *arguments, *found;
	} cases[] = {
		{BUS(one), "", "usb:0f44:0002#SN-77 FASTRAK\n"},
		/* A number that a line of rig.conf cannot have is not used as a name. */
		{BUS(two), "",
		 "usb:0f44:0002#SN-77 FASTRAK\n"
		 "usb:0f44:0002@1-2.4 FASTRAK\n"
		 "usb:0f44:ff20@2-1 LIBERTY HS\n"},
		{BUS(two), "0f44:0002@1-2.4", "usb:0f44:0002@1-2.4 FASTRAK\n"},
		{BUS(two), "0f44:0003", ""},
		{BUS(unready), "",
		 "! usb:0f44:0001@3-2 FASTRAK without firmware: load the "
		 "manufacturer's .hex file with fxload\n"},
		/* Without the right to read the serial number, the place is the name. */
		{BUS(locked), "",
		 "usb:0f44:0002@1-1 FASTRAK\nusb:0f44:0002@1-2 FASTRAK\n"},
	};
	int n = 0;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char text[400] = "";

		plug(cases[i].devices, cases[i].n);
		assert_int_equal(usb_scan(cases[i].arguments, note, text, &err), 0);
		assert_string_equal(text, cases[i].found);
		for (int k = 0; k < bus.n; k++)
			assert_int_equal(bus.device[k].references, 0);
		assert_int_equal(bus.opened, 0);
	}
	assert_int_equal(usb_scan("0f44", note, NULL, &err), -EINVAL);
	plug(BUS(two));
	assert_int_equal(usb_scan("", enough, &n, &err), 7);
	assert_int_equal(n, 1);
}

/* --- polhemus_usb --- */

enum { OUT = 0x02, IN = 0x82, INTERRUPT = 0x84 };

static struct libusb_endpoint_descriptor endpoints[3];
static struct libusb_interface_descriptor interfaces[1];
static struct libusb_interface interface;
/* Packets that the device has to send, and those sent. */
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
	describe(LIBUSB_TRANSFER_TYPE_BULK, 64);
	line = usb_open("0f44:0002", "rig.conf:1", &err);
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
TEST(none_is_thrown_away, begin, end)
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
TEST(a_small_reader, begin, end)
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

TEST(empty_packets, begin, end)
{
	char byte = 0;

	bus.events = come_empty;
	/* A host that is busy has the time for them. */
	assert_int_equal(read_some(&byte, 1, 20000), 1);
	assert_int_equal(byte, 'x');
	assert_int_equal(sent, 500);
}

TEST(pulled_out, begin, end)
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

TEST(refuses)
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
		{0, LIBUSB_ERROR_OTHER, 0, 3, EIO, "unplug it, plug it in"},
		{0, 0, 1, 3, EIO, "unplug it, plug it in"},
		/* No way in; no way at all. */
		{0, 0, 0, 1, EIO, "does not respond"},
		{0, 0, 0, 0, EIO, "does not respond"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_error err = {0};

		describe(LIBUSB_TRANSFER_TYPE_BULK, 64);
		bus.claim_error = cases[i].claim_error;
		bus.device[0].open_error = cases[i].open_error;
		bus.submit_error = cases[i].submit_error;
		interfaces[0].bNumEndpoints = (uint8_t)cases[i].endpoints;
		errno = 0;
		assert_null(usb_open("0f44:0002", "rig.conf:1", &err));
		if (errno != cases[i].code || err.code != errno ||
		    !strstr(err.text, cases[i].says))
			fail_msg("case %zu: %s", i, err.text);
		assert_int_equal(bus.opened, 0);
		assert_int_equal(bus.flights, 0);
	}
}

/* Sizes that a descriptor may have, true or not; and commands through an interrupt OUT. */
TEST(descriptors)
{
	static const struct {
		int packet, length;
	} cases[] = {{1, 1},	   {8, 8},    {64, 64},	     {512, 512},
		     {1024, 1024}, {0, 1024}, {0x7ff, 1024}, {0xffff, 1024}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		describe(LIBUSB_TRANSFER_TYPE_INTERRUPT, cases[i].packet);
		line = usb_open("0f44:0002@1-1", "rig.conf:1", NULL);
		assert_non_null(line);
		for (int k = 0; k < bus.flights; k++)
			assert_int_equal(bus.flight[k]->length, cases[i].length);
		assert_int_equal(line->ops->write(line, "abc", 3), 0);
		assert_memory_equal(bus.written, "abc", 3);
		line->ops->close(line);
		assert_int_equal(bus.flights, 0);
	}
}
