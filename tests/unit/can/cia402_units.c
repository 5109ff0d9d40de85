// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/cia402_units.c: profile and units, with those of real drives.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <float.h>
#include "led.h"

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))
#define NO 0xffffffffu /* the drive lacks the object */
/* Some products and a power of ten, each rounded by half a unit in the last place. */
#define ROUNDING (8 * DBL_EPSILON)

static int setup(void **state)
{
	static struct led led;

	led_init(&led);
	*state = &led;
	return 0;
}

struct factors {
	uint32_t feed, feed_turns, encoder, encoder_turns, motor, shaft;
	uint32_t position, velocity, acceleration; /* 60A8, 60A9, 60AA */
};

static void put(struct led *led, uint16_t index, uint8_t sub, uint32_t value)
{
	if (value == NO)
		drive_lacks(&led->drive, index, sub);
	else
		drive_has(&led->drive, index, sub, 4, value);
}

static void put_all(struct led *led, const struct factors *f)
{
	put(led, 0x6092, 1, f->feed);
	put(led, 0x6092, 2, f->feed_turns);
	put(led, 0x608f, 1, f->encoder);
	put(led, 0x608f, 2, f->encoder_turns);
	put(led, 0x6091, 1, f->motor);
	put(led, 0x6091, 2, f->shaft);
	put(led, 0x60a8, 0, f->position);
	put(led, 0x60a9, 0, f->velocity);
	put(led, 0x60aa, 0, f->acceleration);
}

static void assert_near(double is, double expected)
{
	assert_true(fabs(is - expected) <= ROUNDING * expected);
}

static void test_units(void **state)
{
	static const struct {
		const char *what;
		struct factors factors;
		struct cia402_units units;
	} cases[] = {
		{"feed constant; counts/s",
		 {51200, 1, NO, NO, NO, NO, NO, NO, NO},
		 {51200, 51200, 51200}},
		{"feed of several turns",
		 {1000, 3, NO, NO, NO, NO, NO, NO, NO},
		 {1000 / 3.0, 1000 / 3.0, 1000 / 3.0}},
		{"encoder and gear",
		 {NO, NO, 4000, 1, 5, 2, NO, NO, NO},
		 {10000, 10000, 10000}},
		{"encoder without a gear",
		 {NO, NO, 4000, 2, NO, NO, NO, NO, NO},
		 {2000, 2000, 2000}},
		{"rpm, turns/s²",
		 {51200, 1, NO, NO, NO, NO, NO, 0x00b44700, 0x00b45700},
		 {51200, 60, 1}},
		{"0.001 rpm, as Synapticon's",
		 {51200, 1, NO, NO, NO, NO, NO, 0xfdb44700, 0x00b45700},
		 {51200, 60000, 1}},
		{"tenths of degrees, as Nanotec's",
		 {1, 1, 2000, 1, 1, 1, 0xff410000, 0x00b44700, 0xff415700},
		 {3600, 60, 3600}},
		{"increments, rpm, rpm/s, as maxon's",
		 {NO, NO, 4096, 1, 1, 1, 0x00b50000, 0x00b44700, 0x00c00300},
		 {4096, 60, 60}},
		{"increments/s behind a gear",
		 {1000, 1, 4000, 1, 3, 1, NO, 0x00b50300, 0x00b55700},
		 {1000, 12000, 12000}},
		{"degrees/s, ten of them/s²",
		 {51200, 1, NO, NO, NO, NO, NO, 0x00410300, 0x01415700},
		 {51200, 360, 36}},
		{"radians",
		 {51200, 1, NO, NO, NO, NO, NO, 0x00100300, 0x00105700},
		 {51200, 2 * 3.14159265358979323846, 2 * 3.14159265358979323846}},
		{"gon/min",
		 {51200, 1, NO, NO, NO, NO, NO, 0x00404700, 0x00405700},
		 {51200, 24000, 400}},
		{"minutes and seconds of arc",
		 {51200, 1, NO, NO, NO, NO, NO, 0x00420300, 0x00435700},
		 {51200, 21600, 1296000}},
		{"increments without an encoder",
		 {800, 1, NO, NO, NO, NO, 0x00b50000, 0x00b50300, 0x00b55700},
		 {800, 800, 800}},
		{"metres: by the feed",
		 {5000, 1, 4000, 1, 1, 1, 0xfa010000, 0x00b44700, 0x00b45700},
		 {5000, 60, 1}},
	};
	struct led *led = *state;

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct cia402_units units = {0};

		led_init(led);
		put_all(led, &cases[i].factors);
		assert_int_equal(cia402_read_units(&led->client, &units), 0);
		assert_near(units.counts_per_turn, cases[i].units.counts_per_turn);
		assert_near(units.velocity_per_turn_s,
			    cases[i].units.velocity_per_turn_s);
		assert_near(units.acceleration_per_turn_s2,
			    cases[i].units.acceleration_per_turn_s2);
	}
}

