// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/canopen/canopen.c with a simulated drive as the node: frames, heartbeats and NMT;
 * SDOs, with all the answers a node can give; the texts of codes.
 */
#include "../unit.h"
#include "../../../lib/device/can/canopen/canopen.h"
#include "candump.h"
#include "drive.h"

#define OWN 0x7f
#define N DRIVE_NODE
#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static struct world {
	struct drive drive;
	struct canopen master;
} world, *const w = &world;

static int setup(void **state)
{
	drive_init(&w->drive);
	w->master = (struct canopen){.bus = &w->drive.bus,
				     .node = N,
				     .own = OWN,
				     .heartbeat_ns = 20 * DRIVE_MS,
				     .state = CANOPEN_UNKNOWN};
	return 0;
}

static uint32_t handle(const char *text)
{
	struct can_frame frame = candump_read(text);

	return canopen_handle(&w->master, &frame, 42);
}

/* The function of each frame, and whether another master sent it. Node 10h, this side 7Fh. */
TEST(test_functions, setup)
{
	static const struct {
		const char *frame;
		uint32_t function;
		bool foreign;
	} cases[] = {
		{"190#000000000000", CANOPEN_TPDO1, false},
		{"290#00000000", CANOPEN_TPDO2, false},
		{"390#0000000000000000", 0x380, false},
		{"490#", 0x480, false},
		{"590#0000000000000000", CANOPEN_SDO_ANSWER, false},
		{"590#000000", CANOPEN_SDO_ANSWER, false},
		{"610#0000000000000000", 0, false}, /* another client asks */
		{"210#000000000000", 0, true},
		{"310#000000000000", 0, true},
		{"410#000000000000", 0, true},
		{"510#000000000000", 0, true},
		{"080#", 0, true},
		{"000#0000", 0, true},
		{"77F#00", 0, true},
		{"711#00", 0, false},
		{"191#000000000000", 0, false},
		{"211#000000000000", 0, false},
		{"090#0000000000000000", 0, false},
		{"710#00", 0, false},
		{"790#00", 0, false},
		{"110#0000000000000000", 0, false},
		{"00000190#000000000000", 0, false}, /* of 29 bits */
		{"190#R6", 0, false},
		{"00000080#", 0, false},
	};
	struct can_frame too_long = {.can_id = 0x190, .len = 64};

	for (size_t i = 0; i < COUNT(cases); i++) {
		uint32_t before = w->master.foreign;

		assert_int_equal(handle(cases[i].frame), cases[i].function);
		assert_int_equal(w->master.foreign - before, cases[i].foreign);
	}
	assert_int_equal(canopen_handle(&w->master, &too_long, 42), 0);
}

/* Frames one after the other, and what is known after each. */
TEST(test_reports, setup)
{
	static const struct {
		const char *frame;
		enum canopen_state state;
		uint32_t boots;
		uint16_t code, n; /* of errors */
		uint32_t bus_offs;
	} cases[] = {
		{"710#05", CANOPEN_OPERATIONAL, 0, 0, 0, 0},
		/* Invalid: too short, too long, no state, another node's. */
		{"710#", CANOPEN_OPERATIONAL, 0, 0, 0, 0},
		{"710#7F00", CANOPEN_OPERATIONAL, 0, 0, 0, 0},
		{"710#33", CANOPEN_OPERATIONAL, 0, 0, 0, 0},
		{"711#7F", CANOPEN_OPERATIONAL, 0, 0, 0, 0},
		/* Node guarding toggles bit 7. */
		{"710#FF", CANOPEN_PRE_OPERATIONAL, 0, 0, 0, 0},
		{"710#04", CANOPEN_STOPPED, 0, 0, 0, 0},
		{"710#00", CANOPEN_BOOT_UP, 1, 0, 0, 0},
		{"090#1186215657585950", CANOPEN_BOOT_UP, 1, 0x8611, 1, 0},
		{"090#10230100000000", CANOPEN_BOOT_UP, 1, 0x8611, 1, 0},
		{"091#1023010000000000", CANOPEN_BOOT_UP, 1, 0x8611, 1, 0},
		/* The error stays known after its end. */
		{"090#0000000000000000", CANOPEN_BOOT_UP, 1, 0x8611, 1, 0},
		/* Of the controller: passive, off, off. */
		{"20000004#0030000000006008", CANOPEN_BOOT_UP, 1, 0x8611, 1, 0},
		{"20000040#01", CANOPEN_BOOT_UP, 1, 0x8611, 1, 1},
		{"20000040#0102030405060708", CANOPEN_BOOT_UP, 1, 0x8611, 1, 2},
	};

	w->master.state = CANOPEN_UNKNOWN;
	for (size_t i = 0; i < COUNT(cases); i++) {
		handle(cases[i].frame);
		assert_int_equal(w->master.state, cases[i].state);
		assert_int_equal(w->master.boots, cases[i].boots);
		assert_int_equal(w->master.emcy.code, cases[i].code);
		assert_int_equal(w->master.emcy.count, cases[i].n);
		assert_int_equal(w->master.bus_offs, cases[i].bus_offs);
	}
	assert_int_equal(w->master.last_heartbeat_ns, 42);
	assert_int_equal(w->master.emcy.error_register, 0x21);
}

