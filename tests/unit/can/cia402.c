// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402.c: every statusword against the standard's table, PDOs bit by bit.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>
#include "../../../lib/device/can/cia402/cia402.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

/* IEC 61800-7-201, statusword: xxxx xxxx x0xx 0000b and so on; x: mask bit 0. */
static const struct {
	const char *bits; /* 6 5 3 2 1 0 */
	enum cia402_state state;
	bool powered;
} table[] = {
	{"0x0000", CIA402_NOT_READY, false},	 {"1x0000", CIA402_DISABLED, false},
	{"010001", CIA402_READY, false},	 {"010011", CIA402_SWITCHED_ON, true},
	{"010111", CIA402_ENABLED, true},	 {"000111", CIA402_QUICK_STOP, true},
	{"0x1111", CIA402_FAULT_REACTION, true}, {"0x1000", CIA402_FAULT, false},
};

static bool matches(uint32_t word, const char *bits)
{
	static const int position[] = {6, 5, 3, 2, 1, 0};

	for (int i = 0; i < 6; i++)
		if (bits[i] != 'x' && (bits[i] == '1') != !!(word & 1u << position[i]))
			return false;
	return true;
}

static void test_states(void **state)
{
	for (uint32_t word = 0; word <= UINT16_MAX; word++) {
		enum cia402_state expected = CIA402_UNKNOWN;
		bool powered = true; /* what is not known may have power */

		for (size_t i = 0; i < COUNT(table); i++)
			if (matches(word, table[i].bits)) {
				assert_int_equal(expected, CIA402_UNKNOWN);
				expected = table[i].state;
				powered = table[i].powered;
			}
		assert_int_equal(cia402_state((uint16_t)word), expected);
		assert_int_equal(cia402_powered(expected), powered);
	}
}

static void test_names(void **state)
{
	for (int i = 0; i <= CIA402_UNKNOWN; i++)
		for (int j = 0; j < i; j++)
			assert_string_not_equal(cia402_state_name((enum cia402_state)i),
						cia402_state_name((enum cia402_state)j));
	assert_string_equal(cia402_state_name(CIA402_ENABLED), "operation enabled");
	assert_string_equal(cia402_state_name((enum cia402_state)99), "unknown");
	assert_string_equal(cia402_state_name((enum cia402_state) - 1), "unknown");
	assert_string_equal(cia402_mode_name(CIA402_CSP), "CSP (8)");
	assert_string_equal(cia402_mode_name(CIA402_CSV), "CSV (9)");
	assert_string_equal(cia402_mode_name(CIA402_CST), "CST (10)");
	assert_string_equal(cia402_mode_name(CIA402_HOMING), "homing (6)");
	assert_string_equal(cia402_mode_name(-3), "manufacturer's own");
	assert_string_equal(cia402_mode_name(INT32_MAX), "unknown");
}

/* One step at a time; out of what went wrong there is none. */
static void test_up(void **state)
{
	assert_int_equal(cia402_up(CIA402_DISABLED), 0x06);
	assert_int_equal(cia402_up(CIA402_READY), 0x07);
	assert_int_equal(cia402_up(CIA402_SWITCHED_ON), 0x0f);
	assert_int_equal(cia402_up(CIA402_ENABLED), 0x0f);
	assert_int_equal(cia402_up(CIA402_FAULT), 0);
	assert_int_equal(cia402_up(CIA402_FAULT_REACTION), 0);
	assert_int_equal(cia402_up(CIA402_QUICK_STOP), 0);
	assert_int_equal(cia402_up(CIA402_NOT_READY), 0);
	assert_int_equal(cia402_up(CIA402_UNKNOWN), 0);
}

static void test_put(void **state)
{
	static const struct {
		enum cia402_mode mode;
		int32_t target;
		uint8_t len;
		const char *bytes;
	} cases[] = {
		{CIA402_CSP, 0x12345678, 6, "\x0f\x01\x78\x56\x34\x12"},
		{CIA402_CSP, -1, 6, "\x0f\x01\xff\xff\xff\xff"},
		{CIA402_CSV, INT32_MIN, 6, "\x0f\x01\x00\x00\x00\x80"},
		{CIA402_CST, -2, 4, "\x0f\x01\xfe\xff"},
		{CIA402_CST, 70000, 4, "\x0f\x01\xff\x7f"}, /* held, not wrapped */
		{CIA402_CST, -70000, 4, "\x0f\x01\x00\x80"},
	};
	struct can_frame frame;

	for (size_t i = 0; i < COUNT(cases); i++) {
		memset(&frame, 0xa5, sizeof(frame));
		cia402_put(&frame, 0x10, cases[i].mode, 0x010f, cases[i].target);
		assert_int_equal(frame.can_id, 0x210);
		assert_int_equal(frame.len, cases[i].len);
		assert_memory_equal(frame.data, cases[i].bytes, cases[i].len);
	}
}

static void test_get(void **state)
{
	struct can_frame frame = {.can_id = 0x190, .len = 6};
	uint32_t inputs = 7;
	uint16_t word = 7;
	int32_t position = 7;

	memcpy(frame.data, "\x37\x12\xfe\xff\xff\xff", 6);
	assert_true(cia402_get(&frame, &word, &position));
	assert_int_equal(word, 0x1237);
	assert_int_equal(position, -2);
	assert_false(cia402_get_inputs(&frame, &inputs));

	static const struct {
		uint32_t id;
		uint8_t len;
	} wrong[] = {
		{0x190, 5},
		{0x190, 0},
		{0x190, 9},
		{0x290, 6},
		{0x210, 6},
		{0x190 | CAN_RTR_FLAG, 6},
		{0x190 | CAN_EFF_FLAG, 6},
		{0x190 | CAN_ERR_FLAG, 8},
	};
	word = 7;
	position = 7;
	for (size_t i = 0; i < COUNT(wrong); i++) {
		frame.can_id = wrong[i].id;
		frame.len = wrong[i].len;
		assert_false(cia402_get(&frame, &word, &position));
	}
	assert_int_equal(word, 7);
	assert_int_equal(position, 7);

	frame = (struct can_frame){.can_id = 0x290, .len = 4, .data = {9, 0, 0, 0x80}};
	assert_true(cia402_get_inputs(&frame, &inputs));
	assert_int_equal(inputs, 0x80000009);
	frame.len = 3;
	assert_false(cia402_get_inputs(&frame, &inputs));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_states), cmocka_unit_test(test_names),
		cmocka_unit_test(test_up),     cmocka_unit_test(test_put),
		cmocka_unit_test(test_get),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
