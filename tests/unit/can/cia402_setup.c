// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_setup.c: the drive then behaves as it was set up, holds its limits and
 * sends only what is for this side. can_session.c has a failure at any step.
 */
#include "../unit.h"
#include "led.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static struct led led_of_test, *const led = &led_of_test;

static int setup(void **state)
{
	led_init(led);
	return 0;
}

TEST(test_objects, setup)
{
	static const struct {
		uint16_t index;
		uint8_t sub;
		uint32_t value;
	} cases[] = {
		{0x1005, 0, 0x80},	 {0x1006, 0, 1000},
		{0x1007, 0, 0},		 {0x1014, 0, 0x90},
		{0x1016, 1, 0x7f0064},	 {0x1017, 0, 20},
		{0x1029, 1, 0},		 {0x6007, 0, 3},
		{0x605a, 0, 2},		 {0x6060, 0, 8},
		{0x6065, 0, 500},	 {0x6066, 0, 20},
		{0x6072, 0, 800},	 {0x607d, 1, (uint32_t)-100},
		{0x607d, 2, 200000},	 {0x607f, 0, 50000},
		{0x6085, 0, 1000000},	 {0x60c2, 1, 1},
		{0x60c2, 2, 0xfd},	 {0x60c5, 0, 1000000},
		{0x60c6, 0, 1000000},	 {0x1400, 1, 0x210},
		{0x1400, 2, 1},		 {0x1400, 5, 0},
		{0x1600, 0, 2},		 {0x1600, 1, 0x60400010},
		{0x1600, 2, 0x607a0020}, {0x1401, 1, 0x80000310},
		{0x1800, 1, 0x40000190}, {0x1800, 2, 1},
		{0x1a00, 0, 2},		 {0x1a00, 1, 0x60410010},
		{0x1a00, 2, 0x60640020}, {0x1801, 1, 0x40000290},
		{0x1801, 2, 255},	 {0x1801, 3, 100},
		{0x1801, 5, 100},	 {0x1a01, 0, 1},
		{0x1a01, 1, 0x60fd0020}, {0x1802, 1, 0xc0000390},
	};
	int64_t t = led->drive.now_ns;

	led->drive.od[OD_SYNC_ID].value = 0x40000080; /* it would send SYNCs itself */
	led->drive.od[OD_EMCY_ID].value = 0x80000090; /* and no EMCYs */
	assert_int_equal(led_configure(led), 0);
	for (size_t i = 0; i < COUNT(cases); i++)
		assert_int_equal(led_value(led, cases[i].index, cases[i].sub),
				 cases[i].value);
	assert_true(led->supported.inputs);
	assert_int_equal(led->drive.nmt, CANOPEN_OPERATIONAL);
	assert_int_equal(led->drive.state, CIA402_DISABLED);
	assert_int_equal(led->drive.enables, 0);
	/* Start-up in a second, at 0.2 ms for each SDO: a third of it is left to slower ones. */
	assert_true(led->drive.now_ns - t < 300 * DRIVE_MS);
	assert_true(led->drive.requests < 250);
	/* Again, as after a reboot of this side. */
	assert_int_equal(led_configure(led), 0);
}

/* The next of "1400:5 1006": an object, or all of it with sub -1. */
static bool next_object(const char **text, uint16_t *index, int *sub)
{
	char *end;

	*index = (uint16_t)strtoul(*text, &end, 16);
	*sub = *end == ':' ? (int)strtoul(end + 1, &end, 10) : -1;
	*text = end;
	return *index;
}