/* This side's heartbeat: on time, not made up for, tried again when the queue was full. */
TEST(test_own_heartbeat, setup)
{
	int64_t t = w->drive.now_ns;

	w->drive.od[OD_CONSUMER].value = (uint32_t)OWN << 16 | 50;
	for (int i = 0; i < 1000; i++) {
		assert_int_equal(canopen_send_heartbeat(&w->master, w->drive.now_ns), 0);
		drive_advance(&w->drive, DRIVE_MS);
	}
	/* At 0, 20, … 980 ms. */
	assert_int_equal(w->drive.master_beats, 50);
	assert_int_equal(w->drive.emcys, 0);

	drive_advance(&w->drive, 1000 * DRIVE_MS);
	assert_int_equal(w->drive.emcys, 1); /* 8130h: it watches */
	for (int i = 0; i < 3; i++)
		canopen_send_heartbeat(&w->master, w->drive.now_ns);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.master_beats, 51);

	t = w->drive.now_ns + 20 * DRIVE_MS;
	w->drive.send_error = -ENOBUFS;
	assert_int_equal(canopen_send_heartbeat(&w->master, t), -ENOBUFS);
	assert_int_equal(canopen_send_heartbeat(&w->master, t), 0); /* not yet */
	assert_int_equal(canopen_send_heartbeat(&w->master, t + DRIVE_MS), -ENOBUFS);
	w->drive.send_error = 0;
	assert_int_equal(canopen_send_heartbeat(&w->master, t + 2 * DRIVE_MS), 0);

	w->master.own = 0;
	w->master.next_heartbeat_ns = 0;
	assert_int_equal(canopen_send_heartbeat(&w->master, INT64_MAX), 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.master_beats, 52);
}

TEST(test_nmt, setup)
{
	assert_int_equal(canopen_send_nmt(&w->master, CANOPEN_START), 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.nmt, CANOPEN_OPERATIONAL);
	w->master.node++; /* another node is meant */
	assert_int_equal(canopen_send_nmt(&w->master, CANOPEN_STOP), 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.nmt, CANOPEN_OPERATIONAL);
	w->drive.send_error = -ENETDOWN;
	assert_int_equal(canopen_send_nmt(&w->master, CANOPEN_STOP), -ENETDOWN);
}

static bool operational(const struct canopen *master)
{
	return master->state == CANOPEN_OPERATIONAL;
}

TEST(test_await, setup)
{
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
	/* A full queue stops heartbeats, but not the wait. */
	w->drive.send_error = -ENOBUFS;
	t = w->drive.now_ns;
	w->drive.no_heartbeat = true;
	assert_int_equal(canopen_await(&w->master, NULL, t + 100 * DRIVE_MS), 0);
	assert_int_equal(w->drive.now_ns, t + 100 * DRIVE_MS);
	w->drive.send_error = -ENETDOWN;
	assert_int_equal(canopen_await(&w->master, NULL, t + 200 * DRIVE_MS), -ENETDOWN);
}

