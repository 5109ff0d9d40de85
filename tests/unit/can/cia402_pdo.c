// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_pdo.c: PDOs are set up on drives that are strict about the order, each in
 * its own way, and only what is meant for this side is sent.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include "led.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static int setup(void **state)
{
	static struct led led;

	led_init(&led);
	*state = &led;
	return 0;
}

/* Of each mode its target, from what a drive was left with. */
static void test_modes(void **state)
{
	static const struct {
		enum cia402_mode mode;
		uint32_t map;
	} cases[] = {
		{CIA402_CSP, 0x607a0020},
		{CIA402_CSV, 0x60ff0020},
		{CIA402_CST, 0x60710010},
		{CIA402_CSP, 0x607a0020},
	};
	struct led *led = *state;

	/* One after the other on the same drive: all of it is on already. */
	for (size_t i = 0; i < COUNT(cases); i++) {
		led->setup.mode = cases[i].mode;
		assert_int_equal(led_configure(led), 0);
		assert_int_equal(led_value(led, 0x1600, 0), 2);
		assert_int_equal(led_value(led, 0x1600, 2), cases[i].map);
	}
}

/* Other ids, other bits 30, more objects than ours: what was there before goes. */
static void test_left_over(void **state)
{
	struct led *led = *state;

	drive_set(&led->drive, 0x1400, 1, 0x40000234);
	drive_set(&led->drive, 0x1800, 1, 0x000001b4);
	drive_set(&led->drive, 0x1801, 1, 0x80000280);
	drive_set(&led->drive, 0x1a00, 0, 4);
	drive_set(&led->drive, 0x1a00, 3, 0x60610008);
	drive_set(&led->drive, 0x1a00, 4, 0x60610008);
	assert_int_equal(led_configure(led), 0);
	assert_int_equal(led_value(led, 0x1400, 1), 0x40000210);
	assert_int_equal(led_value(led, 0x1800, 1), 0x00000190);
	assert_int_equal(led_value(led, 0x1801, 1), 0x00000290);
	assert_int_equal(led_value(led, 0x1a00, 0), 2);
}

/* What comes back, once it runs: TPDO1 at each SYNC, inputs at change, nothing else. */
static void test_traffic(void **state)
{
	struct led *led = *state;
	unsigned int actual = 0, inputs = 0, others = 0;
	struct can_frame frame;
	uint32_t bits = 0;
	int64_t t_ns;

	assert_int_equal(led_configure(led), 0);
	canopen_await(&led->master, NULL, led->drive.now_ns + 5 * DRIVE_MS);
	led->drive.od[OD_HEARTBEAT].value = 0;
	for (int i = 0; i < 50; i++) {
		const struct can_frame sync = {.can_id = CANOPEN_SYNC};

		led->drive.inputs = i == 20   ? CIA402_AT_MIN
				    : i == 21 ? 0
					      : led->drive.inputs;
		led->drive.bus.ops->send(&led->drive.bus, &sync);
		drive_advance(&led->drive, DRIVE_MS);
		while (led->drive.bus.ops->receive(&led->drive.bus, &frame, &t_ns) > 0) {
			uint16_t word;
			int32_t position;

			if (cia402_get(&frame, &word, &position))
				actual++;
			else if (cia402_get_inputs(&frame, &bits))
				inputs++;
			else
				others++;
		}
	}
	assert_int_equal(actual, 50);
	assert_int_equal(inputs, 2); /* on and off */
	assert_int_equal(bits, 0);
	assert_int_equal(others, 0);
}

/* A drive that maps no inputs has none for us, and its TPDO2 stays off. */
static void test_unmapped_inputs(void **state)
{
	struct led *led = *state;

	led->drive.od[OD_INPUTS].access = R_;
	assert_int_equal(led_configure(led), 0);
	assert_false(led->taken.inputs);
	assert_true(led_value(led, 0x1801, 1) & 0x80000000);
	assert_true(led->taken.position_limit);
}

/* Reasons differ; each of them is told. */
static void test_fixed_mapping(void **state)
{
	static const uint32_t codes[] = {ABORT_ACCESS, 0x08000022, ABORT_READ_ONLY};
	struct led *led = *state;

	for (size_t i = 0; i < COUNT(codes); i++) {
		char number[16];

		led_init(led);
		led->drive.abort_index = 0x1600;
		led->drive.abort_sub = 0;
		led->drive.abort_code = codes[i];
		assert_int_equal(led_configure(led), -EOPNOTSUPP);
		snprintf(number, sizeof(number), "(%08Xh)", codes[i]);
		assert_non_null(strstr(led->err.text, number));
		assert_non_null(strstr(led->err.text, "1600:0"));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_modes, setup),
		cmocka_unit_test_setup(test_left_over, setup),
		cmocka_unit_test_setup(test_traffic, setup),
		cmocka_unit_test_setup(test_unmapped_inputs, setup),
		cmocka_unit_test_setup(test_fixed_mapping, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