/* Without each of these: what it then does not support, or the object that is named. */
TEST(test_absences, setup)
{
	static const struct {
		const char *objects;
		int rc;
		size_t taken; /* offset of the unsupported part; SIZE_MAX: none */
	} cases[] = {
		{"60FD 1801", 0, offsetof(struct cia402_supported, inputs)},
		{"1801:5", 0, offsetof(struct cia402_supported, inputs_timed)},
		{"1400:5 1801:3 1006 1007 1029 607D 607F 60C5 6065 6085 60C6 6072 6502 1401 "
		 "1802",
		 0, SIZE_MAX},
		{"1005 1016 1017 1400 1800 6007 605A 6060 6064 607A 60C2", -EOPNOTSUPP,
		 0},
	};
	uint16_t index;
	int sub;

	for (size_t i = 0; i < COUNT(cases); i++)
		for (const char *at = cases[i].objects; next_object(&at, &index, &sub);) {
			bool *taken = (bool *)&led->supported;
			char number[12];

			led_init(led);
			drive_lacks(&led->drive, index, sub);
			assert_int_equal(led_configure(led), cases[i].rc);
			/* Targets and positions are missed where they are mapped. */
			snprintf(number, sizeof(number), "%04X",
				 index == 0x607a   ? 0x1600
				 : index == 0x6064 ? 0x1a00
						   : index);
			if (cases[i].rc) {
				assert_memory_equal(led->err.text, "here: ", 6);
				assert_non_null(strstr(led->err.text, number));
				continue;
			}
			/* Without inputs there are no timed ones. */
			if (!led->supported.inputs)
				led->supported.inputs_timed = true;
			for (size_t k = 0; k < sizeof(led->supported); k++)
				assert_int_equal(taken[k], k != cases[i].taken);
		}
}

/* An object that takes a write and forgets it. */
TEST(test_not_kept, setup)
{
	const char *objects = "1016:1 1017:0 1400:1 1400:2 1401:1 1600:0 1600:2 1800:2 "
			      "1A00:0 1A00:2 6007:0 605A:0 6060:0 6065:0 6066:0 607D:1 "
			      "607D:2 607F:0 6085:0 60C5:0";
	uint16_t index;
	int sub;

	while (next_object(&objects, &index, &sub)) {
		int rc;

		led_init(led);
		drive_object(&led->drive, index, (uint8_t)sub)->deaf = true;
		rc = led_configure(led);
		/* A mode times out; a PDO that stays on refuses. */
		assert_true(rc == -EPROTO || rc == -ETIMEDOUT || rc == -EOPNOTSUPP);
		assert_memory_equal(led->err.text, "here: ", 6);
		assert_false(cia402_powered(led->drive.state));
	}
}

#define FIELD(field) offsetof(struct led, field), sizeof(((struct led *)0)->field)

TEST(test_refused, setup)
{
	static const struct {
		size_t at, size;
		int64_t value;
	} impossible[] = {
		{FIELD(setup.deadman_ms), 0},
		{FIELD(setup.deadman_ms), 65536},
		{FIELD(setup.heartbeat_ms), 0},
		{FIELD(setup.heartbeat_ms), 65536},
		{FIELD(setup.master), 0},
		{FIELD(setup.master), 128},
		{FIELD(setup.master), DRIVE_NODE},
		{FIELD(setup.mode), CIA402_HOMING},
		{FIELD(setup.cycle_ns), 0},
		{FIELD(setup.cycle_ns), 1234567},
		{FIELD(setup.position_min), 200000}, /* the largest */
		{FIELD(master.own), 0},
		{FIELD(master.heartbeat_ns), 0},
		{FIELD(master.heartbeat_ns), LED_DEADMAN_MS * DRIVE_MS},
	};
	uint64_t asked;

	/* It has power. */
	led_enable(led);
	assert_int_equal(led->drive.state, CIA402_ENABLED);
	asked = led->drive.requests;
	assert_int_equal(led_configure(led), -EBUSY);
	assert_non_null(strstr(led->err.text, "operation enabled"));
	/* Nothing was written: there was one request. */
	assert_int_equal(led->drive.state, CIA402_ENABLED);
	assert_int_equal(led->drive.requests, asked + 1);
	assert_int_equal(led_value(led, 0x1016, 1), 0);

	led_init(led);
	drive_set(&led->drive, 0x6502, 0, 0x01);
	assert_int_equal(led_configure(led), -EOPNOTSUPP);
	assert_non_null(strstr(led->err.text, "CSP"));

	for (size_t i = 0; i < COUNT(impossible); i++) {
		led_init(led);
		memcpy((char *)led + impossible[i].at, &impossible[i].value,
		       impossible[i].size); /* little-endian, as here */
		assert_int_equal(led_configure(led), -EINVAL);
		assert_non_null(strstr(led->err.text, "rig.conf"));
		assert_false(cia402_powered(led->drive.state));
	}
}

