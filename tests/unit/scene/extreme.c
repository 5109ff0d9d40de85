// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plans on each kind of ground under millions of poses that no tracker should send: see
 * tests/extremes/plan.c. RealtimeSanitizer runs this test, too.
 */
#include "../../extremes/tested.h"

int main(void)
{
	static const struct property *const tables[] = {plan_properties, NULL};

	/* Half a million ticks are enough under a sanitizer. */
	tested_part = 100;
	return test_properties(tables);
}
