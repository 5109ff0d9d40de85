// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/daq/iio_spacing.c: gaps of any length, late interrupts that are none, a
 * converter whose clock is off, stamps that are nonsense.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/device/daq/iio_spacing.h"

#define T 100000 /* ns */
#define START 5000000000LL

static struct daq_feed *feed;
static struct iio_spacing spacing;

static int setup(void **state)
{
	feed = aligned_alloc(_Alignof(struct daq_feed), sizeof(*feed));
	memset(feed, 0, sizeof(*feed));
	feed->info.bits = 12;
	feed->info.rate_hz = 10000;
	iio_spacing_init(&spacing, feed, 10000);
	return daq_feed_init(feed);
}

static int teardown(void **state)
{
	daq_feed_free(feed);
	free(feed);
	return 0;
}

/* The code says which conversion it was. */
static void put(int64_t n, int64_t late_ns)
{
	iio_spacing_put(&spacing, START + n * T + late_ns, (int32_t)(n & 4095));
}

/* All that came have the number of their conversion. */
static void numbers_are_right(void)
{
	struct incise_force_sample sample;

	iio_spacing_flush(&spacing);
	while (daq_feed_read(&feed->force, &sample, 1) == 1)
		assert_int_equal(sample.code, sample.seq & 4095);
}

static void gaps(void **state)
{
	static const int lengths[] = {1, 2, 3, 10, 1000, 19999, 1000000};
	uint64_t lost = 0, overflows = 0;
	struct incise_force_info info;
	int64_t n = 0;

	for (size_t i = 0; i < sizeof(lengths) / sizeof(*lengths); i++) {
		for (int k = 0; k < 100; k++)
			put(n++, 0);
		n += lengths[i];
		lost += (uint64_t)lengths[i];
		overflows++;
	}
	put(n, 0);
	put(n + 1, 0);
	numbers_are_right();
	daq_feed_info(&feed->force, &info);
	assert_int_equal(daq_feed_lost(&feed->force), lost);
	assert_int_equal(info.overflows, overflows);
}

/* Up to just below a period late: told apart from a loss by what follows. */
static void lateness_is_no_gap(void **state)
{
	for (int64_t n = 0; n < 20000; n++)
		put(n, n % 7 == 3 ? (n % 100) * T / 101 : 0);
	numbers_are_right();
	assert_int_equal(daq_feed_lost(&feed->force), 0);
}

/* And a loss is one, when the sample behind it is late, too. */
static void late_behind_a_gap(void **state)
{
	int64_t n = 0;

	for (int i = 0; i < 1000; i++) {
		put(n++, 0);
		put(n++, 0);
		n += i % 5;
		put(n++, (i % 97) * T / 100);
	}
	numbers_are_right();
	assert_int_equal(daq_feed_lost(&feed->force), 2000);
}

/* An oscillator that is 1 % off: after it has been seen, long gaps are right, too. */
static void clock_is_off(void **state)
{
	static const double factors[] = {0.99, 1.01};

	for (size_t i = 0; i < 2; i++) {
		int64_t n = 0;

		teardown(NULL);
		setup(NULL);
		for (; n < 30000; n++)
			put(n, llround((double)(n * T) * (factors[i] - 1)));
		n += 5000;
		for (int k = 0; k < 100; k++, n++)
			put(n, llround((double)(n * T) * (factors[i] - 1)));
		numbers_are_right();
		assert_int_equal(daq_feed_lost(&feed->force), 5000);
	}
}

/* Nothing is computed beyond what numbers hold, and no sample is left out. */
static void nonsense(void **state)
{
	static const int64_t stamps[] = {0, INT64_MAX, INT64_MIN, -1, 1, INT64_MAX / 2,
					 0, 5,	       5,	  3};
	struct incise_force_sample sample;
	uint64_t last = 0;
	int n = 0, total = 0;

	for (int round = 0; round < 200; round++)
		for (size_t i = 0; i < sizeof(stamps) / sizeof(*stamps); i++, total++)
			iio_spacing_put(&spacing, stamps[(i * 7 + (size_t)round) % 10],
					1);
	iio_spacing_flush(&spacing);
	while (daq_feed_read(&feed->force, &sample, 1) == 1) {
		assert_true(!n || sample.seq > last);
		last = sample.seq;
		n++;
	}
	assert_int_equal(n, total);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test_setup_teardown(gaps, setup, teardown),
		cmocka_unit_test_setup_teardown(lateness_is_no_gap, setup, teardown),
		cmocka_unit_test_setup_teardown(late_behind_a_gap, setup, teardown),
		cmocka_unit_test_setup_teardown(clock_is_off, setup, teardown),
		cmocka_unit_test_setup_teardown(nonsense, setup, teardown),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