TEST(test_numbers, setup)
{
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
	/* With another size than the object's. */
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

TEST(test_silence, setup)
{
	int64_t t = w->drive.now_ns;
	uint32_t value;

	w->drive.mute = true;
	assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value), -ETIMEDOUT);
	assert_int_equal(w->drive.now_ns, t + CANOPEN_ANSWER_NS + CANOPEN_LATE_NS);
	assert_int_equal(w->master.late_ns, 0);
	drive_advance(&w->drive, DRIVE_MS);
	assert_int_equal(w->drive.master_abort, ABORT_TIMEOUT);
	w->master.answer_ns = 5 * DRIVE_MS;
	t = w->drive.now_ns;
	assert_int_equal(canopen_write(&w->master, 0x6060, 0, 1, 8), -ETIMEDOUT);
	assert_int_equal(w->drive.now_ns, t + 5 * DRIVE_MS + CANOPEN_LATE_NS);

	/* A late answer does not count for the next request. */
	w->drive.mute = false;
	w->drive.answer_ns = 10 * DRIVE_MS;
	assert_int_equal(canopen_read(&w->master, 0x1018, 2, 4, &value), -ETIMEDOUT);
	assert_in_range(w->master.late_ns, 10 * DRIVE_MS, 11 * DRIVE_MS);
	w->drive.answer_ns = 500 * DRIVE_MS;
	assert_int_equal(canopen_read(&w->master, 0x1018, 2, 4, &value), -ETIMEDOUT);
	assert_int_equal(w->master.late_ns, 0);
	w->drive.answer_ns = 0;
	w->master.answer_ns = 0;
	assert_int_equal(canopen_read(&w->master, 0x1018, 1, 4, &value), 0);
	assert_int_equal(value, 0x286);
}

