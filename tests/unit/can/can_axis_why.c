// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_axis_why.c: each reason has its line, which says what to do.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <string.h>
#include "../../../lib/device/can/cia402/can_axis.h"

static void each_reason_has_its_own_line(void **state)
{
	static const struct {
		enum can_axis_why why;
		int64_t a, b;
		const char *says;
	} cases[] = {
		{CAN_AXIS_EMCY, 0x8611, 0x21, "(8611h), error register 21h"},
		{CAN_AXIS_DRIVE_FAULT, 0, 0, "does not say why"},
		{CAN_AXIS_NOT_ENABLED, CIA402_DISABLED, 0, "switch-on disabled"},
		{CAN_AXIS_NO_HEARTBEAT, 150, 0, "no heartbeat of it for 150 ms"},
		{CAN_AXIS_NO_TPDO, 150, 0, "(TPDO1) of it for 150 ms"},
		{CAN_AXIS_NO_INPUTS, 300, 0, "not heard for 300 ms"},
		{CAN_AXIS_REBOOTED, 0, 0, "began anew"},
		{CAN_AXIS_NMT, CANOPEN_STOPPED, 0, "stopped"},
		{CAN_AXIS_BUS_OFF, 0, 0, "the bus is off"},
		{CAN_AXIS_QUEUE_FULL, 6, 0, "for 6 cycles"},
		{CAN_AXIS_BUS_FAILED, ENETDOWN, 0, "Network is down"},
		{CAN_AXIS_FOREIGN, 0, 0, "another program"},
		{CAN_AXIS_OFF_TARGET, 200, 0, "by 1.5 mm"},
		{CAN_AXIS_NO_START, CIA402_READY, 0, "stays in ready to switch on"},
		{CAN_AXIS_NO_HOME, 0, 0, "its homing failed"},
		{CAN_AXIS_HOME_TIME, 0, 0, "not done in time"},
		{CAN_AXIS_OUTSIDE, -100, 0, "to -0.750 mm"},
		{CAN_AXIS_NO_STOP, CIA402_ENABLED, 0, "operation enabled: switch"},
	};
	struct can_axis axis = {.setup.step_mm = 0.0075};
	char text[300] = "as it was";

	assert_int_equal(can_axis_why(&axis, text, sizeof(text)), 0);
	assert_string_equal(text, "as it was");
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int length;

		axis.why = (int)cases[i].why;
		axis.why_a = cases[i].a;
		axis.why_b = cases[i].b;
		length = can_axis_why(&axis, text, sizeof(text));
		if (length != (int)strlen(text) || !strstr(text, cases[i].says))
			fail_msg("%d: \"%s\"", cases[i].why, text);
		/* What to do: after a colon or a semicolon. */
		assert_non_null(strpbrk(text, ":;"));
	}
	/* All of them, from the first to the last. */
	assert_int_equal(sizeof(cases) / sizeof(*cases), CAN_AXIS_NO_STOP);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_reason_has_its_own_line),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
