// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plans on each kind of ground under millions of poses that no tracker should send: see
 * tests/extremes/plan.c. RealtimeSanitizer runs this test, too.
 *
 * Usage: extreme [SEED]
 */
#include "../../extremes/tested.h"
#include <stdlib.h>

int main(int argc, char **argv)
{
	static const struct property *const tables[] = {plan_properties, NULL};

#ifdef __SANITIZE_ADDRESS__
	tested_reduce(100);
#else
	tested_reduce(4);
#endif
	if (argc > 1)
		tested_few.seed = tested_all.seed = strtoull(argv[1], NULL, 0);
	return test_properties(tables);
}
