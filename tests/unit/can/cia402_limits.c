// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_limits.c: what a drive was told to hold, it holds by itself; what it was
 * told before does not stay.
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

/* Limits are the drive's own too. */
static void test_limits(void **state)
{
	struct led *led = *state;

	led->setup.position_max = 1000;
	led->setup.following = UINT32_MAX;
	assert_int_equal(led_configure(led), 0);
	for (int k = 0; k < 500; k++)
		led_cycle(led, cia402_up(led->drive.state), k < 50 ? 0 : 1000000);
	assert_in_range((int)led->drive.position, 990, 1000);
	assert_true(led->drive.fastest <= 50000);

	led_init(led);
	assert_int_equal(led_configure(led), 0);
	for (int k = 0; k < 500; k++) {
		led->drive.blocked = k > 100;
		led_cycle(led, cia402_up(led->drive.state), k * 10);
	}
	assert_int_equal(led->drive.state, CIA402_FAULT);
	assert_int_equal(led->master.emcy.code, 0x8611);
	assert_int_equal(led->drive.enabled_unasked, 0);
}

/* Limits of before do not stay: a machine that is not homed has no range. */
static void test_unlimited(void **state)
{
	struct led *led = *state;

	drive_set(&led->drive, 0x607d, 1, 5);
	drive_set(&led->drive, 0x607d, 2, 9);
	led->setup.limited = false;
	assert_int_equal(led_configure(led), 0);
	assert_false(led->taken.position_limit);
	assert_int_equal((int32_t)led_value(led, 0x607d, 1), INT32_MIN);
	assert_int_equal((int32_t)led_value(led, 0x607d, 2), INT32_MAX);
	assert_int_equal(cia402_set_range(&led->master, 10, 20, "here", &led->err), 0);
	assert_int_equal(cia402_set_range(&led->master, 30, 40, "here", &led->err), 0);
	assert_int_equal(led_value(led, 0x607d, 1), 30);
	assert_int_equal(led_value(led, 0x607d, 2), 40);
	assert_int_equal(cia402_set_range(&led->master, 40, 40, "here", &led->err),
			 -EINVAL);
}

/* What is not limited here is left to the drive. */
static void test_left_alone(void **state)
{
	struct led *led = *state;

	drive_set(&led->drive, 0x607f, 0, 7);
	drive_set(&led->drive, 0x60c5, 0, 8);
	drive_set(&led->drive, 0x6065, 0, 9);
	led->setup.velocity = led->setup.acceleration = led->setup.following = 0;
	led->setup.torque_permille = 0;
	assert_int_equal(led_configure(led), 0);
	assert_false(led->taken.velocity_limit || led->taken.acceleration_limit ||
		     led->taken.following_limit);
	assert_int_equal(led_value(led, 0x607f, 0), 7);
	assert_int_equal(led_value(led, 0x60c5, 0), 8);
	assert_int_equal(led_value(led, 0x6065, 0), 9);
	assert_int_equal(led_value(led, 0x6072, 0), 1000);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_limits, setup),
		cmocka_unit_test_setup(test_unlimited, setup),
		cmocka_unit_test_setup(test_left_alone, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
