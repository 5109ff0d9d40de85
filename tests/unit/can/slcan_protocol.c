// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/slcan_protocol.c against lines written by hand from Lawicel's manual, and
 * against itself: formatted frames are parsed back. slcan.c tests the status over a pty.
 */
#include "../unit.h"
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "../../../lib/device/can/bus/slcan_protocol.h"
#include "candump.h"

#define MS INT64_C(1000000)

/* Returns the last kind other than SLCAN_NONE. */
static enum slcan_kind receive(struct slcan_line *line, const char *bytes, size_t n,
			       struct slcan_message *message)
{
	enum slcan_kind kind = SLCAN_NONE;

	for (size_t i = 0; i < n; i++) {
		enum slcan_kind one =
			slcan_line_receive(line, (unsigned char)bytes[i], message);

		if (one != SLCAN_NONE)
			kind = one;
	}
	return kind;
}

static const struct {
	const char *text; /* without its CR */
	const char *frame;
} frames[] = {
	{"t1230", "123#"},
	{"t7FF1a5", "7FF#A5"},
	{"t456311aAfF", "456#11AAFF"},
	{"t18181122334455667788", "181#1122334455667788"},
	{"t1801AAEA5F", "180#AA"},
	{"t0800ffff", "080#"},
	{"T12ABCDEF2AA55", "12ABCDEF#AA55"},
	{"T1FFFFFFF81122334455667788EA5F", "1FFFFFFF#1122334455667788"},
	{"r1230", "123#R"},
	{"r12380001", "123#R8"},
	{"R000000018", "00000001#R8"},
};

