// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/time/timeline_knots.c: times between knots. How good knots are is in
 * timeline.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/record/time/timeline.h"

static void between_and_beyond(void **state)
{
	/*  one line: 100 ns, then 110 ns a sample     plugged in again at 300 */
	static const struct incise_timeline_knot knots[] = {
		{100, 10000, 1, true},	{200, 20000, 1, false},	 {210, 21100, 1, false},
		{300, 900000, 1, true}, {400, 910000, 1, false},
	};
	static const struct {
		uint64_t seq;
		int64_t t_ns;
	} cases[] = {
		{100, 10000},  {150, 15000},  {200, 20000},  {205, 20550},
		{210, 21100},  {220, 22200}, /* the old line goes on up to the new one */
		{299, 30890},  {300, 900000}, {350, 905000}, {400, 910000},
		{500, 920000}, {0, 0}, /* before the first */
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(incise_timeline_at(knots, 5, cases[i].seq),
				 cases[i].t_ns);
}

/* A device that is exact: its knots and its line are exact, too. */
static void exact_device(void **state)
{
	struct incise_timeline_setup setup = {.rate_hz = 100, .delay_ns = 5000000};
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS + 3];
	struct incise_timeline_line line;
	struct incise_timeline timeline;
	int n;

	incise_timeline_begin(&timeline, &setup);
	for (int i = 0; i < 20000; i++)
		incise_timeline_sample(&timeline, 50 + (uint64_t)i,
				       7000000000 + 10001000LL * i);
	n = incise_timeline_knots(&timeline, knots);
	/* its begin, one each 16 s from the middle of the blocks on, the last blocks, its end */
	assert_in_range(n, 200 / 16, 200 / 16 + 3);
	assert_true(knots[0].begins);
	assert_int_equal(knots[0].seq, 50);
	assert_int_equal(knots[n - 1].seq, 50 + 19999);
	for (int i = 0; i < n; i++)
		assert_in_range(
			knots[i].t_ns -
				(6995000000 + 10001000LL * (int64_t)(knots[i].seq - 50)) +
				100,
			90, 110); /* ± 10 ns of rounding */
	assert_int_equal(incise_timeline_line(&timeline, &line), 0);
	assert_int_equal(line.seq, 50);
	assert_in_range(line.ns - 6995000000 + 100, 90, 110);
	assert_in_range((int64_t)(line.period_ns * 1000), 10000999990, 10001000010);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(between_and_beyond),
		cmocka_unit_test(exact_device),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
