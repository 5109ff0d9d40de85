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
 */
#ifndef INCISE_TEST_UNIT_H
#define INCISE_TEST_UNIT_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <setjmp.h>
#include <cmocka.h>

static struct CMUnitTest unit_tests[100];
static size_t unit_tests_n;

static inline void unit_add(const char *name, CMUnitTestFunction run,
			    const CMFixtureFunction fixture[2])
{
	if (unit_tests_n == sizeof(unit_tests) / sizeof(*unit_tests))
		abort();
	unit_tests[unit_tests_n++] =
		(struct CMUnitTest){name, run, fixture[0], fixture[1], NULL};
}

#define TEST(name, ...)                                                     \
	static void name(void **state);                                     \
	__attribute__((constructor)) static void unit_add_##name(void)      \
	{                                                                   \
		unit_add(#name, name, (CMFixtureFunction[2]){__VA_ARGS__}); \
	}                                                                   \
	static void name(void **state)

int main(void)
{
	return _cmocka_run_group_tests("tests", unit_tests, unit_tests_n, NULL, NULL);
}

#endif