TEST(test_cycles, setup)
{
	static const struct {
		uint32_t ns;
		uint8_t digit;
		int8_t power;
	} cases[] = {
		{1000000, 1, -3}, {2000000, 2, -3},  {10000000, 10, -3},  {500000, 5, -4},
		{250000, 25, -5}, {1500000, 15, -4}, {300000000, 30, -2},
	};

	for (size_t i = 0; i < COUNT(cases); i++) {
		led_init(led);
		led->setup.cycle_ns = cases[i].ns;
		assert_int_equal(led_configure(led), 0);
		assert_int_equal(led_value(led, 0x60c2, 1), cases[i].digit);
		assert_int_equal((int8_t)led_value(led, 0x60c2, 2), cases[i].power);
	}
}

/* The bus fails at the start or at the k-th frame, permanently or once. */
TEST(test_bus_fails, setup)
{
	static const int errors[] = {-ENETDOWN, -ENODEV, -EIO};
	uint64_t frames;

	assert_int_equal(led_configure(led), 0);
	frames = led->drive.bus.counts.sent;
	/* The number of frames without a failure, up to a heartbeat. */
	for (uint32_t k = 0; k < frames - 2; k++)
		for (int good = 0; good < 2; good++) {
			led_init(led);
			led->drive.send_first = k;
			led->drive.send_error = good ? -ENOBUFS : -ENETDOWN;
			led->drive.send_errors = (uint32_t)good;
			assert_int_equal(led_configure(led), good ? 0 : -ENETDOWN);
			assert_false(cia402_powered(led->drive.state));
		}
	for (size_t i = 0; i < COUNT(errors); i++) {
		struct drive *d = &led->drive;
		int *const calls[] = {&d->send_error, &d->receive_error, &d->wait_error};

		for (int k = 0; k < 3; k++) {
			led_init(led);
			*calls[k] = errors[i];
			assert_int_equal(led_configure(led), errors[i]);
			assert_non_null(strstr(led->err.text, d->bus.name));
		}
	}
	led_init(led);
	led->drive.wait_error = -EINTR;
	assert_int_equal(led_configure(led), -EINTR);
	led_init(led);
	led->drive.send_error = -ENOBUFS;
	led->drive.send_errors = 10;
	assert_int_equal(led_configure(led), 0);
	led_init(led);
	led->drive.twice = true;
	assert_int_equal(led_configure(led), 0);
	/*
	 * The message about silence names the object, also where a refusal is tolerated.
	 */
	for (uint16_t index = 0x1006; index <= 0x1007; index++) {
		char name[8];

		led_init(led);
		drive_object(&led->drive, index, 0)->lost = true;
		assert_int_equal(led_configure(led), -ETIMEDOUT);
		snprintf(name, sizeof(name), "%04X:0", index);
		assert_non_null(strstr(led->err.text, name));
	}
	led_init(led);
	led->drive.no_heartbeat = true;
	assert_int_equal(led_configure(led), -ETIMEDOUT);
	assert_non_null(strstr(led->err.text, "operational"));
}

