// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/slcan_line.c against lines written by hand from Lawicel's manual, and
 * against itself: what it says it must read back.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>
#include <linux/can/netlink.h>
#include "../../../lib/device/can/bus/slcan_line.h"

/* The last kind that is not SLCAN_NONE, of all bytes. */
static enum slcan_kind take(struct slcan_line *line, const char *bytes, size_t n,
			    struct slcan_told *told)
{
	enum slcan_kind kind = SLCAN_NONE;

	for (size_t i = 0; i < n; i++) {
		enum slcan_kind one =
			slcan_line_take(line, (unsigned char)bytes[i], told);

		if (one != SLCAN_NONE)
			kind = one;
	}
	return kind;
}

static const struct {
	const char *text; /* without its CR */
	struct can_frame frame;
} frames[] = {
	{"t1230", {.can_id = 0x123}},
	{"t7FF1a5", {.can_id = 0x7ff, .can_dlc = 1, .data = {0xa5}}},
	{"t456311aAfF", {.can_id = 0x456, .can_dlc = 3, .data = {0x11, 0xaa, 0xff}}},
	{"t18181122334455667788",
	 {.can_id = 0x181,
	  .can_dlc = 8,
	  .data = {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88}}},
	{"t1801AAEA5F", {.can_id = 0x180, .can_dlc = 1, .data = {0xaa}}},
	{"t0800ffff", {.can_id = 0x080}},
	{"T12ABCDEF2AA55",
	 {.can_id = 0x12abcdef | CAN_EFF_FLAG, .can_dlc = 2, .data = {0xaa, 0x55}}},
	{"T1FFFFFFF81122334455667788EA5F",
	 {.can_id = CAN_EFF_MASK | CAN_EFF_FLAG,
	  .can_dlc = 8,
	  .data = {0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88}}},
	{"r1230", {.can_id = 0x123 | CAN_RTR_FLAG}},
	{"r12380001", {.can_id = 0x123 | CAN_RTR_FLAG, .can_dlc = 8}},
	{"R000000018", {.can_id = 1 | CAN_EFF_FLAG | CAN_RTR_FLAG, .can_dlc = 8}},
};

static void frames_are_read(void **state)
{
	for (size_t i = 0; i < sizeof(frames) / sizeof(*frames); i++) {
		struct slcan_line line = {0};
		struct slcan_told told;

		assert_int_equal(take(&line, frames[i].text, strlen(frames[i].text),
				      &told),
				 SLCAN_NONE);
		assert_int_equal(slcan_line_take(&line, '\r', &told), SLCAN_FRAME);
		assert_memory_equal(&told.frame, &frames[i].frame, sizeof(told.frame));
		/* LF after CR is of no line. */
		assert_int_equal(slcan_line_take(&line, '\n', &told), SLCAN_NONE);
		assert_int_equal(take(&line, "t1230\r", 6, &told), SLCAN_FRAME);
	}
}

static const struct {
	const char *text;
	size_t n;
	enum slcan_kind kind;
} lines[] = {
	{"\r", 1, SLCAN_NONE},
	{"z\r", 2, SLCAN_NONE},
	{"Z\r", 2, SLCAN_NONE},
	{"\a", 1, SLCAN_REFUSED},
	{"z\r\a", 3, SLCAN_REFUSED},
	{"\nF80\r", 5, SLCAN_FLAGS},
	{"sb256256\r", 9, SLCAN_STATE},
	/* of another host, or answers to one */
	{"C\r", 2, SLCAN_OTHER},
	{"S8\r", 3, SLCAN_OTHER},
	{"O\r", 2, SLCAN_OTHER},
	{"Z1\r", 3, SLCAN_OTHER},
	{"V1013\r", 6, SLCAN_OTHER},
	{"NA123\r", 6, SLCAN_OTHER},
	{"F\r", 2, SLCAN_OTHER},
	{"sx256256\r", 9, SLCAN_OTHER},
	{"sa25625\r", 8, SLCAN_OTHER},
	{"d1239\r", 6, SLCAN_OTHER},
	/* no lines */
	{"t\r", 2, SLCAN_BROKEN},
	{"t123\r", 5, SLCAN_BROKEN},
	{"t8000\r", 6, SLCAN_BROKEN},
	{"t12g0\r", 6, SLCAN_BROKEN},
	{"t123g\r", 6, SLCAN_BROKEN},
	{"t1239112233445566778899\r", 24, SLCAN_BROKEN},
	{"t1231\r", 6, SLCAN_BROKEN},
	{"t1231A\r", 7, SLCAN_BROKEN},
	{"t1231AAB\r", 9, SLCAN_BROKEN},
	{"t1231AABBCCD\r", 13, SLCAN_BROKEN},
	{"t1231AA12G4\r", 12, SLCAN_BROKEN},
	{"t1231At\r", 8, SLCAN_BROKEN},
	{"T200000000\r", 11, SLCAN_BROKEN},
	{"T1234567\r", 9, SLCAN_BROKEN},
	{"r123811\r", 8, SLCAN_BROKEN},
	{"t12\0"
	 "0\r",
	 6, SLCAN_BROKEN},
	{"\0\0\r", 3, SLCAN_BROKEN},
	{"login: \r", 8, SLCAN_BROKEN},
	{"\xff\xfe\r", 3, SLCAN_BROKEN},
	{"t123\a", 5, SLCAN_BROKEN},
	{"T1FFFFFFF81122334455667788EA5F0\r", 32, SLCAN_BROKEN},
};

