// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/canopen/canopen.c: what is heard and said, against a simulated drive and against
 * frames that no drive sends.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "can_drive.h"

#define OWN 0x7f
#define N DRIVE_NODE
#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

struct world {
	struct drive drive;
	struct canopen master;
};

static int setup(void **state)
{
	static struct world w;

	drive_init(&w.drive);
	w.master = (struct canopen){.bus = &w.drive.bus,
				    .node = N,
				    .own = OWN,
				    .beat_ns = 20 * DRIVE_MS,
				    .state = CANOPEN_UNKNOWN};
	*state = &w;
	return 0;
}

static uint32_t take(struct world *w, uint32_t id, uint8_t len, const char *bytes)
{
	struct can_frame frame = {.can_id = id, .len = len};

	memcpy(frame.data, bytes, len < 8 ? len : 8);
	return canopen_take(&w->master, &frame, 42);
}

/* Which frames are whose, and what they are. */
static void test_functions(void **state)
{
	static const struct {
		uint32_t id, function;
		uint8_t len;
		bool foreign;
	} cases[] = {
		{0x180 + N, CANOPEN_TPDO1, 6, false},
		{0x280 + N, CANOPEN_TPDO2, 4, false},
		{0x380 + N, 0x380, 8, false},
		{0x480 + N, 0x480, 0, false},
		{0x580 + N, CANOPEN_SDO_ANSWER, 8, false},
		{0x580 + N, CANOPEN_SDO_ANSWER, 3, false},
		{0x600 + N, 0, 8, false}, /* another client asks */
		{0x200 + N, 0, 6, true},
		{0x300 + N, 0, 6, true},
		{0x400 + N, 0, 6, true},
		{0x500 + N, 0, 6, true},
		{0x080, 0, 0, true},
		{0x000, 0, 2, true},
		{0x700 + OWN, 0, 1, true},
		{0x700 + N + 1, 0, 1, false},
		{0x180 + N + 1, 0, 6, false},
		{0x200 + N + 1, 0, 6, false},
		{0x080 + N, 0, 8, false},
		{0x700 + N, 0, 1, false},
		{0x780 + N, 0, 1, false},
		{0x100 + N, 0, 8, false},
		{(0x180 + N) | CAN_EFF_FLAG, 0, 6, false},
		{(0x180 + N) | CAN_RTR_FLAG, 0, 6, false},
		{0x180 + N, 0, 64, false}, /* no length of CAN 2.0 */
		{0x080 | CAN_EFF_FLAG, 0, 0, false},
	};
	struct world *w = *state;

	for (size_t i = 0; i < COUNT(cases); i++) {
		uint32_t before = w->master.foreign;

		assert_int_equal(take(w, cases[i].id, cases[i].len, "\0\0\0\0\0\0\0"),
				 cases[i].function);
		assert_int_equal(w->master.foreign - before, cases[i].foreign);
	}
}

static void test_heartbeats(void **state)
{
	struct world *w = *state;

	take(w, 0x700 + N, 1, "\x05");
	assert_int_equal(w->master.state, CANOPEN_OPERATIONAL);
	assert_int_equal(w->master.heard_ns, 42);
	/* Not one: too short, too long, of no state, somebody else's. */
	take(w, 0x700 + N, 0, "");
	take(w, 0x700 + N, 2, "\x7f\0");
	take(w, 0x700 + N, 1, "\x33");
	take(w, 0x701 + N, 1, "\x7f");
	assert_int_equal(w->master.state, CANOPEN_OPERATIONAL);
	/* Node guarding toggles bit 7. */
	take(w, 0x700 + N, 1, "\xff");
	assert_int_equal(w->master.state, CANOPEN_PRE_OPERATIONAL);
	take(w, 0x700 + N, 1, "\x04");
	assert_int_equal(w->master.state, CANOPEN_STOPPED);
	assert_int_equal(w->master.boots, 0);
	take(w, 0x700 + N, 1, "\0");
	assert_int_equal(w->master.boots, 1);
	assert_int_equal(w->master.state, CANOPEN_BOOT_UP);
}

static void test_emcy(void **state)
{
	struct world *w = *state;

	take(w, 0x80 + N, 8, "\x11\x86\x21VWXYZ");
	assert_int_equal(w->master.emcy.code, 0x8611);
	assert_int_equal(w->master.emcy.error_register, 0x21);
	assert_memory_equal(w->master.emcy.vendor, "VWXYZ", 5);
	take(w, 0x80 + N, 7, "\x10\x23\x01\0\0\0\0");
	take(w, 0x81 + N, 8, "\x10\x23\x01\0\0\0\0\0");
	assert_int_equal(w->master.emcy.code, 0x8611);
	assert_int_equal(w->master.emcy.count, 1);
	/* What it was is kept when it is over. */
	take(w, 0x80 + N, 8, "\0\0\0\0\0\0\0\0");
	assert_int_equal(w->master.emcy.code, 0x8611);
	assert_int_equal(w->master.emcy.count, 1);
}

