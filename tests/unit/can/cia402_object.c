// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_object.c: what an SDO says becomes a line that names where, which object,
 * why, and what to do.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "led.h"
#include "../../../lib/device/can/cia402/cia402_object.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

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
		 "here: the drive refuses to let quick-stop option (605A:0) be read: invalid "
		 "value (06090030h); see its manual whether it can do this, and its firmware"},
		{-ETIMEDOUT, 0, -ETIMEDOUT,
		 "here: no answer when quick-stop option (605A:0) was to be read; see the "
		 "drive's power, its wiring, node id and bit rate"},
		{-EPROTO, 0, -EPROTO,
		 "here: the answer makes no sense when quick-stop option (605A:0) was to be "
		 "read; see that no other node has this id and that it is a CiA 402 drive"},
		{-EINTR, 0, -EINTR,
		 "here: stopped when quick-stop option (605A:0) was to be read"},
		{-ENETDOWN, 0, -ENETDOWN,
		 "here: the bus can-test failed when quick-stop option (605A:0) was to be "
		 "read: Network is down; see `ip -details link`, cables and termination"},
	};
	struct led *led = *state;
	const struct cia402_talk talk = {&led->master, "here", &led->err};

	for (size_t i = 0; i < COUNT(cases); i++) {
		led->master.abort = cases[i].abort;
		assert_int_equal(cia402_failed(&talk, &word, "read", cases[i].rc),
				 cases[i].expected);
		assert_string_equal(led->err.text, cases[i].line);
	}
}

static void test_objects(void **state)
{
	struct led *led = *state;
	const struct cia402_talk talk = {&led->master, "here", &led->err};
	struct drive_object *o = drive_object(&led->drive, 0x605a, 0);
	uint32_t value = 0;
	uint64_t asked;
	bool has = true;

	assert_int_equal(cia402_keep(&talk, &word, 2), 0);
	assert_int_equal(cia402_ask(&talk, &word, &value), 0);
	assert_int_equal(value, 2);
	assert_int_equal(cia402_keep(&talk, &word, (uint32_t)-1), 0); /* of 16 bits */
	assert_int_equal(o->value, 0xffff);
	/* What is so already is not written. */
	asked = led->drive.requests;
	assert_int_equal(cia402_see_to(&talk, &word, 0xffff), 0);
	assert_int_equal(led->drive.requests, asked + 1);
	o->access = R_;
	assert_int_equal(cia402_see_to(&talk, &word, 0xffff), 0);
	assert_int_equal(cia402_see_to(&talk, &word, 2), -EOPNOTSUPP);
	o->access = RW;
	o->deaf = true;
	assert_int_equal(cia402_keep(&talk, &word, 3), -EPROTO);
	assert_string_equal(
		led->err.text,
		"here: the drive did not keep quick-stop option (605A:0): 3 was "
		"written, 65535 is read (FFFFh); see the range that its manual "
		"gives");

	assert_int_equal(cia402_ask(&talk, &absent, &value), -EOPNOTSUPP);
	assert_int_equal(cia402_tell(&talk, &absent, 1), -EOPNOTSUPP);
	assert_int_equal(cia402_ask_if(&talk, &absent, &value, &has), 0);
	assert_false(has);
	has = true;
	assert_int_equal(cia402_keep_if(&talk, &absent, 1, &has), 0);
	assert_false(has);
	/* Only absence is none; any other refusal is an error. */
	led->drive.abort_index = 0x605a;
	assert_int_equal(cia402_ask_if(&talk, &word, &value, &has), -EOPNOTSUPP);
	assert_int_equal(cia402_keep_if(&talk, &word, 1, &has), -EOPNOTSUPP);
}

static bool never(enum cia402_state state)
{
	return false;
}

static void test_watch(void **state)
{
	struct led *led = *state;
	const struct cia402_talk talk = {&led->master, "here", &led->err};
	enum cia402_state last = CIA402_UNKNOWN;
	int64_t t = led->drive.now_ns;

	assert_int_equal(cia402_watch(&talk, never, 50 * DRIVE_MS, &last), -ETIME);
	assert_int_equal(last, CIA402_DISABLED);
	assert_in_range(led->drive.now_ns - t, 50 * DRIVE_MS, 55 * DRIVE_MS);
	led->drive.mute = true;
	assert_int_equal(cia402_watch(&talk, never, 50 * DRIVE_MS, &last), -ETIMEDOUT);
	led->drive.wait_error = -EINTR;
	assert_int_equal(cia402_pause(&talk, DRIVE_MS), -EINTR);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_lines, setup),
		cmocka_unit_test_setup(test_objects, setup),
		cmocka_unit_test_setup(test_watch, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