static void every_line_has_its_kind(void **state)
{
	for (size_t i = 0; i < sizeof(lines) / sizeof(*lines); i++) {
		struct slcan_line line = {0};
		struct slcan_told told;
		enum slcan_kind kind = take(&line, lines[i].text, lines[i].n, &told);

		if (kind != lines[i].kind)
			fail_msg("line %zu: kind %d, not %d", i, kind, lines[i].kind);
		/* Whatever it was, the next one is read. */
		assert_int_equal(take(&line, "t1230\r", 6, &told), SLCAN_FRAME);
		assert_int_equal(told.frame.can_id, 0x123);
	}
}

static void status_is_read(void **state)
{
	struct slcan_line line = {0};
	struct slcan_told told;

	assert_int_equal(take(&line, "FaF\r", 4, &told), SLCAN_FLAGS);
	assert_int_equal(told.flags, 0xaf);
	assert_int_equal(take(&line, "sa057033\r", 9, &told), SLCAN_STATE);
	assert_int_equal(told.state, CAN_STATE_ERROR_ACTIVE);
	assert_int_equal(take(&line, "sw100000\r", 9, &told), SLCAN_STATE);
	assert_int_equal(told.state, CAN_STATE_ERROR_WARNING);
	assert_int_equal(take(&line, "sp000130\r", 9, &told), SLCAN_STATE);
	assert_int_equal(told.state, CAN_STATE_ERROR_PASSIVE);
	assert_int_equal(take(&line, "sb256256\r", 9, &told), SLCAN_STATE);
	assert_int_equal(told.state, CAN_STATE_BUS_OFF);
}

/* However long junk is, it is one broken line, and what follows it is read. */
static void long_junk_is_one_line(void **state)
{
	struct slcan_line line = {0};
	struct slcan_told told;

	for (int i = 0; i < 100000; i++)
		assert_int_equal(slcan_line_take(&line, "t1230\n\0z"[i % 8], &told),
				 SLCAN_NONE);
	assert_int_equal(slcan_line_take(&line, '\r', &told), SLCAN_BROKEN);
	assert_int_equal(take(&line, "t1230\r", 6, &told), SLCAN_FRAME);
}

static void what_is_said_is_read_back(void **state)
{
	srand(1);
	for (int i = 0; i < 20000; i++) {
		struct can_frame frame = {.can_dlc = (uint8_t)(rand() % 9)};
		struct slcan_line line = {0};
		struct slcan_told told;
		char text[SLCAN_LINE_MAX + 1];
		size_t n;

		frame.can_id =
			(uint32_t)rand() & (rand() & 1 ? CAN_SFF_MASK : CAN_EFF_MASK);
		if (frame.can_id > CAN_SFF_MASK || rand() & 1)
			frame.can_id |= CAN_EFF_FLAG;
		if (rand() & 1)
			frame.can_id |= CAN_RTR_FLAG;
		for (int k = 0; k < frame.can_dlc && !(frame.can_id & CAN_RTR_FLAG); k++)
			frame.data[k] = (uint8_t)rand();
		text[SLCAN_LINE_MAX] = 'x';
		n = slcan_line_put(text, &frame);
		assert_in_range(n, 6, SLCAN_LINE_MAX);
		assert_int_equal(text[n - 1], '\r');
		assert_int_equal(text[SLCAN_LINE_MAX], 'x');
		assert_int_equal(take(&line, text, n, &told), SLCAN_FRAME);
		assert_memory_equal(&told.frame, &frame, sizeof(frame));
	}
}

static void a_line_is_as_the_manual_says(void **state)
{
	struct can_frame frame = {
		.can_id = 0x12abcdef | CAN_EFF_FLAG, .can_dlc = 2, .data = {0xaa, 0x55}};
	char text[SLCAN_LINE_MAX];

	assert_int_equal(slcan_line_put(text, &frame), 15);
	assert_memory_equal(text, "T12ABCDEF2AA55\r", 15);
	frame.can_id = 0x080;
	frame.can_dlc = 0;
	assert_int_equal(slcan_line_put(text, &frame), 6);
	assert_memory_equal(text, "t0800\r", 6);
	frame.can_dlc = 9;
	assert_int_equal(slcan_line_put(text, &frame), 0);
	frame.can_dlc = 8;
	frame.can_id = CAN_ERR_FLAG;
	assert_int_equal(slcan_line_put(text, &frame), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(frames_are_read),
		cmocka_unit_test(every_line_has_its_kind),
		cmocka_unit_test(status_is_read),
		cmocka_unit_test(long_junk_is_one_line),
		cmocka_unit_test(what_is_said_is_read_back),
		cmocka_unit_test(a_line_is_as_the_manual_says),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