static void test_error_frames(void **state)
{
	struct world *w = *state;

	assert_int_equal(
		take(w, CAN_ERR_FLAG | CAN_ERR_CRTL, 8, "\0\x30\0\0\0\0\x60\x08"), 0);
	assert_int_equal(w->master.bus_error, CAN_ERR_CRTL);
	assert_int_equal(w->master.bus_error_data[1], 0x30);
	assert_int_equal(w->master.bus_offs, 0);
	take(w, CAN_ERR_FLAG | CAN_ERR_BUSOFF, 1, "\x01");
	assert_int_equal(w->master.bus_error, CAN_ERR_BUSOFF);
	assert_int_equal(w->master.bus_error_data[1], 0);
	assert_int_equal(w->master.bus_offs, 1);
	take(w, CAN_ERR_FLAG | CAN_ERR_BUSOFF, 0xff, "\1\2\3\4\5\6\7\10");
	assert_int_equal(w->master.bus_error_data[7], 8);
}

/* This side's heartbeat: on time, not made up for, tried again when the queue was full. */
static void test_beat(void **state)
{
	struct world *w = *state;
	int64_t t = w->drive.now_ns;

	w->drive.od[OD_CONSUMER].value = (uint32_t)OWN << 16 | 50;
	for (int i = 0; i < 1000; i++) {
		assert_int_equal(canopen_beat(&w->master, w->drive.now_ns), 0);
		drive_advance(&w->drive, DRIVE_MS);
	}
	/* At 0, 20, … 980 ms. */
	assert_int_equal(w->drive.master_beats, 50);
	assert_int_equal(w->drive.emcys, 0);

	drive_advance(&w->drive, 1000 * DRIVE_MS);
	assert_int_equal(w->drive.emcys, 1); /* 8130h: it watches */
	for (int i = 0; i < 3; i++)
		canopen_beat(&w->master, w->drive.now_ns);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.master_beats, 51);

	t = w->drive.now_ns + 20 * DRIVE_MS;
	w->drive.send_error = -ENOBUFS;
	assert_int_equal(canopen_beat(&w->master, t), -ENOBUFS);
	assert_int_equal(canopen_beat(&w->master, t), 0); /* not yet */
	assert_int_equal(canopen_beat(&w->master, t + DRIVE_MS), -ENOBUFS);
	w->drive.send_error = 0;
	assert_int_equal(canopen_beat(&w->master, t + 2 * DRIVE_MS), 0);

	w->master.own = 0;
	w->master.next_beat_ns = 0;
	assert_int_equal(canopen_beat(&w->master, INT64_MAX), 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.master_beats, 52);
}

static void test_nmt(void **state)
{
	struct world *w = *state;

	assert_int_equal(canopen_nmt(&w->master, CANOPEN_START), 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.nmt, CANOPEN_OPERATIONAL);
	w->master.node++; /* another node is meant */
	assert_int_equal(canopen_nmt(&w->master, CANOPEN_STOP), 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.nmt, CANOPEN_OPERATIONAL);
	w->drive.send_error = -ENETDOWN;
	assert_int_equal(canopen_nmt(&w->master, CANOPEN_STOP), -ENETDOWN);
}

static bool operational(const struct canopen *master)
{
	return master->state == CANOPEN_OPERATIONAL;
}

static void test_await(void **state)
{
	struct world *w = *state;
	int64_t t = w->drive.now_ns;

	assert_int_equal(canopen_await(&w->master, operational, t + 100 * DRIVE_MS),
			 -ETIMEDOUT);
	assert_int_equal(w->drive.now_ns, t + 100 * DRIVE_MS);
	assert_int_equal(w->master.boots, 1); /* it was taken meanwhile */
	drive_advance(&w->drive, DRIVE_MS);
	w->drive.od[OD_CONSUMER].value = (uint32_t)OWN << 16 | 50;
	assert_int_equal(
		canopen_await(&w->master, NULL, w->drive.now_ns + 100 * DRIVE_MS), 0);
	assert_int_equal(w->drive.master_beats, 5); /* and it beat */

	w->drive.od[OD_HEARTBEAT].value = 10;
	w->drive.nmt = CANOPEN_OPERATIONAL;
	t = w->drive.now_ns;
	assert_int_equal(canopen_await(&w->master, operational, t + 100 * DRIVE_MS), 0);
	assert_true(w->drive.now_ns < t + 15 * DRIVE_MS);

	w->master.state = CANOPEN_UNKNOWN;
	t = w->drive.now_ns;
	w->drive.wait_error = -EINTR;
	assert_int_equal(canopen_await(&w->master, operational, t + DRIVE_MS), -EINTR);
	w->drive.wait_error = 0;
	w->drive.receive_error = -ENETDOWN;
	assert_int_equal(canopen_await(&w->master, operational, t + DRIVE_MS), -ENETDOWN);
	w->drive.receive_error = 0;
	/* A queue that is full stops heartbeats, but not the waiting. */
	w->drive.send_error = -ENOBUFS;
	t = w->drive.now_ns;
	w->drive.no_heartbeat = true;
	assert_int_equal(canopen_await(&w->master, NULL, t + 100 * DRIVE_MS), 0);
	assert_int_equal(w->drive.now_ns, t + 100 * DRIVE_MS);
	w->drive.send_error = -ENETDOWN;
	assert_int_equal(canopen_await(&w->master, NULL, t + 200 * DRIVE_MS), -ENETDOWN);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_functions, setup),
		cmocka_unit_test_setup(test_heartbeats, setup),
		cmocka_unit_test_setup(test_emcy, setup),
		cmocka_unit_test_setup(test_error_frames, setup),
		cmocka_unit_test_setup(test_beat, setup),
		cmocka_unit_test_setup(test_nmt, setup),
		cmocka_unit_test_setup(test_await, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