TEST(test_bus, setup)
{
	int64_t t = w->drive.now_ns;
	uint32_t value;

	w->master.own = 0; /* no heartbeats between */
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

/*
 * Answers of the drive, which itself is mute: each 2 ms a line of candump's, from 1 ms on, that is
 * one after each request.
 */
static void script(struct world *w, const char *answers)
{
	w->drive.mute = true;
	w->drive.latency_ns = DRIVE_MS;
	for (; *answers; answers += strcspn(answers, " ")) {
		struct can_frame frame;

		answers += strspn(answers, " ");
		frame = candump_read(answers);
		drive_say(&w->drive, &frame);
		w->drive.latency_ns += 2 * DRIVE_MS;
	}
	w->drive.latency_ns = DRIVE_LATENCY_NS;
}

TEST(test_answers, setup)
{
	static const struct {
		const char *answer;
		int rc;
		uint32_t value;
	} cases[] = {
		{"590#4300100092010200", 0, 0x00020192},
		{"590#4200100092010200", 0, 0x00020192}, /* without a size */
		{"590#43001000920102", -ETIMEDOUT, 0},	 /* truncated */
		{"590#4300100192010200", -ETIMEDOUT, 0}, /* another sub */
		{"590#4301100092010200", -ETIMEDOUT, 0}, /* another index */
		{"590#4300110092010200", -ETIMEDOUT, 0},
		{"590#6000100000000000", -EPROTO, 0}, /* answers a write */
		{"590#0000100000000000", -EPROTO, 0},
		{"590#E000100000000000", -EPROTO, 0},
		{"590#4700100092010200", -EPROTO, 0}, /* three bytes */
		{"590#8000100000000008", -EREMOTEIO, 0},
		{"590#8001100000000008", -ETIMEDOUT, 0},
		/* Announces segments that do not come. */
		{"590#41001000FFFFFFFF", -ETIMEDOUT, 0},
	};
	uint32_t value;

	for (size_t i = 0; i < COUNT(cases); i++) {
		int64_t t = w->drive.now_ns;

		value = 0;
		script(w, cases[i].answer);
		assert_int_equal(canopen_read(&w->master, 0x1000, 0, 4, &value),
				 cases[i].rc);
		assert_int_equal(value, cases[i].value);
		assert_true(w->drive.now_ns - t <=
			    2 * CANOPEN_ANSWER_NS + CANOPEN_LATE_NS);
		drive_advance(&w->drive, DRIVE_MS);
	}
	script(w, "590#4300100000000000");
	assert_int_equal(canopen_write(&w->master, 0x1000, 0, 4, 1), -EPROTO);
}

TEST(test_segments, setup)
{
	static const struct {
		const char *answers;
		size_t size;
		int rc;
		const char *text;
	} cases[] = {
		/* Nine letters: "ofwords" and "12"; seven; none. */
		{"590#4108100009000000 590#006F66776F726473 590#1B31327878787878", 64, 0,
		 "ofwords12"},
		{"590#4108100007000000 590#016F66776F726473", 64, 0, "ofwords"},
		{"590#4108100000000000 590#0F00000000000000", 64, 0, ""},
		/* There is less room. */
		{"590#4108100009000000 590#006F66776F726473 590#1B31327878787878", 9, 0,
		 "ofwords1"},
		{"590#4108100009000000 590#006F66776F726473 590#1B31327878787878", 8, 0,
		 "ofwords"},
		{"590#4108100009000000 590#006F66776F726473", 2, 0, "o"},
		{"590#4108100009000000 590#006F66776F726473", 1, 0, ""},
		/* LF, an umlaut, a space and DEL. */
		{"590#4108100006000000 590#03610AC3A4207F00", 64, 0, "a??? ?"},
		/* The toggle bit stays, or is set at first. */
		{"590#4108100009000000 590#006F66776F726473 590#0B31327878787878", 64,
		 -EPROTO, ""},
		{"590#4108100009000000 590#106F66776F726473 590#0B31327878787878", 64,
		 -EPROTO, ""},
		/* Nothing in it, and not the last. */
		{"590#4108100009000000 590#0E6F66776F726473 590#1B31327878787878", 64,
		 -EPROTO, ""},
		/* It aborts half-way, or at once. */
		{"590#4108100009000000 590#006F66776F726473 590#8008100000000008", 64,
		 -EREMOTEIO, ""},
		{"590#8008100000000206", 64, -EREMOTEIO, ""},
		/* Expedited: "wxyz". */
		{"590#430810007778797A 590#017A7A7A7A7A7A7A", 64, 0, "wxyz"},
		/* Another client's answer between; "zzz", 0, and more. */
		{"590#4108100009000000 590#6008100000000000 590#097A7A7A007A7A7A", 64, 0,
		 "zzz"},
	};
	char text[64];

	w->master.answer_ns = 20 * DRIVE_MS;
	for (size_t i = 0; i < COUNT(cases); i++) {
		canopen_await(&w->master, NULL, w->drive.now_ns + 50 * DRIVE_MS);
		script(w, cases[i].answers);
		memset(text, 'x', sizeof(text));
		assert_int_equal(canopen_read_text(&w->master, 0x1008, 0, text,
						   cases[i].size),
				 cases[i].rc);
		assert_string_equal(text, cases[i].text);
		/* The second of the segments is requested with the toggle bit. */
		if (!i)
			assert_int_equal(w->drive.command, 0x70);
	}
}

/* CiA 301 V4.2, table 22. */
static const uint32_t aborts[] = {
	0x05030000, 0x05040000, 0x05040001, 0x05040002, 0x05040003, 0x05040004,
	0x05040005, 0x06010000, 0x06010001, 0x06010002, 0x06020000, 0x06040041,
	0x06040042, 0x06040043, 0x06040047, 0x06060000, 0x06070010, 0x06070012,
	0x06070013, 0x06090011, 0x06090030, 0x06090031, 0x06090032, 0x06090036,
	0x060a0023, 0x08000000, 0x08000020, 0x08000021, 0x08000022, 0x08000023,
	0x08000024,
};

TEST(test_aborts)
{
	char text[100], other[100], number[20];

	for (size_t i = 0; i < COUNT(aborts); i++) {
		canopen_abort_text(aborts[i], text, sizeof(text));
		snprintf(number, sizeof(number), "(%08Xh)", aborts[i]);
		assert_non_null(strstr(text, number));
		assert_null(strstr(text, "not in CiA 301"));
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
	assert_non_null(strstr(text, "not in CiA 301"));
}

TEST(test_emcys)
{
	static const struct {
		uint16_t code;
		const char *text;
	} cases[] = {
		{0x0000, "no error, or reset (0000h)"},
		{0x0001, "an error without a class (0001h)"},
		{0x1234, "generic error (1234h)"},
		{0x2310, "continuous over-current, motor side (2310h)"},
		{0x2311, "continuous over-current, motor side (2311h)"},
		{0x23ff, "current, motor side (23FFh)"},
		{0x2fff, "current (2FFFh)"},
		{0x8130, "life guard or heartbeat error (8130h)"},
		{0x8611, "following error too large (8611h)"},
		{0xff42, "fault of the manufacturer's own (FF42h)"},
		{0xb000, "an error without a class (B000h)"},
	};
	char text[100];

	for (size_t i = 0; i < COUNT(cases); i++)
		assert_string_equal(canopen_emcy_text(cases[i].code, text, sizeof(text)),
				    cases[i].text);
}

/* Any code in any size: the text ends with 0 and has the code. */
TEST(test_all_emcys)
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

TEST(test_states)
{
	assert_string_equal(canopen_state_name(CANOPEN_PRE_OPERATIONAL),
			    "pre-operational");
	assert_string_equal(canopen_state_name(CANOPEN_OPERATIONAL), "operational");
	assert_string_equal(canopen_state_name(CANOPEN_STOPPED), "stopped");
	assert_string_equal(canopen_state_name(CANOPEN_BOOT_UP), "booting");
	assert_string_equal(canopen_state_name(CANOPEN_UNKNOWN), "not heard");
}
