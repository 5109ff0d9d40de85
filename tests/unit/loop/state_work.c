// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/loop/state_work.c: the work of a spring and of friction, what is no motion, and sums
 * that are long.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include "../../../lib/loop/state_work.h"

static struct incise_tick at(double x_mm, double force_N)
{
	return (struct incise_tick){.tool_mm = {0, 0, x_mm},
				    .command_N = {0, 0, force_N},
				    .tool = INCISE_TOOL_BLADE};
}

/* In and out of a spring of 0.5 N/mm, along -z: k x²/2 each way. */
static void test_spring(void **state)
{
	struct incise_work work = {0};
	const int n = 10000;
	const double k = 0.5, depth_mm = 10, exact = k * depth_mm * depth_mm / 2;

	for (int i = 0; i <= 2 * n; i++) {
		double x = -depth_mm * (n - fabs((double)i - n)) / n;
		struct incise_tick tick = at(x, -k * x);

		incise_work_add(&work, &tick);
	}
	/* The force is held over a way of depth/n: less on the way in, more out. */
	assert_true(fabs(work.absorbed.value - exact) <= exact / n * 1.01);
	assert_true(fabs(work.returned.value - exact) <= exact / n * 1.01);
	assert_true(work.returned.value > work.absorbed.value);
}

/* Friction only takes. */
static void test_friction(void **state)
{
	struct incise_work work = {0};

	for (int i = 0; i <= 2000; i++) {
		struct incise_tick tick = at(i < 1000 ? i : 2000 - i, i < 1000 ? -2 : 2);

		incise_work_add(&work, &tick);
	}
	/* 1000 mm there and 1000 mm back against 2 N; whole numbers are exact. */
	assert_true(work.absorbed.value == 4000);
	assert_true(work.returned.value == 0);
}

static void test_what_is_no_motion(void **state)
{
	static const struct {
		unsigned int flags[2];
		enum incise_tool tool[2];
		double work_mJ;
	} cases[] = {
		{{0, 0}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 20},
		{{INCISE_TICK_CONTACT, INCISE_TICK_CLAMPED},
		 {INCISE_TOOL_TUBE, INCISE_TOOL_TUBE},
		 20},
		{{0, 0}, {INCISE_TOOL_BLADE, INCISE_TOOL_HANDLE}, 0},
		{{INCISE_TICK_STALE, 0}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 0},
		{{0, INCISE_TICK_STALE}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 0},
		{{0, INCISE_TICK_FAULT}, {INCISE_TOOL_BLADE, INCISE_TOOL_BLADE}, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_work work = {0};

		for (int k = 0; k < 2; k++) {
			struct incise_tick tick = at(-10 * k, 2);

			tick.flags = cases[i].flags[k];
			tick.tool = cases[i].tool[k];
			incise_work_add(&work, &tick);
		}
		assert_true(work.absorbed.value == cases[i].work_mJ);
		assert_true(work.returned.value == 0);
	}
}

static void test_no_numbers_are_left_out(void **state)
{
	static const double ways[] = {NAN, INFINITY, -INFINITY, 1e300};
	struct incise_work work = {0};

	for (size_t i = 0; i < sizeof(ways) / sizeof(*ways); i++) {
		struct incise_tick bad = at(ways[i], 1e300), good = at(0, -1);

		incise_work_add(&work, &bad);
		incise_work_add(&work, &good);
	}
	assert_true(isfinite(work.absorbed.value) && isfinite(work.returned.value));
}

/*
 * As after years: what is added lies below the last bit of the sum, and would be lost each
 * time. Ten million of 1e-10 are 1e-3.
 */
static void test_long_sum(void **state)
{
	struct incise_sum sum = {1e6, 0};
	double naive = 1e6;

	for (int i = 0; i < 10000000; i++) {
		incise_sum_add(&sum, 5e-11);
		naive += 5e-11;
	}
	assert_true(naive == 1e6);
	/* The last bit of 1e6. */
	assert_true(fabs(sum.value - 1e6 - 5e-4) <= 0x1p-33);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_spring),
		cmocka_unit_test(test_friction),
		cmocka_unit_test(test_what_is_no_motion),
		cmocka_unit_test(test_no_numbers_are_left_out),
		cmocka_unit_test(test_long_sum),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