/* The target of each mode, after any other mode. */
TEST(test_modes, setup)
{
	static const struct {
		enum cia402_mode mode;
		uint32_t map;
	} cases[] = {
		{CIA402_CSP, 0x607a0020},
		{CIA402_CSV, 0x60ff0020},
		{CIA402_CST, 0x60710010},
		{CIA402_CSP, 0x607a0020},
	};

	/* One after the other on the same drive, whose PDOs are on already. */
	for (size_t i = 0; i < COUNT(cases); i++) {
		led->setup.mode = cases[i].mode;
		assert_int_equal(led_configure(led), 0);
		assert_int_equal(led_value(led, 0x1600, 0), 2);
		assert_int_equal(led_value(led, 0x1600, 2), cases[i].map);
	}
}

/* Other ids, bits 30 and objects from before are replaced. */
TEST(test_left_over, setup)
{
	drive_set(&led->drive, 0x1400, 1, 0x40000234);
	drive_set(&led->drive, 0x1800, 1, 0x000001b4);
	drive_set(&led->drive, 0x1801, 1, 0x80000280);
	drive_set(&led->drive, 0x1a00, 0, 4);
	drive_set(&led->drive, 0x1a00, 3, 0x60610008);
	drive_set(&led->drive, 0x1a00, 4, 0x60610008);
	assert_int_equal(led_configure(led), 0);
	assert_int_equal(led_value(led, 0x1400, 1), 0x40000210);
	assert_int_equal(led_value(led, 0x1800, 1), 0x00000190);
	assert_int_equal(led_value(led, 0x1801, 1), 0x00000290);
	assert_int_equal(led_value(led, 0x1a00, 0), 2);
}

/* If a drive cannot map inputs, its TPDO2 stays off. */
TEST(test_unmapped_inputs, setup)
{
	led->drive.od[OD_INPUTS].access = R_;
	assert_int_equal(led_configure(led), 0);
	assert_false(led->supported.inputs);
	assert_true(led_value(led, 0x1801, 1) & 0x80000000);
}

/* Old limits do not stay: without homing there is no range. */
TEST(test_unlimited, setup)
{
	bool has;

	drive_set(&led->drive, 0x607d, 1, 5);
	drive_set(&led->drive, 0x607d, 2, 9);
	led->setup.position_min = INT32_MIN;
	led->setup.position_max = INT32_MAX;
	assert_int_equal(led_configure(led), 0);
	assert_int_equal((int32_t)led_value(led, 0x607d, 1), INT32_MIN);
	assert_int_equal((int32_t)led_value(led, 0x607d, 2), INT32_MAX);
	assert_int_equal(cia402_set_range(&led->client, 10, 20), 0);
	assert_int_equal(cia402_set_range(&led->client, 30, 40), 0);
	assert_int_equal(led_value(led, 0x607d, 1), 30);
	assert_int_equal(led_value(led, 0x607d, 2), 40);
	assert_int_equal(cia402_set_range(&led->client, 40, 40), -EINVAL);
	assert_int_equal(cia402_has_range(&led->client, 30, 40, &has), 0);
	assert_true(has);
	assert_int_equal(cia402_has_range(&led->client, 30, 41, &has), 0);
	assert_false(has);
	drive_lacks(&led->drive, 0x607d, -1);
	assert_int_equal(cia402_has_range(&led->client, 30, 40, &has), 0);
	assert_false(has);
	assert_int_equal(cia402_set_range(&led->client, 30, 40), 0);
}

/* Limits that are not set here stay the drive's. */
TEST(test_left_alone, setup)
{
	drive_set(&led->drive, 0x607f, 0, 7);
	drive_set(&led->drive, 0x60c5, 0, 8);
	drive_set(&led->drive, 0x6065, 0, 9);
	led->setup.velocity = led->setup.acceleration = led->setup.following = 0;
	led->setup.torque_permille = 0;
	assert_int_equal(led_configure(led), 0);
	assert_int_equal(led_value(led, 0x607f, 0), 7);
	assert_int_equal(led_value(led, 0x60c5, 0), 8);
	assert_int_equal(led_value(led, 0x6065, 0), 9);
	assert_int_equal(led_value(led, 0x6072, 0), 1000);
}
