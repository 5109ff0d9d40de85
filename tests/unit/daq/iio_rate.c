// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_rate.c on a converter that a test makes: where a rate is, how it is
 * written, and how far off it may be. What a whole opening makes of it is in iio_source.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/device/daq/iio_rate.h"
#include "converter.h"

static struct iio_source source;

static struct attribute *own(void)
{
	return device_attribute(&world.devices[0], "sampling_frequency");
}

static struct attribute *timer(void)
{
	return device_attribute(&world.devices[2], "sampling_frequency");
}

static int setup(void **state)
{
	world_reset();
	source = (struct iio_source){.where = "rig.conf:3: force",
				     .device = &world.devices[0],
				     .voltage = &world.devices[0].channels[1]};
	return 0;
}

static int set_rate(double rate_hz, const struct iio_device *trigger,
		    struct incise_error *err)
{
	*err = (struct incise_error){0};
	source.setup.rate_hz = rate_hz;
	return iio_rate_set(&source, trigger, err);
}

/* Whole numbers without a point: some drivers take no other. */
static void how_it_is_written(void **state)
{
	static const struct {
		double rate_hz;
		const char *text;
	} cases[] = {
		{1, "1"},
		{10000, "10000"},
		{1234.5, "1234.500"},
		{99999.9996, "100000"},
		{0.001, "0.001"},
	};
	struct incise_error err;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		setup(NULL);
		assert_int_equal(set_rate(cases[i].rate_hz, NULL, &err), 0);
		assert_string_equal(own()->text, cases[i].text);
	}
}

/* A trigger's before the device's, that before the channel's. */
static void where_it_is(void **state)
{
	struct incise_error err;

	assert_int_equal(set_rate(5000, &world.devices[2], &err), 0);
	assert_string_equal(timer()->text, "5000");
	assert_string_equal(own()->text, "5000");
	assert_true(source.rate_hz == 5000);
	setup(NULL);
	/* A trigger without one: the device makes the pace. */
	assert_int_equal(set_rate(4000, &world.devices[1], &err), 0);
	assert_string_equal(own()->text, "4000");
	setup(NULL);
	own()->key = "other";
	source.voltage->attributes[2] =
		(struct attribute){.key = "sampling_frequency", .text = "1"};
	assert_int_equal(set_rate(3000, NULL, &err), 0);
	assert_string_equal(source.voltage->attributes[2].text, "3000");
	setup(NULL);
	own()->key = "other";
	assert_int_equal(set_rate(3000, NULL, &err), -EOPNOTSUPP);
	assert_non_null(strstr(err.text, "name a timer in force_setup.trigger"));
}

/* Converters divide a clock: within 1 % it is the rate that was asked for. */
static void how_far_off_it_may_be(void **state)
{
	static const struct {
		const char *is;
		bool taken;
	} cases[] = {
		{"10099", true}, {"9901", true}, {"10101", false},
		{"9899", false}, {"0", false},	 {"", false},
		{"nan", false},	 {"inf", false}, {"-10000", false},
	};
	struct incise_error err;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		setup(NULL);
		own()->stuck = true;
		strcpy(own()->text, cases[i].is);
		if (set_rate(10000, NULL, &err) != (cases[i].taken ? 0 : -EINVAL))
			fail_msg("%s: %s", cases[i].is, err.text);
		if (!cases[i].taken)
			assert_non_null(strstr(err.text, "set force_setup.rate_hz"));
	}
	/* A converter that is slower than its trigger leaves some out. */
	setup(NULL);
	own()->stuck = true;
	strcpy(own()->text, "9000");
	assert_int_equal(set_rate(10000, &world.devices[2], &err), -EINVAL);
	assert_non_null(strstr(err.text, "converts at 9000 Hz, its trigger at 10000 Hz"));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(how_it_is_written, setup),
		cmocka_unit_test_setup(where_it_is, setup),
		cmocka_unit_test_setup(how_far_off_it_may_be, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
