// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402: cia402.c, words, PDOs and objects by SDO; cia402_units.c, profile and
 * units, with those of real drives; cia402_power.c, which never leads to operation enabled.
 * cia402_setup.c has a test of its own.
 */
#include "../unit.h"
#include <float.h>
#include "led.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

static struct led led_of_test, *const led = &led_of_test;

static int setup(void **state)
{
	led_init(led);
	return 0;
}

/* --- words and PDOs --- */

/*
 * IEC 61800-7-201, statusword: xxxx xxxx x0xx 0000b and so on; x: mask bit 0. One step at a time
 * leads to operation enabled; none leads out of a fault.
 */
static const struct {
	const char *bits; /* 6 5 3 2 1 0 */
	enum cia402_state state;
	bool powered;
	uint16_t next;
} table[] = {
	{"0x0000", CIA402_NOT_READY, false, 0},
	{"1x0000", CIA402_DISABLED, false, 0x06},
	{"010001", CIA402_READY, false, 0x07},
	{"010011", CIA402_SWITCHED_ON, true, 0x0f},
	{"010111", CIA402_ENABLED, true, 0x0f},
	{"000111", CIA402_QUICK_STOP, true, 0},
	{"0x1111", CIA402_FAULT_REACTION, true, 0},
	{"0x1000", CIA402_FAULT, false, 0},
};

static bool matches(uint32_t word, const char *bits)
{
	static const int position[] = {6, 5, 3, 2, 1, 0};

	for (int i = 0; i < 6; i++)
		if (bits[i] != 'x' && (bits[i] == '1') != !!(word & 1u << position[i]))
			return false;
	return true;
}

TEST(test_states)
{
	for (uint32_t word = 0; word <= UINT16_MAX; word++) {
		enum cia402_state expected = CIA402_UNKNOWN;
		bool powered = true; /* an unknown state may have power */
		uint16_t next = 0;

		for (size_t i = 0; i < COUNT(table); i++)
			if (matches(word, table[i].bits)) {
				assert_int_equal(expected, CIA402_UNKNOWN);
				expected = table[i].state;
				powered = table[i].powered;
				next = table[i].next;
			}
		assert_int_equal(cia402_state((uint16_t)word), expected);
		assert_int_equal(cia402_powered(expected), powered);
		assert_int_equal(cia402_next_controlword(expected), next);
	}
}

TEST(test_names)
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

TEST(test_pack_rpdo)
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

TEST(test_parse_tpdos)
{
	struct can_frame frame = {.can_id = 0x190, .len = 6};
	uint32_t inputs = 7;
	uint16_t word = 7;
	int32_t position = 7;
	int mode = 7;

	memcpy(frame.data, "\x37\x12\xfe\xff\xff\xff\xfd", 7);
	assert_true(cia402_parse_status(&frame, &word, &position, &mode));
	assert_int_equal(mode, 7);
	frame.len = 7;
	assert_true(cia402_parse_status(&frame, &word, &position, &mode));
	assert_int_equal(mode, -3);
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
		assert_false(cia402_parse_status(&frame, &word, &position, &mode));
	}
	assert_int_equal(word, 7);
	assert_int_equal(position, 7);

	frame = (struct can_frame){.can_id = 0x290, .len = 4, .data = {9, 0, 0, 0x80}};
	assert_true(cia402_parse_inputs(&frame, &inputs));
	assert_int_equal(inputs, 0x80000009);
	frame.len = 3;
	assert_false(cia402_parse_inputs(&frame, &inputs));
}

/* --- objects by SDO --- */

static const struct cia402_object word = {0x605a, 0, 2, "quick-stop option"};
static const struct cia402_object absent = {0x2000, 3, 4, "nothing"};

/* The message has the place in rig.conf, the object and the reason. */
TEST(test_messages, setup)
{
	static const struct {
		int rc, expected;
		const char *says;
	} cases[] = {
		{-EREMOTEIO, -EOPNOTSUPP, "(06090030h)"},
		{-ETIMEDOUT, -ETIMEDOUT, "no answer"},
		{-EPROTO, -EPROTO, "invalid"},
		{-EINTR, -EINTR, "stopped"},
		{-ENETDOWN, -ENETDOWN, "can-test"},
	};

	led->master.abort = 0x06090030;
	for (size_t i = 0; i < COUNT(cases); i++) {
		assert_int_equal(cia402_fail(&led->client, &word, "read", cases[i].rc),
				 cases[i].expected);
		assert_memory_equal(led->err.text, "here: ", 6);
		assert_non_null(strstr(led->err.text, "(605A:0)"));
		assert_non_null(strstr(led->err.text, cases[i].says));
	}
}

