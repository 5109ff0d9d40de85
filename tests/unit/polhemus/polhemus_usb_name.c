// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_usb_name.c: what is a name of a tracker on USB, and what is not.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/device/polhemus/polhemus_usb_name.h"

#define LETTERS_63 "abcdefghijklmnopqrstuvwxyzabcdefghijklmnopqrstuvwxyz01234567890"
/* The longest that there is: 7 hubs behind one another, 255 of everything. */
#define LONGEST "255-255.255.255.255.255.255.255"

static void good_names(void **state)
{
	static const struct {
		const char *text;
		struct polhemus_usb_name name;
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
		const struct polhemus_usb_name *is = &cases[i].name;
		struct polhemus_usb_name name;

		memset(&name, 0xaa, sizeof(name));
		if (polhemus_usb_name_read(cases[i].text, &name))
			fail_msg("\"%s\" is refused", cases[i].text);
		assert_int_equal(name.vendor, is->vendor);
		assert_int_equal(name.product, is->product);
		assert_string_equal(name.path, is->path);
		assert_string_equal(name.serial, is->serial);
	}
}

static void bad_names(void **state)
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
		/* Behind its end is nothing that may be read: a checker tells. */
		char *text = strdup(cases[i]);
		struct polhemus_usb_name name;

		assert_non_null(text);
		if (polhemus_usb_name_read(text, &name) != -EINVAL)
			fail_msg("\"%s\" is taken", text);
		free(text);
	}
}

static void places(void **state)
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
		char path[POLHEMUS_USB_PATH_MAX], text[64] = "0f44:0002@";
		struct polhemus_usb_name name;

		polhemus_usb_path(path, cases[i].bus, cases[i].ports, cases[i].n);
		assert_string_equal(path, cases[i].path);
		/* What a place is called can be said in rig.conf; a root hub is no tracker. */
		if (cases[i].n < 1)
			continue;
		assert_int_equal(polhemus_usb_name_read(strcat(text, path), &name), 0);
		assert_string_equal(name.path, path);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(good_names),
		cmocka_unit_test(bad_names),
		cmocka_unit_test(places),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
