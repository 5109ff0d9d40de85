// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_power.c: power off, clear, modes and homing; nothing of it leads to
 * operation enabled.
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

static void test_power_off(void **state)
{
	struct led *led = *state;
	struct drive *d = &led->drive;

	assert_int_equal(cia402_power_off(&led->client), 0);
	led_enable(led);
	assert_int_equal(d->state, CIA402_ENABLED);
	assert_int_equal(cia402_power_off(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);
	led_control(led, CIA402_SHUTDOWN);
	led_control(led, CIA402_SWITCH_ON);
	assert_int_equal(d->state, CIA402_SWITCHED_ON);
	assert_int_equal(cia402_power_off(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);

	/* It does not obey. */
	led_enable(led);
	d->od[OD_CONTROLWORD].deaf = true;
	d->od[OD_CONTROLWORD].index = 0x5040;
	assert_int_equal(cia402_power_off(&led->client), -EOPNOTSUPP);
	d->od[OD_CONTROLWORD].index = 0x6040;
	d->state = CIA402_FAULT_REACTION; /* which does not end */
	assert_int_equal(cia402_power_off(&led->client), -ETIMEDOUT);
	assert_non_null(strstr(led->err.text, "fault reaction active"));
	d->mute = true;
	assert_int_equal(cia402_power_off(&led->client), -ETIMEDOUT);
}

static void test_clear(void **state)
{
	struct led *led = *state;
	struct drive *d = &led->drive;

	assert_int_equal(cia402_clear(&led->client), 0);
	led_enable(led);
	drive_fault(d, 0x2310);
	assert_int_equal(cia402_clear(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);
	assert_int_equal(d->enabled_unasked, 0);

	/* Also where bit 7 was left set: an edge is made. */
	drive_fault(d, 0x2310);
	d->od[OD_CONTROLWORD].value = CIA402_FAULT_RESET;
	d->had_reset_bit = true;
	assert_int_equal(cia402_clear(&led->client), 0);

	drive_fault(d, 0x3210);
	d->fault_stays = true;
	assert_int_equal(cia402_clear(&led->client), -EBUSY);
	assert_non_null(strstr(led->err.text, "DC link over-voltage (3210h)"));
	assert_int_equal(d->state, CIA402_FAULT);
	/* From its EMCY, without 603F. */
	drive_lacks(d, 0x603f, -1);
	led->master.emcy.code = 0x8611;
	assert_int_equal(cia402_clear(&led->client), -EBUSY);
	assert_non_null(strstr(led->err.text, "8611h"));
	d->fault_stays = false;
	assert_int_equal(cia402_clear(&led->client), 0);

	/* Clear also removes power without a fault. */
	d->tripped = false;
	led_enable(led);
	assert_int_equal(cia402_clear(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);
	d->mute = true;
	assert_int_equal(cia402_clear(&led->client), -ETIMEDOUT);
}

/* The k-th SDO is refused or lost: it ends with a message, and never with power. */
static void test_every_step(void **state)
{
	struct led *led = *state;

	for (uint32_t k = 1; k <= 8; k++)
		for (int drop = 0; drop < 2; drop++) {
			int64_t t;
			int rc;

			led_init(led);
			drive_fault(&led->drive, 0x2310);
			*(drop ? &led->drive.drop_at : &led->drive.abort_at) = k;
			t = led->drive.now_ns;
			rc = cia402_clear(&led->client);
			assert_true(led->drive.now_ns - t < 5000 * DRIVE_MS);
			assert_int_equal(led->drive.enables, 0);
			assert_false(cia402_powered(led->drive.state));
			if (k < led->drive.requests || rc)
				assert_int_equal(rc, drop ? -ETIMEDOUT : -EOPNOTSUPP);
			if (rc)
				assert_memory_equal(led->err.text, "here: ", 6);
		}
}

static void test_set_mode(void **state)
{
	struct led *led = *state;
	struct drive *d = &led->drive;

	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSV), 0);
	assert_int_equal(d->od[OD_MODE_NOW].value, 9);
	assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
	drive_set(d, 0x6502, 0, 0x20);
	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSP), -EOPNOTSUPP);
	d->od[OD_MODE].deaf = true;
	drive_set(d, 0x6502, 0, 0x3a5);
	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSP), -ETIMEDOUT);
	assert_non_null(strstr(led->err.text, "CSP (8)"));
	assert_non_null(strstr(led->err.text, "homing (6)"));
}

static bool homed(struct led *led, int rc)
{
	bool is = true;

	assert_int_equal(cia402_read_homed(&led->client, CIA402_CSP, &is), rc);
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
	assert_int_equal(cia402_set_homing(&led->client, 17, 10000, 1000, 500000), 0);
	assert_int_equal(d->od[OD_HOME_OFFSET].value, 0);
	assert_int_equal(d->od[OD_HOMING_METHOD].value, 17);
	assert_int_equal(d->od[OD_HOMING_SPEED].value, 10000);
	assert_int_equal(d->od[OD_HOMING_SLOW].value, 1000);
	assert_int_equal(d->od[OD_HOMING_RAMP].value, 500000);

	assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
	led_enable(led);
	led_control(led, CIA402_HOME_START);
	assert_true(d->velocity < 0);
	/* 5000 counts at 10000 counts/s, and half of that to spare. */
	canopen_await(&led->master, NULL, d->now_ns + 750 * DRIVE_MS);
	led_control(led, CIA402_ENABLE);
	assert_true(d->position == 0);
	assert_false(homed(led, -EBUSY)); /* not with power */
	assert_int_equal(d->od[OD_MODE_NOW].value, CIA402_HOMING);
	assert_int_equal(cia402_power_off(&led->client), 0);
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
		assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
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
	assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
	led_enable(led);
	led_control(led, CIA402_HOME_START);
	cia402_power_off(&led->client);
	assert_false(homed(led, 0));
	drive_lacks(d, 0x607c, -1);
	drive_lacks(d, 0x609a, -1);
	assert_int_equal(cia402_set_homing(&led->client, -3, 1, 1, 1), 0);
	assert_int_equal(cia402_set_homing(&led->client, 128, 1, 1, 1), -EINVAL);
	drive_lacks(d, 0x6099, 2);
	assert_int_equal(cia402_set_homing(&led->client, 1, 1, 1, 1), -EOPNOTSUPP);
	/* No homing mode: an error, and back to its own mode. */
	cia402_set_mode(&led->client, CIA402_CSV);
	drive_set(d, 0x6502, 0, 0x380);
	assert_false(homed(led, -EOPNOTSUPP));
	assert_int_equal(d->od[OD_MODE].value, CIA402_CSP);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_power_off, setup),
		cmocka_unit_test_setup(test_clear, setup),
		cmocka_unit_test_setup(test_every_step, setup),
		cmocka_unit_test_setup(test_set_mode, setup),
		cmocka_unit_test_setup(test_homes, setup),
		cmocka_unit_test_setup(test_bits, setup),
		cmocka_unit_test_setup(test_fails, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