TEST(test_objects, setup)
{
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
	assert_non_null(strstr(led->err.text, "(605A:0)"));
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

TEST(test_await_state, setup)
{
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

/* --- units --- */

/* Some products and a power of ten, each rounded by half a unit in the last place. */
#define ROUNDING (8 * DBL_EPSILON)

/* The drive has these and no other factors: "6092=51200/1 60A9=00B44700", ratios and units. */
static void set_factors(struct led *led, const char *text)
{
	static const uint16_t all[] = {0x6092, 0x608f, 0x6091, 0x60a8, 0x60a9, 0x60aa};
	unsigned int index, unit;
	uint32_t a, b;
	int n;

	for (size_t i = 0; i < COUNT(all); i++)
		drive_lacks(&led->drive, all[i], -1);
	for (; sscanf(text, " %4x=%n", &index, &n) == 1; text += strcspn(text, " ")) {
		text += n;
		if (sscanf(text, "%u/%u", &a, &b) == 2) {
			drive_has(&led->drive, (uint16_t)index, 1, 4, a);
			drive_has(&led->drive, (uint16_t)index, 2, 4, b);
		} else if (sscanf(text, "%x", &unit) == 1) {
			drive_has(&led->drive, (uint16_t)index, 0, 4, unit);
		}
	}
}

static void assert_near(double is, double expected)
{
	assert_true(fabs(is - expected) <= ROUNDING * expected);
}

TEST(test_units, setup)
{
	static const struct {
		const char *factors;
		struct cia402_units units;
	} cases[] = {
		/* Feed constant; counts/s. Of several turns. */
		{"6092=51200/1", {51200, 51200, 51200}},
		{"6092=1000/3", {1000 / 3.0, 1000 / 3.0, 1000 / 3.0}},
		/* Encoder, with a gear and without. */
		{"608F=4000/1 6091=5/2", {10000, 10000, 10000}},
		{"608F=4000/2", {2000, 2000, 2000}},
		/* rpm, turns/s²; 0.001 rpm, as Synapticon's. */
		{"6092=51200/1 60A9=00B44700 60AA=00B45700", {51200, 60, 1}},
		{"6092=51200/1 60A9=FDB44700 60AA=00B45700", {51200, 60000, 1}},
		/* Tenths of degrees, as Nanotec's. */
		{"6092=1/1 608F=2000/1 6091=1/1 60A8=FF410000 60A9=00B44700 60AA=FF415700",
		 {3600, 60, 3600}},
		/* Increments, rpm, rpm/s, as maxon's. */
		{"608F=4096/1 6091=1/1 60A8=00B50000 60A9=00B44700 60AA=00C00300",
		 {4096, 60, 60}},
		/* Increments/s behind a gear. */
		{"6092=12000/1 608F=4000/1 6091=3/1 60A9=00B50300 60AA=00B55700",
		 {12000, 12000, 12000}},
		/* Degrees/s, ten of them/s²; radians; gon/min; minutes and seconds of arc. */
		{"6092=51200/1 60A9=00410300 60AA=01415700", {51200, 360, 36}},
		{"6092=51200/1 60A9=00100300 60AA=00105700",
		 {51200, 2 * 3.14159265358979323846, 2 * 3.14159265358979323846}},
		{"6092=51200/1 60A9=00404700 60AA=00405700", {51200, 24000, 400}},
		{"6092=51200/1 60A9=00420300 60AA=00435700", {51200, 21600, 1296000}},
		/* Increments without an encoder. */
		{"6092=800/1 60A8=00B50000 60A9=00B50300 60AA=00B55700", {800, 800, 800}},
		/* Metres: by the feed. */
		{"6092=5000/1 608F=4000/1 6091=1/1 60A8=FA010000 60A9=00B44700 60AA=00B45700",
		 {5000, 60, 1}},
	};

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct cia402_units units = {0};

		led_init(led);
		set_factors(led, cases[i].factors);
		assert_int_equal(cia402_read_units(&led->client, &units), 0);
		assert_near(units.counts_per_turn, cases[i].units.counts_per_turn);
		assert_near(units.velocity_per_turn_s,
			    cases[i].units.velocity_per_turn_s);
		assert_near(units.acceleration_per_turn_s2,
			    cases[i].units.acceleration_per_turn_s2);
	}
}

TEST(test_refused_units, setup)
{
	static const struct {
		const char *factors, *key;
	} cases[] = {
		{"", "counts_per_turn"},
		{"6092=0/1", "counts_per_turn"},
		{"6092=1/0", "counts_per_turn"},
		{"6092=1/3", "counts_per_turn"},
		{"608F=0/1", "counts_per_turn"},
		{"608F=4000/1 6091=1/0", "counts_per_turn"},
		/* More than a position can hold. */
		{"608F=4294967294/1 6091=4294967294/1", "counts_per_turn"},
		/* Nobody knows by which of the two it counts. */
		{"6092=1/1 608F=51200/1", "counts_per_turn"},
		{"6092=12000/1 608F=4000/1 6091=2/1", "counts_per_turn"},
		{"6092=1000/1 608F=4000/1 6091=1/1 60A8=00AA0000", "counts_per_turn"},
		{"6092=1000/1 608F=4000/1 6091=1/1 60A8=80410000", "counts_per_turn"},
		{"6092=1000/1 608F=4000/1 6091=1/1 60A8=7F410000", "counts_per_turn"},
		{"6092=1000/1 60A9=00000000", "velocity_per_turn_s"},
		{"6092=1000/1 60A9=00B45700", "velocity_per_turn_s"},
		{"6092=1000/1 60A9=00B44800", "velocity_per_turn_s"},
		{"6092=1000/1 60A9=00010300", "velocity_per_turn_s"},
		{"6092=1000/1 60A9=80B44700", "velocity_per_turn_s"},
		{"6092=1000/1 60A9=00C00300", "velocity_per_turn_s"},
		/* The unit of accelerations could be rpm/s. */
		{"6092=1000/1 60A9=00B44700", "acceleration_per_turn_s2"},
		{"6092=1000/1 60AA=00B44700", "acceleration_per_turn_s2"},
		{"6092=1000/1 60AA=00B40300", "acceleration_per_turn_s2"},
		{"6092=1000/1 60AA=FFFFFF00", "acceleration_per_turn_s2"},
	};

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct cia402_units units = {0};

		led_init(led);
		set_factors(led, cases[i].factors);
		assert_int_equal(cia402_read_units(&led->client, &units), -EPROTO);
		assert_non_null(strstr(led->err.text, cases[i].key));
		assert_true(units.counts_per_turn == 0); /* nothing by halves */
	}
}

