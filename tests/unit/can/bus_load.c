// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/can/cia402/can_units.c: the load of the bus, against frames that are stuffed here
 * bit by bit, and against sums made by hand.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/device/can/cia402/can_units.h"

/* The longest frame: a run of 5 equal bits, then runs of 4 with each stuffed bit. */
static uint32_t stuffed_by_hand(unsigned int bytes)
{
	unsigned int bits = 1 + 11 + 1 + 1 + 1 + 4 + 8 * bytes + 15, run = 0, sent = 0;
	int last = -1, next = 0;

	for (unsigned int i = 0; i < bits; i++) {
		/* The worst case repeats the last bit on the wire. */
		run = next == last ? run + 1 : 1;
		last = next;
		sent++;
		if (run == 5) {
			last = !last;
			run = 1;
			sent++;
			next = last;
		}
	}
	return sent + 1 + 1 + 1 + 7 + 3; /* delimiters, acknowledge, end, gap */
}

static void test_bits(void **state)
{
	for (unsigned int bytes = 0; bytes <= 8; bytes++)
		assert_int_equal(bus_load_bits(bytes), stuffed_by_hand(bytes));
	assert_int_equal(bus_load_bits(0), 55);
	assert_int_equal(bus_load_bits(8), 135);
	assert_int_equal(bus_load_bits(9), 135);
	assert_int_equal(bus_load_bits(UINT32_MAX), 135);
}

static void test_loads(void **state)
{
	/* SYNC 55, two of 8 bytes 135 each, at 1 kHz; inputs 95 bits at 100 Hz. */
	assert_int_equal(bus_load_of(1000000, 8, 8, 0), 325000 + 9500);
	/* Heartbeats of 65 bits, ten a second each way. */
	assert_int_equal(bus_load_of(1000000, 8, 8, 100000000), 325000 + 9500 + 1300);
	assert_int_equal(bus_load_of(2000000, 6, 6, 0), 285000 / 2 + 9500);
}

/* 1 kHz fits at 1 Mbit/s and at 500 kbit/s, not at 250. */
static void test_fits(void **state)
{
	uint64_t load = bus_load_of(1000000, 6, 6, 20000000);

	assert_true(load * 100 < 1000000ull * BUS_LOAD_MOST);
	assert_true(load * 100 < 500000ull * BUS_LOAD_MOST);
	assert_true(load * 100 > 250000ull * BUS_LOAD_MOST);
}

static void test_extremes(void **state)
{
	assert_int_equal(bus_load_of(0, 8, 8, 1), UINT32_MAX);
	assert_int_equal(bus_load_of(1, 8, 8, 1), UINT32_MAX);
	assert_int_equal(bus_load_of(UINT32_MAX, 0, 0, INT64_MAX), 39 + 9500 + 1);
	assert_int_equal(bus_load_of(UINT32_MAX, 0, 0, -1), 39 + 9500);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_bits),
		cmocka_unit_test(test_loads),
		cmocka_unit_test(test_fits),
		cmocka_unit_test(test_extremes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