TEST(frames_are_read)
{
	for (size_t i = 0; i < sizeof(frames) / sizeof(*frames); i++) {
		struct can_frame frame = candump_read(frames[i].frame);
		struct slcan_line line = {0};
		struct slcan_message message;

		assert_int_equal(receive(&line, frames[i].text, strlen(frames[i].text),
					 &message),
				 SLCAN_NONE);
		assert_int_equal(slcan_line_receive(&line, '\r', &message), SLCAN_FRAME);
		assert_memory_equal(&message.frame, &frame, sizeof(frame));
		/* An LF after CR belongs to no line. */
		assert_int_equal(slcan_line_receive(&line, '\n', &message), SLCAN_NONE);
		assert_int_equal(receive(&line, "t1230\r", 6, &message), SLCAN_FRAME);
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
	/* timestamps */
	{"t1231AA12F4\r", 12, SLCAN_FRAME},
	{"t1231AA0012F4E0\r", 16, SLCAN_FRAME},
	{"T1FFFFFFF81122334455667788000EA5F0\r", 35, SLCAN_FRAME},
	/* commands of another host, or answers to one */
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
	{"t1231AA12F4E0\r", 14, SLCAN_BROKEN},
	{"t1231AA0012G4E0\r", 16, SLCAN_BROKEN},
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

TEST(every_line_has_its_kind)
{
	for (size_t i = 0; i < sizeof(lines) / sizeof(*lines); i++) {
		struct slcan_line line = {0};
		struct slcan_message message;
		enum slcan_kind kind =
			receive(&line, lines[i].text, lines[i].n, &message);

		if (kind != lines[i].kind)
			fail_msg("line %zu: kind %d, not %d", i, kind, lines[i].kind);
		/* After any line the next one is parsed. */
		assert_int_equal(receive(&line, "t1230\r", 6, &message), SLCAN_FRAME);
		assert_int_equal(message.frame.can_id, 0x123);
	}
}

TEST(status_is_read)
{
	static const struct {
		const char *line;
		int state;
	} cases[] = {
		{"sa057033\r", CAN_STATE_ERROR_ACTIVE},
		{"sw100000\r", CAN_STATE_ERROR_WARNING},
		{"sp000130\r", CAN_STATE_ERROR_PASSIVE},
		{"sb256256\r", CAN_STATE_BUS_OFF},
	};
	struct slcan_line line = {0};
	struct slcan_message message;

	assert_int_equal(receive(&line, "FaF\r", 4, &message), SLCAN_FLAGS);
	assert_int_equal(message.flags, 0xaf);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		assert_int_equal(receive(&line, cases[i].line, 9, &message), SLCAN_STATE);
		assert_int_equal(message.state, cases[i].state);
	}
}

/* Junk of any length is one broken line, and the next line is parsed. */
TEST(long_junk_is_one_line)
{
	struct slcan_line line = {0};
	struct slcan_message message;

	for (int i = 0; i < 100000; i++)
		assert_int_equal(slcan_line_receive(&line, "t1230\n\0z"[i % 8], &message),
				 SLCAN_NONE);
	assert_int_equal(slcan_line_receive(&line, '\r', &message), SLCAN_BROKEN);
	assert_int_equal(receive(&line, "t1230\r", 6, &message), SLCAN_FRAME);
}

TEST(a_formatted_frame_is_parsed_back)
{
	srand(1);
	for (int i = 0; i < 20000; i++) {
		struct can_frame frame = {.can_dlc = (uint8_t)(rand() % 9)};
		struct slcan_line line = {0};
		struct slcan_message message;
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
		n = slcan_line_format(text, &frame);
		assert_in_range(n, 6, SLCAN_LINE_MAX);
		assert_int_equal(text[n - 1], '\r');
		assert_int_equal(text[SLCAN_LINE_MAX], 'x');
		assert_int_equal(receive(&line, text, n, &message), SLCAN_FRAME);
		assert_memory_equal(&message.frame, &frame, sizeof(frame));
	}
}

TEST(a_line_is_that_of_the_manual)
{
	static const struct {
		const char *frame, *line;
	} cases[] = {
		{"12ABCDEF#AA55", "T12ABCDEF2AA55\r"},
		{"080#", "t0800\r"},
		{"123#R8", "r1238\r"},
		{"20000000#0000000000000000", ""}, /* an error frame */
	};
	struct can_frame frame;
	char text[SLCAN_LINE_MAX];

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		size_t n = strlen(cases[i].line);

		frame = candump_read(cases[i].frame);
		assert_int_equal(slcan_line_format(text, &frame), n);
		assert_memory_equal(text, cases[i].line, n);
	}
	frame.can_id = 0x080;
	frame.can_dlc = 9;
	assert_int_equal(slcan_line_format(text, &frame), 0);
}

static bool refused(struct slcan_status *status)
{
	const struct slcan_message message = {.flags = 0xff, .state = CAN_STATE_BUS_OFF};
	struct can_frame frame;

	return slcan_status_update(status, SLCAN_REFUSED, &message, &frame);
}

TEST(a_query_is_due_each_100_ms)
{
	struct slcan_status status;

	slcan_status_init(&status, 0, 1000 * MS);
	assert_int_equal(status.state, -EOPNOTSUPP);
	assert_false(slcan_status_due(&status, 1100 * MS - 1));
	assert_true(slcan_status_due(&status, 1100 * MS));
	/* It stays due until it was sent: the tty may have refused the line. */
	assert_true(slcan_status_due(&status, 1150 * MS));
	slcan_status_queried(&status, 1150 * MS);
	assert_false(slcan_status_due(&status, 1250 * MS - 1));
	assert_true(slcan_status_due(&status, 1250 * MS));
}

/* Refusals answer first the start commands, then queries, then frames. */
TEST(refusals_answer_in_order_of_sending)
{
	struct slcan_status status;
	int64_t now = 0;

	slcan_status_init(&status, 2, now);
	assert_false(refused(&status));
	assert_false(refused(&status));
	assert_true(refused(&status));
	for (int i = 0; i < 3; i++) {
		now += 100 * MS;
		assert_true(slcan_status_due(&status, now));
		slcan_status_queried(&status, now);
		assert_false(refused(&status));
		assert_true(refused(&status));
	}
	/* The adapter does not implement the query. */
	assert_false(slcan_status_due(&status, now + 1000 * MS));
}

