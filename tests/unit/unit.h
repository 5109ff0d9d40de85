/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A file of unit tests without a list of them: each is run by main(), which is here, in the order
 * of the file.
 *
 *	TEST(a_line_ends)
 *	{
 *		assert_int_equal(…);
 *	}
 *	TEST(with_a_bus, setup, teardown)    NULL for one that there is not
 *
 *	GROUP(setup, teardown);              of all tests of the file
 */
#ifndef INCISE_TEST_UNIT_H
#define INCISE_TEST_UNIT_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
/* Most tests use these. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/error.h>
#include "message.h"

/* Of the calls of a test, at whose start it is clear; assert_error() clears it, too. */
__attribute__((unused)) static struct incise_error err;

/* Else the test fails with the text of err. */
#define succeeds(ok)                              \
	do {                                      \
		if (!(ok))                        \
			fail_msg("%s", err.text); \
	} while (0)

static struct CMUnitTest unit_tests[100];
static size_t unit_tests_n;
static const CMFixtureFunction unit_group[2];

static inline void unit_add(const char *name, CMUnitTestFunction run,
			    const CMFixtureFunction fixture[2])
{
	if (unit_tests_n == sizeof(unit_tests) / sizeof(*unit_tests))
		abort();
	unit_tests[unit_tests_n++] =
		(struct CMUnitTest){name, run, fixture[0], fixture[1], NULL};
}

#define TEST(name, ...)                                                                \
	static void name(void **state);                                                \
	static void unit_run_##name(void **state)                                      \
	{                                                                              \
		err = (struct incise_error){0};                                        \
		name(state);                                                           \
	}                                                                              \
	__attribute__((constructor)) static void unit_add_##name(void)                 \
	{                                                                              \
		unit_add(#name, unit_run_##name, (CMFixtureFunction[2]){__VA_ARGS__}); \
	}                                                                              \
	static void name(void **state)

#define GROUP(setup, teardown) \
	static const CMFixtureFunction unit_group[2] = {setup, teardown}

int main(void)
{
	return _cmocka_run_group_tests("tests", unit_tests, unit_tests_n, unit_group[0],
				       unit_group[1]);
}

#endif
