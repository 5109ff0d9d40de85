// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_format.c: every kind of layout that the kernel's documents name, and
 * those that cannot be.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <stdio.h>
#include "../../../lib/device/daq/iio_format.h"

/* As the kernel writes it in scan_elements/in_voltage0_type: "le:s12/16>>4". */
static struct iio_data_format data_of(const char *type)
{
	struct iio_data_format data = {.repeat = 1};
	char endian, sign;

	if (sscanf(type, "%ce:%c%u/%uX%u>>%u", &endian, &sign, &data.bits, &data.length,
		   &data.repeat, &data.shift) != 6)
		assert_int_equal(sscanf(type, "%ce:%c%u/%u>>%u", &endian, &sign,
					&data.bits, &data.length, &data.shift),
				 5);
	data.is_be = endian == 'b';
	data.is_signed = sign == 's' || sign == 'S';
	return data;
}

static void codes(void **state)
{
	static const struct {
		const char *type;
		unsigned char bytes[8];
		uint64_t raw;
		int32_t code;
	} cases[] = {
		{"le:u8/8>>0", {0xa5}, 0xa5, 0xa5},
		{"le:s8/8>>0", {0x80}, 0x80, 0},
		{"le:s8/8>>0", {0x7f}, 0x7f, 255},
		{"le:u12/16>>0", {0x34, 0xf2}, 0x234, 0x234},
		{"be:u12/16>>0", {0xf2, 0x34}, 0x234, 0x234},
		{"le:u12/16>>4", {0x4f, 0x23}, 0x234, 0x234},
		{"be:u12/16>>4", {0x23, 0x4f}, 0x234, 0x234},
		{"le:s12/16>>0", {0x00, 0x08}, 0x800, 0},
		{"le:s12/16>>0", {0xff, 0x07}, 0x7ff, 4095},
		{"le:s12/16>>0", {0xff, 0xff}, 0xfff, 2047},
		{"be:s12/16>>4", {0x80, 0x00}, 0x800, 0},
		{"be:s12/16>>4", {0x00, 0x0f}, 0x000, 2048},
		{"le:S16/16>>0", {0x00, 0x80}, 0x8000, 0},
		{"be:u16/16>>0", {0xff, 0xff}, 0xffff, 65535},
		{"be:u24/32>>8", {0x12, 0x34, 0x56, 0xff}, 0x123456, 0x123456},
		{"be:s24/32>>8", {0x80, 0x00, 0x01, 0xff}, 0x800001, 1},
		{"le:s24/32>>0", {0xff, 0xff, 0x7f, 0x00}, 0x7fffff, 0xffffff},
		{"le:u31/32>>1", {0xff, 0xff, 0xff, 0xff}, 0x7fffffff, 0x7fffffff},
		{"le:s31/64>>33", {0, 0, 0, 0, 0, 0, 0, 0x80}, 0x40000000, 0},
		{"le:u1/8>>7", {0x80}, 1, 1},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct iio_data_format data = data_of(cases[i].type);
		struct iio_format format;

		assert_int_equal(iio_format_of(&format, &data, 31), 0);
		assert_int_equal(iio_format_raw(&format, cases[i].bytes), cases[i].raw);
		assert_int_equal(iio_format_code(&format, cases[i].bytes), cases[i].code);
	}
}

static void stamps(void **state)
{
	static const unsigned char le[8] = {8, 7, 6, 5, 4, 3, 2, 1};
	struct iio_data_format data = data_of("le:s64/64>>0");
	struct iio_format format;

	assert_int_equal(iio_format_of(&format, &data, 64), 0);
	assert_int_equal(iio_format_raw(&format, le), 0x0102030405060708);
	data = data_of("be:s64/64>>0");
	assert_int_equal(iio_format_of(&format, &data, 64), 0);
	assert_int_equal(iio_format_raw(&format, le), 0x0807060504030201);
}

/* A signed code grows with the voltage, through all of its range. */
static void order(void **state)
{
	struct iio_data_format data = data_of("be:s10/16>>3");
	struct iio_format format;

	assert_int_equal(iio_format_of(&format, &data, 31), 0);
	for (int volts = -512; volts < 512; volts++) {
		uint16_t stored = (uint16_t)((unsigned int)(volts & 0x3ff) << 3 | 5);
		unsigned char bytes[2] = {stored >> 8, stored & 0xff};

		assert_int_equal(iio_format_code(&format, bytes), volts + 512);
	}
}

static void refused(void **state)
{
	static const char *const types[] = {
		"le:u0/16>>0",	 "le:u12/12>>0",   "le:u17/16>>0",
		"le:u12/16>>5",	 "le:u32/32>>0",   "le:u12/24>>0",
		"le:u12/128>>0", "le:u12/16X2>>0", "le:u12/16>>4294967295",
	};

	for (size_t i = 0; i < sizeof(types) / sizeof(*types); i++) {
		struct iio_data_format data = data_of(types[i]);
		struct iio_format format;

		assert_int_equal(iio_format_of(&format, &data, 31), -EINVAL);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(codes),
		cmocka_unit_test(stamps),
		cmocka_unit_test(order),
		cmocka_unit_test(refused),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
