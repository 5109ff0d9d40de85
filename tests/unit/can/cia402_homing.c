// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_homing.c: a drive homes as it was told to, and says whether it has.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "led.h"

static int setup(void **state)
{
	static struct led led;

	led_init(&led);
	*state = &led;
	return 0;
}

static bool homed(struct led *led, int rc)
{
	bool is = true;

	assert_int_equal(cia402_homed(&led->master, CIA402_CSP, &is, "here", &led->err),
			 rc);
	return is;
}

static void test_homes(void **state)
{
	struct led *led = *state;
	struct drive *d = &led->drive;

	assert_int_equal(led_configure(led), 0);
	assert_false(homed(led, 0));
	assert_int_equal(d->od[OD_MODE_NOW].value, CIA402_CSP);
	d->od[OD_HOME_OFFSET].value = 77; /* of before */
	assert_int_equal(cia402_set_homing(&led->master, 17, 10000, 1000, 500000, "here",
					   &led->err),
			 0);
	assert_int_equal(d->od[OD_HOME_OFFSET].value, 0);
	assert_int_equal(d->od[OD_HOMING_METHOD].value, 17);
	assert_int_equal(d->od[OD_HOMING_SPEED].value, 10000);
	assert_int_equal(d->od[OD_HOMING_SLOW].value, 1000);
	assert_int_equal(d->od[OD_HOMING_RAMP].value, 500000);

	assert_int_equal(cia402_set_mode(&led->master, CIA402_HOMING, "here", &led->err),
			 0);
	led_enable(led);
	led_control(led, CIA402_HOME_START);
	assert_true(d->velocity < 0);
	/* 5000 counts at 10000 counts/s, and half of that to spare. */
	canopen_await(&led->master, NULL, d->now_ns + 750 * DRIVE_MS);
	led_control(led, CIA402_ENABLE);
	assert_true(d->position == 0);
	assert_false(homed(led, -EBUSY)); /* with power it is not asked */
	assert_int_equal(d->od[OD_MODE_NOW].value, CIA402_HOMING);
	assert_int_equal(cia402_power_off(&led->master, "here", &led->err), 0);
	assert_true(homed(led, 0));
	assert_int_equal(d->enables, 1);
	drive_reboot(d);
	assert_false(homed(led, 0));
	d->absolute = true;
	drive_reboot(d);
	assert_true(homed(led, 0));
}

/* All three bits count. */
static void test_bits(void **state)
{
	struct led *led = *state;
	struct drive *d = &led->drive;

	for (int bits = 0; bits < 8; bits++) {
		assert_int_equal(cia402_set_mode(&led->master, CIA402_HOMING, "here",
						 &led->err),
				 0);
		d->homed = bits & 1;
		d->homing = bits & 2;
		d->homing_error = bits & 4;
		assert_int_equal(homed(led, 0), bits == 1);
	}
}

static void test_fails(void **state)
{
	struct led *led = *state;
	struct drive *d = &led->drive;

	d->homing_fails = true;
	assert_int_equal(cia402_set_mode(&led->master, CIA402_HOMING, "here", &led->err),
			 0);
	led_enable(led);
	led_control(led, CIA402_HOME_START);
	cia402_power_off(&led->master, "here", &led->err);
	assert_false(homed(led, 0));
	drive_lacks(d, 0x607c, -1);
	drive_lacks(d, 0x609a, -1);
	assert_int_equal(cia402_set_homing(&led->master, -3, 1, 1, 1, "here", &led->err),
			 0);
	assert_int_equal(cia402_set_homing(&led->master, 128, 1, 1, 1, "here", &led->err),
			 -EINVAL);
	drive_lacks(d, 0x6099, 2);
	assert_int_equal(cia402_set_homing(&led->master, 1, 1, 1, 1, "here", &led->err),
			 -EOPNOTSUPP);
	/* No homing mode: it says so, and goes back to its own. */
	cia402_set_mode(&led->master, CIA402_CSV, "here", &led->err);
	drive_set(d, 0x6502, 0, 0x380);
	assert_false(homed(led, -EOPNOTSUPP));
	assert_int_equal(d->od[OD_MODE].value, CIA402_CSP);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_homes, setup),
		cmocka_unit_test_setup(test_bits, setup),
		cmocka_unit_test_setup(test_fails, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
