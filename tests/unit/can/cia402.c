// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402.c: words and PDOs; objects by SDO, with messages that name the
 * drive, the object, the reason and what to do.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>
#include "../../../lib/device/can/cia402/cia402.h"
#include "led.h"

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
		bool powered = true; /* an unknown state may have power */

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

/* One step at a time; none leads out of a fault. */
static void test_next_controlword(void **state)
{
	assert_int_equal(cia402_next_controlword(CIA402_DISABLED), 0x06);
	assert_int_equal(cia402_next_controlword(CIA402_READY), 0x07);
	assert_int_equal(cia402_next_controlword(CIA402_SWITCHED_ON), 0x0f);
	assert_int_equal(cia402_next_controlword(CIA402_ENABLED), 0x0f);
	assert_int_equal(cia402_next_controlword(CIA402_FAULT), 0);
	assert_int_equal(cia402_next_controlword(CIA402_FAULT_REACTION), 0);
	assert_int_equal(cia402_next_controlword(CIA402_QUICK_STOP), 0);
	assert_int_equal(cia402_next_controlword(CIA402_NOT_READY), 0);
	assert_int_equal(cia402_next_controlword(CIA402_UNKNOWN), 0);
}

static void test_pack_rpdo(void **state)
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
		cia402_pack_rpdo(&frame, 0x10, cases[i].mode, 0x010f, cases[i].target);
		assert_int_equal(frame.can_id, 0x210);
		assert_int_equal(frame.len, cases[i].len);
		assert_memory_equal(frame.data, cases[i].bytes, cases[i].len);
	}
}

static void test_parse_tpdos(void **state)
{
	struct can_frame frame = {.can_id = 0x190, .len = 6};
	uint32_t inputs = 7;
	uint16_t word = 7;
	int32_t position = 7;

	memcpy(frame.data, "\x37\x12\xfe\xff\xff\xff", 6);
	assert_true(cia402_parse_status(&frame, &word, &position));
	assert_int_equal(word, 0x1237);
	assert_int_equal(position, -2);
	assert_false(cia402_parse_inputs(&frame, &inputs));

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
		assert_false(cia402_parse_status(&frame, &word, &position));
	}
	assert_int_equal(word, 7);
	assert_int_equal(position, 7);

	frame = (struct can_frame){.can_id = 0x290, .len = 4, .data = {9, 0, 0, 0x80}};
	assert_true(cia402_parse_inputs(&frame, &inputs));
	assert_int_equal(inputs, 0x80000009);
	frame.len = 3;
	assert_false(cia402_parse_inputs(&frame, &inputs));
}

static int setup(void **state)
{
	static struct led led;

	led_init(&led);
	*state = &led;
	return 0;
}

static const struct cia402_object word = {0x605a, 0, 2, "quick-stop option"};
static const struct cia402_object absent = {0x2000, 3, 4, "nothing"};

static void test_lines(void **state)
{
	static const struct {
		int rc;
		uint32_t abort;
		int expected;
		const char *line;
	} cases[] = {
		{-EREMOTEIO, 0x06090030, -EOPNOTSUPP,
		 "here: the drive does not allow its quick-stop option (605A:0) to be "
		 "read: invalid value (06090030h); check its manual and its firmware"},
		{-ETIMEDOUT, 0, -ETIMEDOUT,
		 "here: no answer when quick-stop option (605A:0) was to be read; "
		 "check the drive's power, its wiring, node id and bit rate"},
		{-EPROTO, 0, -EPROTO,
		 "here: invalid answer when quick-stop option (605A:0) was to be read; "
		 "check that no other node has this id and that it is a CiA 402 drive"},
		{-EINTR, 0, -EINTR,
		 "here: stopped when quick-stop option (605A:0) was to be read"},
		{-ENETDOWN, 0, -ENETDOWN,
		 "here: the bus can-test failed when quick-stop option (605A:0) was to "
		 "be read: Network is down; check `ip -details link`, cables and "
		 "termination"},
	};
	struct led *led = *state;

	for (size_t i = 0; i < COUNT(cases); i++) {
		led->master.abort = cases[i].abort;
		assert_int_equal(cia402_fail(&led->client, &word, "read", cases[i].rc),
				 cases[i].expected);
		assert_string_equal(led->err.text, cases[i].line);
	}
}

static void test_objects(void **state)
{
	struct led *led = *state;
	struct drive_object *o = drive_object(&led->drive, 0x605a, 0);
	uint32_t value = 0;
	uint64_t asked;
	bool has = true;

	assert_int_equal(cia402_write_verified(&led->client, &word, 2), 0);
	assert_int_equal(cia402_read(&led->client, &word, &value), 0);
	assert_int_equal(value, 2);
	assert_int_equal(cia402_write_verified(&led->client, &word, (uint32_t)-1),
			 0); /* of 16 bits */
	assert_int_equal(o->value, 0xffff);
	/* An equal value is not written. */
	asked = led->drive.requests;
	assert_int_equal(cia402_ensure(&led->client, &word, 0xffff), 0);
	assert_int_equal(led->drive.requests, asked + 1);
	o->access = R_;
	assert_int_equal(cia402_ensure(&led->client, &word, 0xffff), 0);
	assert_int_equal(cia402_ensure(&led->client, &word, 2), -EOPNOTSUPP);
	o->access = RW;
	o->deaf = true;
	assert_int_equal(cia402_write_verified(&led->client, &word, 3), -EPROTO);
	assert_string_equal(
		led->err.text,
		"here: the drive did not keep quick-stop option (605A:0): 3 was "
		"written, 65535 is read (FFFFh); check the range in its manual");

	assert_int_equal(cia402_read(&led->client, &absent, &value), -EOPNOTSUPP);
	assert_int_equal(cia402_write(&led->client, &absent, 1), -EOPNOTSUPP);
	assert_int_equal(cia402_read_optional(&led->client, &absent, &value, &has), 0);
	assert_false(has);
	has = true;
	assert_int_equal(cia402_write_optional(&led->client, &absent, 1, &has), 0);
	assert_false(has);
	/* Any other refusal than absence is an error. */
	led->drive.abort_index = 0x605a;
	assert_int_equal(cia402_read_optional(&led->client, &word, &value, &has),
			 -EOPNOTSUPP);
	assert_int_equal(cia402_write_optional(&led->client, &word, 1, &has),
			 -EOPNOTSUPP);
}

static bool never(enum cia402_state state)
{
	return false;
}

static void test_await_state(void **state)
{
	struct led *led = *state;
	enum cia402_state last = CIA402_UNKNOWN;
	int64_t t = led->drive.now_ns;

	assert_int_equal(cia402_await_state(&led->client, never, 50 * DRIVE_MS, &last),
			 -ETIME);
	assert_int_equal(last, CIA402_DISABLED);
	assert_in_range(led->drive.now_ns - t, 50 * DRIVE_MS, 55 * DRIVE_MS);
	led->drive.mute = true;
	assert_int_equal(cia402_await_state(&led->client, never, 50 * DRIVE_MS, &last),
			 -ETIMEDOUT);
	led->drive.wait_error = -EINTR;
	assert_int_equal(cia402_pause(&led->client, DRIVE_MS), -EINTR);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_states),
		cmocka_unit_test(test_names),
		cmocka_unit_test(test_next_controlword),
		cmocka_unit_test(test_pack_rpdo),
		cmocka_unit_test(test_parse_tpdos),
		cmocka_unit_test_setup(test_lines, setup),
		cmocka_unit_test_setup(test_objects, setup),
		cmocka_unit_test_setup(test_await_state, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