static void test_refused(void **state)
{
	static const struct {
		struct factors factors;
		const char *key;
	} cases[] = {
		{{NO, NO, NO, NO, NO, NO, NO, NO, NO}, "counts_per_turn"},
		{{0, 1, NO, NO, NO, NO, NO, NO, NO}, "counts_per_turn"},
		{{1, 0, NO, NO, NO, NO, NO, NO, NO}, "counts_per_turn"},
		{{1, 3, NO, NO, NO, NO, NO, NO, NO}, "counts_per_turn"},
		{{NO, NO, 0, 1, NO, NO, NO, NO, NO}, "counts_per_turn"},
		{{NO, NO, 4000, 1, 1, 0, NO, NO, NO}, "counts_per_turn"},
		/* More than a position can hold. */
		{{NO, NO, 0xfffffffe, 1, 0xfffffffe, 1, NO, NO, NO}, "counts_per_turn"},
		{{1000, 1, 4000, 1, 1, 1, 0x00aa0000, NO, NO}, "counts_per_turn"},
		{{1000, 1, 4000, 1, 1, 1, 0x80410000, NO, NO}, "counts_per_turn"},
		{{1000, 1, 4000, 1, 1, 1, 0x7f410000, NO, NO}, "counts_per_turn"},
		{{1000, 1, NO, NO, NO, NO, NO, 0x00000000, NO}, "velocity_per_turn_s"},
		{{1000, 1, NO, NO, NO, NO, NO, 0x00b45700, NO}, "velocity_per_turn_s"},
		{{1000, 1, NO, NO, NO, NO, NO, 0x00b44800, NO}, "velocity_per_turn_s"},
		{{1000, 1, NO, NO, NO, NO, NO, 0x00010300, NO}, "velocity_per_turn_s"},
		{{1000, 1, NO, NO, NO, NO, NO, 0x80b44700, NO}, "velocity_per_turn_s"},
		{{1000, 1, NO, NO, NO, NO, NO, 0x00c00300, NO}, "velocity_per_turn_s"},
		/* The unit of accelerations could be rpm/s. */
		{{1000, 1, NO, NO, NO, NO, NO, 0x00b44700, NO},
		 "acceleration_per_turn_s2"},
		{{1000, 1, NO, NO, NO, NO, NO, NO, 0x00b44700},
		 "acceleration_per_turn_s2"},
		{{1000, 1, NO, NO, NO, NO, NO, NO, 0x00b40300},
		 "acceleration_per_turn_s2"},
		{{1000, 1, NO, NO, NO, NO, NO, NO, 0xffffff00},
		 "acceleration_per_turn_s2"},
	};
	struct led *led = *state;

	for (size_t i = 0; i < COUNT(cases); i++) {
		struct cia402_units units = {0};

		led_init(led);
		put_all(led, &cases[i].factors);
		assert_int_equal(cia402_read_units(&led->client, &units), -EPROTO);
		assert_non_null(strstr(led->err.text, cases[i].key));
		assert_true(units.counts_per_turn == 0); /* nothing by halves */
	}
}

/* Units from rig.conf are not read. */
static void test_given(void **state)
{
	struct cia402_units units = {200, 60, 1};
	struct led *led = *state;

	led->drive.mute = true;
	assert_int_equal(cia402_read_units(&led->client, &units), 0);
	assert_true(units.counts_per_turn == 200 && units.velocity_per_turn_s == 60);
	led->drive.mute = false;
	units.velocity_per_turn_s = 0;
	assert_int_equal(cia402_read_units(&led->client, &units), 0);
	assert_true(units.counts_per_turn == 200);
	assert_true(units.velocity_per_turn_s == 51200); /* its own increments/s */
}

static void test_identify(void **state)
{
	struct led *led = *state;

	assert_int_equal(cia402_identify(&led->client), 0);
	/* All other objects may be absent. */
	led->drive.name = NULL;
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
	assert_non_null(strstr(led->err.text, "no answer from node 0x10 on can-test"));
	led->drive.send_error = -ENETDOWN;
	assert_int_equal(cia402_identify(&led->client), -ENETDOWN);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup(test_units, setup),
		cmocka_unit_test_setup(test_refused, setup),
		cmocka_unit_test_setup(test_given, setup),
		cmocka_unit_test_setup(test_identify, setup),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