/* Units from rig.conf are not read. */
TEST(test_given, setup)
{
	struct cia402_units units = {200, 60, 1};

	led->drive.mute = true;
	assert_int_equal(cia402_read_units(&led->client, &units), 0);
	assert_true(units.counts_per_turn == 200 && units.velocity_per_turn_s == 60);
	led->drive.mute = false;
	units.velocity_per_turn_s = 0;
	assert_int_equal(cia402_read_units(&led->client, &units), 0);
	assert_true(units.counts_per_turn == 200);
	assert_true(units.velocity_per_turn_s == 51200); /* its own increments/s */
}

TEST(test_identify, setup)
{
	assert_int_equal(cia402_identify(&led->client), 0);
	/* All other objects may be absent. */
	drive_lacks(&led->drive, 0x1008, 0);
	drive_lacks(&led->drive, 0x1018, -1);
	drive_lacks(&led->drive, 0x6502, -1);
	assert_int_equal(cia402_identify(&led->client), 0);

	drive_set(&led->drive, 0x1000, 0, 0x00020191); /* an I/O module */
	assert_int_equal(cia402_identify(&led->client), -EPROTO);
	assert_non_null(strstr(led->err.text, "401"));
	drive_lacks(&led->drive, 0x1000, -1);
	assert_int_equal(cia402_identify(&led->client), -EOPNOTSUPP);
	led->drive.mute = true;
	assert_int_equal(cia402_identify(&led->client), -ENODEV);
	assert_non_null(strstr(led->err.text, "node 0x10 on can-test"));
	led->drive.send_error = -ENETDOWN;
	assert_int_equal(cia402_identify(&led->client), -ENETDOWN);
}