TEST(an_adapter_that_answered_is_queried_on)
{
	const struct slcan_message message = {.flags = 0};
	struct slcan_status status;
	struct can_frame frame;
	int64_t now = 0;

	slcan_status_init(&status, 0, now);
	slcan_status_queried(&status, now);
	assert_false(slcan_status_update(&status, SLCAN_FLAGS, &message, &frame));
	assert_int_equal(status.state, CAN_STATE_ERROR_ACTIVE);
	for (int i = 0; i < 10; i++) {
		now += 100 * MS;
		assert_true(slcan_status_due(&status, now));
		slcan_status_queried(&status, now);
		assert_true(refused(&status));
	}
}

/* All 256 flags after all others: each change is reported once, by a valid frame. */
TEST(a_change_is_reported_once)
{
	struct slcan_status status;
	struct can_frame frame;

	slcan_status_init(&status, 0, 0);
	for (unsigned int before = 0; before < 256; before++)
		for (unsigned int flags = 0; flags < 256; flags++) {
			const struct slcan_message first = {.flags = (uint8_t)before},
						   then = {.flags = (uint8_t)flags};
			unsigned int fresh = flags & ~before;
			int was;
			bool says;

			slcan_status_update(&status, SLCAN_FLAGS, &first, &frame);
			was = status.state;
			says = slcan_status_update(&status, SLCAN_FLAGS, &then, &frame);
			assert_int_equal(status.state, flags & SLCAN_PASSIVE
							       ? CAN_STATE_ERROR_PASSIVE
						       : flags & SLCAN_WARNING
							       ? CAN_STATE_ERROR_WARNING
							       : CAN_STATE_ERROR_ACTIVE);
			assert_int_equal(
				says, status.state != was ||
					      fresh & (SLCAN_RX_FULL | SLCAN_TX_FULL |
						       SLCAN_OVERRUN | SLCAN_BUS_ERROR));
			if (!says)
				continue;
			assert_int_equal(frame.can_dlc, CAN_ERR_DLC);
			assert_true(frame.can_id & CAN_ERR_FLAG);
			assert_int_equal(!!(frame.can_id & CAN_ERR_BUSERROR),
					 !!(fresh & SLCAN_BUS_ERROR));
			assert_int_equal(!!(frame.data[1] & CAN_ERR_CRTL_RX_OVERFLOW),
					 !!(fresh & (SLCAN_RX_FULL | SLCAN_OVERRUN)));
			/* The same again is no change. */
			assert_false(
				slcan_status_update(&status, SLCAN_FLAGS, &then, &frame));
		}
}

/* Flags have no bus-off: they do not end it. */
TEST(bus_off_ends_when_a_state_reports_it)
{
	const struct slcan_message off = {.state = CAN_STATE_BUS_OFF},
				   on = {.state = CAN_STATE_ERROR_ACTIVE},
				   flags = {.flags = SLCAN_PASSIVE};
	struct slcan_status status;
	struct can_frame frame;

	slcan_status_init(&status, 0, 0);
	assert_true(slcan_status_update(&status, SLCAN_STATE, &off, &frame));
	assert_int_equal(frame.can_id, CAN_ERR_FLAG | CAN_ERR_BUSOFF);
	assert_false(slcan_status_update(&status, SLCAN_FLAGS, &flags, &frame));
	assert_int_equal(status.state, CAN_STATE_BUS_OFF);
	assert_true(slcan_status_update(&status, SLCAN_STATE, &on, &frame));
	assert_int_equal(frame.can_id, CAN_ERR_FLAG | CAN_ERR_CRTL | CAN_ERR_RESTARTED);
	assert_false(slcan_status_update(&status, SLCAN_FRAME, &on, &frame));
}
