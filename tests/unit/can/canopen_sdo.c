// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/canopen/canopen_sdo.c: against the SDO server of a simulated drive, and against
 * answers that are scripted byte by byte.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "can_drive.h"

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
	w.master = (struct canopen){.bus = &w.drive.bus, .node = N};
	*state = &w;
	return 0;
}

static void test_numbers(void **state)
{
	struct world *w = *state;
	uint32_t value = 0;

	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), 0);
	assert_int_equal(value, 0x00040192);
	assert_int_equal(canopen_write(&w->master, 0x607d, 1, 4, 0xfedcba98), 0);
	assert_int_equal(canopen_read(&w->master, 0x607d, 1, 4, &value), 0);
	assert_int_equal(value, 0xfedcba98);
	assert_int_equal(canopen_write(&w->master, 0x605a, 0, 2, 0xffffffff), 0);
	assert_int_equal(canopen_read(&w->master, 0x605a, 0, 2, &value), 0);
	assert_int_equal(value, 0xffff); /* not extended */
	assert_int_equal(canopen_write(&w->master, 0x60c2, 2, 1, 0xfffffffd), 0);
	assert_int_equal(canopen_read(&w->master, 0x60c2, 2, 1, &value), 0);
	assert_int_equal(value, 0xfd);
	/* Of another size than it has. */
	assert_int_equal(canopen_read(&w->master, 0x605a, 0, 4, &value), -EPROTO);
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 2, &value), -EPROTO);
	assert_int_equal(canopen_write(&w->master, 0x605a, 0, 4, 1), -EREMOTEIO);
	assert_int_equal(w->master.abort, ABORT_LONG);
	assert_int_equal(canopen_write(&w->master, 0x1000, 0, 4, 1), -EREMOTEIO);
	assert_int_equal(w->master.abort, ABORT_READ_ONLY);
	assert_int_equal(canopen_read(&w->master, 0x2000, 0, 4, &value), -EREMOTEIO);
	assert_int_equal(w->master.abort, ABORT_NO_OBJECT);
	assert_int_equal(canopen_read(&w->master, 0x1018, 9, 4, &value), -EREMOTEIO);
	assert_int_equal(w->master.abort, ABORT_NO_SUB);
	assert_int_equal(canopen_read(&w->master, 0x1018, 1, 4, &value), 0);
	assert_int_equal(w->master.abort, 0);
}

static void test_text(void **state)
{
	static const struct {
		const char *name;
		size_t size;
		const char *text;
	} cases[] = {
		{"simulated drive", 64, "simulated drive"},
		{"7 chars", 64, "7 chars"},
		{"14 characters.", 64, "14 characters."},
		{"", 64, ""},
		{"a", 64, "a"},
		{"new\nline \xc3\xa4 \x7f", 64, "new?line ?? ?"},
		{"simulated drive", 8, "simulat"},
		{"simulated drive", 9, "simulate"},
		{"simulated drive", 2, "s"},
		{"simulated drive", 1, ""},
	};
	struct world *w = *state;
	char text[65];
	uint32_t value;

	for (size_t i = 0; i < COUNT(cases); i++) {
		memset(text, 'x', sizeof(text));
		w->drive.name = cases[i].name;
		assert_int_equal(
			canopen_read_text(&w->master, 0x1008, 0, text, cases[i].size), 0);
		assert_string_equal(text, cases[i].text);
		/* And what comes next is none the worse. */
		assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), 0);
	}
	w->drive.name = NULL;
	assert_int_equal(canopen_read_text(&w->master, 0x1008, 0, text, 64), -EREMOTEIO);
	assert_string_equal(text, "");
}

static void test_silence(void **state)
{
	struct world *w = *state;
	int64_t t = w->drive.now_ns;
	uint32_t value;

	w->drive.mute = true;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), -ETIMEDOUT);
	assert_int_equal(w->drive.now_ns, t + CANOPEN_ANSWER_NS);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.master_abort, ABORT_TIMEOUT);
	w->master.answer_ns = 5 * DRIVE_MS;
	t = w->drive.now_ns;
	assert_int_equal(canopen_write(&w->master, 0x6060, 0, 1, 8), -ETIMEDOUT);
	assert_int_equal(w->drive.now_ns, t + 5 * DRIVE_MS);

	/* An answer that comes too late is not taken for that of the next request. */
	w->drive.mute = false;
	w->drive.answer_ns = 10 * DRIVE_MS;
	assert_int_equal(canopen_read(&w->master, 0x1018, 2, 4, &value), -ETIMEDOUT);
	w->drive.answer_ns = 0;
	w->master.answer_ns = 0;
	assert_int_equal(canopen_read(&w->master, 0x1018, 1, 4, &value), 0);
	assert_int_equal(value, 0x286);
}

static void test_bus(void **state)
{
	struct world *w = *state;
	int64_t t = w->drive.now_ns;
	uint32_t value;

	w->drive.send_error = -ENOBUFS;
	w->drive.send_errors = 3;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), 0);
	assert_true(w->drive.now_ns >= t + 3 * DRIVE_MS);
	w->drive.send_error = -ENOBUFS;
	w->drive.send_errors = 0;
	t = w->drive.now_ns;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), -ENOBUFS);
	assert_in_range(w->drive.now_ns - t, CANOPEN_ANSWER_NS,
			CANOPEN_ANSWER_NS + 2 * DRIVE_MS);
	w->drive.send_error = -ENETDOWN;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), -ENETDOWN);
	w->drive.send_error = 0;
	w->drive.wait_error = -EINTR;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), -EINTR);
	w->drive.wait_error = 0;
	w->drive.receive_error = -ENODEV;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), -ENODEV);
}