/* --- power --- */

TEST(test_power_off, setup)
{
	struct drive *d = &led->drive;

	assert_int_equal(cia402_power_off(&led->client), 0);
	led_enable(led);
	assert_int_equal(d->state, CIA402_ENABLED);
	assert_int_equal(cia402_power_off(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);
	led_control(led, CIA402_SHUTDOWN);
	led_control(led, CIA402_SWITCH_ON);
	assert_int_equal(d->state, CIA402_SWITCHED_ON);
	assert_int_equal(cia402_power_off(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);

	/* It does not obey. */
	led_enable(led);
	d->od[OD_CONTROLWORD].deaf = true;
	d->od[OD_CONTROLWORD].index = 0x5040;
	assert_int_equal(cia402_power_off(&led->client), -EOPNOTSUPP);
	d->od[OD_CONTROLWORD].index = 0x6040;
	d->state = CIA402_FAULT_REACTION; /* which does not end */
	assert_int_equal(cia402_power_off(&led->client), -ETIMEDOUT);
	assert_non_null(strstr(led->err.text, "fault reaction active"));
	d->mute = true;
	assert_int_equal(cia402_power_off(&led->client), -ETIMEDOUT);
}

TEST(test_clear, setup)
{
	struct drive *d = &led->drive;

	assert_int_equal(cia402_clear(&led->client), 0);
	led_enable(led);
	drive_fault(d, 0x2310);
	assert_int_equal(cia402_clear(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);
	assert_int_equal(d->enabled_unasked, 0);

	/* Also where bit 7 was left set: an edge is made. */
	drive_fault(d, 0x2310);
	d->od[OD_CONTROLWORD].value = CIA402_FAULT_RESET;
	d->had_reset_bit = true;
	assert_int_equal(cia402_clear(&led->client), 0);

	drive_fault(d, 0x3210);
	d->fault_stays = true;
	assert_int_equal(cia402_clear(&led->client), -EBUSY);
	assert_non_null(strstr(led->err.text, "DC link over-voltage (3210h)"));
	assert_int_equal(d->state, CIA402_FAULT);
	/* From its EMCY, without 603F. */
	drive_lacks(d, 0x603f, -1);
	led->master.emcy.code = 0x8611;
	assert_int_equal(cia402_clear(&led->client), -EBUSY);
	assert_non_null(strstr(led->err.text, "8611h"));
	d->fault_stays = false;
	assert_int_equal(cia402_clear(&led->client), 0);

	/* Clear also removes power without a fault. */
	d->tripped = false;
	led_enable(led);
	assert_int_equal(cia402_clear(&led->client), 0);
	assert_int_equal(d->state, CIA402_DISABLED);
	d->mute = true;
	assert_int_equal(cia402_clear(&led->client), -ETIMEDOUT);
}

/* The k-th SDO is refused or lost: it ends with a message, and never with power. */
TEST(test_every_step_of_clear, setup)
{
	for (uint32_t k = 1; k <= 8; k++)
		for (int drop = 0; drop < 2; drop++) {
			int64_t t;
			int rc;

			led_init(led);
			drive_fault(&led->drive, 0x2310);
			*(drop ? &led->drive.drop_at : &led->drive.abort_at) = k;
			t = led->drive.now_ns;
			rc = cia402_clear(&led->client);
			assert_true(led->drive.now_ns - t < 5000 * DRIVE_MS);
			assert_int_equal(led->drive.enables, 0);
			assert_false(cia402_powered(led->drive.state));
			if (k < led->drive.requests || rc)
				assert_int_equal(rc, drop ? -ETIMEDOUT : -EOPNOTSUPP);
			if (rc)
				assert_memory_equal(led->err.text, "here: ", 6);
		}
}

TEST(test_set_mode, setup)
{
	struct drive *d = &led->drive;

	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSV), 0);
	assert_int_equal(d->od[OD_MODE_NOW].value, 9);
	assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
	drive_set(d, 0x6502, 0, 0x20);
	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSP), -EOPNOTSUPP);
	d->od[OD_MODE].deaf = true;
	drive_set(d, 0x6502, 0, 0x3a5);
	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSP), -ETIMEDOUT);
	assert_non_null(strstr(led->err.text, "CSP (8)"));
	assert_non_null(strstr(led->err.text, "homing (6)"));
	/* It keeps the mode, and shows it with power. */
	d->od[OD_MODE].deaf = false;
	d->mode_late = true;
	assert_int_equal(cia402_set_mode(&led->client, CIA402_CSP), 1);
}

