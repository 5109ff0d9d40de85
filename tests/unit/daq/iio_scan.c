// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_scan.c on converters that a test makes: which are told of, by what name,
 * and which rig.conf may name.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/device/daq/iio_force.h"
#include "converter.h"
#include "found.h"

static struct found found;

static int setup(void **state)
{
	world_reset();
	found = (struct found){0};
	return 0;
}

static int scan(const char *arguments)
{
	struct incise_error err = {0};
	int rc = iio_force_scan(arguments, keep, &found, &err);

	/* Whatever it found, it leaves nothing open. */
	assert_int_equal(world.made, 0);
	return rc;
}

static void a_converter_is_told_of(void **state)
{
	const struct incise_scan_device *adc = &found.device[0];
	static const char *const properties[][2] = {
		{"id", "null"},		 {"name", "adc"},    {"channels", "1"},
		{"channel", "voltage0"}, {"bits", "12"},     {"range_V", "-2.5 to 2.5"},
		{"rate_hz", "1000"},	 {"trigger", "own"}, {"time_stamps", "kernel"},
	};

	assert_int_equal(scan(""), 0);
	/* Triggers are devices too, and none of these. */
	assert_int_equal(found.n, 1);
	assert_string_equal(adc->device, "iio:adc");
	assert_true(adc->usable);
	for (size_t i = 0; i < sizeof(properties) / sizeof(*properties); i++)
		assert_string_equal(told(adc, properties[i][0]), properties[i][1]);
}

static void two_of_a_name_go_by_number(void **state)
{
	world.devices[1] = world.devices[0];
	world.devices[1].id = "iio:device7";
	assert_int_equal(scan(""), 0);
	assert_int_equal(found.n, 2);
	assert_string_equal(found.device[0].device, "iio:null");
	assert_string_equal(found.device[1].device, "iio:iio:device7");
}

static void what_cannot_be_used_is_told_as_such(void **state)
{
	struct iio_device *adc = &world.devices[0];

	adc->channels[1].format.bits = 32; /* of incise_force_sample.code 31 are */
	assert_int_equal(scan(""), 0);
	assert_false(found.device[0].usable);
	assert_string_equal(told(&found.device[0], "range_V"), "");
	setup(NULL);
	adc->channels[2].id = "voltage1";
	assert_int_equal(scan(""), 0);
	assert_false(found.device[0].usable);
	assert_string_equal(told(&found.device[0], "channels"), "2");
	assert_string_equal(told(&found.device[0], "time_stamps"), "none");
	/* Without a scale it is of use, once rig.conf says what the codes stand for. */
	setup(NULL);
	adc->channels[1].attributes[0].key = "other";
	assert_int_equal(scan(""), 0);
	assert_true(found.device[0].usable);
	assert_string_equal(told(&found.device[0], "range_V"), "");
}

static void by_name_and_without_any(void **state)
{
	static const struct {
		const char *arguments;
		int n;
	} cases[] = {{"adc", 1}, {"null", 1}, {"other", 0}, {"own", 0}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		setup(NULL);
		assert_int_equal(scan(cases[i].arguments), 0);
		if (found.n != cases[i].n)
			fail_msg("%s: %d", cases[i].arguments, found.n);
	}
	setup(NULL);
	world.error = ENOSYS; /* no IIO in this kernel */
	assert_int_equal(scan(""), 0);
	assert_int_equal(found.n, 0);
	setup(NULL);
	world.devices[1] = world.devices[0];
	found.answer = -ENOMEM;
	assert_int_equal(scan(""), -ENOMEM);
	assert_int_equal(found.n, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(a_converter_is_told_of, setup),
		cmocka_unit_test_setup(two_of_a_name_go_by_number, setup),
		cmocka_unit_test_setup(what_cannot_be_used_is_told_as_such, setup),
		cmocka_unit_test_setup(by_name_and_without_any, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
