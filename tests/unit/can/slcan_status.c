// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/bus/slcan_status.c; the same over a pty is in slcan.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "../../../lib/device/can/bus/slcan_status.h"

#define MS INT64_C(1000000)

static bool refused(struct slcan_status *status)
{
	const struct slcan_told told = {.flags = 0xff, .state = CAN_STATE_BUS_OFF};
	struct can_frame frame;

	return slcan_status_take(status, SLCAN_REFUSED, &told, &frame);
}

static void it_is_asked_each_100_ms(void **state)
{
	struct slcan_status status;

	slcan_status_begin(&status, 0, 1000 * MS);
	assert_int_equal(status.state, -EOPNOTSUPP);
	assert_false(slcan_status_due(&status, 1100 * MS - 1));
	assert_true(slcan_status_due(&status, 1100 * MS));
	/* Until it was: a line that the tty did not take asked nothing. */
	assert_true(slcan_status_due(&status, 1150 * MS));
	slcan_status_asked(&status, 1150 * MS);
	assert_false(slcan_status_due(&status, 1250 * MS - 1));
	assert_true(slcan_status_due(&status, 1250 * MS));
}

/* Refusals are first of the start, then of questions, then of frames. */
static void refusals_are_of_what_was_sent(void **state)
{
	struct slcan_status status;
	int64_t now = 0;

	slcan_status_begin(&status, 2, now);
	assert_false(refused(&status));
	assert_false(refused(&status));
	assert_true(refused(&status));
	for (int i = 0; i < 3; i++) {
		now += 100 * MS;
		assert_true(slcan_status_due(&status, now));
		slcan_status_asked(&status, now);
		assert_false(refused(&status));
		assert_true(refused(&status));
	}
	/* It does not know the question. */
	assert_false(slcan_status_due(&status, now + 1000 * MS));
}

static void who_answered_once_is_asked_on(void **state)
{
	const struct slcan_told told = {.flags = 0};
	struct slcan_status status;
	struct can_frame frame;
	int64_t now = 0;

	slcan_status_begin(&status, 0, now);
	slcan_status_asked(&status, now);
	assert_false(slcan_status_take(&status, SLCAN_FLAGS, &told, &frame));
	assert_int_equal(status.state, CAN_STATE_ERROR_ACTIVE);
	for (int i = 0; i < 10; i++) {
		now += 100 * MS;
		assert_true(slcan_status_due(&status, now));
		slcan_status_asked(&status, now);
		assert_true(refused(&status));
	}
}

/* 256 flags in a row, from each other: what is told is what is new, and a valid frame. */
static void what_is_new_is_told_once(void **state)
{
	struct slcan_status status;
	struct can_frame frame;

	slcan_status_begin(&status, 0, 0);
	for (unsigned int before = 0; before < 256; before++)
		for (unsigned int flags = 0; flags < 256; flags++) {
			const struct slcan_told first = {.flags = (uint8_t)before},
						then = {.flags = (uint8_t)flags};
			unsigned int fresh = flags & ~before;
			int was;
			bool says;

			slcan_status_take(&status, SLCAN_FLAGS, &first, &frame);
			was = status.state;
			says = slcan_status_take(&status, SLCAN_FLAGS, &then, &frame);
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
			/* The same again is nothing new. */
			assert_false(
				slcan_status_take(&status, SLCAN_FLAGS, &then, &frame));
		}
}

/* Flags do not know bus-off: they do not end it. */
static void bus_off_ends_when_that_is_told(void **state)
{
	const struct slcan_told off = {.state = CAN_STATE_BUS_OFF},
				on = {.state = CAN_STATE_ERROR_ACTIVE},
				flags = {.flags = SLCAN_PASSIVE};
	struct slcan_status status;
	struct can_frame frame;

	slcan_status_begin(&status, 0, 0);
	assert_true(slcan_status_take(&status, SLCAN_STATE, &off, &frame));
	assert_int_equal(frame.can_id, CAN_ERR_FLAG | CAN_ERR_BUSOFF);
	assert_false(slcan_status_take(&status, SLCAN_FLAGS, &flags, &frame));
	assert_int_equal(status.state, CAN_STATE_BUS_OFF);
	assert_true(slcan_status_take(&status, SLCAN_STATE, &on, &frame));
	assert_int_equal(frame.can_id, CAN_ERR_FLAG | CAN_ERR_CRTL | CAN_ERR_RESTARTED);
	assert_false(slcan_status_take(&status, SLCAN_FRAME, &on, &frame));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(it_is_asked_each_100_ms),
		cmocka_unit_test(refusals_are_of_what_was_sent),
		cmocka_unit_test(who_answered_once_is_asked_on),
		cmocka_unit_test(what_is_new_is_told_once),
		cmocka_unit_test(bus_off_ends_when_that_is_told),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
