// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Properties under extreme inputs at all interfaces but the plan's, which has a test of its own:
 * see tests/extremes.
 */
#include "../../extremes/tested.h"

/*
 * libconfig 1.5 loses the string in hand at a syntax error, some 70 bytes: it is not ours
 * to free. A configuration that we forgot to destroy would show by its other parts.
 */
const char *__lsan_default_suppressions(void)
{
	return "leak:libconfig_yylex\nleak:strbuf_append\n";
}

int main(void)
{
	static const struct property *const tables[] = {
		model_properties,   fixed_properties,  surface_properties,
		control_properties, motion_properties, wall_properties,
		device_properties,  file_properties,   NULL};

	tested_reduce(4);
	return test_properties(tables);
}
