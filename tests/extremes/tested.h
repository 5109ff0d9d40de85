/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Properties as unit tests, one each: of those that tests/bench/extremes tries a part of the cases.
 */
#ifndef INCISE_EXTREMES_TESTED_H
#define INCISE_EXTREMES_TESTED_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <setjmp.h>
#include <cmocka.h>
#include "extremes.h"
#include "../unit/cases.h"

#define TESTED_MAX 64

/* One of so many cases, where not all are tried. */
static int tested_part = 20;

static void test_property(void **state)
{
	const struct property *property = *state;
	struct extremes_setup setup = {
		.seed = cases_seed(1), .part = tested_part, .scenes = "scenes"};
	struct extremes_row row;

	if (cases_are_all())
		setup.part = 1;
	extremes_try(property, &setup, &row);
	print_message("%ld cases, %ld refused\n", row.tried, row.refused);
	if (row.wrong)
		fail_msg("%ld of %ld cases are wrong, the first: %s", row.wrong,
			 row.tried, row.failed);
	assert_true(row.held > 0);
}

/* @tables: ends with NULL. @return the program's exit status */
static int test_properties(const struct property *const *tables)
{
	struct CMUnitTest tests[TESTED_MAX];
	size_t n = 0;

	for (; *tables; tables++)
		for (const struct property *p = *tables; p->name; p++) {
			if (n == TESTED_MAX)
				return 1;
			tests[n++] = (struct CMUnitTest){p->name, test_property, NULL,
							 NULL, (void *)p};
		}
	return _cmocka_run_group_tests("extremes", tests, n, NULL, NULL);
}

#endif
