// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/canopen/canopen_text.c: every code is named and carries its number.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <string.h>
#include "../../../lib/device/can/canopen/canopen.h"

/* CiA 301 V4.2, table 22. */
static const uint32_t aborts[] = {
	0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004,
	0x05040005, 0x06010000, 0x06010001, 0x06010002, 0x06020000, 0x06040041,
	0x06040042, 0x06040043, 0x06040047, 0x06060000, 0x06070010, 0x06070012,
	0x06070013, 0x06090011, 0x06090030, 0x06090031, 0x06090032, 0x06090036,
	0x060a0023, 0x08000000, 0x08000020, 0x08000021, 0x08000022, 0x08000023,
	0x08000024,
};

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static void test_aborts(void **state)
{
	char text[100], other[100], number[20];

	for (size_t i = 0; i < COUNT(aborts); i++) {
		canopen_abort_text(aborts[i], text, sizeof(text));
		snprintf(number, sizeof(number), "(%08Xh)", aborts[i]);
		assert_non_null(strstr(text, number));
		assert_null(strstr(text, "does not have"));
		/* Two codes do not read the same. */
		for (size_t j = 0; j < i; j++) {
			canopen_abort_text(aborts[j], other, sizeof(other));
			assert_int_not_equal(
				strncmp(text, other, strlen(text) - strlen(number)), 0);
		}
	}
	assert_string_equal(canopen_abort_text(0x06020000, text, sizeof(text)),
			    "object does not exist (06020000h)");
	canopen_abort_text(0xdeadbeef, text, sizeof(text));
	assert_non_null(strstr(text, "DEADBEEF"));
	assert_non_null(strstr(text, "does not have"));
}

static void test_emcys(void **state)
{
	static const struct {
		uint16_t code;
		const char *text;
	} cases[] = {
		{0x0000, "no error, or reset (0000h)"},
		{0x0001, "an error without a class (0001h)"},
		{0x1000, "generic error (1000h)"},
		{0x1234, "generic error (1234h)"},
		{0x2310, "continuous over-current, motor side (2310h)"},
		{0x2311, "continuous over-current, motor side (2311h)"},
		{0x23ff, "current, motor side (23FFh)"},
		{0x2fff, "current (2FFFh)"},
		{0x3210, "DC link over-voltage (3210h)"},
		{0x4210, "temperature of the device too high (4210h)"},
		{0x5441, "contacts 1 (5441h)"},
		{0x7305, "incremental sensor 1 (7305h)"},
		{0x7320, "position sensor (7320h)"},
		{0x7500, "communication inside the drive (7500h)"},
		{0x8110, "CAN overrun: frames lost (8110h)"},
		{0x8120, "CAN in error passive mode (8120h)"},
		{0x8130, "life guard or heartbeat error (8130h)"},
		{0x8140, "recovered from bus-off (8140h)"},
		{0x8150, "CAN-ID collision (8150h)"},
		{0x8611, "following error too large (8611h)"},
		{0x8612, "reference limit (8612h)"},
		{0xff42, "fault of the manufacturer's own (FF42h)"},
		{0xf001, "additional functions (F001h)"},
		{0xb000, "an error without a class (B000h)"},
	};
	char text[100];

	for (size_t i = 0; i < COUNT(cases); i++)
		assert_string_equal(canopen_emcy_text(cases[i].code, text, sizeof(text)),
				    cases[i].text);
}

/* Any code, any room: it ends and says its number. */
static void test_all_emcys(void **state)
{
	char text[100], number[12];

	for (uint32_t code = 0; code <= UINT16_MAX; code++) {
		canopen_emcy_text((uint16_t)code, text, sizeof(text));
		snprintf(number, sizeof(number), "(%04Xh)", code);
		assert_non_null(strstr(text, number));
		assert_true(strlen(text) > strlen(number) + 3); /* "RAM" and a space */
	}
	for (size_t size = 1; size < 12; size++) {
		memset(text, 'x', sizeof(text));
		canopen_emcy_text(0x8611, text, size);
		assert_int_equal(strlen(text), size - 1);
		assert_int_equal(text[size], 'x');
	}
}

static void test_states(void **state)
{
	assert_string_equal(canopen_state_name(CANOPEN_PRE_OPERATIONAL),
			    "pre-operational");
	assert_string_equal(canopen_state_name(CANOPEN_OPERATIONAL), "operational");
	assert_string_equal(canopen_state_name(CANOPEN_STOPPED), "stopped");
	assert_string_equal(canopen_state_name(CANOPEN_BOOT_UP), "booting");
	assert_string_equal(canopen_state_name(CANOPEN_UNKNOWN), "not heard");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_aborts),
		cmocka_unit_test(test_emcys),
		cmocka_unit_test(test_all_emcys),
		cmocka_unit_test(test_states),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