static bool homed(struct led *led, int rc)
{
	bool is = true;

	assert_int_equal(cia402_read_homed(&led->client, CIA402_CSP, &is), rc);
	return is;
}

TEST(test_homes, setup)
{
	struct drive *d = &led->drive;

	assert_int_equal(led_configure(led), 0);
	assert_false(homed(led, 0));
	assert_int_equal(d->od[OD_MODE_NOW].value, CIA402_CSP);
	d->od[OD_HOME_OFFSET].value = 77; /* of before */
	assert_int_equal(cia402_set_homing(&led->client, 17, 10000, 1000, 500000), 0);
	assert_int_equal(d->od[OD_HOME_OFFSET].value, 0);
	assert_int_equal(d->od[OD_HOMING_METHOD].value, 17);
	assert_int_equal(d->od[OD_HOMING_SPEED].value, 10000);
	assert_int_equal(d->od[OD_HOMING_SLOW].value, 1000);
	assert_int_equal(d->od[OD_HOMING_RAMP].value, 500000);

	assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
	led_enable(led);
	led_control(led, CIA402_HOME_START);
	assert_true(d->velocity < 0);
	/* 5000 counts at 10000 counts/s, and half of that to spare. */
	canopen_await(&led->master, NULL, d->now_ns + 750 * DRIVE_MS);
	led_control(led, CIA402_ENABLE);
	assert_true(d->position == 0);
	assert_false(homed(led, -EBUSY)); /* not with power */
	assert_int_equal(d->od[OD_MODE_NOW].value, CIA402_HOMING);
	assert_int_equal(cia402_power_off(&led->client), 0);
	assert_true(homed(led, 0));
	assert_int_equal(d->enables, 1);
	drive_reboot(d);
	assert_false(homed(led, 0));
	d->absolute = true;
	drive_reboot(d);
	assert_true(homed(led, 0));
}

/* All three bits count. */
TEST(test_homed_bits, setup)
{
	struct drive *d = &led->drive;

	for (int bits = 0; bits < 8; bits++) {
		assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
		d->homed = bits & 1;
		d->homing = bits & 2;
		d->homing_error = bits & 4;
		assert_int_equal(homed(led, 0), bits == 1);
	}
}

TEST(test_homing_fails, setup)
{
	struct drive *d = &led->drive;

	d->homing_fails = true;
	assert_int_equal(cia402_set_mode(&led->client, CIA402_HOMING), 0);
	led_enable(led);
	led_control(led, CIA402_HOME_START);
	cia402_power_off(&led->client);
	assert_false(homed(led, 0));
	drive_lacks(d, 0x607c, -1);
	drive_lacks(d, 0x609a, -1);
	assert_int_equal(cia402_set_homing(&led->client, -3, 1, 1, 1), 0);
	assert_int_equal(cia402_set_homing(&led->client, 128, 1, 1, 1), -EINVAL);
	drive_lacks(d, 0x6099, 2);
	assert_int_equal(cia402_set_homing(&led->client, 1, 1, 1, 1), -EOPNOTSUPP);
	/* No homing mode: an error, and back to its own mode. */
	cia402_set_mode(&led->client, CIA402_CSV);
	drive_set(d, 0x6502, 0, 0x380);
	assert_false(homed(led, -EOPNOTSUPP));
	assert_int_equal(d->od[OD_MODE].value, CIA402_CSP);
}
