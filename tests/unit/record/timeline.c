// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/record/timeline.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include "../../../lib/record/timeline.h"

static void latency_is_taken_off(void **state)
{
	struct incise_timeline timeline;

	incise_timeline_init(&timeline, 4200000);
	assert_int_equal(incise_timeline_acquired(&timeline, 1000000000), 995800000);
	assert_int_equal(incise_timeline_acquired(&timeline, 1008333333), 1004133333);
}

static void times_always_increase(void **state)
{
	static const struct {
		int64_t arrival_ns, acquired_ns;
	} cases[] = {
		{-5, 0},	       /* never negative */
		{100, 90},  {100, 91}, /* two that arrive at once */
		{50, 92},	       /* a device whose clock ran back */
		{102, 93},	       /* would be 92, which was given out */
		{200, 190},	       /* and on as before */
	};
	struct incise_timeline timeline;

	incise_timeline_init(&timeline, 10);
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(incise_timeline_acquired(&timeline, cases[i].arrival_ns),
				 cases[i].acquired_ns);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(latency_is_taken_off),
		cmocka_unit_test(times_always_increase),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