/* Answers by script, one frame a line; the drive itself is mute. */
static void script(struct world *w, uint8_t len, const char *bytes)
{
	struct can_frame frame = {.can_id = CANOPEN_SDO_ANSWER + N, .len = len};

	memcpy(frame.data, bytes, 8);
	w->drive.latency_ns += DRIVE_MS; /* after what is asked */
	drive_say(&w->drive, &frame);
	w->drive.latency_ns -= DRIVE_MS;
}

static void test_answers(void **state)
{
	static const struct {
		const char *answer;
		uint8_t len;
		int rc;
		uint32_t value;
	} cases[] = {
		{"\x43\x00\x10\x00\x92\x01\x02\x00", 8, 0, 0x00020192},
		{"\x42\x00\x10\x00\x92\x01\x02\x00", 8, 0,
		 0x00020192}, /* without a size */
		{"\x43\x00\x10\x00\x92\x01\x02\x00", 7, -ETIMEDOUT, 0}, /* truncated */
		{"\x43\x00\x10\x01\x92\x01\x02\x00", 8, -ETIMEDOUT, 0}, /* another sub */
		{"\x43\x01\x10\x00\x92\x01\x02\x00", 8, -ETIMEDOUT,
		 0}, /* another index */
		{"\x43\x00\x11\x00\x92\x01\x02\x00", 8, -ETIMEDOUT, 0},
		{"\x60\x00\x10\x00\x00\x00\x00\x00", 8, -EPROTO, 0}, /* answers a write */
		{"\x00\x00\x10\x00\x00\x00\x00\x00", 8, -EPROTO, 0},
		{"\xe0\x00\x10\x00\x00\x00\x00\x00", 8, -EPROTO, 0},
		{"\x47\x00\x10\x00\x92\x01\x02\x00", 8, -EPROTO, 0}, /* three bytes */
		{"\x80\x00\x10\x00\x00\x00\x00\x08", 8, -EREMOTEIO, 0},
		{"\x80\x01\x10\x00\x00\x00\x00\x08", 8, -ETIMEDOUT, 0},
		/* Announces segments that do not come. */
		{"\x41\x00\x10\x00\xff\xff\xff\xff", 8, -ETIMEDOUT, 0},
	};
	struct world *w = *state;
	uint32_t value;

	w->drive.mute = true;
	for (size_t i = 0; i < COUNT(cases); i++) {
		int64_t t = w->drive.now_ns;

		value = 0;
		script(w, cases[i].len, cases[i].answer);
		assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value),
				 cases[i].rc);
		assert_int_equal(value, cases[i].value);
		assert_true(w->drive.now_ns - t <= 2 * CANOPEN_ANSWER_NS);
		drive_advance(&w->drive, DRIVE_MS);
	}
	script(w, 8, "\x43\x00\x10\x00\x00\x00\x00\x00");
	assert_int_equal(canopen_write(&w->master, 0x1000, 0, 4, 1), -EPROTO);
}

static void test_segments(void **state)
{
	static const struct {
		const char *answers[3];
		int rc;
		const char *text;
	} cases[] = {
		{{"\x41\x08\x10\x00\x09\0\0\0", "\x00ofwords", "\x1b\x31\x32xxxxx"},
		 0,
		 "ofwords12"},
		/* The toggle bit stays. */
		{{"\x41\x08\x10\x00\x09\0\0\0", "\x00ofwords", "\x0b\x31\x32xxxxx"},
		 -EPROTO,
		 ""},
		{{"\x41\x08\x10\x00\x09\0\0\0", "\x10ofwords", "\x0b\x31\x32xxxxx"},
		 -EPROTO,
		 ""},
		/* Nothing in it, and not the last. */
		{{"\x41\x08\x10\x00\x09\0\0\0", "\x0eofwords", "\x1b\x31\x32xxxxx"},
		 -EPROTO,
		 ""},
		/* It gives up half-way. */
		{{"\x41\x08\x10\x00\x09\0\0\0", "\x00ofwords",
		  "\x80\x08\x10\x00\x00\x00\x00\x08"},
		 -EREMOTEIO,
		 ""},
		/* Expedited: four letters. */
		{{"\x43\x08\x10\x00wxyz", "\x01zzzzzzz", "\x01zzzzzzz"}, 0, "wxyz"},
		/* Another client's answer between. */
		{{"\x41\x08\x10\x00\x09\0\0\0", "\x60\x08\x10\x00\0\0\0\0",
		  "\x09zzz\0zzz"},
		 0,
		 "zzz"},
	};
	struct world *w = *state;
	char text[64];

	w->drive.mute = true;
	w->master.answer_ns = 20 * DRIVE_MS;
	for (size_t i = 0; i < COUNT(cases); i++) {
		canopen_await(&w->master, NULL, w->drive.now_ns + 50 * DRIVE_MS);
		/* Frames come one by one, each after what asks for it. */
		for (int j = 0; j < 3; j++) {
			w->drive.latency_ns = (1 + 2 * j) * DRIVE_MS;
			script(w, 8, cases[i].answers[j]);
		}
		w->drive.latency_ns = 100000;
		assert_int_equal(canopen_read_text(&w->master, 0x1008, 0, text,
						   sizeof(text)),
				 cases[i].rc);
		assert_string_equal(text, cases[i].text);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_numbers, setup),
		cmocka_unit_test_setup(test_text, setup),
		cmocka_unit_test_setup(test_silence, setup),
		cmocka_unit_test_setup(test_bus, setup),
		cmocka_unit_test_setup(test_answers, setup),
		cmocka_unit_test_setup(test_segments, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
