// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_usb_find.c: which device of a bus it takes, and what it says of
 * the others.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include "../../../lib/device/polhemus/polhemus_usb_find.c"
#include "usb_bus.h"

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

static void which_one(void **state)
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
		struct polhemus_usb_name wanted;
		libusb_device *device = NULL;
		int rc;

		if (cases[i].n)
			plug(cases[i].devices, cases[i].n);
		else
			memset(&bus, 0, sizeof(bus));
		assert_int_equal(polhemus_usb_wanted(cases[i].name, &wanted, &model,
						     "rig.conf:1", &err),
				 0);
		rc = polhemus_usb_find(NULL, &wanted, cases[i].was, cases[i].name,
				       &device, "rig.conf:1", &err);
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

static void what_is_wanted(void **state)
{
	static const struct {
		const char *name;
		int rc;
		const char *says;
	} cases[] = {
		{"", -EINVAL, "expected usb:0f44:0002"},
		{"0f44:0002@", -EINVAL, "expected usb:0f44:0002"},
		{"1d6b:0002", -EINVAL, "1d6b:0002 is no tracker"},
		{"0f44:0004", -EINVAL, "no tracker"},
		{"0f44:0001", -ENODEV, "fxload"},
		{"0f44:ff11", -ENODEV, "a LIBERTY 0f44:ff11 has no firmware"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct polhemus_model *model;
		struct polhemus_usb_name wanted;
		struct incise_error err = {0};

		assert_int_equal(polhemus_usb_wanted(cases[i].name, &wanted, &model,
						     "rig.conf:1", &err),
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

static void a_scan(void **state)
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
		 "! usb:0f44:0001@3-2 FASTRAK without firmware: load the maker's .hex "
		 "file with fxload\n"},
		/* Who may not ask for the number names the place. */
		{BUS(locked), "",
		 "usb:0f44:0002@1-1 FASTRAK\nusb:0f44:0002@1-2 FASTRAK\n"},
	};
	struct incise_error err = {0};
	int n = 0;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char text[400] = "";

		plug(cases[i].devices, cases[i].n);
		assert_int_equal(polhemus_usb_scan(cases[i].arguments, note, text, &err),
				 0);
		assert_string_equal(text, cases[i].found);
		for (int k = 0; k < bus.n; k++)
			assert_int_equal(bus.device[k].references, 0);
		assert_int_equal(bus.opened, 0);
	}
	assert_int_equal(polhemus_usb_scan("0f44", note, NULL, &err), -EINVAL);
	plug(BUS(two));
	assert_int_equal(polhemus_usb_scan("", enough, &n, &err), 7);
	assert_int_equal(n, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(which_one),
		cmocka_unit_test(what_is_wanted),
		cmocka_unit_test(a_scan),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
